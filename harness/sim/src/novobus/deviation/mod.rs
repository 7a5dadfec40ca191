//! Wrong drives: named deviations from the manual, for tests of what must find them.
//!
//! A [`Deviant`] stands around a drive and is the only place where anything is put wrong: it hears what
//! arrives before the drive's bus end does, says what goes out after it, stands between the bus end and the
//! memory, and changes what the drive's program finds in its cells. The drive inside knows nothing of it.
//! [`deviations`] are the table: a name, a sentence, the section that is broken, and the injection.
//!
//! [`DeviantMaster`] and [`master_deviations`] are the same for the other end of the ring: the bench's own master.

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
pub use how::{Deviation, deviation, deviations, relatives};
pub use master::{DeviantMaster, MasterDeviation, master_deviation, master_deviations};
