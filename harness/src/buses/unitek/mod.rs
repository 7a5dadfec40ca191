//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.

pub mod gate;
pub mod rig;
pub(crate) mod serve;
#[cfg(test)]
mod serve_tests;
pub mod simulate;
