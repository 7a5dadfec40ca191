//! What is asked of drives beside everybody's conversation.

use crate::link::Line;
use harness_proto::time::Instant;
use std::fmt;

/// Looks at drives while nothing is under way.
pub trait Watch: Send + fmt::Debug {
    /// When it wants to look next, on a clock that is never set back; `None` for never.
    fn due(&self) -> Option<Instant>;

    /// Looks. It sends whole telegrams only, and leaves with their answers taken.
    ///
    /// # Errors
    /// What must not go on, in a sentence.
    fn look(&mut self, now: Instant, line: &mut dyn Line) -> Result<(), String>;
}
