//! Plays a plan on a link and says what came of it.

mod check;
mod look;
mod player;
mod record;

pub use player::{AtFinding, Difference, Finding, Outcome, Shown, needs, play, run, show};
pub use record::{MAX_SAMPLES, Record, Sample};
