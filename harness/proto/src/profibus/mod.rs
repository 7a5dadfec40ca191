//! PROFIBUS as far as a DP slave and its master need it: telegrams of the data link layer (FDL) and the services of DP.
//!
//! The documents are EN 50170 (DIN 19245 parts 1 and 3). "EN 1" and "EN 2" are sections 1 and 2 of our reading of it, which stands beside the
//! reading of the NORDAC manual.
//!
//! * [`rate`]: bit rates, and the times that are counted in bits;
//! * [`fdl`]: telegrams SD1 to SD4 and SC, function codes, repetitions;
//! * [`dp`]: the services, their data, the configuration bytes;
//! * [`master`]: requests to a slave, and its replies.

mod buffer;
mod control;
pub mod dp;
pub mod fdl;
pub mod master;
pub mod rate;

pub use fdl::{Buffer, Pdu, Telegram};
pub use rate::BusRate;

#[cfg(test)]
mod tests;
