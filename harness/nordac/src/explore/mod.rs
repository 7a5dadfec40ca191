//! Exploring NORDAC slaves: conversations of telegrams with times.

mod act;
mod bus;
mod generate;
mod hex;
mod idiom;
mod on_adapter;
pub(crate) mod oracle;
mod play;
mod tasks;
#[cfg(test)]
mod tests;
mod text;
mod wire;

pub(crate) use act::TelegramTalk;
pub(crate) use play::TelegramsSeen;
