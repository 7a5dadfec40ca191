//! Exploring UNITEK drives: conversations of frames with times.

mod act;
mod bus;
mod generate;
mod idiom;
mod on_adapter;
pub(crate) mod oracle;
mod play;
#[cfg(test)]
mod tests;
mod text;

pub(crate) use act::FrameTalk;
pub(crate) use play::FramesSeen;
