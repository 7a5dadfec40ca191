//! A scenario as written, for a ring of any size.

mod scenario;

pub use crate::buses::Bus;
pub use crate::buses::novobus::language::syntax::cell::{CellCheck, CellPlace, Relation, Written};
pub use crate::buses::novobus::language::syntax::check::{
    Check, Condition, DriveCheck, Ending, Showing,
};
pub use crate::buses::novobus::language::syntax::header::{
    Drives, Header, Influence, RingRange, Setup, SetupKind,
};
pub use crate::buses::novobus::language::syntax::job::{Job, JobKind, MasterCall, Target};
pub use scenario::*;
