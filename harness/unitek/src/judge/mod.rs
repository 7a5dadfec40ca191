//! Judges frames of drives whose history is unknown: a capture, or drives behind an adapter.
//!
//! A [`Follower`] hears every frame of the bus and knows no more of a drive than these frames show. What the manual leaves open
//! (UNITEK 7) may have any value, and what a plant decides is not compared. It compares which registers are sent and when, how long
//! replies are, and what a register reads that was written.

#[cfg(test)]
mod begun_tests;
mod contents;
mod cycle;
mod drives;
mod elsewhere;
mod follower;
mod gaps;
mod held;
mod reasons;
mod supply;
mod symptom;
#[cfg(test)]
mod tests;
mod way;
mod world;
#[cfg(test)]
mod world_tests;

pub(crate) use drives::{Breach, HeardFrames, judge, judge_guessed};
pub(crate) use follower::Follower;
pub(crate) use symptom::FrameSymptom;
pub(crate) use world::World;
