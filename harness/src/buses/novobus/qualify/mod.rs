//! The hypotheses about drives of a ring, and the probes that settle them.

mod blame;
mod diagnose;
mod exchange;
mod hypothesis;
mod probes;
mod settle;

pub use blame::{Culprit, Meant, Sighting, Trial, agreed, culprit, exchange};
pub use diagnose::{Named, Seen, Whose, deviating_masters, name};
pub use hypothesis::{Evidence, Hypothesis, explaining};
pub use probes::{Asked, Probe, conversations, hypotheses, probes};
pub use settle::{Answer, answer};
