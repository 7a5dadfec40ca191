//! The hypotheses about drives of a ring, and the probes that settle them.

mod blame;
mod delays;
mod diagnose;
mod eeprom;
mod exchange;
mod findings;
mod hypothesis;
mod parts;
mod pinned;
mod probes;
mod qualification;
mod recorded;
mod settle;

pub use blame::{Culprit, Meant, Sighting, Trial, agreed, culprit, exchange};
pub use diagnose::{Named, RingSeen, Whose, deviating_masters, name};
pub use eeprom::{dumps, marches};
pub use hypothesis::{Fit, Hypothesis, explaining};
pub use pinned::{Pinned, Question, questions};
pub use probes::{Asked, Probe, conversations, hypotheses, probes, thorough};
pub use qualification::{Qualification, QualificationFacts, QualifiedBench};
pub(crate) use recorded::{of_parts, of_run};
pub use settle::{Answer, answer};

/// What the names of scenarios begin with that a qualification makes from what it has heard: the roles of drives exchanged, questions to the
/// ring, and marches over the EEPROM.
pub const TRIALS: [&str; 3] = [EXCHANGED, ASKED, EEPROM_TRIAL];
const EXCHANGED: &str = "exchanged-";
const ASKED: &str = "asked-";
const EEPROM_TRIAL: &str = "thorough-eeprom-";
