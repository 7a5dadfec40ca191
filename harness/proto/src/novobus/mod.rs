//! NOVOBUS, the ring of the Novotron ND21 (ND21 chapters 8 to 10).
//!
//! The master and up to 250 drives form a ring. The master sends [telegrams](telegram) without a gap;
//! a drive forwards what is not meant for it and answers, byte for byte, what is. The rooms follow the
//! manual's sections:
//!
//! | section | what | where |
//! |---|---|---|
//! | 8.2 | how many bytes an exchange takes | [`timing`] |
//! | 8.5, 9.3 | addresses | [`address`] |
//! | 9.1 | telegrams | [`telegram`] |
//! | 9.2 | the sync byte | [`sync`] |
//! | 9.5, 10 | the nine commands | [`command`] |
//! | 9.6 | both checking bytes | [`checksum`] |
//! | 9.7, 9.9 | the error mode | [`error_mode`] |
//! | 9.8 | the check sequence | [`check_sequence`] |
//! | 9.1-9.9 | a drive's end of the bus | [`bus_end`] |
//! | 8-11 | the master's end of the bus | [`master`] |
//! | 9-14 | which bytes may go onto a ring | [`guard`] |
//! | 10.1-10.3 | what of a drive the bus reaches | [`memory`] |
//! | 10.4 | the digital outputs | [`output`] |
//!
//! What the manual leaves open is a named value of [`properties`].

pub mod address;
pub mod bus_end;
pub mod check_sequence;
pub mod checksum;
pub mod command;
pub use crate::decode;
pub mod error;
pub mod error_mode;
pub mod guard;
pub mod master;
pub mod memory;
pub mod output;
mod parameter_channel;
pub mod properties;
pub mod role;
pub mod sync;
pub mod telegram;
pub mod timing;

#[cfg(test)]
mod tests;
