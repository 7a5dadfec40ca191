//! Exploring NORDAC slaves: conversations of telegrams with times, and what generates, plays, judges and shrinks them.
//!
//! What the manual leaves open is not held against a slave: a conversation differs only if no value of any open point explains it
//! ([`oracle`]).

mod act;
mod fuzz_case;
mod generate;
mod hex;
mod idiom;
mod on_sim;
pub mod oracle;
mod play;
pub mod setup;
mod tasks;
#[cfg(test)]
mod tests;
mod text;
mod wire;

pub use act::{Count, Harm, Request, TelegramAct, TelegramActKind, TelegramTalk};
pub use fuzz_case::NoAttempt;
pub use generate::{TelegramScope, TelegramSpice};
pub use on_sim::OnLine;
pub use oracle::TelegramDifference;
pub use play::{TelegramsSeen, play};
pub use setup::{PlantedSlave, TelegramSetup};
