//! Queries to drives in the pauses of a conversation.

use crate::link::{Line, Trouble};
use crate::medium::{HeardPiece, Out};
use harness_proto::time::Instant;
use std::fmt;

/// Looks at drives while nothing is under way.
pub trait Watch: Send + fmt::Debug {
    /// When it next needs to look, on a monotonic clock; `None` for never.
    fn due(&self) -> Option<Instant>;

    /// Looks at the drives. It sends whole telegrams only, and returns when it has received their answers.
    ///
    /// # Errors
    /// Why the conversation must not continue, in a sentence.
    fn look(&mut self, now: Instant, line: &mut dyn Line) -> Result<(), String>;

    /// Looks at everything, due or not; every drive must answer. Nothing is under way.
    ///
    /// # Errors
    /// [`Trouble::Interlock`] where the work must not continue, [`Trouble::Lost`] where the bench cannot find out.
    fn look_at_all(&mut self, line: &mut dyn Line) -> Result<(), Trouble>;

    /// Takes notice of what the conversation sends.
    fn sent(&mut self, what: Out<'_>) {
        let _of_no_interest = what;
    }

    /// Observes a piece that was received for the conversation.
    ///
    /// # Errors
    /// Why the conversation must not continue, in a sentence.
    fn hear(&mut self, heard: &HeardPiece) -> Result<(), String> {
        let _of_no_interest = heard;
        Ok(())
    }

    /// The pieces received during the last look that do not answer it, with their times. They belong to the conversation.
    fn take_unasked(&mut self) -> Vec<(Instant, HeardPiece)> {
        Vec::new()
    }
}
