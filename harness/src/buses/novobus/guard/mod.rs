//! What the guard learns from a ring, and its safe state.

pub(crate) mod learn;
pub(crate) mod safe_state;
