//! Judges telegrams of slaves whose history is unknown: a capture.
//!
//! A `Follower` hears every telegram of the line and knows no more of a slave than these show. What the manual leaves open may have any
//! value, and what parameters, a plant or the supply decide is not compared. It compares who replies and in which form, repetitions, the
//! diagnosis, status words and answers of the parameter channel. Times are not compared: an adapter decides over them.

#[cfg(test)]
mod begun_tests;
mod channel;
mod diagnosis;
mod doubt;
mod follower;
mod line;
mod standing;
mod symptom;
#[cfg(test)]
mod tests;

pub(crate) use line::judge_runs;
pub(crate) use line::{Breach, judge};
pub(crate) use symptom::{ReplySubject, Symptom};
