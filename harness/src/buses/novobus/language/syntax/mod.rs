//! The bus's words, as written, for a ring of any size.

pub(crate) mod cell;
pub(crate) mod check;
pub(crate) mod header;
pub(crate) mod job;
pub(crate) mod step;

pub use cell::{CellCheck, CellPlace, Relation, Written};
pub use check::{Check, Condition, DriveCheck, Ending, Showing};
pub use header::{DriveRange, Header, Influence, RingRange, Setup, SetupKind};
pub use job::{JobKind, JobStep, MasterCall, WrittenTarget};
pub use step::{CellRecording, FaultKind, FaultStep, LinkEnds, LinkFaultKind, Looks, RingStep};
