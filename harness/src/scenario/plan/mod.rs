//! A scenario settled for rings of given sizes: every number is known, everything that cannot be is
//! refused, and nothing has been sent yet.

mod job;
mod planner;
mod types;

pub(super) use planner::MAX_CARRIED;
pub use planner::plan;
pub(super) use types::PlannedSetupKind;
pub use types::{Plan, PlannedAction, PlannedCheck, PlannedStep, PlannedWhen, PlannedWindow};
