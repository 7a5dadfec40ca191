//! Plays a plan on a link and returns the outcome.

pub mod halt;
pub mod outcome;
pub mod player;
pub mod record;
pub mod skip;

pub use outcome::{ByteDifference, Mismatch, Outcome, Stop, Unready};
pub use player::{AtMismatch, PortState, Runner, needs, play, run};
pub use record::{CellRecord, Sample};
pub use skip::DENIED;
pub use skip::sizes;
pub use skip::{Skip, Unlock, Why, lacks, lacks_as_well, together};
