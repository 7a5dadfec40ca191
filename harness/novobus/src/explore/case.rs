//! A case: one conversation as a value, with all faults to inject.
//!
//! A case consists of acts in the manual's terms, so that it stays a valid conversation when it is mutated or shrunk. Checking bytes
//! are computed when the bytes are made. A fault belongs to a byte of its act, wherever the act stands.

use super::order::{CommandSent, RawCommand};
use harness_bench::link::LinkFault;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{SEQUENCE, ZEROS};
use harness_proto::novobus::sync::{PAUSE, SYNCO};
use harness_proto::time::Span;
use harness_sim::fault::Flips;
use serde::{Deserialize, Serialize};

/// Maximum number of acts of a case.
pub(crate) const MOST_ACTS: usize = 48;

/// Maximum number of bytes that a case sends.
pub(crate) const MOST_BYTES: usize = 400;

/// Maximum number of net bytes of a telegram (ND21 9.2).
pub(crate) const MOST_NET: u8 = 7;

/// A conversation with a ring of a given size.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Case {
    /// How many drives the ring has.
    pub drives: u8,
    /// The other ring of the bench, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<OtherRing>,
    /// The acts, in order.
    pub acts: Vec<Act>,
}

/// The other ring of the bench and its number of drives (ND21 12.2). No byte goes from one ring to the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OtherRing {
    /// It is ring 1: the conversation is with ring 2.
    First(u8),
    /// It is ring 2: the conversation is with ring 1.
    Second(u8),
}

/// An action of the master, with the faults on its bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Act {
    pub what: ActKind,
    /// The faults on its bytes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub damages: Vec<Damage>,
}

/// What the master can do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum ActKind {
    /// This number of SYNCO (ND21 9.2).
    Synco(u8),
    /// This number of PAUSE (9.2).
    Pause(u8),
    /// This number of zeros.
    Zeros(u8),
    /// 17 zeros and the check sequence (9.8).
    Recover,
    /// The five bytes of the check sequence alone (9.8).
    Sequence,
    /// Any bytes.
    Bytes(Vec<u8>),
    /// One telegram or several to a drive.
    Talk(Talk),
    /// Silence of this many milliseconds.
    Wait(u16),
    /// A drive loses its power, or gets it back.
    Power {
        drive: u8,
        /// Whether it has power from now on.
        on: bool,
    },
}

/// Telegrams to one drive (9.1). If the commands do not fit into one telegram, they are split over several telegrams to the same drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Talk {
    /// The addressee.
    pub to: To,
    /// The process data of the first telegram (9.4).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process_data: Option<u16>,
    /// The commands (9.5).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orders: Vec<CommandSent>,
    /// Maximum number of net bytes of each telegram, 2 to 7.
    #[serde(default = "most_net", skip_serializing_if = "is_most_net")]
    pub room: u8,
    /// Whole telegrams or idle bytes (9.2) between the telegrams of a split command.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub between: Vec<u8>,
}

const fn most_net() -> u8 {
    MOST_NET
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
const fn is_most_net(room: &u8) -> bool {
    *room == MOST_NET
}

/// The addressee of a telegram (9.2, 9.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum To {
    /// A drive, by an address byte.
    Drive(u8),
    /// The drive of the telegram before.
    Same,
    Next,
    /// No drive: this address byte addresses no drive of the ring.
    Nobody(u8),
}

/// A fault at a byte of an act.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Damage {
    /// On which link, counted from the master's outgoing one as 0.
    pub link: u8,
    /// At which byte of the act, counted from 0; the last one where there are fewer.
    pub at: u16,
    pub harm: Harm,
}

/// What happens to a byte on a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Harm {
    /// Bits are inverted.
    Flip { data: u8, parity: bool, stop: bool },
    /// Another byte arrives.
    Replace(u8),
    /// Nothing arrives.
    Drop,
    /// It arrives twice.
    Duplicate,
    /// Another one arrives before it.
    Insert(u8),
    /// It arrives this many microseconds later.
    Delay(u16),
    /// The line is held at 0 for this many microseconds.
    Break(u16),
    /// The receiver was too slow.
    Overrun,
}

impl Talk {
    /// One command to a drive.
    #[must_use]
    pub(crate) fn one(to: To, command: RawCommand) -> Self {
        Self {
            to,
            process_data: None,
            orders: vec![CommandSent::sound(command)],
            room: MOST_NET,
            between: Vec::new(),
        }
    }

    /// The telegrams, each with its bytes, in a ring of `drives`.
    #[must_use]
    pub(crate) fn telegrams(&self, drives: u8) -> Vec<Vec<u8>> {
        let mut telegrams = Vec::new();
        self.each_telegram(drives, |bytes| telegrams.push(bytes.to_vec()));
        telegrams
    }

    /// Gives the bytes of each telegram to `take`, in order.
    fn each_telegram(&self, drives: u8, mut take: impl FnMut(&[u8])) {
        let room = usize::from(self.room.clamp(2, MOST_NET));
        let mut all = Vec::with_capacity(8 * self.orders.len());
        for order in &self.orders {
            order.append_to(&mut all);
        }
        let mut rest = &all[..];
        let mut bytes = Vec::new();
        let mut first = true;
        while first || !rest.is_empty() {
            let data = self.process_data.filter(|_| first);
            let taken = if data.is_some() { 2 } else { 0 };
            let (now, later) = rest.split_at((room - taken).min(rest.len()));
            // Behind a telegram to another drive the address is needed again.
            let addressed = self
                .between
                .iter()
                .all(|byte| [SYNCO, PAUSE].contains(byte));
            let to = match first || !addressed {
                true => self.to,
                false => To::Same,
            };
            if !first && !self.between.is_empty() {
                take(&self.between);
            }
            bytes.clear();
            telegram(&mut bytes, to, data, now, drives);
            take(&bytes);
            rest = later;
            first = false;
        }
    }
}

/// Appends a telegram of any kind (9.1, 9.2), an address byte without net bytes among them.
fn telegram(bytes: &mut Vec<u8>, to: To, data: Option<u16>, parameters: &[u8], drives: u8) {
    let (form, address) = match to {
        // 9.3: the master sends k-N.
        To::Drive(drive) => (0x80, Some(drive.wrapping_sub(drives))),
        To::Nobody(byte) => (0x80, Some(byte)),
        To::Same => (0xA0, None),
        To::Next => (0xE0, None),
    };
    let data_bytes = data.map(u16::to_be_bytes);
    let length = parameters.len() + data_bytes.map_or(0, |bytes| bytes.len());
    let length = u8::try_from(length).unwrap_or(MOST_NET).min(MOST_NET);
    bytes.push(form | length << 1 | u8::from(data.is_some()));
    bytes.extend(address);
    bytes.extend(data_bytes.into_iter().flatten());
    bytes.extend(parameters);
}

impl Act {
    /// An act without a fault.
    #[must_use]
    pub(crate) const fn sound(what: ActKind) -> Self {
        Self {
            what,
            damages: Vec::new(),
        }
    }

    /// What is sent, telegram by telegram.
    #[must_use]
    pub(crate) fn parts(&self, drives: u8) -> Vec<Vec<u8>> {
        let mut parts = Vec::new();
        self.each_part(drives, |part| parts.push(part.to_vec()));
        parts
    }

    /// Gives what is sent to `take`, telegram by telegram.
    pub(super) fn each_part(&self, drives: u8, mut take: impl FnMut(&[u8])) {
        const MOST: usize = u8::MAX as usize;
        match &self.what {
            ActKind::Synco(count) => take(&[SYNCO; MOST][..usize::from(*count)]),
            ActKind::Pause(count) => take(&[PAUSE; MOST][..usize::from(*count)]),
            ActKind::Zeros(count) => take(&[0; MOST][..usize::from(*count)]),
            ActKind::Recover => {
                let mut bytes = vec![0; usize::from(ZEROS)];
                bytes.extend(SEQUENCE);
                take(&bytes);
            }
            ActKind::Sequence => take(&SEQUENCE),
            ActKind::Bytes(bytes) => take(bytes),
            ActKind::Talk(talk) => talk.each_telegram(drives, take),
            ActKind::Wait(_) | ActKind::Power { .. } => {}
        }
    }

    /// How many bytes are sent.
    #[must_use]
    pub(crate) fn length(&self, drives: u8) -> usize {
        let mut length = 0;
        self.each_part(drives, |part| length += part.len());
        length
    }
}

impl Case {
    /// Which ring of the bench it is with, counted from 0.
    #[must_use]
    pub(crate) const fn ring(&self) -> usize {
        match self.beside {
            Some(OtherRing::First(_)) => 1,
            Some(OtherRing::Second(_)) | None => 0,
        }
    }

    /// How many drives the rings of the bench have, in order.
    #[must_use]
    pub(crate) fn sizes(&self) -> Vec<u8> {
        match self.beside {
            None => vec![self.drives],
            Some(OtherRing::First(other)) => vec![other, self.drives],
            Some(OtherRing::Second(other)) => vec![self.drives, other],
        }
    }

    /// All bytes that are sent.
    #[must_use]
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(MOST_BYTES);
        for act in &self.acts {
            act.each_part(self.drives, |part| bytes.extend(part));
        }
        bytes
    }

    /// How many bytes are sent.
    pub(super) fn length(&self) -> usize {
        self.acts.iter().map(|act| act.length(self.drives)).sum()
    }

    /// The faults on links: link, byte counted from 1 over all bytes that the master sends, and what happens.
    #[must_use]
    pub(crate) fn faults(&self) -> Vec<(u8, u64, Harm)> {
        let mut faults = Vec::new();
        if self.acts.iter().all(|act| act.damages.is_empty()) {
            return faults;
        }
        let mut before = 0;
        for act in &self.acts {
            let length = act.length(self.drives);
            for damage in act.damages.iter().filter(|_| length > 0) {
                let at = usize::from(damage.at).min(length - 1);
                let link = damage.link.min(self.drives);
                faults.push((link, (before + at + 1) as u64, damage.harm));
            }
            before += length;
        }
        faults
    }

    pub(crate) fn orders(&self) -> impl Iterator<Item = &CommandSent> {
        self.acts.iter().flat_map(|act| match &act.what {
            ActKind::Talk(talk) => &talk.orders[..],
            _ => &[],
        })
    }

    /// Whether it stays within the bounds of a case, and its rings within theirs (ND21 8.4).
    #[must_use]
    pub(crate) fn is_bounded(&self) -> bool {
        self.is_within(1)
    }

    /// The same for a finding, in which more may stand than in a new case: what was sent before.
    #[must_use]
    pub(crate) fn is_kept(&self) -> bool {
        self.is_within(30)
    }

    fn is_within(&self, times: usize) -> bool {
        let is_ring = |drives: &u8| RingSize::new(u64::from(*drives)).is_ok();
        self.acts.len() <= MOST_ACTS * times
            && self.length() <= MOST_BYTES * times
            && self.sizes().iter().all(is_ring)
    }
}

impl Harm {
    /// The fault of the language.
    #[must_use]
    pub(crate) const fn fault(self) -> LinkFault {
        match self {
            Self::Flip { data, parity, stop } => LinkFault::Flip(Flips {
                data,
                parity,
                stop,
                start: false,
            }),
            Self::Replace(byte) => LinkFault::Replace(byte),
            Self::Drop => LinkFault::Drop,
            Self::Duplicate => LinkFault::Duplicate,
            Self::Insert(byte) => LinkFault::Insert(byte),
            Self::Delay(us) => LinkFault::Delay(Span::from_micros(us as u64)),
            Self::Break(us) => LinkFault::Break(Span::from_micros(us as u64)),
            Self::Overrun => LinkFault::Overrun,
        }
    }

    /// How complex it is: a single inverted bit is the simplest.
    #[must_use]
    pub(crate) const fn weight(self) -> u64 {
        match self {
            Self::Flip { data, parity, stop } => {
                let bits = data.count_ones() as u64 + parity as u64 + 4 * stop as u64;
                // Any single bit is as simple, but a reader expects the lowest one.
                let place = if data == 0 { 0 } else { data.ilog2() as u64 };
                16 * bits + place
            }
            Self::Drop | Self::Overrun => 200,
            Self::Duplicate => 201,
            Self::Replace(byte) | Self::Insert(byte) => 1_000 + byte as u64,
            Self::Delay(us) | Self::Break(us) => 2_000 + us as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::novobus::checksum::Checksum;

    /// ND21 9.7: `88 FE C0 13 FE D1` reads byte FE13 of drive 1 in a ring of three.
    #[test]
    fn a_talk_is_the_telegram_of_the_print() {
        let talk = Talk::one(To::Drive(1), RawCommand::ReadByte { cell: 0xFE13 });
        assert_eq!(
            talk.telegrams(3),
            [vec![0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1]]
        );
    }

    /// ND21 9.5: a command may be cut over several telegrams; process data go with the first.
    #[test]
    fn a_command_is_cut_over_telegrams() {
        let talk = Talk {
            process_data: Some(0x1234),
            room: 4,
            ..Talk::one(
                To::Next,
                RawCommand::WriteWord {
                    cell: 0xFF08,
                    data: 0xABCD,
                },
            )
        };
        let check = Checksum::over(&[0x63, 0xCD, 0xAB, 0x08, 0xFF]).plus();
        let expected = [
            vec![0xE9, 0x12, 0x34, 0x63, 0xCD],
            vec![0xA8, 0xAB, 0x08, 0xFF, check],
        ];
        assert_eq!(talk.telegrams(3), expected);
    }

    /// A fault stays at the byte of its act, whatever precedes the act.
    #[test]
    fn a_fault_moves_with_its_act() {
        let damage = Damage {
            link: 1,
            at: 2,
            harm: Harm::Drop,
        };
        let read = ActKind::Talk(Talk::one(
            To::Drive(0),
            RawCommand::ReadByte { cell: 0xFE13 },
        ));
        let mut case = Case {
            drives: 2,
            beside: None,
            acts: vec![Act {
                what: read,
                damages: vec![damage],
            }],
        };
        assert_eq!(case.faults(), [(1, 3, Harm::Drop)]);
        case.acts.insert(0, Act::sound(ActKind::Synco(10)));
        assert_eq!(case.faults(), [(1, 13, Harm::Drop)]);
    }
}
