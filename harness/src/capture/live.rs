//! Bytes of several links as lines of text while they arrive, and what such a line starts and ends.

use harness_proto::line::{Rate, Received};
use std::fmt::Write as _;

/// The most bytes of a line of text.
const MOST: usize = 16;

/// A line of text that is being made, of one link.
#[derive(Clone, Debug, Default)]
struct Open {
    text: String,
    bytes: usize,
    last: u64,
}

/// LiveLines of text of several links: a pause of two byte times or sixteen bytes end one.
#[derive(Clone, Debug)]
pub(crate) struct LiveLines {
    names: Vec<String>,
    open: Vec<Open>,
    /// A pause, in nanoseconds.
    pause: u64,
    start: u64,
}

impl LiveLines {
    /// LiveLines of these links; times are shown since `start`, in nanoseconds.
    pub(crate) fn new(names: Vec<String>, rate: Rate, start: u64) -> Self {
        Self {
            open: vec![Open::default(); names.len()],
            names,
            pause: rate.byte_time().as_nanos() * 2,
            start,
        }
    }

    /// A byte has arrived; a line that is complete.
    pub(crate) fn byte(&mut self, link: usize, nanos: u64, own: Received) -> Option<String> {
        let ended = self.ended(link, nanos);
        let (start, name) = (self.start, self.names.get(link)?);
        let line = self.open.get_mut(link)?;
        if line.bytes == 0 {
            line.text = format!("{} {name}", seconds(nanos.saturating_sub(start)));
        }
        let byte = own.byte;
        // Writing to a String cannot fail.
        let _infallible = write!(line.text, " {byte:02X}");
        if let Some(error) = own.error {
            let _infallible = write!(line.text, " ({error})");
        }
        line.bytes += 1;
        line.last = nanos;
        ended.or_else(|| self.ended(link, nanos))
    }

    /// The line of a link, where a pause or its length has ended it.
    fn ended(&mut self, link: usize, now: u64) -> Option<String> {
        let line = self.open.get_mut(link)?;
        let paused = now.saturating_sub(line.last) > self.pause;
        let ends = line.bytes > 0 && (paused || line.bytes >= MOST);
        ends.then(|| std::mem::take(line).text)
    }

    /// The lines that a pause has ended until now.
    pub(crate) fn idle(&mut self, now: u64) -> Vec<String> {
        let links = 0..self.names.len();
        links.filter_map(|link| self.ended(link, now)).collect()
    }
}

/// Seconds with microseconds.
pub(crate) fn seconds(nanos: u64) -> String {
    let micros = nanos / 1_000;
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::line::LineError;

    #[test]
    fn pauses_and_lengths_end_a_line() {
        let names = vec!["98->97".to_owned(), "97->96".to_owned()];
        let mut lines = LiveLines::new(names, Rate::Baud38400, 1_000_000);
        let good = Received::good;
        assert_eq!(lines.byte(0, 1_286_458, good(0x88)), None);
        assert_eq!(lines.byte(1, 1_500_000, good(0x12)), None);
        let bad = Received::bad(0xFE, LineError::Parity);
        assert_eq!(lines.byte(0, 1_572_916, bad), None);
        assert_eq!(lines.idle(1_600_000), Vec::<String>::new());
        let ended = lines.byte(0, 9_000_000, good(0x80));
        assert_eq!(ended.as_deref(), Some("0.000286 98->97 88 FE (parity)"));
        assert_eq!(
            lines.idle(20_000_000),
            ["0.008000 98->97 80", "0.000500 97->96 12"]
        );
        let ended: Vec<_> = (0..16)
            .filter_map(|own| lines.byte(1, 30_000_000 + own, good(0)))
            .collect();
        assert_eq!(ended.len(), 1);
    }
}
