//! What is heard as lines of text while it arrives, in the words of its bus.

use super::recorder::Piece;

/// A line of text: when it began, in nanoseconds since 1970, and its words.
pub type LiveLine = (u64, String);

/// Text of what is heard at one place: a line for each telegram or frame.
pub trait LiveText {
    /// Takes what was heard; gives the lines that it completes.
    fn piece(&mut self, piece: &Piece) -> Vec<LiveLine>;

    /// The line that a pause until now, in nanoseconds since 1970, has ended.
    fn idle(&mut self, now: u64) -> Option<LiveLine> {
        let _begun = now;
        None
    }
}

/// Seconds with microseconds.
pub fn seconds(nanos: u64) -> String {
    let micros = nanos / 1_000;
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}
