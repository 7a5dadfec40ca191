//! Plays a plan on a link and returns the outcome.

pub(crate) mod halt;
pub(crate) mod now;
pub(crate) mod outcome;
pub(crate) mod player;
pub(crate) mod skip;

pub use crate::buses::novobus::language::run::bytes::{Shown, show};
pub(crate) use crate::buses::novobus::language::run::bytes::{matches, resolve};
pub use crate::buses::novobus::language::run::over_bus::{
    NotReady, play_over_bus, reset_drives, start_anew,
};
pub(crate) use crate::buses::novobus::language::run::over_bus::{come_home, read_byte};
pub use crate::buses::novobus::language::run::record::{MAX_SAMPLES, Record, Sample};
pub use now::{Now, now};
pub use outcome::{Difference, Mismatch, Outcome, Unready};
pub use player::{AtMismatch, needs, play, run};
pub(crate) use skip::DENIED;
pub use skip::{Skip, Unlock, Why, lacks, together};
