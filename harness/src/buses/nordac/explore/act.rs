//! A conversation of telegrams as a value: what masters send and what happens to the slaves from outside, with the times between.
//!
//! A request is kept as what it asks for. Its frame count bit is worked out when the conversation is played, so that requests can be left
//! out without making a repetition of the next one.

use super::hex;
use harness_proto::profibus::fdl::{FrameControl, Pdu};
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use harness_proto::profibus::fdl::Sequence;

/// Maximum number of acts of a case.
pub(super) const MOST_ACTS: usize = 64;

/// Maximum number of telegrams of a case.
const MOST_TELEGRAMS: u64 = 400;

/// The longest time behind an act, in microseconds.
pub(super) const LONGEST_WAIT: u64 = 5_000_000;

/// The longest case, in microseconds.
const LONGEST_CASE: u64 = 60_000_000;

/// The longest gap in a telegram, in microseconds.
const LONGEST_GAP: u16 = 10_000;

/// A conversation with the slaves of a line, from their power-up on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TelegramTalk {
    /// The acts, in order.
    pub acts: Vec<TelegramAct>,
}

/// An act, how often it happens, and the time behind it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TelegramAct {
    /// What.
    pub what: TelegramActKind,
    /// How many times it happens, each with the time behind it.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub times: u8,
    /// Microseconds from the end of the reply, or from when it would have begun, to the next act.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub wait_us: u64,
}

const fn once() -> u8 {
    1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the form that serde asks for"
)]
const fn is_once(times: &u8) -> bool {
    *times == 1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the form that serde asks for"
)]
const fn is_zero(wait: &u64) -> bool {
    *wait == 0
}

/// What can happen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum TelegramActKind {
    /// A master sends a request.
    Ask(Request),
    /// A master sends these octets without a gap, whatever they are.
    Octets {
        /// The octets.
        #[serde(with = "hex")]
        octets: Vec<u8>,
        /// What is wrong with one of them on the line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        harm: Option<Harm>,
    },
    /// Inverter and module lose each other, or find each other again.
    Link {
        /// The slave.
        slave: u8,
        /// Whether they find each other.
        found: bool,
    },
    /// The cause of a fault comes, or goes.
    Fault {
        /// The slave.
        slave: u8,
        /// The fault, 1 to 25.
        number: u8,
        /// Whether it comes.
        on: bool,
    },
    /// A slave is switched off and on.
    Restart {
        /// The slave.
        slave: u8,
    },
}

/// A request of a master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// To which station.
    pub da: u8,
    /// From which master.
    pub sa: u8,
    /// Bits 3 to 0 of FC.
    pub function: u8,
    /// How it is counted.
    #[serde(default, skip_serializing_if = "Count::is_next")]
    pub count: Count,
    /// DSAP and SSAP.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub saps: Option<(u8, u8)>,
    /// The data.
    #[serde(with = "hex", default, skip_serializing_if = "Vec::is_empty")]
    pub data: Vec<u8>,
    /// What is wrong with it on the line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub harm: Option<Harm>,
}

/// How a request is counted (EN 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Count {
    /// As the next new request of its master to its station: 6x, 5x, 7x, 5x, ...
    #[default]
    Next,
    /// As the last request of its master to its station: the slave takes it for a repetition.
    Again,
    /// As a first request: 6x.
    First,
    /// Without a count: 4x.
    Without,
}

impl Count {
    fn is_next(&self) -> bool {
        *self == Self::Next
    }
}

/// What is wrong with a telegram on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Harm {
    /// The parity bit of the octet at a place is wrong; places are counted from 0, beyond the last one from the start again.
    Parity(u8),
    /// Its stop bit is 0.
    Stop(u8),
    /// These data bits of it are inverted, and its parity bit is right.
    Replace(u8, u8),
    /// The line is idle for this number of microseconds in front of it.
    Gap(u8, u16),
    /// The last octets, this many, are left out.
    Short(u8),
    /// This octet stands behind the last one.
    Long(u8),
}

/// A telegram that goes out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Outgoing {
    pub(super) octets: Vec<u8>,
    /// What happens to one of them on the line, and its place.
    pub(super) bad: Option<(usize, LinkFault)>,
}

/// The counts of every master towards every station.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts(BTreeMap<(u8, u8), Sequence>);

impl Counts {
    /// The octets of a request, with the count that belongs to it.
    fn octets(&mut self, request: &Request) -> Vec<u8> {
        let own = self.0.entry((request.sa, request.da)).or_default();
        *own = match request.count {
            Count::Next => own.next(),
            Count::Again => *own,
            Count::First => Sequence::First,
            Count::Without => Sequence::None,
        };
        let bits = match *own {
            Sequence::None => 0x40,
            Sequence::First => 0x60,
            Sequence::Counted(false) => 0x50,
            Sequence::Counted(true) => 0x70,
        };
        let control = FrameControl(bits | request.function & 0x0F);
        let saps = request.saps;
        let (dsap, ssap) = (saps.map(|own| own.0 & 0x3F), saps.map(|own| own.1 & 0x3F));
        let (da, sa) = (request.da & 0x7F, request.sa & 0x7F);
        let pdu = Pdu::with_saps(da, sa.min(126), control, dsap, ssap, &request.data);
        pdu.map(|own| Telegram::Pdu(own).encode().to_vec())
            .unwrap_or_default()
    }

    /// What goes out for an act; `None` where it sends nothing.
    pub(super) fn outgoing(&mut self, what: &TelegramActKind) -> Option<Outgoing> {
        let (octets, harm) = match what {
            TelegramActKind::Ask(request) => (self.octets(request), request.harm),
            TelegramActKind::Octets { octets, harm } => (octets.clone(), *harm),
            _ => return None,
        };
        Some(match harm {
            Some(harm) => harm.done_to(octets),
            None => Outgoing { octets, bad: None },
        })
    }
}

impl Harm {
    fn done_to(self, mut octets: Vec<u8>) -> Outgoing {
        let last = octets.len().max(1);
        let at = |place: u8| usize::from(place) % last;
        let flips = |place, flips| Some((at(place), LinkFault::Flip(flips)));
        let bad = match self {
            Self::Parity(place) => {
                let parity = true;
                flips(
                    place,
                    Flips {
                        parity,
                        ..Flips::default()
                    },
                )
            }
            Self::Stop(place) => {
                let stop = true;
                flips(
                    place,
                    Flips {
                        stop,
                        ..Flips::default()
                    },
                )
            }
            Self::Gap(place, micros) => {
                let time = Span::from_micros(micros.into());
                Some((at(place), LinkFault::Delay(time)))
            }
            Self::Replace(place, bits) => {
                let place = at(place);
                if let Some(octet) = octets.get_mut(place) {
                    *octet ^= bits;
                }
                None
            }
            Self::Short(count) => {
                octets.truncate(octets.len().saturating_sub(count.into()).max(1));
                None
            }
            Self::Long(octet) => {
                octets.push(octet);
                None
            }
        };
        Outgoing { octets, bad }
    }
}

impl TelegramAct {
    /// An act that happens once, with this time behind it.
    #[must_use]
    pub const fn new(what: TelegramActKind, wait_us: u64) -> Self {
        Self {
            what,
            times: 1,
            wait_us,
        }
    }

    /// The time behind it.
    #[must_use]
    pub const fn wait(&self) -> Span {
        Span::from_micros(self.wait_us)
    }

    fn is_bounded(&self) -> bool {
        let fits = match &self.what {
            TelegramActKind::Ask(own) => {
                let gap = matches!(own.harm, Some(Harm::Gap(_, micros)) if micros > LONGEST_GAP);
                own.data.len() <= 240 && !gap
            }
            TelegramActKind::Octets { octets, harm } => {
                let gap = matches!(harm, Some(Harm::Gap(_, micros)) if *micros > LONGEST_GAP);
                (1..=300).contains(&octets.len()) && !gap
            }
            TelegramActKind::Fault { number, .. } => (1..=25).contains(number),
            TelegramActKind::Link { .. } | TelegramActKind::Restart { .. } => true,
        };
        fits && self.times >= 1 && self.wait_us <= LONGEST_WAIT
    }
}

impl TelegramTalk {
    /// How many telegrams are sent.
    #[must_use]
    pub fn telegrams(&self) -> u64 {
        let sent = self.acts.iter().filter(|act| {
            matches!(
                act.what,
                TelegramActKind::Ask(_) | TelegramActKind::Octets { .. }
            )
        });
        sent.map(|act| u64::from(act.times)).sum()
    }

    /// Whether it is within the bounds of a case.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        let time = |act: &TelegramAct| act.wait_us.saturating_mul(act.times.into());
        let total = self.acts.iter().map(time).fold(0, u64::saturating_add);
        self.acts.len() <= MOST_ACTS
            && total <= LONGEST_CASE
            && self.telegrams() <= MOST_TELEGRAMS
            && self.acts.iter().all(TelegramAct::is_bounded)
    }

    /// Leaves out the end, so that it is within the bounds of a case; `room` acts are left free.
    pub(super) fn cut(&mut self, room: usize) {
        self.acts.truncate(MOST_ACTS.saturating_sub(room));
        while !self.is_bounded() && self.acts.pop().is_some() {}
    }

    /// What makes a case small: telegrams and other acts, then octets, then time.
    #[must_use]
    pub fn measure(&self) -> (usize, u64, u64) {
        let size = |act: &TelegramAct| match &act.what {
            TelegramActKind::Ask(own) => {
                let data: u64 = own.data.iter().map(|own| 2 + u64::from(*own != 0)).sum();
                let special = u64::from(own.count != Count::Next);
                10 + data + special + 10 * u64::from(own.harm.is_some())
            }
            TelegramActKind::Octets { octets, harm } => {
                20 + 3 * octets.len() as u64 + 10 * u64::from(harm.is_some())
            }
            _ => 1,
        };
        let acts = self.acts.iter().map(|act| usize::from(act.times));
        let time = self
            .acts
            .iter()
            .map(|act| act.wait_us.saturating_mul(act.times.into()));
        (acts.sum(), self.acts.iter().map(size).sum(), time.sum())
    }
}

/// The rate of a header is that of all stations: this many bits behind the end of a request no right slave begins its reply.
pub(super) fn slot(rate: BusRate) -> Span {
    // min T_SDR of Set_Prm is at most 255 bits.
    rate.bit_time() * 260
}
