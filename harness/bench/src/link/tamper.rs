//! Faults on a link whose bytes pass through this program: the master's own two links, and those with an
//! interposer.
//!
//! The rules are those of the simulated wire: bytes are counted from 1 as they are transmitted, and several faults at
//! one byte act one after the other.

use super::LinkFault;
use harness_proto::line::{LineError, Received};
use harness_proto::time::{Instant, Span};
use harness_sim::fault::Flips;
use harness_sim::record::LineByte;
use std::collections::BTreeMap;

/// What becomes of a byte.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PassedByte {
    /// Bytes that are passed on before it.
    inserted: Vec<Received>,
    /// The byte itself, unless it is lost.
    byte: Option<Received>,
    twice: bool,
    /// How long the first of them is delayed.
    pub delay: Span,
    /// How long the line is held at 0 in place of the byte.
    pub hold: Option<Span>,
}

impl PassedByte {
    /// The bytes that are passed on, in order.
    pub fn bytes(&self) -> impl Iterator<Item = Received> + '_ {
        let inserted = self.inserted.iter().copied();
        inserted.chain(self.byte).chain(self.again())
    }

    fn again(&self) -> Option<Received> {
        self.byte.filter(|_| self.twice)
    }

    /// The wire's bytes for a record, the first of which ends at `at`: what was sent, and what arrives.
    pub fn seen(
        &self,
        sent: u8,
        at: Instant,
        byte_time: Span,
    ) -> impl Iterator<Item = LineByte> + '_ {
        let (byte, error) = match self.hold {
            Some(_) => (Some(0), Some(LineError::Break)),
            None => (
                self.byte.map(|received| received.byte),
                self.byte.and_then(|received| received.error),
            ),
        };
        let line_byte = LineByte::seen(at, Some(sent), byte, error);
        let other = move |other: Received| LineByte::seen(at, None, Some(other.byte), other.error);
        let inserted = self.inserted.iter().copied().map(other);
        let all = inserted.chain([line_byte]).chain(self.again().map(other));
        let times = (0..).map(move |behind| at + byte_time * behind);
        all.zip(times).map(|(mut byte, at)| {
            byte.at = at;
            byte
        })
    }
}

/// One link's faults.
#[derive(Clone, Debug, Default)]
pub struct Tamper {
    count: u64,
    armed: BTreeMap<u64, Vec<LinkFault>>,
    cut: bool,
    held_until: Option<Instant>,
}

impl Tamper {
    /// How many bytes have come.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Arms a fault for the `byte`-th byte.
    pub fn arm(&mut self, byte: u64, fault: LinkFault) {
        self.armed.entry(byte).or_default().push(fault);
    }

    /// Lets a fault happen now; what needs a byte takes the next one.
    pub fn suffer(&mut self, fault: LinkFault) {
        match fault {
            LinkFault::Cut => self.cut = true,
            LinkFault::Join => self.cut = false,
            fault => self.arm(self.count + 1, fault),
        }
    }

    /// Faults whose byte has not come.
    pub fn unused(&self) -> impl Iterator<Item = (u64, LinkFault)> + '_ {
        let each = |(byte, faults): (&u64, &Vec<LinkFault>)| {
            let byte = *byte;
            let faults: Vec<_> = faults.iter().map(|fault| (byte, *fault)).collect();
            faults
        };
        self.armed.iter().flat_map(each)
    }

    /// Whether the next byte gets a wrong parity bit.
    pub(crate) fn damages_next_parity(&self) -> bool {
        let next = self.armed.get(&(self.count + 1));
        next.is_some_and(|all| all.iter().copied().any(is_wrong_parity))
    }

    /// Passes on a byte at `start`.
    pub fn pass(&mut self, byte: Received, start: Instant) -> PassedByte {
        self.count += 1;
        let mut passed = PassedByte::default();
        let mut whole = Some(byte);
        let mut flips = Flips::default();
        for fault in self.armed.remove(&self.count).unwrap_or_default() {
            match fault {
                LinkFault::Flip(more) => {
                    flips = flips.and(more);
                    whole = whole.map(|received| Received {
                        byte: received.byte ^ more.data,
                        ..received
                    });
                }
                LinkFault::Replace(data) => {
                    flips = Flips::default();
                    whole = whole.map(|_| Received::good(data));
                }
                LinkFault::Drop => whole = None,
                LinkFault::Duplicate => passed.twice = true,
                LinkFault::Insert(data) => passed.inserted.push(Received::good(data)),
                LinkFault::Delay(span) => passed.delay = passed.delay + span,
                LinkFault::Break(span) => passed.hold = Some(span),
                LinkFault::Overrun => {}
                LinkFault::Cut => self.cut = true,
                LinkFault::Join => self.cut = false,
            }
        }
        let held = self.held_until.is_some_and(|until| start < until);
        if let Some(span) = passed.hold {
            self.held_until = Some(start + span);
        }
        if self.cut || held {
            return PassedByte {
                delay: passed.delay,
                ..PassedByte::default()
            };
        }
        if passed.hold.is_none() {
            passed.byte = whole.map(|received| Received {
                error: received.error.or(flips.noticed()),
                ..received
            });
        }
        passed
    }
}

/// Whether a fault needs bytes with a wrong parity bit or breaks on the wire.
#[must_use]
pub fn needs_line_errors(fault: LinkFault) -> bool {
    is_wrong_parity(fault) || matches!(fault, LinkFault::Break(_))
}

/// Whether a fault gives a byte a wrong parity bit.
pub(crate) fn is_wrong_parity(fault: LinkFault) -> bool {
    matches!(fault, LinkFault::Flip(flips) if flips.noticed() == Some(LineError::Parity))
}

/// Whether no UART can be made to do it: a wrong start or stop bit, an overrun.
#[must_use]
pub fn only_simulated(fault: LinkFault) -> bool {
    match fault {
        LinkFault::Flip(flips) => flips.start || flips.noticed() == Some(LineError::Framing),
        LinkFault::Overrun => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(tamper: &mut Tamper, bytes: &[u8]) -> Vec<(u8, bool)> {
        let all = bytes.iter().flat_map(|byte| {
            let passed = tamper.pass(Received::good(*byte), Instant::START);
            passed.bytes().collect::<Vec<_>>()
        });
        all.map(|byte| (byte.byte, byte.error.is_some())).collect()
    }

    #[test]
    fn each_fault_at_its_byte() {
        let mut tamper = Tamper::default();
        let odd = Flips {
            data: 1,
            ..Flips::default()
        };
        let even = Flips { data: 3, ..odd };
        tamper.arm(1, LinkFault::Flip(odd));
        tamper.arm(2, LinkFault::Flip(even));
        tamper.arm(3, LinkFault::Drop);
        tamper.arm(4, LinkFault::Duplicate);
        tamper.arm(5, LinkFault::Insert(0x55));
        tamper.arm(6, LinkFault::Replace(0x66));
        let seen = pass(&mut tamper, &[0x10; 6]);
        let expected = [0x11, 0x13, 0x10, 0x10, 0x55, 0x10, 0x66].map(|byte| (byte, byte == 0x11));
        assert_eq!(seen, expected);
        assert_eq!(tamper.unused().count(), 0);
    }

    /// As on the simulated wire.
    #[test]
    fn what_is_put_in_front_of_a_byte_arrives_although_the_byte_does_not() {
        let byte_time = Span::from_millis(1);
        let at = |ms| Instant::START + Span::from_millis(ms);
        let seen = |faults: &[LinkFault]| {
            let mut tamper = Tamper::default();
            faults.iter().for_each(|fault| tamper.arm(1, *fault));
            let passed = tamper.pass(Received::good(0x10), at(0));
            let seen = passed.seen(0x10, at(1), byte_time);
            seen.map(|byte| (byte.at, byte.sent, byte.received, byte.error))
                .collect::<Vec<_>>()
        };
        let inserted = (at(1), None, Some(0x55), None);
        assert_eq!(
            seen(&[LinkFault::Insert(0x55), LinkFault::Drop]),
            [inserted, (at(2), Some(0x10), None, None)]
        );
        let hold = LinkFault::Break(Span::from_millis(5));
        assert_eq!(
            seen(&[LinkFault::Insert(0x55), hold]),
            [
                inserted,
                (at(2), Some(0x10), Some(0), Some(LineError::Break))
            ]
        );
        assert_eq!(
            seen(&[LinkFault::Insert(0x55), LinkFault::Duplicate]),
            [
                inserted,
                (at(2), Some(0x10), Some(0x10), None),
                (at(3), None, Some(0x10), None)
            ]
        );
        assert_eq!(
            seen(&[LinkFault::Insert(0x55), LinkFault::Cut]),
            [(at(1), Some(0x10), None, None)]
        );
    }

    #[test]
    fn cut_and_joined() {
        let mut tamper = Tamper::default();
        tamper.arm(2, LinkFault::Cut);
        tamper.arm(4, LinkFault::Join);
        let seen = pass(&mut tamper, &[1, 2, 3, 4]);
        assert_eq!(seen, [(1, false), (4, false)]);
        tamper.suffer(LinkFault::Drop);
        assert_eq!(pass(&mut tamper, &[5, 6]), [(6, false)]);
        tamper.arm(99, LinkFault::Drop);
        assert_eq!(tamper.unused().collect::<Vec<_>>(), [(99, LinkFault::Drop)]);
    }

    #[test]
    fn a_break_swallows_what_is_sent_meanwhile() {
        let mut tamper = Tamper::default();
        tamper.arm(1, LinkFault::Break(Span::from_millis(5)));
        let at = |ms| Instant::START + Span::from_millis(ms);
        let passed = tamper.pass(Received::good(1), at(0));
        assert_eq!(
            (passed.bytes().count(), passed.hold),
            (0, Some(Span::from_millis(5)))
        );
        assert_eq!(tamper.pass(Received::good(2), at(4)).bytes().count(), 0);
        assert_eq!(tamper.pass(Received::good(3), at(5)).bytes().count(), 1);
    }
}
