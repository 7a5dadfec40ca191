//! Reports: pure functions of a finished run.

pub mod json;
pub mod mismatch;
pub mod plot;
pub mod table;
