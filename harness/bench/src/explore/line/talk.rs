//! A conversation as a value: what masters send and what happens to the drives from outside, with the times between.

use super::LineBus;
use harness_proto::time::Span;
use serde::{Deserialize, Serialize};

/// Maximum number of acts of a conversation.
const MOST_ACTS: usize = 64;

/// How often acts may send something.
const MOST_SENT: u64 = 400;

/// How long conversations on a bus may be.
#[derive(Clone, Copy, Debug)]
pub struct ActBounds {
    /// How many times in a row an act may happen.
    pub times: u8,
    /// The longest time after an act, in microseconds.
    pub wait_us: u64,
    /// The longest conversation, in microseconds.
    pub total_us: u64,
}

/// A conversation with the drives of a line, from their power-up on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct LineTalk<B: LineBus> {
    pub acts: Vec<LineAct<B::What>>,
}

/// An act, how often it happens, and the time after it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineAct<W> {
    pub what: W,
    /// How many times it happens, each with the time after it.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub times: u8,
    /// Microseconds to the next act; where a reply is waited for, from its end, or from when it would have begun.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub wait_us: u64,
}

const fn once() -> u8 {
    1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the form that serde asks for"
)]
const fn is_once(times: &u8) -> bool {
    *times == 1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the form that serde asks for"
)]
const fn is_zero(wait: &u64) -> bool {
    *wait == 0
}

impl<W> LineAct<W> {
    /// An act that happens once, with this time after it.
    #[must_use]
    pub const fn new(what: W, wait_us: u64) -> Self {
        Self {
            what,
            times: 1,
            wait_us,
        }
    }

    /// The time after it.
    #[must_use]
    pub const fn wait(&self) -> Span {
        Span::from_micros(self.wait_us)
    }

    /// The time after all its repetitions together, in microseconds.
    pub(super) const fn lasts(&self) -> u64 {
        self.wait_us.saturating_mul(self.times as u64)
    }
}

impl<B: LineBus> LineTalk<B> {
    /// How often something is sent.
    #[must_use]
    pub fn sent(&self) -> u64 {
        let sent = self.acts.iter().filter(|act| B::sends(&act.what));
        sent.map(|act| u64::from(act.times)).sum()
    }

    /// Whether it is within the bounds of a conversation.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        let total = self.acts.iter().map(LineAct::lasts);
        let fits = |act: &LineAct<B::What>| {
            (1..=B::BOUNDS.times).contains(&act.times)
                && act.wait_us <= B::BOUNDS.wait_us
                && B::fits(&act.what)
        };
        self.acts.len() <= MOST_ACTS
            && total.fold(0, u64::saturating_add) <= B::BOUNDS.total_us
            && self.sent() <= MOST_SENT
            && self.acts.iter().all(fits)
    }

    /// Drops acts at the end, so that it is within the bounds of a conversation with room for `room` more acts.
    pub fn cut(&mut self, room: usize) {
        self.acts.truncate(MOST_ACTS.saturating_sub(room));
        while !self.is_bounded() && self.acts.pop().is_some() {}
    }
}

/// What a conversation has shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineSeen<S, D> {
    /// What the drives sent, in order.
    pub said: Vec<S>,
    /// Each act, repeated as often as it happened.
    pub done: Vec<D>,
    /// How long the conversation took.
    pub took: Span,
}

impl<S, D> Default for LineSeen<S, D> {
    fn default() -> Self {
        Self {
            said: Vec::new(),
            done: Vec::new(),
            took: Span::ZERO,
        }
    }
}

/// What a conversation on a bus has shown.
pub type Seen<B> = LineSeen<<B as LineBus>::Said, <B as LineBus>::Done>;
