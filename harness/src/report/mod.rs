//! Reports: pure functions of a finished run.

pub mod csv;
pub mod html;
pub mod json;
pub mod meaning;
pub mod mismatch;
pub mod page;
pub mod pcapng;
pub mod plot;
pub mod svg;
pub mod table;
pub mod vcd;
pub mod walk;
