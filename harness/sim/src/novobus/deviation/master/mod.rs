//! Wrong masters: named deviations of a bench's own end of the bus, for tests of what must find them.
//!
//! A [`DeviantMaster`] stands around a right master and is the only place where anything is put wrong: it changes the jobs that the master
//! takes, the bytes that it sends and hears, the times for which it waits, and what it tells. The master inside knows nothing of it.
//! [`master_deviations`] are the table: a name, a sentence, the section that is broken, and the injection.

mod deviant;
mod how;
mod speech;
mod table;
#[cfg(test)]
mod tests;

pub use deviant::DeviantMaster;
pub use how::{MasterDeviation, master_deviation, master_deviations};
