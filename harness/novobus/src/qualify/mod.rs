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

#[cfg(test)]
pub(crate) use blame::{Culprit, Meant, Sighting, agreed, culprit, exchange};
#[cfg(test)]
pub(crate) use diagnose::{AccusedDrives, NamedDeviation, RingSeen, deviating_masters, name};
#[cfg(test)]
pub(crate) use eeprom::{dumps, marches};
#[cfg(test)]
pub(crate) use hypothesis::{Hypothesis, explaining};
#[cfg(test)]
pub(crate) use pinned::{PinnedDrive, questions};
#[cfg(test)]
pub(crate) use probes::{Probe, ProbeTarget, hypotheses};
pub(crate) use probes::{conversations, probes, some_drives, thorough};
pub(crate) use qualification::{Qualification, QualificationFacts, QualifiedBench};
pub(crate) use recorded::{of_parts, of_run};
#[cfg(test)]
pub(crate) use settle::{ProbeAnswer, answer};

/// What the names of scenarios begin with that a qualification makes from what it has heard: the roles of drives exchanged, questions to the
/// ring, and marches over the EEPROM.
pub(crate) const TRIALS: [&str; 3] = [EXCHANGED, ASKED, EEPROM_TRIAL];
const EXCHANGED: &str = "exchanged-";
const ASKED: &str = "asked-";
const EEPROM_TRIAL: &str = "thorough-eeprom-";
