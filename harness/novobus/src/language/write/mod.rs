//! The bus's words, written: what `parse` reads back as the same.

mod cell;
mod check;
mod fault;
mod header;
mod job;

pub(crate) use header::{devices, header, lines, setup};

use super::Novobus;
use super::syntax::{DriveRange, LinkEnds, RingStep};

/// The text of a scenario of rings, line by line.
pub(crate) type Text = harness_bench::scenario::write::Text<Novobus>;

/// A step, with its symbol or its word.
pub(crate) fn step(step: &RingStep) -> String {
    match step {
        RingStep::Fault(fault) => format!("! {}", fault::fault(fault)),
        RingStep::Check(check) => format!("? {}", check::check(check)),
        RingStep::Until(check, within) => {
            format!("until {} within {within}", check::drive_check(check))
        }
        RingStep::Influence(drives, influence) => header::influence_on(drives, influence),
        RingStep::Record(recording) => check::record(recording),
        RingStep::Job(job) => job::job(job),
    }
}

/// `2:` in front of a drive or a link of the second ring; the ring is counted from 0.
pub(crate) const fn ring_prefix(ring: usize) -> &'static str {
    if ring == 0 { "" } else { "2:" }
}

/// `95..99`, `2:0..last`
pub(super) fn drives(drives: &DriveRange) -> String {
    let prefix = ring_prefix(drives.ring);
    match &drives.to {
        None => format!("{prefix}{}", drives.from),
        Some(to) => format!("{prefix}{}..{to}", drives.from),
    }
}

/// `98->97`, `2:0->master`
fn link(ring: usize, ends: &LinkEnds) -> String {
    let end = |end: &Option<_>| match end {
        None => "master".to_owned(),
        Some(drive) => format!("{drive}"),
    };
    let (from, to) = (end(&ends.from), end(&ends.to));
    format!("{}{from}->{to}", ring_prefix(ring))
}

/// ` ring 2` behind a job of the second ring; the ring is counted from 0.
const fn which_ring(ring: usize) -> &'static str {
    if ring == 0 { "" } else { " ring 2" }
}

/// The name of a value in a table of names.
fn named<T: Copy + PartialEq>(names: &[(&'static str, T)], value: T) -> &'static str {
    let found = names.iter().find(|(_, known)| *known == value);
    found.map_or("", |(name, _)| name)
}
