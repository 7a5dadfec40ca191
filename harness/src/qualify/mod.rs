//! What a drive is, settled by its answers: which value an open property has, which known deviation explains what came.
//!
//! One idea does both: a hypothesis is a model with one thing changed, and it holds where its twin gives every byte
//! that the real ring gave.

mod diagnose;
mod hypothesis;
mod probes;
mod settle;

pub use crate::rig::{Profile, ProfileError, Settled};
pub use diagnose::{deviating, deviating_masters};
pub use hypothesis::{Evidence, Hypothesis, explaining, explaining_most};
pub use probes::{Asked, Probe, conversations, hypotheses, probes};
pub use settle::{Answer, answer};
