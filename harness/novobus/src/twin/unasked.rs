//! Bytes that drives send unasked in real time (ND21 9.9).
//!
//! The number of zeros before another byte, and which drive sends the first zero, depend on the clocks of the drives, which no model
//! knows. From the first unasked byte to the next byte of the master, only properties that hold for every order are checked.

use super::comparison::Symptom;
use super::follow::{Conversation, Done, TwinBytes};
use super::places::answered;
use super::silence::EARLY;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// Longest silence after which a drive that monitors detects a time-out (ND21 9.9, 14.10.2).
const LATEST_TIME_OUT: Span = Span::from_millis(20);

/// Shortest silence after which a drive that monitors detects a time-out (ND21 9.9). A model that deviates may detect one earlier.
pub(crate) const EARLIEST_TIME_OUT: Span = Span::from_millis(10);

/// Maximum error of the clocks of the bench and of a drive over the time of a time-out.
const CLOCKS: Span = Span::from_micros(500);

/// How many bytes after a silence come back as they were sent where the bench knows when it ended: they take four times [`EARLY`]. A
/// computer that was late delivers them together.
const PUNCTUAL: usize = 16;

/// A byte and when it came.
type TimedByte = (Instant, Received);

/// A race of clocks, which begins at the first byte that was sent unasked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Race {
    /// Its place among the bytes received.
    pub(crate) first: usize,
    /// Whether it is unasked both in the ring and in the model: then its value and its time are compared.
    pub(crate) in_both: bool,
    /// A byte from there on that no order of the clocks explains, and how it differs.
    pub(crate) fault: Option<(usize, Symptom)>,
}

/// The times at which the master's bytes were sent.
pub(crate) struct SentTimes<'a> {
    /// The start of each byte that is answered, in order.
    pub(crate) answered: &'a [Instant],
    /// The start of every byte, in order.
    pub(crate) all: &'a [Instant],
    /// Time from the start of a byte to its answer.
    pub(crate) way: Span,
}

impl SentTimes<'_> {
    /// The first byte received from `from` on that came before the master's byte that it would answer.
    fn first(&self, received: &[TimedByte], from: Instant) -> Option<usize> {
        let unasked = |(index, (at, _)): (usize, &TimedByte)| {
            let early = self.answered.get(index).is_none_or(|start| at < start);
            early && *at >= from
        };
        received.iter().enumerate().position(unasked)
    }

    /// The place past the bytes, from an unasked one on, that came before the master's next byte.
    fn end_of_race(&self, heard: &[TimedByte], first: usize) -> usize {
        let (from, _) = heard[first];
        let next = self.all.partition_point(|start| *start <= from);
        let before = |(at, _): &TimedByte| self.all.get(next).is_none_or(|next| at < next);
        first + heard[first..].partition_point(before)
    }

    /// The first byte that was sent unasked, by the ring or by its model, and what is wrong from there to the next byte of the master's.
    /// `None` where the model sends none: no drive may then (ND21 9.9). A drive may be known to monitor.
    pub(crate) fn judge(
        &self,
        size: RingSize,
        answer: &TwinBytes,
        received: &[TimedByte],
        tolerance: Span,
        monitored: bool,
    ) -> Option<Race> {
        let expected = &answer.bytes[..];
        let model = answer.unasked?;
        let (due, _) = expected[model];
        let ring = self.first(received, due - tolerance);
        let first = ring.map_or(model, |ring| ring.min(model));
        let in_both = ring == Some(model);
        let here = match (expected.get(first), received.get(first)) {
            (Some(_), None) => Some(Symptom::Missing),
            (None, Some(_)) => Some(Symptom::Surplus),
            // A byte of the master's came first in one of them. Close together, that is chance.
            (Some((due, _)), Some((at, _))) if !in_both && apart(*due, *at) > tolerance => {
                match model == first {
                    true => Some(Symptom::Missing),
                    false => Some(Symptom::Surplus),
                }
            }
            _ => None,
        };
        // The drives of a model that deviates may spell out other numbers than those of the ring.
        let mut spelled = [false; 256];
        spelled[..usize::from(size.drives())].fill(true);
        for (_, byte) in &expected[model..self.end_of_race(expected, model)] {
            spelled[usize::from(byte.byte)] |= byte.error.is_none();
        }
        let foreign = || {
            let first = ring.filter(|ring| *ring == first)?;
            let race = &received[first..self.end_of_race(received, first)];
            let foreign =
                |(_, byte): &TimedByte| byte.error.is_some() || !spelled[usize::from(byte.byte)];
            Some((first + race.iter().position(foreign)?, Symptom::Value))
        };
        let overdue = monitored && first == model && self.is_overdue(received, model);
        let overdue = overdue.then_some((model, Symptom::Value));
        let here = here.map(|what| (first, what));
        Some(Race {
            first,
            in_both,
            fault: overdue.or(here).or_else(foreign),
        })
    }

    /// Whether a drive that monitors has let the latest time-out pass: the first byte after a silence that was longer than that answers one of
    /// the master's, and is not the zero of a drive in error (ND21 9.7, 9.9). A silence that the drive hears is no shorter than from the
    /// return of the byte before it to the start of the next one, and [`PUNCTUAL`] bytes that come back as they were sent, none before its
    /// time, show that the next one started when the bench says.
    fn is_overdue(&self, received: &[TimedByte], first: usize) -> bool {
        let after = || {
            let before = first.checked_sub(1)?;
            let start = self.answered.get(before)?;
            let next = self.all.partition_point(|at| at <= start);
            let (next, (back, _)) = (self.all.get(next)?, received.get(before)?);
            let silence = next.since((*start + self.way).max(*back));
            let starts = self.answered.get(first..first + PUNCTUAL)?;
            let came = received.get(first..first + PUNCTUAL)?;
            let units = |at: Instant| i128::from(at.since_start().units());
            let late = starts.iter().zip(came);
            let late = late.map(|(start, (at, _))| units(*at) - units(*start + self.way));
            let (least, most) = (late.clone().min()?, late.max()?);
            let [spread, early] = [EARLY * 2, CLOCKS].map(|span| i128::from(span.units()));
            let is_so = starts[0] == *next && least >= -early && most - least <= spread;
            let is_zero = came[0].1 == Received::good(0);
            Some(silence > LATEST_TIME_OUT + CLOCKS && is_so && !is_zero)
        };
        after() == Some(true)
    }
}

/// What was sent and received after a check sequence that ends a race (ND21 9.8), what the twin received there, and how many bytes came
/// before. `None` where it is not certain that the drives are as their models again: the master has sent something else than zeros and SYNCO
/// in front of it, the sequence or a byte after it is not in its place, or a drive that monitors may not have missed its master.
pub(super) fn after_a_race(
    conversation: &Conversation,
    ring: usize,
    size: RingSize,
    answer: &TwinBytes,
    tolerance: Span,
    one_monitors: bool,
) -> Option<(Conversation, TwinBytes, usize)> {
    let fault = |(_, done): &(usize, Done)| matches!(done, Done::Fault(..));
    let (due, _) = answer.bytes[answer.unasked?];
    let (sent, starts) = (conversation.sent_in(ring), conversation.sent_at(ring));
    let last = starts
        .partition_point(|start| *start < due)
        .checked_sub(1)?;
    let silence = starts.get(last + 1)?.since(starts[last]);
    // No drive sends a zero until every drive has detected the time-out.
    let unasked = due.since(starts[last]) + tolerance;
    let all_missed = silence >= LATEST_TIME_OUT + tolerance && unasked >= LATEST_TIME_OUT;
    if !(all_missed || one_monitors) || conversation.done.iter().any(fault) {
        return None;
    }
    let after: Vec<u8> = sent[last + 1..].iter().map(|(byte, _)| *byte).collect();
    let place = after
        .windows(SEQUENCE.len())
        .position(|window| window == SEQUENCE)?;
    if !after[..place].iter().all(|byte| [0, SYNCO].contains(byte)) {
        return None;
    }
    // A drive that alone monitors has missed its bytes after the longest silence in front of the sequence, too.
    let missed = |gap: &[Instant]| gap[1].since(gap[0]) >= LATEST_TIME_OUT + tolerance;
    if !all_missed && !starts[last..=last + 1 + place].windows(2).any(missed) {
        return None;
    }
    let end = last + 1 + place + SEQUENCE.len();
    let answered = answered(size, &sent[end..]).0.len();
    // Each byte after the sequence has come back, and the sequence in front of them.
    let received = conversation.received_in(ring);
    let after_the_sequence = |heard: &[TimedByte]| {
        let from = heard.len().checked_sub(answered)?;
        let values: Vec<_> = heard[..from].iter().map(|(_, byte)| *byte).collect();
        values
            .ends_with(&SEQUENCE.map(Received::good))
            .then_some(from)
    };
    let left = after_the_sequence(&received)?;
    let rest = TwinBytes {
        bytes: answer.bytes[after_the_sequence(&answer.bytes)?..].to_vec(),
        unasked: None,
    };
    let mut places = 0..;
    let done = conversation.done.iter().filter(|(at, done)| match done {
        Done::Sent(..) => *at == ring && places.next() >= Some(end),
        _ => true,
    });
    let received = received[left..].iter().map(|(at, byte)| (ring, *at, *byte));
    let conversation = Conversation {
        done: done.copied().collect(),
        received: received.collect(),
        end: conversation.end,
        unwatched: conversation.unwatched.clone(),
    };
    Some((conversation, rest, left))
}

fn apart(one: Instant, other: Instant) -> Span {
    one.since(other).max(other.since(one))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 9.7, 9.9: no order of the clocks explains a number that the ring does not have, unless the drives of the model spell it out too.
    #[test]
    fn a_model_that_deviates_may_spell_out_more_drives_than_there_are() {
        let heard = |bytes: &[u8]| -> Vec<TimedByte> {
            let timed = (1..).zip(bytes);
            timed
                .map(|(place, byte)| {
                    (
                        Instant::START + Span::from_millis(place),
                        Received::good(*byte),
                    )
                })
                .collect()
        };
        let race = |model: &[u8], ring: &[u8]| {
            let sent = SentTimes {
                answered: &[],
                all: &[],
                way: Span::ZERO,
            };
            let answer = TwinBytes {
                bytes: heard(model),
                unasked: Some(0),
            };
            let size = RingSize::new(3).expect("a size");
            let tolerance = Span::from_millis(20);
            let race = sent.judge(size, &answer, &heard(ring), tolerance, false);
            race.expect("a race").fault
        };
        assert_eq!(race(&[0, 0, 1, 2], &[0, 1, 1, 2]), None);
        assert_eq!(
            race(&[0, 0, 1, 2], &[0, 1, 3, 3]),
            Some((2, Symptom::Value))
        );
        assert_eq!(race(&[0, 0, 1, 3], &[0, 1, 3, 3]), None);
        assert_eq!(
            race(&[0, 0, 1, 3], &[0, 1, 3, 4]),
            Some((3, Symptom::Value))
        );
    }
}
