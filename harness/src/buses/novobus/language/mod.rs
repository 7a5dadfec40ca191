//! The words of the scenario language that belong to the NOVOBUS: drives, jobs, checks of cells, calls of the driver.

pub mod argument;
pub(crate) mod parse;
pub mod plan;
pub(crate) mod run;
pub(crate) mod syntax;
pub(crate) mod write;
