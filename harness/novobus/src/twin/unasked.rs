//! Bytes that drives send unasked in real time (ND21 9.9).
//!
//! The number of zeros before another byte, and which drive sends the first zero, depend on the clocks of the drives, which no model
//! knows. From the first unasked byte to the next byte of the master, only properties that hold for every order are checked.
//!
//! A bench that stands still leaves the line silent. Drives that monitor time-outs miss their bytes then, and that is not their fault. The
//! same holds for drives of which it is not known whether they monitor: it is a setting (14.3.6).

use super::comparison::Symptom;
use super::follow::{Conversation, Done, TwinBytes};
use super::places::answered;
use harness_bench::link::HARMLESS;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{SEQUENCE, ZEROS};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// Longest silence after which a drive that monitors detects a time-out (ND21 9.9, 14.10.2).
const LATEST_TIME_OUT: Span = Span::from_millis(20);

/// Shortest silence after which a drive that monitors detects a time-out (ND21 9.9). A model that deviates may detect one earlier.
pub(crate) const EARLIEST_TIME_OUT: Span = Span::from_millis(10);

/// How long in front of unasked bytes the silence may have begun that they come from: it lasts 20 ms at most, and a drive waits for 10 ms
/// more. Twice as long is certain.
const BEFORE_ZEROS: Span = Span::from_millis(60);

/// Maximum time by which a byte is earlier over a socket that keeps a line's times than on a line.
const EARLY: Span = Span::from_millis(1);

/// Maximum error of the clocks of the bench and of a drive over the time of a time-out.
const CLOCKS: Span = Span::from_micros(500);

/// How many bytes after a silence come back as they were sent where the bench knows when it ended: they take four times [`EARLY`]. A
/// computer that was late delivers them together.
const PUNCTUAL: usize = 16;

/// A byte and when it came.
type TimedByte = (Instant, Received);

/// Why a difference after a silence of the bench accuses no drive.
pub(crate) const SILENCED: &str = "the computer was late or the line was silent before the first byte that differs: drives that monitor time-outs miss their bytes then \
    (ND21 9.9), and these drives do, or it is not known that they do not; run it again on a computer with less load";

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
    /// Shortest silence after which a drive that monitors detects a time-out.
    pub(crate) earliest: Span,
    /// Whether the model answers each byte.
    pub(crate) complete: bool,
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

    /// The time from which on the bench itself may be the cause of a difference. The bytes before `right` do not differ: they are as expected, or
    /// the drives' choice. If drives `may` monitor time-outs, they miss bytes while the bench is silent or late. If the model `does`, it is wrong
    /// about the time of a silence when the bench was late.
    pub(crate) fn excused_from(
        &self,
        size: RingSize,
        expected: &[TimedByte],
        received: &[TimedByte],
        right: usize,
        may: bool,
        does: bool,
    ) -> Option<Instant> {
        if self.nothing_was_missed(expected, received, right) {
            return None;
        }
        let missed = may.then(|| self.timed_out(size, expected, received, right));
        let early = (may && self.complete).then(|| self.early(expected, received));
        let late = || (0..received.len()).find(|index| is_late(expected, received, *index));
        let late = does.then(late);
        let all = missed.into_iter().chain(early).chain(late);
        let first = all.flatten().min()?;
        Some(received[first].0)
    }

    /// The first byte that is as expected and came back before it was sent: the bench was late, and does not know how long the line was silent.
    fn early(&self, expected: &[TimedByte], received: &[TimedByte]) -> Option<usize> {
        let value = |heard: &[TimedByte], index: usize| heard.get(index).map(|(_, byte)| *byte);
        let same = |index: &usize| value(expected, *index) == value(received, *index);
        let early = |index: &usize| {
            let start = self.answered.get(*index);
            start.is_some_and(|start| received[*index].0 + HARMLESS < *start + self.way)
        };
        (0..received.len()).take_while(same).find(early)
    }

    /// Whether the bytes came back so close together, up to the first that differs, that no drive can have missed one. On a line no byte leaves
    /// before the bench sends it, and none comes back before it has been round the ring. So no drive is without a byte for longer than from the
    /// start of one to the return of the next, less the way round. A computer that is late makes these spans longer, and never shorter. A ring
    /// behind a socket may take bytes before their time; they come back early then.
    fn nothing_was_missed(
        &self,
        expected: &[TimedByte],
        received: &[TimedByte],
        right: usize,
    ) -> bool {
        let value = |heard: &[TimedByte], index: usize| heard.get(index).map(|(_, byte)| *byte);
        let same = |index: usize| index < right || value(expected, index) == value(received, index);
        let Some(first) = (0..received.len()).find(|index| !same(*index)) else {
            return false;
        };
        let from = received[first].0 - BEFORE_ZEROS;
        let close = |index: usize| {
            let before = index.checked_sub(1).and_then(|at| self.answered.get(at));
            let silence = |start: &Instant| received[index].0.since(*start + self.way);
            before.is_some_and(|start| silence(start) + EARLY < self.earliest)
        };
        let due = |index: usize| {
            let start = self.answered.get(index);
            start.is_some_and(|start| received[index].0 + EARLY >= *start + self.way)
        };
        let begins = received.partition_point(|(at, _)| *at < from);
        begins > 0 && (begins..first).all(due) && (begins..=first).all(close)
    }

    /// The first byte of the zeros and addresses of drives that have missed their master (ND21 9.9): in front of the byte that it
    /// answers, the bench left the line silent or was late. A check sequence after it that comes back whole, with nothing other than
    /// expected from there to its end, takes every drive out of the error mode (9.8): the drives have missed nothing then.
    fn timed_out(
        &self,
        size: RingSize,
        expected: &[TimedByte],
        received: &[TimedByte],
        right: usize,
    ) -> Option<usize> {
        let silent = |index: usize| {
            let start = self.answered.get(index)?;
            let before = self.all.partition_point(|at| at < start).checked_sub(1)?;
            Some(start.since(self.all[before]) > HARMLESS)
        };
        // No answer comes before it has been round the ring.
        let early = |index: usize| {
            let start = self.answered.get(index);
            start.is_none_or(|start| received[index].0 < *start + self.way)
        };
        let begins = |index: &usize| {
            early(*index) || is_late(expected, received, *index) || silent(*index).unwrap_or(true)
        };
        let spelled = |(_, byte): &TimedByte| byte.error.is_none() && byte.byte < size.drives();
        // How many of them come from a byte on, and whether nothing else comes after them. The check sequence begins with some too.
        let mut run = 0;
        let mut in_error_mode = vec![false; received.len()];
        let last = received.iter().rposition(|heard| !spelled(heard));
        for (index, heard) in received.iter().enumerate().rev() {
            run = if spelled(heard) { run + 1 } else { 0 };
            let at_end = last.is_none_or(|last| index > last);
            // What comes before any answer can come is unasked: the line was silent before the conversation.
            let before = index == 0 && run > 0 && early(0);
            in_error_mode[index] = run > usize::from(ZEROS) || at_end || before;
        }
        let same = |index: usize| {
            index < right || expected.get(index).map(|(_, byte)| *byte) == Some(received[index].1)
        };
        let sequence = SEQUENCE.map(Received::good);
        // Whether a byte differs from a byte on, and whether a whole check sequence comes before the first that does.
        let (mut differs, mut ended) = (false, false);
        let mut first = None;
        for index in (0..received.len()).rev() {
            if !same(index) {
                (differs, ended) = (true, false);
            }
            let after = received[index..].iter().map(|heard| heard.1);
            let whole = after.take(sequence.len()).eq(sequence);
            ended |= whole && (index..index + sequence.len()).all(same);
            if in_error_mode[index] && differs && !ended && begins(&index) {
                first = Some(index);
            }
        }
        first
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

/// Whether a byte came so much later than in the model that the bench may have left the line silent for longer than it knows.
fn is_late(expected: &[TimedByte], received: &[TimedByte], index: usize) -> bool {
    let times = expected.get(index).zip(received.get(index));
    times.is_some_and(|((due, _), (at, _))| at.since(*due) > HARMLESS)
}

fn apart(one: Instant, other: Instant) -> Span {
    one.since(other).max(other.since(one))
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;

    /// ND21 9.8, 9.9: bytes that come a little early, as over a socket, among them a byte that is the drive's choice in front of the zeros of a
    /// check sequence. The sequence comes back whole, so the drives have missed nothing, whatever differs after it.
    #[test]
    fn a_check_sequence_ends_what_a_silence_may_have_begun() {
        let byte = Span::from_micros(286);
        let size = RingSize::new(3).expect("a size");
        let way = byte * 4;
        let ring = |address: u8, last: u8| {
            let bytes = [address].into_iter().chain(CHECK_SEQUENCE).chain([last]);
            let timed = bytes.enumerate().map(|(place, value)| {
                let at = Instant::START + byte * place as u64 + way - Span::from_micros(200);
                (at, Received::good(value))
            });
            timed.collect::<Vec<_>>()
        };
        let (expected, received) = (ring(0x60, 0x11), ring(0x00, 0x33));
        let starts = (0..received.len() as u64).map(|place| Instant::START + byte * place);
        let starts: Vec<_> = starts.collect();
        let sent = SentTimes {
            answered: &starts,
            all: &starts,
            way,
            earliest: EARLIEST_TIME_OUT,
            complete: true,
        };
        let excused = |right: usize| {
            let excused = sent.excused_from(size, &expected, &received, right, true, false);
            excused.is_some()
        };
        assert!(!excused(received.len() - 1));
        assert!(excused(0), "a zero that is not expected stands before it");
    }

    /// ND21 9.9: no drive detects a time-out before 10 ms. A zero in the place of an answer that comes so soon after the byte before it is
    /// wrong; after a longer silence, or a byte that came late, it may be a drive's that has missed its master.
    #[test]
    fn a_zero_behind_a_short_silence_is_not_excused() {
        let byte = Span::from_micros(286);
        let size = RingSize::new(3).expect("a size");
        let way = byte * 4;
        // The earliest time-out, the bytes in front of the silence, how long it is, and how late each byte comes back.
        let excused = |earliest: Span, before: u64, silence: Span, (early, late): (Span, Span)| {
            let start = |place: u64| {
                let gap = if place < before { Span::ZERO } else { silence };
                Instant::START + byte * place + gap
            };
            let starts: Vec<_> = (0..before + 4).map(start).collect();
            let heard = |last: u8, (early, late): (Span, Span)| -> Vec<TimedByte> {
                let places = 0..before + 4;
                let value = |place: u64| if place < before { SYNCO } else { last };
                let at = |place: u64| start(place) + way + late - early;
                let timed = places.map(|place| (at(place), Received::good(value(place))));
                timed.collect()
            };
            let sent = SentTimes {
                answered: &starts,
                all: &starts,
                way,
                earliest,
                complete: true,
            };
            let (expected, received) = (
                heard(SYNCO, (Span::ZERO, Span::ZERO)),
                heard(0, (early, late)),
            );
            let right = usize::try_from(before).expect("few");
            let excused = sent.excused_from(size, &expected, &received, right, true, false);
            excused.is_some()
        };
        let ms = Span::from_millis;
        let on_time = (ms(0), ms(0));
        let right = EARLIEST_TIME_OUT;
        assert!(!excused(right, 250, ms(6), on_time));
        assert!(!excused(right, 250, ms(8), on_time));
        assert!(excused(right, 250, ms(9), on_time), "within a millisecond");
        assert!(excused(right, 20, ms(6), on_time), "silence before them");
        assert!(
            excused(right, 250, ms(8), (ms(0), ms(2))),
            "a late computer"
        );
        assert!(
            excused(right, 250, ms(6), (ms(2), ms(0))),
            "no times of a line"
        );
        // A drive of the model that detects a time-out after 8 ms.
        assert!(!excused(ms(8), 250, ms(6), on_time));
        assert!(excused(ms(8), 250, ms(8), on_time));
    }

    /// No byte comes back before it was sent: the bench was late then, and drives that monitor (ND21 9.9) may have heard a longer silence than it
    /// notes. Where the model loses bytes, each may answer another one.
    #[test]
    fn bytes_before_their_time_show_that_the_bench_was_late() {
        let size = RingSize::new(3).expect("a size");
        let (byte, way) = (Span::from_micros(286), Span::from_micros(286 * 4));
        let starts: Vec<_> = (0..100)
            .map(|place| Instant::START + byte * (100 + place))
            .collect();
        let heard = |early: u64, last: u8| -> Vec<TimedByte> {
            let values = (0..100).map(|place| if place < 99 { SYNCO } else { last });
            let came = starts
                .iter()
                .map(|start| *start + way - Span::from_millis(early));
            came.zip(values.map(Received::good)).collect()
        };
        let excused = |early: u64, may: bool, complete: bool| {
            let sent = SentTimes {
                answered: &starts,
                all: &starts,
                way,
                earliest: EARLIEST_TIME_OUT,
                complete,
            };
            let (expected, received) = (heard(0, SYNCO), heard(early, 0x33));
            let excused = sent.excused_from(size, &expected, &received, 99, may, false);
            excused.is_some()
        };
        assert!(excused(6, true, true));
        assert!(!excused(4, true, true));
        assert!(!excused(6, false, true), "no drive monitors");
        assert!(!excused(6, true, false));
    }

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
                earliest: EARLIEST_TIME_OUT,
                complete: true,
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
