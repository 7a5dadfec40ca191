//! What another program uses: scenarios on simulated drives, drives, and rings served to a controller. Everything here is re-exported by
//! the crate itself.

mod drives;
mod error;
mod scenario;
mod served;

pub use drives::{Drives, Reading};
pub use error::Error;
pub use scenario::{Played, Scenario};
pub use served::Served;
