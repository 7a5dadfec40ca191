//! What the guard learns from a ring, and its safe state.

pub(crate) mod learn;
pub(crate) mod safe_state;

pub use harness_proto::novobus::guard::{Denial, Found, Guard, Limits, Need};
pub use safe_state::{NotSafe, SafeConfirmation, blind_stop, safe_state};
