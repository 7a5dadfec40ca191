//! What the guard learns from a ring, and its safe state.

pub mod learn;
pub(crate) mod safe_state;

pub use safe_state::{NotSafe, SafeConfirmation, blind_stop, safe_state};
