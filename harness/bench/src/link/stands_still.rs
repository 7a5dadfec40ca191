//! A computer that stalls, for tests.

use super::{Line, Trouble};
use crate::medium::{HeardPiece, Medium, Out};
use harness_proto::time::{Instant, Span};

/// A line behind a computer that stalls for a while after this many telegrams or frames were sent.
pub struct StandsStill<L> {
    pub line: L,
    pub after: usize,
    pub span: Span,
}

impl<L: Line> Line for StandsStill<L> {
    fn medium(&self, port: usize) -> Medium {
        self.line.medium(port)
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let sent = self.line.send(port, what);
        self.after = self.after.wrapping_sub(1);
        if self.after == 0 {
            let end = sent + self.span;
            while self.now() < end && self.wait(end) {}
        }
        sent
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        self.line.receive(port)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.line.wait(until)
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.line.trouble()
    }
}
