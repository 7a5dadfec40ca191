//! Reports: pure functions of a finished run.

pub use harness_bench::report::*;
pub mod finding;
pub mod page;
