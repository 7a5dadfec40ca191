//! What another program uses: scenarios on simulated drives, drives, and rings served to a controller. Everything here is re-exported by
//! the crate itself.

mod drives;
mod scenario;
mod served;

pub use drives::Drives;
pub use harness_bench::embed::{Error, Reading};
pub use scenario::{Played, Scenario};
pub use served::Served;

use crate::buses::BUSES;
use harness_bench::embed::Embedding;

/// What the bus of rings lends.
fn embedding() -> &'static Embedding {
    let lent = BUSES.iter().find_map(|bus| bus.embedding.as_ref());
    lent.unwrap_or_else(|| unreachable!("a bus of rings is built"))
}
