//! What the guard learns from a ring, and its safe state.

pub(crate) mod learn;
pub(crate) mod safe_state;

#[cfg(test)]
pub(crate) use safe_state::SafeConfirmation;
pub(crate) use safe_state::{blind_stop, safe_state};
