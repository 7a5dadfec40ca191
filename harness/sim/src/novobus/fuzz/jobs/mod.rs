//! Jobs for a master on a ring with faults, judged by the drives' cells, the injected faults and the bytes on the wire.
//!
//! The input describes the work in a form that a fuzzer can write: see [`Work::read`]. The master sees only its line; the
//! judge also looks into the drives.

mod judge;
mod noted;
mod play;
mod wire;
mod work;

pub use judge::Lie;
pub use work::{JobFault, JobOrder, Work};

use crate::fuzz::Notebook;
use crate::novobus::deviation::MasterDeviation;
use harness_proto::novobus::command::Command;

/// A body for fuzz targets: the master must report the true outcome of each job of the input.
///
/// # Panics
/// The master reports something false, or sends bytes that the manual does not allow.
pub fn jobs(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and notes the states of the master and the drives.
///
/// # Panics
/// As [`jobs`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let work = Work::read(data);
    if let Err(lie) = play::play(&work, None, notes) {
        panic!("{lie}: {work:?}");
    }
}

/// Checks that the bytes that a master sent into a ring of `drives` drives obey the manual (ND21 9.1-9.8, 10). If `asked` is given, each
/// command must be one of these: once, and once more after each check sequence.
///
/// # Errors
/// The first violation.
pub fn conduct(drives: u8, sent: &[u8], asked: Option<&[(u8, Command)]>) -> Result<(), Lie> {
    let read = wire::read(drives, sent)?;
    asked.map_or(Ok(()), |asked| read.asked_for(asked))
}

/// The first mistake of a master; `None` if all its bytes and reports are right.
#[must_use]
pub fn judged(work: &Work, deviates: Option<&'static MasterDeviation>) -> Option<Lie> {
    play::play(work, deviates, &mut Notebook::none()).err()
}
