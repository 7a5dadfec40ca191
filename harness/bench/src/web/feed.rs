//! The stream of events: numbered, bounded, for any number of readers.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Events kept for readers that are late or come back, at most.
const MAX_EVENTS: usize = 512;
/// Their bytes, at most.
const MAX_BYTES: usize = 1 << 20;

/// How long recording continues for a reader that may return.
const LINGER: Duration = Duration::from_secs(10);

/// The events of a page.
#[derive(Debug, Default)]
pub(crate) struct Feed {
    inner: Mutex<FeedState>,
    more: Condvar,
}

#[derive(Debug, Default)]
struct FeedState {
    /// The last events; the number of the last one is `count`.
    events: VecDeque<Arc<str>>,
    bytes: usize,
    /// Events so far. The first one has number 1.
    count: u64,
    readers: usize,
    /// When the last reader left.
    left: Option<Instant>,
    /// Readers so far.
    came: u64,
    ended: bool,
}

/// What a reader gets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum FeedPiece {
    /// An event and its number.
    Event(u64, Arc<str>),
    /// This number of events are not kept any more.
    LeftOut(u64),
}

impl FeedState {
    /// The number of the oldest event that is kept, or of the next one.
    fn oldest(&self) -> u64 {
        self.count + 1 - self.events.len() as u64
    }
}

impl Feed {
    fn inner(&self) -> MutexGuard<'_, FeedState> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an event, a line of text. The oldest ones make room for it.
    pub(crate) fn publish(&self, text: String) {
        let mut inner = self.inner();
        inner.count += 1;
        inner.bytes += text.len();
        inner.events.push_back(text.into());
        while inner.events.len() > MAX_EVENTS || inner.bytes > MAX_BYTES && inner.events.len() > 1 {
            let gone = inner.events.pop_front();
            inner.bytes -= gone.map_or(0, |gone| gone.len());
        }
        drop(inner);
        self.more.notify_all();
    }

    /// Drops all events that are kept; their numbers stay used.
    pub(crate) fn clear(&self) {
        let mut inner = self.inner();
        inner.events.clear();
        inner.bytes = 0;
    }

    /// Whether a reader is there, or was some seconds ago.
    #[must_use]
    pub(crate) fn is_wanted(&self) -> bool {
        let inner = self.inner();
        inner.readers > 0 || inner.left.is_some_and(|left| left.elapsed() < LINGER)
    }

    /// How many readers there are.
    #[cfg(test)]
    pub(super) fn readers(&self) -> usize {
        self.inner().readers
    }

    /// How many readers there have been.
    #[must_use]
    pub(crate) fn came(&self) -> u64 {
        self.inner().came
    }

    /// Ends the streams of all readers.
    pub(crate) fn end(&self) {
        self.inner().ended = true;
        self.more.notify_all();
    }

    /// A reader comes, who knows the events up to number `after`. Without a number it gets all that are kept.
    #[must_use]
    pub(crate) fn watch(self: &Arc<Self>, after: Option<u64>) -> FeedReader {
        let mut inner = self.inner();
        inner.readers += 1;
        inner.came += 1;
        // A number that was never used is of another run.
        let known = after.filter(|after| *after <= inner.count);
        let next = known.map_or(inner.oldest(), |known| known + 1);
        FeedReader {
            feed: Arc::clone(self),
            next,
        }
    }
}

#[derive(Debug)]
pub(crate) struct FeedReader {
    feed: Arc<Feed>,
    /// The number of the next event.
    next: u64,
}

impl FeedReader {
    /// The events since the last call; waits for them at most `patience`. `None` if the stream has ended.
    pub(crate) fn wait(&mut self, patience: Duration) -> Option<Vec<FeedPiece>> {
        let inner = self.feed.inner();
        let next = self.next;
        let nothing = |inner: &mut FeedState| !inner.ended && inner.count < next;
        let waited = self.feed.more.wait_timeout_while(inner, patience, nothing);
        let (inner, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if inner.ended {
            return None;
        }
        let oldest = inner.oldest();
        let left_out = oldest.saturating_sub(self.next);
        let mut pieces = Vec::new();
        if left_out > 0 {
            pieces.push(FeedPiece::LeftOut(left_out));
            self.next = oldest;
        }
        let known = usize::try_from(self.next - oldest).unwrap_or(usize::MAX);
        for text in inner.events.iter().skip(known) {
            pieces.push(FeedPiece::Event(self.next, Arc::clone(text)));
            self.next += 1;
        }
        Some(pieces)
    }
}

impl Drop for FeedReader {
    fn drop(&mut self) {
        let mut inner = self.feed.inner();
        inner.readers -= 1;
        if inner.readers == 0 {
            inner.left = Some(Instant::now());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::ZERO;

    fn numbers(pieces: &[FeedPiece]) -> Vec<u64> {
        let number = |piece: &FeedPiece| match piece {
            FeedPiece::Event(number, _) => Some(*number),
            FeedPiece::LeftOut(_) => None,
        };
        pieces.iter().filter_map(number).collect()
    }

    #[test]
    fn a_reader_that_comes_back_misses_nothing_that_is_kept() {
        let feed = Arc::new(Feed::default());
        for _ in 0..5 {
            feed.publish("x".to_owned());
        }
        let mut first = feed.watch(None);
        assert_eq!(numbers(&first.wait(NOW).expect("open")), [1, 2, 3, 4, 5]);
        assert_eq!(first.wait(NOW), Some(Vec::new()));
        drop(first);
        feed.publish("x".to_owned());
        let mut again = feed.watch(Some(4));
        assert_eq!(numbers(&again.wait(NOW).expect("open")), [5, 6]);
        let mut of_another_run = feed.watch(Some(900));
        assert_eq!(numbers(&of_another_run.wait(NOW).expect("open")).len(), 6);
        let mut last = feed.watch(Some(6));
        assert_eq!(last.wait(NOW), Some(Vec::new()));
        assert!(feed.is_wanted());
        feed.end();
        assert_eq!(last.wait(Duration::from_secs(60)), None);
    }

    #[test]
    fn what_a_slow_reader_has_missed_is_counted() {
        let feed = Arc::new(Feed::default());
        let mut slow = feed.watch(Some(0));
        for _ in 0..MAX_EVENTS + 7 {
            feed.publish("x".to_owned());
        }
        let pieces = slow.wait(NOW).expect("open");
        assert_eq!(pieces[0], FeedPiece::LeftOut(7));
        assert_eq!(numbers(&pieces)[0], 8);
        assert_eq!(pieces.len(), 1 + MAX_EVENTS);
        // The bytes have a bound too, and the newest event is always kept.
        for _ in 0..3 {
            feed.publish("x".repeat(MAX_BYTES));
        }
        assert_eq!(slow.wait(NOW).expect("open").len(), 2);
        feed.clear();
        assert_eq!(slow.wait(NOW), Some(Vec::new()));
        let count = feed.inner().count;
        let mut resumed = feed.watch(Some(count - 3));
        assert_eq!(resumed.wait(NOW), Some(vec![FeedPiece::LeftOut(3)]));
    }
}
