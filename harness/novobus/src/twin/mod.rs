//! The differential verdict: a simulated ring, the twin, is given what a real one is given, and every byte received is
//! compared with what the twin says.
//!
//! The twin is the model of the manual. Where a real drive answers with data that the model cannot know (what it
//! measures itself, what was set before the bench came), the data are not compared, or are taken over; all else is:
//! value, order, line status and, within the rig's tolerance, time.

mod compare;
mod comparison;
mod error_mode;
mod follow;
mod known;
mod places;
mod program;
mod rows;
mod silence;
mod unasked;

pub(crate) use compare::unknowable;
pub(crate) use comparison::{
    Comparison, DecidingBits, Divergence, Exactness, OwnByte, Symptom, UnaskedByte,
};
pub(crate) use follow::{Conversation, Done, Silences, Twin};
#[cfg(test)]
pub(crate) use harness_proto::novobus::role::Role;
pub(crate) use places::{answered, answering, what_of};
pub(crate) use silence::{SILENCED, TOO_MANY};
