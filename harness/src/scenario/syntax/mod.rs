//! A scenario as written, for a ring of any size.

mod check;
mod job;
mod scenario;

pub use check::Check;
pub use job::{Job, JobKind};
pub use scenario::*;
