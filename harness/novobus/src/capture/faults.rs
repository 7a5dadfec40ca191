//! What was damaged on a link, in the words of the scenario language.

use crate::language::syntax::{FaultStep, LinkEnds};
use harness_bench::scenario::times::Duration;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::record::Channel;
use harness_sim::record::LineByte;

/// A run of lost bytes longer than this is a cut cable.
const CUT: usize = 8;

/// The faults of a link. Bytes do not always show what a cable did: a break is assumed to last as long as bytes were
/// lost behind it, and many lost bytes are taken for a cut. A delay is not seen.
pub(crate) fn faults(ring: usize, link: &Channel, rate: Rate) -> Vec<FaultStep> {
    let bytes = link.octets();
    let ends = || LinkEnds::between(link.from, link.to);
    let at_byte =
        |number: u64, fault: LinkFault| FaultStep::on_link(ring, ends(), fault.into(), number);
    let mut faults = Vec::new();
    let mut number = 0_u64;
    let mut place = 0;
    while let Some(byte) = bytes.get(place) {
        number += u64::from(byte.sent.is_some());
        let lost = bytes[place + 1..]
            .iter()
            .take_while(|next| next.received.is_none() && next.sent.is_some())
            .count();
        let here = |fault: LinkFault| at_byte(number, fault);
        match (byte.sent, byte.received) {
            (None, Some(_)) if byte.error == Some(LineError::Break) => {
                let start = byte.at - rate.byte_time();
                let span = break_span(byte, bytes.get(place + lost), rate);
                let at = Duration::nanos(start.since_start().as_nanos());
                faults.push(FaultStep {
                    byte: None,
                    at: Some(at),
                    ..here(LinkFault::Break(span))
                });
                number += lost as u64;
                place += lost;
            }
            (None, Some(received)) => {
                let before = place.checked_sub(1).and_then(|place| bytes.get(place));
                faults.push(if doubled(before, byte, rate) {
                    here(LinkFault::Duplicate)
                } else {
                    at_byte(number + 1, LinkFault::Insert(received))
                });
            }
            (Some(_), Some(_)) if byte.error == Some(LineError::Break) => {
                let span = break_span(byte, bytes.get(place + lost), rate);
                faults.push(here(LinkFault::Break(span)));
                number += lost as u64;
                place += lost;
            }
            (Some(_), None) => {
                if lost + 1 >= CUT {
                    faults.push(here(LinkFault::Cut));
                    number += lost as u64;
                    place += lost;
                    if place + 1 < bytes.len() {
                        faults.push(at_byte(number + 1, LinkFault::Join));
                    }
                } else {
                    faults.push(here(LinkFault::Drop));
                }
            }
            (Some(sent), Some(received)) => {
                faults.extend(damage(sent, received, byte.error).map(here));
            }
            (None, None) => {}
        }
        place += 1;
    }
    faults
}

/// Whether a byte that was not sent repeats the byte before it.
fn doubled(before: Option<&LineByte>, byte: &LineByte, rate: Rate) -> bool {
    before.is_some_and(|before| {
        before.received == byte.received
            && before.sent.is_some()
            && byte.at.since(before.at).units() <= rate.byte_time().units() + 3
    })
}

/// How one byte became another.
fn damage(sent: u8, received: u8, error: Option<LineError>) -> Option<LinkFault> {
    let data = sent ^ received;
    let odd = data.count_ones() % 2 == 1;
    Some(match error {
        None if data == 0 => return None,
        None => LinkFault::Replace(received),
        Some(LineError::Parity) => LinkFault::Flip(Flips {
            data,
            parity: !odd,
            stop: false,
            start: false,
        }),
        Some(LineError::Framing) => LinkFault::Flip(Flips {
            data,
            parity: false,
            stop: true,
            start: false,
        }),
        Some(LineError::Overrun) => LinkFault::Overrun,
        Some(LineError::Break) => return None,
    })
}

/// How long a break lasted: until the last byte that was lost had begun, or a moment where none was.
fn break_span(byte: &LineByte, last: Option<&LineByte>, rate: Rate) -> Span {
    let start = byte.at - rate.byte_time();
    let until = last
        .filter(|last| last.at > byte.at)
        .map_or(byte.at, |last| last.at);
    let half = rate.bit_time() * 5;
    until.since(start).saturating_sub(half)
}
