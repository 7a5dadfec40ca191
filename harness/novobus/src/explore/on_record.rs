//! Attempts on a ring with ports as a finding keeps them, and judged again from there.

use super::case::{Act, Case, Harm};
use super::judge::{BytesExchanged, Judge};
use super::on_rig::LONGEST_HISTORY;
use super::oracle::{Difference, sent};
use super::setup::RingSetup;
use crate::explore::{Rehearsal, Tried};
use crate::language::syntax::{DriveRange, Setup as HeaderLine, SetupKind};
use crate::twin::{self, Conversation, Done, Exactness, Twin};
use harness_bench::explore::{ExploreError, Target};
use harness_bench::link::{Moment, PlacedFault};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::Role;
use harness_proto::time::{Instant, Span};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::collections::VecDeque;

/// How late bytes may be read where a silence explains them. Their times are judged apart from their values.
const LATEST: Span = Span::from_millis(1_000);

/// An attempt at a case, with all that its difference rests on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AttemptRecord {
    /// Which values of the manual's open properties the bench took for possible, as numbers of 4 bits. From the highest one:
    /// `empty-short-telegram = error`, `short-address = kept-sum`, `read-long = as-printed`, `broken-sequence = forwarded`.
    pub(super) possible: Vec<u8>,
    /// Whether the link shows line errors at their bytes.
    pub(super) line_errors: bool,
    /// What came before it since the drives were made ready; the first one is the telegram from which they know their addresses.
    pub(super) before: Vec<AnsweredCase>,
    /// The case, and what came back; nothing where it was not played.
    pub(super) last: AnsweredCase,
    pub(super) played: bool,
    /// Whether its drives may monitor time-outs (ND21 9.9), in real time.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) may_monitor: bool,
    /// Whether a known deviation of the rig's file explains its difference.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) known: bool,
    /// When its bytes went and came.
    pub(super) times: ByteTimes,
}

/// A case, and the bytes that came back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AnsweredCase {
    pub(super) case: Case,
    #[serde(serialize_with = "write", deserialize_with = "read")]
    pub(super) received: Vec<Received>,
}

/// Times of an attempt, in thirds of a nanosecond.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ByteTimes {
    pub(super) byte: u64,
    /// How far times may be apart.
    pub(super) tolerance: u64,
    /// When each byte was sent.
    pub(super) sent: Vec<u64>,
    /// When each byte came.
    pub(super) came: Vec<u64>,
}

impl AttemptRecord {
    /// Whether it is within the bounds of what a run writes.
    #[must_use]
    pub(super) fn is_sound(&self) -> bool {
        let mut all = self.before.iter().chain([&self.last]);
        let ring = |case: &Case| (case.drives, case.ring());
        let sent = self.before.iter();
        let sent = sent.map(|answered| answered.case.bytes().len());
        all.all(|AnsweredCase { case, .. }| case.is_kept() && ring(case) == ring(&self.last.case))
            && sent.sum::<usize>() <= 2 * LONGEST_HISTORY
            && !self.possible.is_empty()
            && self.possible.iter().all(|place| *place < 16)
    }

    /// How the ring differed, judged again.
    fn difference(&self) -> Option<Difference> {
        let Self { before, last, .. } = self;
        if !self.played {
            return None;
        }
        let size = RingSize::new(u64::from(last.case.drives)).ok()?;
        let mut judge = Judge::new(last.case.ring(), size, self.line_errors);
        judge.set_possible(&self.possible);
        for answered in before {
            // As in the run, a difference in the first telegram shows again in the case.
            let exchange = BytesExchanged::of(&answered.case, answered.received.clone());
            let _again = judge.see(exchange).map(|_| judge.begin());
        }
        let exchange = BytesExchanged::of(&last.case, last.received.clone());
        let found = judge.see(exchange);
        let found = found.or_else(|| untimely(&last.case, &last.received, &self.times));
        found.filter(|_| !self.known && !self.is_silenced())
    }
}

/// The acts of conversations after the first one, which belongs to making the drives ready.
pub(super) fn acts(before: &[AnsweredCase]) -> Vec<Act> {
    let cases = before.iter().skip(1).map(|answered| &answered.case);
    cases.flat_map(|case| case.acts.iter().cloned()).collect()
}

/// The first byte of a complete conversation that came at a wrong time (ND21 8.2): every drive takes a byte time.
pub(super) fn untimely(
    case: &Case,
    received: &[Received],
    times: &ByteTimes,
) -> Option<Difference> {
    let size = RingSize::new(u64::from(case.drives)).ok()?;
    let (places, roles) = twin::answered(size, &sent(case));
    let starts = places.iter().map_while(|place| times.sent.get(*place));
    let answered: Vec<_> = roles.into_iter().zip(starts.copied()).collect();
    if answered.len() != received.len()
        || received.len() != times.came.len()
        || !case.faults().is_empty()
    {
        return None;
    }
    let round = Span::from_units(times.byte.saturating_mul(u64::from(case.drives)));
    let tolerance = Span::from_units(times.tolerance);
    let apart = |(index, (_, sent)): (usize, &(Role, u64))| {
        let (due, came) = (at(*sent) + round, at(times.came[index]));
        came.since(due).max(due.since(came)) > tolerance
    };
    let index = answered.iter().enumerate().position(apart)?;
    let (role, sent) = answered[index];
    Some(Difference::from(&twin::Divergence {
        ring: case.ring(),
        byte: index + 1,
        what: twin::Symptom::Time,
        expected: Some((at(sent) + round, received[index])),
        received: Some((at(times.came[index]), received[index])),
        role,
        rule: role.rule(),
        step: None,
        drive: None,
    }))
}

/// The properties that [`AttemptRecord::possible`] numbers, from the highest bit.
const OPEN: [(&str, &str); 4] = [
    ("empty-short-telegram", "error"),
    ("short-address", "kept-sum"),
    ("read-long", "as-printed"),
    ("broken-sequence", "forwarded"),
];

impl AttemptRecord {
    /// Whether right drives that monitor time-outs have sent what came, if they have heard a longer silence than the bench has noted (ND21
    /// 9.9).
    pub(super) fn is_silenced(&self) -> bool {
        let Self { before, last, .. } = self;
        let (drives, Ok(size)) = (last.case.drives, RingSize::new(u64::from(last.case.drives)))
        else {
            return false;
        };
        let exactness = Exactness {
            tolerance: LATEST,
            line_errors: self.line_errors,
            knows_cells: false,
            looks: None,
        };
        let byte = Span::from_units(self.times.byte);
        let explained = |place: &u8| {
            let lines = (0..).zip(OPEN).filter(|(bit, _)| place & (8 >> bit) != 0);
            let lines = lines.map(|(_, (name, word))| {
                HeaderLine::new(DriveRange::all(0), SetupKind::word(name, word))
            });
            let mut setup = RingSetup::of_ports(1);
            setup.header.setups.extend(lines);
            let Ok(link) = setup.model(&[drives]) else {
                return false;
            };
            let mut twin = Twin::new(link, &[size]);
            twin.rest_through_self_tests();
            for answered in before {
                let ideal = ByteTimes::ideal(answered, byte);
                let _alike = twin.follow(&answered.conversation(&ideal), exactness);
            }
            let comparison = twin.follow(&last.conversation(&self.times), exactness);
            comparison.silenced
        };
        self.may_monitor && self.possible.iter().any(explained)
    }
}

impl ByteTimes {
    /// Those of bytes that follow one another without a gap.
    fn ideal(answered: &AnsweredCase, byte: Span) -> Self {
        let way = u64::from(answered.case.drives) + 1;
        let times =
            |first: u64, count: usize| (first..).take(count).map(|place| byte.units() * place);
        Self {
            byte: byte.units(),
            tolerance: 0,
            sent: times(0, answered.case.bytes().len()).collect(),
            came: times(way, answered.received.len()).collect(),
        }
    }
}

impl AnsweredCase {
    /// What went and came, as a conversation of the ring alone.
    fn conversation(&self, times: &ByteTimes) -> Conversation {
        let fault = |(link, byte, harm): (u8, u64, Harm)| {
            let fault = PlacedFault::Link(usize::from(link), harm.fault());
            Done::Fault(Instant::START, fault, Moment::Byte(byte))
        };
        let faults = self.case.faults().into_iter().map(fault);
        let sent = times.sent.iter().zip(self.case.bytes());
        let sent = sent.map(|(start, byte)| Done::Sent(at(*start), byte));
        let received = times.came.iter().zip(&self.received);
        let received: Vec<_> = received.map(|(came, byte)| (0, at(*came), *byte)).collect();
        let last = times.sent.iter().chain(&times.came).max();
        Conversation {
            done: faults.chain(sent).map(|done| (0, done)).collect(),
            received,
            end: last.map_or(Instant::START, |last| at(*last)),
            unwatched: Vec::new(),
        }
    }
}

fn at(units: u64) -> Instant {
    Instant::START + Span::from_units(units)
}

/// The attempts of a finding, one after the other, in place of a rig.
pub(crate) struct OnRecord {
    left: VecDeque<AttemptRecord>,
}

impl OnRecord {
    /// The attempts of a finding.
    pub(crate) fn new(attempts: &[AttemptRecord]) -> Self {
        let left = attempts.iter().cloned().collect();
        Self { left }
    }

    /// The case of the next attempt.
    pub(crate) fn next(&self) -> Option<&Case> {
        self.left.front().map(|attempt| &attempt.last.case)
    }
}

impl Target<Case> for OnRecord {
    fn rehearse(&mut self, _: &Case) -> Result<Rehearsal, ExploreError> {
        Ok(Rehearsal::default())
    }

    fn attempt(&mut self, case: &Case, _: &Rehearsal) -> Result<Tried, ExploreError> {
        let next = self.left.pop_front();
        let next = next.filter(|attempt| attempt.last.case == *case);
        let attempt = next.ok_or_else(|| {
            ExploreError::File("an attempt at another case was due here".to_owned())
        })?;
        let difference = attempt.difference();
        let acts = acts(&attempt.before);
        Ok(Tried {
            before: (difference.is_some() && !acts.is_empty()).then_some(acts),
            difference,
            not_played: (!attempt.played).then(|| "the record says so".to_owned()),
            ..Tried::default()
        })
    }

    fn over(&mut self) -> Option<String> {
        let ended = self.left.is_empty();
        ended.then(|| "the record ends".to_owned())
    }
}

/// The line errors that a byte can have.
const ERRORS: [LineError; 4] = [
    LineError::Parity,
    LineError::Framing,
    LineError::Break,
    LineError::Overrun,
];

/// Writes bytes as a text: `80 00/parity`.
fn write<S: Serializer>(received: &[Received], serializer: S) -> Result<S::Ok, S::Error> {
    let bytes = received.iter().map(|byte| match byte.error {
        None => format!("{:02X}", byte.byte),
        Some(error) => format!("{:02X}/{}", byte.byte, error.name()),
    });
    serializer.serialize_str(&bytes.collect::<Vec<_>>().join(" "))
}

fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Received>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let byte = |word: &str| -> Option<Received> {
        let (byte, error) = match word.split_once('/') {
            None => (word, None),
            Some((byte, name)) => {
                let error = ERRORS.into_iter().find(|error| error.name() == name)?;
                (byte, Some(error))
            }
        };
        let byte = u8::from_str_radix(byte, 16).ok()?;
        Some(Received { byte, error })
    };
    let words = text.split_whitespace();
    words
        .map(|word| byte(word).ok_or_else(|| de::Error::custom(format!("`{word}` is no byte"))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::judge::{all_properties, prologue};
    use super::*;
    use harness_proto::novobus::properties::{BusSetting, Properties};

    /// ND21 9.9: drives that monitor time-outs answer with zeros after a silence of the bench. Zeros after none, and other bytes, are a drive's
    /// fault.
    #[test]
    fn only_what_drives_send_after_a_silence_is_silenced() {
        let case = prologue(3, None);
        let count = case.bytes().len() as u64;
        let byte = Span::from_micros(286).units();
        let silenced = |silence: Span, wrong: u8, may_monitor: bool| {
            let sent: Vec<u64> = (0..count)
                .map(|place| place * byte + if place < 3 { 0 } else { silence.units() })
                .collect();
            let right = RingSetup::of_ports(1).model_answers(&case).expect("a ring");
            let mut received: Vec<_> = right.received.iter().map(|(_, byte)| *byte).collect();
            received[3..].fill(Received::good(wrong));
            let times = ByteTimes {
                byte,
                tolerance: Span::from_millis(20).units(),
                came: sent.iter().map(|sent| sent + 4 * byte).collect(),
                sent,
            };
            let record = AttemptRecord {
                possible: vec![0],
                line_errors: true,
                before: Vec::new(),
                last: AnsweredCase {
                    case: case.clone(),
                    received,
                },
                played: true,
                may_monitor,
                known: false,
                times,
            };
            record.is_silenced()
        };
        let (long, short) = (Span::from_millis(12), Span::from_millis(1));
        assert!(silenced(long, 0, true));
        assert!(!silenced(long, 0x55, true));
        assert!(!silenced(long, 0, false));
        assert!(!silenced(short, 0, true));
    }

    /// Each number of an attempt names the same properties for the judge and for a ring that is made of it.
    #[test]
    fn numbers_of_properties_are_those_of_the_judge() {
        for (place, wanted) in (0u8..).zip(all_properties()) {
            let mut made = Properties::default();
            for (_, (name, word)) in (0..).zip(OPEN).filter(|(bit, _)| place & (8 >> bit) != 0) {
                made.set(name, BusSetting::Word(word)).expect("a property");
            }
            assert_eq!(made, wanted, "{place}");
        }
    }
}
