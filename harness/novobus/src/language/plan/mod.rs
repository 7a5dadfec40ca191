//! The header and the steps of this bus, settled for rings of given sizes.

mod drive;
mod job;
mod master;
pub(crate) mod planner;
mod setup;
mod types;

pub(crate) use drive::{MAX_LOOKS, number};
pub(crate) use job::Exchange;
pub(crate) use planner::Planner;
pub(crate) use planner::plan_header;
pub(crate) use setup::{in_memory, number_bytes};
pub(crate) use types::CellTest;
pub(crate) use types::{
    LOOK, NumberCheck, PlannedBench, PlannedCall, PlannedCell, PlannedCheck, PlannedCondition,
    PlannedDriveCheck, PlannedLooks, PlannedRecord, RingAct, asks_the_driver,
};
pub(crate) use types::{PlannedSetupKind, fault_links, heard_links};

use super::Novobus;
use harness_bench::scenario::plan;

/// A scenario of rings, settled.
pub(crate) type Plan = plan::Plan<Novobus>;

pub(crate) type PlannedStep = plan::PlannedStep<Novobus>;
