//! Campaigns on the ring: how a case is played, and what became of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, [`plan`] makes the list of cases of it, a pure function of the file, the
//! ring and the conversation. [`replay`] prints one case as a scenario.

mod alike;
pub(crate) mod by_driver;
pub(crate) mod by_manual;
pub(crate) mod class;
mod common;
pub(crate) mod conversation;
pub(crate) mod fault;
pub(crate) mod file;
pub(crate) mod find;
pub(crate) mod html;
pub(crate) mod pairs;
pub(crate) mod plan;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod sharing;
pub(crate) mod sound;

#[cfg(test)]
pub(crate) use fault::CaseFaults;
pub(crate) use run::PlayedCampaign;
#[cfg(test)]
pub(crate) use run::{Campaign, CaseOutcome};
