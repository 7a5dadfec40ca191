//! Exploring UNITEK drives: conversations of frames with times, and what generates, plays, judges and shrinks them.
//!
//! What the manual leaves open is not held against a drive: a conversation differs only if no value of any open point explains it
//! ([`oracle`]).

mod act;
mod fuzz_case;
mod generate;
mod idiom;
mod on_adapter;
mod on_sim;
pub mod oracle;
mod play;
pub mod setup;
#[cfg(test)]
mod tests;
mod text;

pub use act::{FrameAct, FrameActKind, FrameTalk};
pub use fuzz_case::NoAttempt;
pub use generate::{FrameScope, FrameSpice};
pub use on_adapter::OnAdapter;
pub use on_sim::OnBench;
pub use oracle::FrameDifference;
pub use play::{FramesSeen, play};
pub use setup::{FrameSetup, PlantedDrive};
