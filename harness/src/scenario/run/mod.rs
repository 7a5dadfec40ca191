//! Plays a plan on a link and says what came of it.

mod bytes;
mod check;
mod drives;
mod look;
mod master;
mod now;
mod outcome;
mod over_bus;
mod player;
mod record;

pub use bytes::{Shown, show};
pub use now::{Now, now};
pub use outcome::{Difference, Finding, Outcome};
pub use over_bus::{Before, restore, set_up};
pub use player::{AtFinding, needs, play, run};
pub use record::{MAX_SAMPLES, Record, Sample};
