//! Plays a plan on a link and returns the outcome.

pub(crate) mod halt;
pub(crate) mod outcome;
pub(crate) mod player;
pub mod record;
pub(crate) mod skip;

pub use outcome::{ByteDifference, Mismatch, Outcome, Stop, Unready};
pub use player::{AtMismatch, PortState, Runner, needs, play, run};
pub use record::{CellRecord, Sample};
pub(crate) use skip::DENIED;
pub(crate) use skip::sizes;
pub use skip::{Skip, Unlock, Why, lacks, lacks_as_well, together};
