//! Campaigns on the ring: how a case is played, and what became of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, [`plan`] makes the list of cases of it, a pure function of the file, the
//! ring and the conversation. [`replay`] prints one case as a scenario.

mod alike;
pub mod by_driver;
pub mod by_manual;
pub mod class;
pub mod conversation;
pub mod fault;
pub mod file;
pub mod find;
mod html;
pub mod pairs;
pub mod part;
pub mod plan;
pub mod replay;
pub mod report;
pub(crate) mod run;
pub(crate) mod sharing;
pub mod sound;

pub use fault::CaseFaults;
pub use html::campaigns;
pub use run::{Campaign, CaseOutcome, CasePlayer, Contradiction, PlayedCampaign};
