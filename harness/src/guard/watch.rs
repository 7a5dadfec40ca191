//! Queries to drives in the pauses of a conversation.

use crate::link::Line;
use harness_proto::time::Instant;
use std::fmt;

/// Looks at drives while nothing is under way.
pub trait Watch: Send + fmt::Debug {
    /// When it wants to look next, on a clock that is never set back; `None` for never.
    fn due(&self) -> Option<Instant>;

    /// Looks at the drives. It sends whole telegrams only, and returns when it has received their answers.
    ///
    /// # Errors
    /// Why the conversation must not go on, in a sentence.
    fn look(&mut self, now: Instant, line: &mut dyn Line) -> Result<(), String>;
}
