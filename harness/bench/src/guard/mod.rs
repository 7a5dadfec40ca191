//! What may leave the program: decided piece by piece, below scenarios, driver and fuzzer.
//!
//! This is not a safety function in the sense of machine safety: an emergency stop must be wired.
//!
//! [`Guarded`] stands around a line or a link and asks the [`Gate`] of each port about every octet or frame. A gate knows its bus: that
//! of a ring is [`harness_proto::novobus::guard`], where the reasoning is. `safe_state` stops and blocks all drives and reads back that
//! they stand. Both begin with 17 zeros and the check sequence (ND21 9.8): before them it is not known what drives make of a byte, and
//! nothing else passes.

pub mod gate;
pub mod guarded;
pub mod safe;
pub mod standstill;
pub mod watch;

pub use gate::{Denied, Gate, Restore};
pub use guarded::Guarded;
pub use guarded::OVERDUE;
pub use safe::Safe;
pub use standstill::{Standstill, StandstillStep};
pub use watch::Watch;
