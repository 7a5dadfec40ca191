//! Reports: pure functions of a finished run.

pub mod json;
pub mod mismatch;
pub mod page;
pub mod plot;
pub mod table;
