//! Wrong masters: named deviations of a bench's own end of the bus, for tests that must find them.
//!
//! A [`DeviantMaster`] wraps a right master and is the only place that injects deviations. It changes the jobs that the master
//! takes, the bytes that it sends and receives, its time-outs, and the events that it reports. The inner master is unchanged.
//! [`MASTER_DEVIATIONS`] is the table: a name, a sentence, the section that is broken, and the injection.

mod deviant;
mod how;
mod speech;
mod table;
#[cfg(test)]
mod tests;

pub use deviant::DeviantMaster;
pub use how::{MASTER_DEVIATIONS, MasterDeviation};
