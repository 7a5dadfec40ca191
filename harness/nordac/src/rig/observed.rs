//! What is noted of a link to NORDAC inverters: which parameters are written, and how late replies come.

use super::known::{ADDRESS, WIPES};
use harness_bench::counted::counted;
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::rig::playing::observed::{LinkNotes, ReceivedSum};
use harness_bench::trouble::Trouble;
use harness_proto::decode::Decoded;
use harness_proto::nordac::{DEFAULT_ADDRESS, Image, Pkw, PpoType, Task};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::{Buffer, Telegram};
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

const MOST_KEPT: usize = 1_000_000;

/// A link to inverters, observed.
pub(super) type Observed<'l> = harness_bench::rig::playing::observed::Observed<'l, TelegramNotes>;

/// A parameter that may have been written: station, number and IND.
pub(super) type WrittenParameter = (u8, u16, u16);

/// A telegram of the bench, and what came after it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Turn {
    /// The step of the scenario that has sent it; `None` for what made the slaves ready.
    pub(super) step: Option<usize>,
    pub(super) octets: Vec<u8>,
    /// Its last octet has left then, if the computer was not late.
    pub(super) left: Instant,
    /// The octets that came, each with bit 8 where it has a line error.
    pub(super) came: Vec<u16>,
    /// When the last of them was read.
    pub(super) read: Option<Instant>,
}

#[derive(Default)]
pub(super) struct TelegramNotes {
    /// The telegrams since the last [`begin_fresh`](Self::begin_fresh), in one time.
    pub(super) turns: Vec<Turn>,
    step: Option<usize>,
    /// How long the conversations before this one took since then, and how long this one has.
    took: [Span; 2],
    /// The parameters that telegrams may have written.
    pub(super) written: BTreeSet<WrittenParameter>,
    /// The addresses that telegrams may have given to stations: the station, and its new one.
    pub(super) moved: BTreeSet<(u8, u8)>,
    /// When the last telegram had left.
    asked: Option<Instant>,
    /// The octets that have come since.
    reply: Buffer,
    /// The longest time from the end of a request until the bench had read its whole reply, beside the reply's own time on the line.
    pub(super) longest: Span,
    /// How many octets were received, and their checksum.
    heard: ReceivedSum,
    /// The octets that were received.
    kept: Vec<ReceivedOctet>,
    /// How often something was sent since the last [`begin_fresh`](Self::begin_fresh).
    sent: u32,
    /// When the last octet came or the last telegram had left, in this conversation.
    last: Option<Instant>,
    /// How many octets had come at the last [`begin_fresh`](Self::begin_fresh).
    pub(super) fresh: usize,
    /// What others sent in the place of what counts here.
    expected: Option<ExpectedOctets>,
    /// That something else came.
    differs: Option<Trouble>,
}

/// Octets with which those of a model are compared as they come.
struct ExpectedOctets {
    came: ReceivedOctets,
    /// How many octets came before them.
    behind: usize,
    /// Whether their times count.
    timed: bool,
}

/// An octet from a slave, and its place in the conversation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ReceivedOctet {
    /// How often something was sent before it: an answer to one request is none to another.
    sent: u32,
    /// How long after the octet before, or after what was sent last.
    gap: Span,
    /// The octet, and in bit 8 whether it has a line error.
    bits: u16,
}

impl ReceivedOctet {
    /// A copy without its time.
    const fn at_any_time(self) -> Self {
        Self {
            sent: 0,
            gap: Span::ZERO,
            ..self
        }
    }
}

/// Octets from the slaves, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ReceivedOctets(Vec<ReceivedOctet>);

/// How far two sequences of octets agree; the more the greater. [`WHOLE`] where they are the same.
pub(super) type Agreement = usize;

/// All octets agree.
pub(super) const WHOLE: Agreement = Agreement::MAX;

impl ReceivedOctets {
    /// The octets without their times.
    pub(super) fn at_any_time(mut self) -> Self {
        let octets = self.0.iter_mut();
        octets.for_each(|octet| *octet = octet.at_any_time());
        self
    }

    /// How many octets from the first on agree with those of another sequence, and how many bits of the next one.
    pub(super) fn agrees(&self, other: &Self) -> Agreement {
        if self == other {
            return WHOLE;
        }
        let pairs = || self.0.iter().zip(&other.0);
        let same = pairs().take_while(|(ours, other)| ours == other).count();
        let next = pairs().nth(same);
        let bits = next.map_or(0, |(ours, other)| {
            (ours.bits ^ other.bits).count_zeros() as usize
        });
        same * 32 + bits
    }

    pub(super) fn telegrams(&self) -> Vec<Telegram> {
        let octets: Vec<u8> = self.0.iter().map(|octet| octet.bits as u8).collect();
        let mut rest = octets.as_slice();
        let mut all = Vec::new();
        while !rest.is_empty() {
            match Telegram::decode(rest) {
                Decoded::Value { value, used } => {
                    all.push(value);
                    rest = &rest[used..];
                }
                _ => rest = &rest[1..],
            }
        }
        all
    }
}

impl TelegramNotes {
    /// What comes from now on does not depend on what the slaves have done before.
    pub(super) fn begin_fresh(&mut self) {
        self.fresh = self.kept.len();
        self.sent = 0;
        self.last = None;
        self.turns = Vec::new();
        self.step = None;
    }

    pub(super) fn reach(&mut self, now: Instant) {
        self.took[1] = self.took[1].max(now.since_start());
    }

    /// The link ends with the first octet after the first `behind` ones that is not that of `came`: how far they agree is known then.
    pub(super) fn expect(&mut self, came: &ReceivedOctets, behind: usize, timed: bool) {
        self.expected = Some(ExpectedOctets {
            came: came.clone(),
            behind,
            timed,
        });
    }

    /// Compares the octet that came last with what is expected.
    fn compare(&mut self) {
        let Some(expected) = &self.expected else {
            return;
        };
        let place = (self.kept.len() - 1).checked_sub(expected.behind);
        let Some((place, last)) = place.zip(self.kept.last()) else {
            return;
        };
        let last = match expected.timed {
            true => *last,
            false => last.at_any_time(),
        };
        if expected.came.0.get(place) != Some(&last) {
            self.differs = Some(Trouble::Interrupted);
        }
    }

    pub(super) const fn len(&self) -> usize {
        self.kept.len()
    }

    /// The octets that came since the last [`begin_fresh`](Self::begin_fresh).
    pub(super) fn came(&self) -> ReceivedOctets {
        ReceivedOctets(self.kept[self.fresh..].to_vec())
    }

    /// All octets that came.
    pub(super) fn all(&self) -> ReceivedOctets {
        ReceivedOctets(self.kept.clone())
    }

    /// What was received so far, in words.
    pub(super) fn received(&self) -> String {
        let ReceivedSum { pieces, sum } = self.heard;
        format!(
            "{} from the slaves, checksum {sum:08X}",
            counted(pieces, "octet")
        )
    }
}

/// The tasks by which a telegram may change parameters, in every layout that its length fits, each with the station.
pub(super) fn changes(octets: &[u8]) -> Vec<(u8, Pkw)> {
    let telegram = Telegram::decode(octets).value();
    let exchange = telegram
        .as_ref()
        .and_then(Telegram::pdu)
        .filter(|pdu| Service::of(pdu.dsap()) == Some(Service::DataExchange));
    let Some(pdu) = exchange else {
        return Vec::new();
    };
    let layouts = PpoType::ALL.into_iter().filter(|ppo| ppo.has_pkw());
    let tasks = layouts.filter_map(|ppo| Some(Image::decode(ppo, pdu.data())?.pkw));
    let changes =
        tasks.filter(|task| task.task().is_change() && task.task() != Task::ChangeDescription);
    changes.map(|task| (pdu.da(), task)).collect()
}

/// The address that a task may give to its station.
pub(super) fn moves_to(task: Pkw) -> Option<u8> {
    let to = match task.number() {
        ADDRESS => u8::try_from(task.low_word()).ok(),
        number if WIPES.contains(&number) => Some(DEFAULT_ADDRESS),
        _ => None,
    };
    to.filter(|address| (1..=DEFAULT_ADDRESS).contains(address))
}

impl LinkNotes for TelegramNotes {
    fn sent(&mut self, what: Out<'_>, end: Instant) {
        self.sent += 1;
        self.last = Some(end);
        self.asked = Some(end);
        self.reply.clear();
        if self.kept.len() < MOST_KEPT {
            self.turns.push(Turn {
                step: self.step,
                octets: what.octets().to_vec(),
                left: end + self.took[0],
                came: Vec::new(),
                read: None,
            });
        }
        self.reach(end);
        for (station, task) in changes(what.octets()) {
            self.written.insert((station, task.number(), task.ind));
            self.moved.extend(moves_to(task).map(|to| (station, to)));
        }
    }

    fn heard(&mut self, medium: Medium, at: Instant, now: Instant, heard: HeardPiece) {
        let HeardPiece::Octet(octet) = heard else {
            return;
        };
        if self.kept.len() < MOST_KEPT {
            let error = u16::from(octet.error.is_some()) << 8;
            let gap = self
                .last
                .replace(at)
                .map_or(Span::ZERO, |last| at.since(last));
            self.kept.push(ReceivedOctet {
                sent: self.sent,
                gap,
                bits: u16::from(octet.byte) | error,
            });
            self.compare();
            if let Some(turn) = self.turns.last_mut() {
                turn.came.push(u16::from(octet.byte) | error);
                turn.read = Some(now + self.took[0]);
            }
            self.reach(now);
        } else if self.kept.len() == MOST_KEPT {
            // Its reply is not whole.
            let _cut = self.turns.pop();
        }
        self.heard.pieces += 1;
        let bits = u32::from(octet.byte) | u32::from(octet.error.is_some()) << 8;
        self.heard.add(bits);
        let Some(asked) = self.asked else { return };
        let _too_long = self.reply.push(octet.byte);
        if let Decoded::Value { used, .. } = Telegram::decode(&self.reply) {
            let length = medium.octet_time() * used as u64;
            let took = now.since(asked).saturating_sub(length);
            self.longest = self.longest.max(took);
            self.asked = None;
        }
    }

    fn ended(&self) -> Option<&Trouble> {
        self.differs.as_ref()
    }

    fn step(&mut self, place: usize) {
        self.step = Some(place);
    }

    fn begin(&mut self, _now: Instant) {
        let took = std::mem::take(&mut self.took[1]);
        self.took[0] = self.took[0] + took;
        self.last = None;
        self.asked = None;
        self.reply.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::{ReceivedOctets, TelegramNotes, WHOLE};
    use harness_bench::medium::{HeardPiece, Medium};
    use harness_bench::rig::playing::observed::LinkNotes;
    use harness_proto::line::Received;
    use harness_proto::profibus::BusRate;
    use harness_proto::time::{Instant, Span};
    use proptest::prelude::*;

    /// Notes octets at their times in ms, until the link ends.
    fn noted(octets: &[(u64, u8)], expected: Option<(&ReceivedOctets, bool)>) -> TelegramNotes {
        let mut notes = TelegramNotes::default();
        if let Some((came, timed)) = expected {
            notes.expect(came, 0, timed);
        }
        let medium = Medium::Octets(BusRate::K500.format());
        let mut at = Instant::default();
        for (gap, octet) in octets {
            if notes.ended().is_some() {
                break;
            }
            at += Span::from_millis(*gap);
            notes.heard(medium, at, at, HeardPiece::Octet(Received::good(*octet)));
        }
        notes
    }

    fn octets() -> impl Strategy<Value = Vec<(u64, u8)>> {
        prop::collection::vec((0..2_u64, 0..3_u8), 0..8)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// A link that ends with the first octet that was not expected shows how far all octets agree.
        #[test]
        fn an_end_at_the_first_difference_changes_no_agreement(
            seen in octets(),
            sent in octets(),
            timed: bool,
        ) {
            let came = |notes: &TelegramNotes| match timed {
                true => notes.came(),
                false => notes.came().at_any_time(),
            };
            let expected = came(&noted(&seen, None));
            let whole = came(&noted(&sent, None)).agrees(&expected);
            let cut = noted(&sent, Some((&expected, timed)));
            prop_assert_eq!(came(&cut).agrees(&expected), whole);
            prop_assert!(cut.ended().is_none() || whole != WHOLE);
        }
    }
}
