//! How the ring's bytes read, and its tables and pictures: a column a drive.

mod cells;
pub(crate) mod csv;
pub(crate) mod diagram;
pub(crate) mod json;
pub(crate) mod live;
pub(crate) mod meaning;
pub(crate) mod mismatch;
mod picture;
pub(crate) mod ring;
pub(crate) mod sequence;
pub(crate) mod svg;
pub(crate) mod table;
pub(crate) mod vcd;
pub(crate) mod walk;

/// The dissector for Wireshark.
pub(crate) const DISSECTOR: &str = include_str!("novobus.lua");
