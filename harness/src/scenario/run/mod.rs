//! Plays a plan on a link and says what came of it.

mod bytes;
mod check;
mod drives;
mod halt;
mod look;
mod master;
mod now;
mod outcome;
mod over_bus;
mod player;
mod record;

pub use bytes::{Shown, show};
pub use now::{Now, now};
pub use outcome::{Difference, Finding, Outcome, Unready};
pub use over_bus::{NotReady, play_over_bus, reset_drives, start_anew};
pub(crate) use over_bus::{come_home, read_byte};
pub use player::{AtFinding, lacks, needs, play, run};
pub use record::{MAX_SAMPLES, Record, Sample};
