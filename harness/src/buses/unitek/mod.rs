//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.

pub mod gate;
pub mod rig;
pub mod simulate;
