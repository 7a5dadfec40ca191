//! Campaigns on the ring: how a case is played, and what became of it.

pub mod by_driver;
pub mod by_manual;
pub mod class;
pub mod conversation;
pub(crate) mod pairs;
pub mod report;
pub(crate) mod sharing;
pub mod sound;
