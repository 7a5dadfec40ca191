//! Fuzz targets whose bodies need the whole bench, the kept inputs of all of them, and what those reach.
//!
//! The bodies for bytes and frames of a bus are in `harness_sim`, in the folder of the bus. Here are those for texts ([`scenario`], [`rig`]);
//! those for captures and records stand beside what reads them.
//! [`coverage`] compares the kept inputs with the matrix of protocol transitions and sums up what they reach. [`distil`](mod@distil) chooses
//! the inputs to keep.

pub mod distil;
pub mod input;
mod written;

pub use written::written;
