//! Plays a plan on a link and says what came of it.

mod bytes;
mod check;
mod drives;
mod look;
mod master;
mod now;
mod player;
mod record;

pub use bytes::{Shown, show};
pub use now::{Now, now};
pub use player::{AtFinding, Difference, Finding, Outcome, needs, play, run};
pub use record::{MAX_SAMPLES, Record, Sample};
