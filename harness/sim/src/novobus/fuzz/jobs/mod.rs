//! Jobs for a master on a ring with faults, judged by the truth: what the drives hold, which faults there were, and what went over the wire.
//!
//! The input is a description of the work, so that a fuzzer can write it: see [`Work::read`]. The master is given nothing but its line; the
//! judge looks into the drives.

mod judge;
mod noted;
mod play;
mod wire;
mod work;

pub use judge::Lie;
pub use work::{Fault, Order, Work};

use super::features::Notebook;
use crate::novobus::deviation::MasterDeviation;
use harness_proto::novobus::command::Command;

/// A body for fuzz targets: the jobs of the input end with the truth.
///
/// # Panics
/// The master tells something that is not so, or sends what the manual does not allow.
pub fn jobs(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what master and drives go through is noted.
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
/// command must be one of these: once, and once more behind each check sequence.
///
/// # Errors
/// The first violation.
pub fn conduct(drives: u8, sent: &[u8], asked: Option<&[(u8, Command)]>) -> Result<(), Lie> {
    let read = wire::read(drives, sent)?;
    asked.map_or(Ok(()), |asked| read.asked_for(asked))
}

/// The first thing in which a master is wrong; `None` where everything that it did and told is as it must be.
#[must_use]
pub fn judged(work: &Work, deviates: Option<&'static MasterDeviation>) -> Option<Lie> {
    play::play(work, deviates, &mut Notebook::none()).err()
}
