//! Exploring UNITEK drives: conversations of frames with times.

mod act;
mod bus;
mod generate;
mod idiom;
mod on_adapter;
pub mod oracle;
mod play;
#[cfg(test)]
mod tests;
mod text;

pub use act::{FrameAct, FrameActKind, FrameTalk};
pub use generate::FrameSpice;
pub use on_adapter::Left;
pub use oracle::FrameDifference;
pub use play::{FramesSeen, play};
