//! Campaigns: one conversation, disturbed at every link, byte and bit, or at a sample of them, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, [`plan`] makes the list of cases of it, a pure function of the file, the
//! ring and the conversation. [`conversation`] takes what the master says out of a scenario. [`by_manual`] plays it as the
//! manual describes a master (ND21 9.7, 9.8), [`by_driver`] lets the driver play it. [`class`](mod@class) says what the outcomes are, and
//! [`report`] shows them; [`replay`] prints one case as a scenario.

pub mod fault;
pub mod file;
pub mod find;
mod html;
pub mod line;
pub mod pairs;
pub mod part;
pub mod plan;
pub mod replay;
pub(crate) mod run;
pub(crate) mod share;

pub use crate::buses::rings::campaign::class::{CaseClass, CaseEvidence, Wrong};
pub use fault::CaseFaults;
pub use html::campaigns;
pub use run::{Campaign, CaseOutcome, CasePlayer, Contradiction, PlayedCampaign};

pub(crate) use crate::buses::rings::campaign::sharing;
/// The classes of the one bus whose conversations are disturbed today, and how a case is played there.
pub use crate::buses::rings::campaign::{by_driver, by_manual, class, conversation, report, sound};
