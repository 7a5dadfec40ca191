//! UNITEK DS and BAMOCAR on CAN: 256 registers over frames of 3 to 6 bytes.
//!
//! The document is the manual *UNITEK DS CAN-BUS* (German, with a bilingual appendix "short description" and a dump of all registers of
//! one drive). "UNITEK 5.2" is its section 5.2, "ex 8" its example 8, "App 7" item 7 of the appendix, "dump" the dump.
//! "E12" is an entry of the errata ledger. "Field" marks what client code of several teams does and this manual does not print.
//!
//! * [`register`]: the register table, names and aliases; [`words`]: words whose bits have names; [`units`]: per cent, rpm, turns, A;
//! * [`frame`]: requests and replies; [`properties`]: what the manual leaves open; [`bit_timing`]: NBT;
//! * [`guard`]: what a frame may do to a physical drive.
//! * [`master`]: jobs in, frames out, results back.

pub mod bit_timing;
pub mod frame;
pub mod guard;
pub mod master;
pub mod properties;
pub mod register;

mod table;
pub mod units;
pub mod words;

pub use frame::{DEFAULT_RX, DEFAULT_TX, Data, Ignored, NoReply, Reply, Request, sender_of};
pub use register::{Access, BadName, Register, Unit, Width};
pub use table::{ALIASES, REGISTERS};

#[cfg(test)]
mod tests;
