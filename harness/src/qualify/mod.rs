//! What a drive is, settled by its answers: which value an open property has, which known deviation explains what came.
//!
//! One idea does both: a hypothesis is a model with one thing changed, and it holds where its twin gives every byte
//! that the real ring gave. Drives that share a segment have their own engine, in `segment`.

pub(crate) mod segment;

pub use crate::buses::rings::qualify::{
    Answer, Asked, Culprit, Fit, Hypothesis, Meant, Named, Pinned, Probe, Question, RingSeen,
    Sighting, Trial, Whose, agreed, answer, conversations, culprit, deviating_masters, dumps,
    exchange, explaining, hypotheses, marches, name, probes, questions, thorough,
};
pub(crate) use crate::buses::rings::qualify::{Qualification, QualificationFacts, QualifiedBench};
pub use crate::rig::{Profile, ProfileError, SettledProperty};
