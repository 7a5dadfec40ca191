//! The bus's words, as written, for a ring of any size.

pub(crate) mod cell;
pub(crate) mod check;
pub(crate) mod header;
pub(crate) mod job;
pub(crate) mod step;

pub(crate) use cell::Relation;
pub use cell::{CellCheck, CellPlace, Written};
pub use check::{Check, Condition, DriveCheck, Ending, Showing};
pub use header::{DriveRange, Header, Influence, RingRange, Setup, SetupKind};
pub use job::{JobKind, JobStep, MasterCall, WrittenTarget};
pub use step::{CellRecording, FaultKind, FaultStep, LinkEnds, LinkFaultKind, Looks, RingStep};

use super::Novobus;
use harness_bench::scenario::syntax;

/// A scenario of rings, as written.
pub type Scenario = syntax::Scenario<Novobus>;

/// A step of it.
pub type Step = syntax::Step<Novobus>;

/// What such a step does.
pub type Action = syntax::Action<Novobus>;
