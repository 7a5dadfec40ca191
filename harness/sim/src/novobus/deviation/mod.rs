//! Wrong drives: named deviations from the manual, for tests that must find them.
//!
//! A [`Deviant`] wraps a right drive and is the only place that injects deviations. It changes incoming bytes before the
//! drive's bus end receives them, outgoing bytes after it, accesses of the bus end to the
//! memory, and the values that the drive's program finds in its cells. The inner drive is unchanged.
//! [`DEVIATIONS`] is the table: a name, a sentence, the section that is broken, and the injection.
//!
//! [`DeviantMaster`] and [`MASTER_DEVIATIONS`] do the same for the bench's own master.

mod behind;
mod cells;
mod channel;
mod deviant;
mod errors;
mod how;
mod master;
mod numbered;
mod proxy;
mod recovery;
mod telegram;

pub use deviant::Deviant;
pub use how::{DEVIATIONS, Deviation, RELATIVES, deviation};
pub use master::{DeviantMaster, MASTER_DEVIATIONS, MasterDeviation};
