//! What the kept inputs reach of the bus's transitions.

pub mod coverage;
pub(crate) mod noted;

/// The scenario of every attempt of a record that a fuzzer makes.
pub const RECORDED: &str = "title A read\nsource nd21 10.1\nring 2\n> 88 FE C0 13 FE D1\n";
