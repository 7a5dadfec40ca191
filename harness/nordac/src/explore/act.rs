//! A conversation of telegrams as a value: what masters send and what happens to the slaves from outside, with the times between.
//!
//! A request is kept as what it asks for. Its frame count bit is worked out when the conversation is played, so that requests can be left
//! out without making a repetition of the next one.

use super::hex;
use crate::language::Nordac;
use harness_bench::explore::line::{LineAct, LineTalk};
use harness_proto::profibus::fdl::{FrameControl, Pdu, Sequence};
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The longest gap in a telegram, in microseconds.
const LONGEST_GAP: u16 = 10_000;

/// A conversation of telegrams.
pub(crate) type TelegramTalk = LineTalk<Nordac>;

/// An act of a conversation.
pub(crate) type TelegramAct = LineAct<TelegramActKind>;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum TelegramActKind {
    /// A master sends a request.
    Ask(Request),
    /// A master sends these octets without a gap, whatever they are.
    Octets {
        #[serde(with = "hex")]
        octets: Vec<u8>,
        /// What is wrong with one of them on the line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        harm: Option<Harm>,
    },
    /// Inverter and module lose each other, or find each other again.
    Link {
        slave: u8,
        /// Whether they find each other, or lose each other.
        found: bool,
    },
    /// The cause of a fault comes, or goes.
    Fault {
        slave: u8,
        /// The fault, 1 to 25.
        number: u8,
        /// Whether it comes or goes.
        on: bool,
    },
    /// A slave is switched off and on.
    Restart { slave: u8 },
}

/// A request of a master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Request {
    /// The station that it is sent to.
    pub(crate) da: u8,
    /// The master that sends it.
    pub(crate) sa: u8,
    /// Bits 3 to 0 of FC.
    pub(crate) function: u8,
    /// How it is counted.
    #[serde(default, skip_serializing_if = "Count::is_next")]
    pub(crate) count: Count,
    /// DSAP and SSAP.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) saps: Option<(u8, u8)>,
    #[serde(with = "hex", default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) data: Vec<u8>,
    /// What is wrong with it on the line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) harm: Option<Harm>,
}

/// How a request is counted (EN 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Count {
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
pub(crate) enum Harm {
    /// The parity bit of the octet at a place is wrong; places are counted from 0, beyond the last one from the start again.
    Parity(u8),
    /// Its stop bit is 0.
    Stop(u8),
    /// These data bits of it are inverted, and its parity bit is right.
    Replace(u8, u8),
    /// The line is idle for this number of microseconds in front of it.
    Gap(u8, u16),
    /// This number of octets at the end is left out.
    Short(u8),
    /// This octet stands after the last one.
    Long(u8),
}

/// A telegram as it is sent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct OutgoingTelegram {
    pub(crate) octets: Vec<u8>,
    /// The place of an octet that the line changes, and how.
    pub(crate) bad: Option<(usize, LinkFault)>,
}

/// The counts of every master towards every station.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts(BTreeMap<(u8, u8), Sequence>);

impl Counts {
    /// The octets of a request, with the count that belongs to it.
    fn octets(&mut self, request: &Request) -> Vec<u8> {
        let sequence = self.0.entry((request.sa, request.da)).or_default();
        *sequence = match request.count {
            Count::Next => sequence.next(),
            Count::Again => *sequence,
            Count::First => Sequence::First,
            Count::Without => Sequence::None,
        };
        let bits = match *sequence {
            Sequence::None => 0x40,
            Sequence::First => 0x60,
            Sequence::Counted(false) => 0x50,
            Sequence::Counted(true) => 0x70,
        };
        let control = FrameControl(bits | request.function & 0x0F);
        let saps = request.saps.map(|(dsap, ssap)| (dsap & 0x3F, ssap & 0x3F));
        let (dsap, ssap) = saps.unzip();
        let (da, sa) = (request.da & 0x7F, request.sa & 0x7F);
        let pdu = Pdu::with_saps(da, sa.min(126), control, dsap, ssap, &request.data);
        pdu.map(|pdu| Telegram::Pdu(pdu).encode().to_vec())
            .unwrap_or_default()
    }

    /// The telegram of an act; `None` if it sends nothing.
    pub(super) fn outgoing(&mut self, what: &TelegramActKind) -> Option<OutgoingTelegram> {
        let (octets, harm) = match what {
            TelegramActKind::Ask(request) => (self.octets(request), request.harm),
            TelegramActKind::Octets { octets, harm } => (octets.clone(), *harm),
            _ => return None,
        };
        Some(match harm {
            Some(harm) => harm.done_to(octets),
            None => OutgoingTelegram { octets, bad: None },
        })
    }
}

impl Harm {
    fn done_to(self, mut octets: Vec<u8>) -> OutgoingTelegram {
        let last = octets.len().max(1);
        let at = |place: u8| usize::from(place) % last;
        let flips = |place, flips| Some((at(place), LinkFault::Flip(flips)));
        let bad = match self {
            Self::Parity(place) => {
                let parity = true;
                let none = Flips::default();
                flips(place, Flips { parity, ..none })
            }
            Self::Stop(place) => {
                let stop = true;
                let none = Flips::default();
                flips(place, Flips { stop, ..none })
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
        OutgoingTelegram { octets, bad }
    }
}

impl TelegramActKind {
    /// Whether it is within its bounds.
    pub(super) fn fits(&self) -> bool {
        let long =
            |harm: &Option<Harm>| matches!(harm, Some(Harm::Gap(_, gap)) if *gap > LONGEST_GAP);
        match self {
            Self::Ask(request) => request.data.len() <= 240 && !long(&request.harm),
            Self::Octets { octets, harm } => (1..=300).contains(&octets.len()) && !long(harm),
            Self::Fault { number, .. } => (1..=25).contains(number),
            Self::Link { .. } | Self::Restart { .. } => true,
        }
    }

    /// Its size, by which simpler cases are preferred.
    pub(super) fn weight(&self) -> u64 {
        match self {
            Self::Ask(request) => {
                let octets = request.data.iter();
                let data: u64 = octets.map(|octet| 2 + u64::from(*octet != 0)).sum();
                let special = u64::from(request.count != Count::Next);
                10 + data + special + 10 * u64::from(request.harm.is_some())
            }
            Self::Octets { octets, harm } => {
                20 + 3 * octets.len() as u64 + 10 * u64::from(harm.is_some())
            }
            _ => 1,
        }
    }
}

/// The rate of a header is that of all stations: this many bits after the end of a request no right slave begins its reply.
pub(super) fn slot(rate: BusRate) -> Span {
    // min T_SDR of Set_Prm is at most 255 bits.
    rate.bit_time() * 260
}
