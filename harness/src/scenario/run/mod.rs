//! Plays a plan on a link and says what came of it.

mod check;
mod player;

pub use player::{AtFinding, Difference, Finding, Outcome, Shown, needs, play, run, show};
