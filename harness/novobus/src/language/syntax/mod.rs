//! The bus's words, as written, for a ring of any size.

pub(crate) mod cell;
pub(crate) mod check;
pub(crate) mod header;
pub(crate) mod job;
pub(crate) mod step;

pub(crate) use cell::Relation;
pub(crate) use cell::{CellCheck, CellPlace, Written};
pub(crate) use check::{Check, Condition, DriveCheck, Ending, Showing};
pub(crate) use header::{DriveRange, Header, Influence, Setup, SetupKind};
pub(crate) use job::{JobKind, JobStep, MasterCall, WrittenTarget};
pub(crate) use step::{
    CellRecording, FaultKind, FaultStep, LinkEnds, LinkFaultKind, Looks, RingStep,
};

use super::Novobus;
use harness_bench::scenario::syntax;

/// A scenario of rings, as written.
pub(crate) type Scenario = syntax::Scenario<Novobus>;

pub(crate) type Step = syntax::Step<Novobus>;
