//! A scenario settled for rings of given sizes: every number is known, everything that cannot be is
//! refused, and nothing has been sent yet.

mod drive;
mod job;
mod master;
mod planner;
mod setup;
mod types;
mod unroll;

pub(crate) use drive::{MAX_LOOKS, number};
pub(crate) use job::Exchange;
pub(crate) use planner::MAX_CARRIED;
pub use planner::{plan, plan_header, plan_step};
pub(crate) use setup::{in_memory, number_bytes};
pub(crate) use types::PlannedSetupKind;
pub use types::{
    CellTest, LOOK, Plan, PlannedAction, PlannedCall, PlannedCell, PlannedCheck, PlannedCondition,
    PlannedDriveCheck, PlannedLooks, PlannedRecord, PlannedStep, PlannedWhen, PlannedWindow,
    Reading,
};
