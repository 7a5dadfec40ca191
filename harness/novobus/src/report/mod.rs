//! How the ring's bytes read, and its tables and pictures: a column a drive.

mod cells;
pub mod csv;
pub(crate) mod diagram;
pub mod html;
pub mod json;
pub(crate) mod lines;
pub mod live;
pub mod meaning;
pub mod mismatch;
mod picture;
pub mod plot;
pub(crate) mod sequence;
pub mod svg;
pub mod table;
pub mod vcd;
pub mod walk;

/// The dissector for Wireshark.
pub(crate) const DISSECTOR: &str = include_str!("novobus.lua");
