//! Exploring NORDAC slaves: conversations of telegrams with times.

mod act;
mod bus;
mod generate;
mod hex;
mod idiom;
mod on_adapter;
pub mod oracle;
mod play;
mod tasks;
#[cfg(test)]
mod tests;
mod text;
mod wire;

pub use act::{Count, Harm, OutgoingTelegram, Request, TelegramAct, TelegramActKind, TelegramTalk};
pub use generate::TelegramSpice;
pub use oracle::TelegramDifference;
pub use play::{Done, TelegramsSeen, play};
