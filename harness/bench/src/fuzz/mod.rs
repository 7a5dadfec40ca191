//! Kept inputs of fuzz targets: [`input`](mod@input) reads one, [`distil`](mod@distil) chooses those to keep; and [`written`](fn@written)
//! compares a scenario with its written form.

pub mod distil;
pub mod input;
mod written;

pub use written::{comes_back, written};
