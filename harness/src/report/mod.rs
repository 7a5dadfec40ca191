//! Reports: pure functions of a finished run.

/// Pages of scenarios, whatever their bus.
pub use crate::buses::novobus::report::html as pages;
pub use harness_bench::report::*;
pub mod finding;
pub mod page;
