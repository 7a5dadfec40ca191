//! Attempts on a ring with ports as a finding keeps them, and judged again from there.

use super::case::{Act, Case};
use super::judge::{BytesExchanged, Judge};
use super::on_rig::LONGEST_HISTORY;
use super::oracle::{Difference, sent};
use crate::explore::{Rehearsal, Tried};
use crate::twin;
use harness_bench::explore::{ExploreError, Target};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::Role;
use harness_proto::time::{Instant, Span};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::collections::VecDeque;

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
        let silenced =
            |found: &Difference| self.may_monitor && is_silenced(last, &self.times, found);
        found.filter(|found| !self.known && !silenced(found))
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

/// Whether drives that may monitor time-outs have missed their bytes in front of a difference, because the bench was silent or late
/// (ND21 9.9).
pub(super) fn is_silenced(last: &AnsweredCase, times: &ByteTimes, found: &Difference) -> bool {
    let AnsweredCase { case, received } = last;
    let (Ok(size), Some(index)) = (
        RingSize::new(u64::from(case.drives)),
        found.byte.and_then(|byte| byte.checked_sub(1)),
    ) else {
        return false;
    };
    let (places, _) = twin::answered(size, &sent(case));
    let starts = places.iter().map_while(|place| times.sent.get(*place));
    let answered: Vec<_> = starts.copied().map(at).collect();
    let all: Vec<_> = times.sent.iter().copied().map(at).collect();
    let way = Span::from_units(times.byte.saturating_mul(u64::from(case.drives) + 1));
    let received = times
        .came
        .iter()
        .copied()
        .map(at)
        .zip(received.iter().copied());
    let received: Vec<_> = received.collect();
    // Where nothing differs the model expects what came.
    let expected = answered.iter().zip(&received).enumerate();
    let expected = expected.map(|(place, (start, (_, came)))| match place < index {
        true => (*start + way, *came),
        false => (*start + way, Received::good(!came.byte)),
    });
    let expected: Vec<_> = expected.collect();
    let sent = twin::SentTimes {
        answered: &answered,
        all: &all,
        way,
        earliest: twin::EARLIEST_TIME_OUT,
        complete: false,
    };
    let excused = sent.excused_from(size, &expected, &received, index, true, true);
    excused.is_some_and(|from| received.get(index).is_none_or(|(came, _)| *came >= from))
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
    use super::super::judge::prologue;
    use super::*;

    /// ND21 9.9: drives that monitor time-outs answer with zeros after a silence of the bench. Zeros behind none are a drive's fault.
    #[test]
    fn only_a_silence_excuses_zeros() {
        let case = prologue(3, None);
        let count = case.bytes().len() as u64;
        let byte = Span::from_micros(286).units();
        let silenced = |silence: Span| {
            let sent: Vec<u64> = (0..count)
                .map(|place| place * byte + if place < 3 { 0 } else { silence.units() })
                .collect();
            let mut came: Vec<_> = sent.iter().map(|sent| sent + 4 * byte).collect();
            let mut received: Vec<_> = case.bytes().into_iter().map(Received::good).collect();
            received[3..].fill(Received::good(0));
            came.truncate(received.len());
            let times = ByteTimes {
                byte,
                tolerance: Span::from_millis(20).units(),
                sent,
                came,
            };
            let last = AnsweredCase {
                case: case.clone(),
                received,
            };
            let found = Difference::from(&twin::Divergence {
                ring: 0,
                byte: 4,
                what: twin::Symptom::Value,
                expected: None,
                received: None,
                role: Role::Foreign,
                rule: Role::Foreign.rule(),
                step: None,
                drive: None,
            });
            is_silenced(&last, &times, &found)
        };
        assert!(silenced(Span::from_millis(12)));
        assert!(!silenced(Span::from_millis(1)));
    }
}
