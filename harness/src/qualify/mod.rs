//! What a drive is, settled by its answers: which value an open property has, which known deviation explains what came.
//!
//! One idea does both: a hypothesis is a model with one thing changed, and it holds where its twin gives every byte
//! that the real ring gave.

pub(crate) mod diagnose;
pub(crate) mod hypothesis;
pub(crate) mod settle;

pub use crate::buses::novobus::probes::{Asked, Probe, conversations, hypotheses, probes};
pub use crate::rig::{Profile, ProfileError, Settled};
pub use diagnose::{Named, Seen, Whose, deviating_masters, name};
pub use hypothesis::{Evidence, Hypothesis, explaining};
pub use settle::{Answer, answer};
