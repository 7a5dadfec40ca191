//! A scenario as written, for a ring of any size.

mod cell;
mod check;
mod job;
mod scenario;

pub use cell::{CellCheck, Place, Relation, Written};
pub use check::{Check, Condition, DriveCheck, Ending, Showing};
pub use job::{Job, JobKind, MasterCall, Target};
pub use scenario::*;
