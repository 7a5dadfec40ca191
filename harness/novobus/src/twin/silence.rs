//! Silences that drives may have heard and the bench has not noted.
//!
//! The bench notes when it hands a byte over. A computer or an adapter that stands still holds bytes back, and drives that monitor time-outs
//! hear a longer silence then (ND21 9.9). A difference accuses no drive if right drives that heard such a silence have sent just what came.

use super::comparison::{Comparison, Divergence};
use super::follow::{Conversation, Done};
use super::places::answered;
use super::rows::LONGEST_ANSWER;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::time::{Instant, Span};

/// Why a difference that a silence explains accuses no drive.
pub(crate) const SILENCED: &str = "the computer was late or the line was silent before the first byte that differs: drives that monitor time-outs miss their bytes then \
    (ND21 9.9), and these drives do, or it is not known that they do not; run it again on a computer with less load";

/// Why a difference is not decided where there are more than [`MOST_PLACES`].
pub(crate) const TOO_MANY: &str = "not decided: there are more than 32 places before the first byte that differs at which the computer or the line may have held bytes back, and \
    drives that monitor time-outs miss their bytes then (ND21 9.9); run it again on a computer with less load";

/// Maximum time by which a byte is earlier over a socket that keeps a line's times than on a line.
pub(super) const EARLY: Span = Span::from_millis(1);

/// Maximum number of places at which bytes may have been held back. Where there are more and none of these explains a difference, it is not
/// decided: a drive whose answers are zeros anyway shows late that it has missed its master.
const MOST_PLACES: usize = 32;

/// Silences that are tried, in milliseconds: one that a drive detects at once, and answers with zeros; one that every drive detects; one after
/// which zeros come unasked (ND21 9.9).
const SILENCES: [u64; 3] = [11, 21, 32];

/// What drives may have heard of a conversation.
pub(super) struct Heard {
    /// The silence before it.
    pub(super) rest: Span,
    pub(super) conversation: Conversation,
}

/// A ring as the bench saw it in a conversation.
pub(super) struct SeenRing {
    pub(super) ring: usize,
    pub(super) size: RingSize,
    pub(super) byte_time: Span,
    /// Shortest silence after which a drive that monitors detects a time-out.
    pub(super) earliest: Span,
    /// Where drives have sent bytes unasked, and a check sequence has ended that: when the first byte came after it.
    pub(super) after_a_race: Option<Instant>,
    /// Where nothing has ended that: when the first of them came.
    pub(super) race: Option<Instant>,
}

impl SeenRing {
    /// Time from the start of a byte to its return.
    fn way(&self) -> Span {
        self.byte_time * (u64::from(self.size.drives()) + 1)
    }

    /// The conversation with the bytes of the ring held back, in each way that the bytes before a difference permit: none of them came back
    /// before it had been round the ring. Whether there are more ways than these.
    pub(super) fn held_back(
        &self,
        conversation: &Conversation,
        found: &Divergence,
    ) -> (Vec<Heard>, bool) {
        let sent = conversation.sent_in(self.ring);
        let received = conversation.received_in(self.ring);
        let way = self.way();
        let (places, _) = answered(self.size, &sent);
        // After unasked bytes the answers are counted from the end, from the check sequence on that ended the race.
        let (first, unasked) = match self.after_a_race {
            Some(from) => (
                received.partition_point(|(at, _)| *at < from),
                received.len().saturating_sub(places.len()),
            ),
            None => (0, 0),
        };
        // Where a byte comes back for each byte, all of them are answers.
        let right = match (self.race, received.len() == places.len() + unasked) {
            (Some(race), _) => received.partition_point(|(at, _)| *at < race),
            (None, true) => received.len(),
            (None, false) => received.len().min(found.byte - 1),
        };
        let answers = received[..right].iter().skip(first.max(unasked));
        let returned = places
            .iter()
            .skip(first.max(unasked) - unasked)
            .zip(answers);
        let returned: Vec<_> = returned
            .map(|(place, (at, _))| (*place, *at - way))
            .collect();
        // A check sequence that came back whole has ended what was before it (ND21 9.8).
        let before = &received[..received.len().min(found.byte - 1)];
        let ended = before.windows(SEQUENCE.len()).rposition(is_check_sequence);
        let ended = ended
            .map(|index| index + SEQUENCE.len())
            .max(self.after_a_race.map(|_| first));
        // So have more bytes than an answer has that drives in the error mode do not send (9.7).
        let answers = before.iter().enumerate().rev();
        let mut answers = answers.filter(|(_, heard)| is_other(heard, self.size));
        let answered = answers.nth(LONGEST_ANSWER).map(|(index, _)| index + 1);
        let begins = ended.max(answered);
        let place = |index: usize| places.get(index.saturating_sub(unasked)).copied();
        let from = begins.map_or(Some(0), place).unwrap_or(sent.len());
        let differs = place(found.byte - 1).map_or(sent.len(), |place| place + 1);
        let by_returns = self.moved(conversation, |place, start, free| {
            let index = returned.binary_search_by_key(&place, |(place, _)| *place);
            index.map_or(start, |index| returned[index].1).max(free)
        });
        let silences = SILENCES.map(Span::from_millis);
        let heard = |rest, conversation| Heard { rest, conversation };
        let (mut all, mut more) = (Vec::new(), false);
        for base in [conversation, &by_returns] {
            let starts = base.sent_at(self.ring);
            // The latest time at which a byte can have left.
            let latest = |place: usize| {
                let from = returned.partition_point(|(at, _)| *at < place);
                let after = returned[from..].iter().map(|(_, at)| *at + EARLY.min(way));
                after.min().unwrap_or(Instant::NEVER)
            };
            let long = |place: &usize| latest(*place) >= starts[place - 1] + self.earliest;
            let places = from.max(1)..differs.min(starts.len());
            let mut places = places.rev().filter(long);
            for place in places.by_ref().take(MOST_PLACES) {
                let (before, latest) = (starts[place - 1], latest(place));
                let ends = silences.iter().map(|silence| before + *silence);
                let ends = ends.chain([latest]).filter(|end| *end < Instant::NEVER);
                let possible = ends.filter(|end| (starts[place]..=latest).contains(end));
                let late = possible.map(|end| {
                    self.moved(base, |at, start, free| match at < place {
                        true => start,
                        false => start.max(end).max(free),
                    })
                });
                all.extend(late.map(|late| heard(Span::ZERO, late)));
            }
            more |= places.next().is_some();
            let rests = silences.into_iter().filter(|_| begins.is_none());
            let rests = std::iter::once(Span::ZERO).chain(rests);
            all.extend(rests.map(|rest| heard(rest, base.clone())));
        }
        (all, more)
    }

    /// Whether what came in the race of a comparison can have come from drives in the error mode: zeros and the numbers of drives (ND21 9.7), up to
    /// the check sequence, and as many answers as the model sends. Something comes: drives in the error mode answer each byte.
    pub(super) fn is_in_error(&self, conversation: &Conversation, comparison: &Comparison) -> bool {
        let mut races = comparison.unasked.iter();
        let Some(race) = races.find(|race| race.ring == self.ring) else {
            return true;
        };
        let received = conversation.received_in(self.ring);
        let from = received.partition_point(|(at, _)| *at < race.at);
        let of_the_race = &received[from..];
        !of_the_race.is_empty()
            && !self.comes_one_by_one(conversation)
            && answers_in_race(of_the_race, self.size) <= race.answers
    }

    /// Whether each byte came back one way round the ring after it was sent: no byte came unasked.
    fn comes_one_by_one(&self, conversation: &Conversation) -> bool {
        let received = conversation.received_in(self.ring);
        let (places, _) = answered(self.size, &conversation.sent_in(self.ring));
        let starts = conversation.sent_at(self.ring);
        let way = self.way();
        let in_time = |(place, (at, _)): (&usize, &(Instant, Received))| {
            let due = starts[*place] + way;
            at.since(due).max(due.since(*at)) <= EARLY
        };
        received.len() == places.len() && places.iter().zip(&received).all(in_time)
    }

    /// A conversation with other times of the ring's bytes. They are made from the place of a byte, its time, and when the line is free for
    /// it.
    fn moved(
        &self,
        conversation: &Conversation,
        time: impl Fn(usize, Instant, Instant) -> Instant,
    ) -> Conversation {
        let mut moved = conversation.clone();
        let (mut place, mut free) = (0, Instant::START);
        for (ring, done) in &mut moved.done {
            if let (true, Done::Sent(at, _)) = (*ring == self.ring, done) {
                *at = time(place, *at, free);
                (place, free) = (place + 1, *at + self.byte_time);
            }
        }
        moved.end = moved.end.max(free);
        moved
    }
}

/// How many of these bytes, up to a whole check sequence (ND21 9.8), drives in the error mode do not send: neither zeros, nor numbers of drives
/// (9.7), nor parts of such a sequence.
pub(super) fn answers_in_race(heard: &[(Instant, Received)], size: RingSize) -> usize {
    let end = heard.windows(SEQUENCE.len()).position(is_check_sequence);
    let of_the_race = &heard[..end.unwrap_or(heard.len())];
    of_the_race
        .iter()
        .filter(|heard| is_other(heard, size))
        .count()
}

/// Whether drives in the error mode do not send a byte.
fn is_other((_, heard): &(Instant, Received), size: RingSize) -> bool {
    let is_number = heard.byte <= size.drives();
    heard.error.is_some() || !is_number && !SEQUENCE.contains(&heard.byte)
}

fn is_check_sequence(bytes: &[(Instant, Received)]) -> bool {
    let bytes = bytes.iter().map(|(_, byte)| *byte);
    bytes.eq(SEQUENCE.map(Received::good))
}

#[cfg(test)]
mod tests {
    use super::super::comparison::Symptom;
    use super::*;
    use harness_proto::novobus::role::Role;

    /// Zeros, each sent 12 ms after the one before and back at once: before each of them the drives may have missed their master.
    #[test]
    fn places_beyond_the_bound_are_told() {
        let size = RingSize::new(3).expect("a ring");
        let more = |zeros: u64| {
            let at = |byte: u64| Instant::START + Span::from_millis(12 * byte);
            let way = Span::from_millis(2);
            let sent = |byte: u64| (0, Done::Sent(at(byte), 0));
            let came = |byte: u64| (0, at(byte) + way, Received::good(0));
            let conversation = Conversation {
                done: (0..zeros).map(sent).collect(),
                received: (0..zeros).map(came).collect(),
                ..Conversation::default()
            };
            let ring = SeenRing {
                ring: 0,
                size,
                byte_time: Span::from_micros(286),
                earliest: Span::from_millis(10),
                after_a_race: None,
                race: None,
            };
            let found = Divergence {
                ring: 0,
                byte: usize::try_from(zeros).expect("few"),
                what: Symptom::Value,
                expected: None,
                received: None,
                role: Role::Idle,
                rule: ("9.9", ""),
                step: None,
                drive: None,
            };
            ring.held_back(&conversation, &found).1
        };
        assert!(!more(MOST_PLACES as u64));
        assert!(more(MOST_PLACES as u64 + 2));
        assert!(TOO_MANY.contains(&format!("more than {MOST_PLACES} places")));
    }
}
