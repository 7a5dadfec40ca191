//! The scenario of a finding on a ring.

use super::setup::planted_line;
use crate::explore::MasterView;
use crate::explore::judge::Judge;
use crate::explore::text::{ExpectedBytes, Surroundings, text};
use crate::explore::{AttemptRecord, Case, Finding};
use crate::manual::MANUAL;
use harness_bench::explore::ExploreError;
use harness_proto::novobus::address::RingSize;

/// Maximum number of attempts of a finding.
const MOST_ATTEMPTS: usize = 1_000;

/// Whether it is within the bounds of what a run writes.
pub(super) fn is_bounded(finding: &Finding) -> bool {
    finding.case.is_kept()
        && finding.attempts.len() <= MOST_ATTEMPTS
        && finding.attempts.iter().all(AttemptRecord::is_sound)
}

/// The scenario, which passes if every byte is as the model predicts, and fails if one is not. `deviating` rings have the planted deviations.
///
/// # Errors
/// The model cannot be made.
pub(crate) fn scenario(
    finding: &Finding,
    title: &str,
    sources: &[String],
    deviating: bool,
) -> Result<String, ExploreError> {
    let header = match deviating {
        true => finding.setup.with_deviations(),
        false => finding.setup.header.clone(),
    };
    let seen = finding.setup.model_answers(&finding.case)?;
    let any = match finding.ports {
        true => unknowable(&finding.case, &seen),
        false => Vec::new(),
    };
    let timed = finding.difference.byte.filter(|_| finding.difference.time);
    let mut remarks = vec![finding.difference.about.clone()];
    for planted in &finding.setup.deviates {
        remarks.push(format!("found on {}", planted_line(planted)));
    }
    let page = Surroundings {
        title,
        sources,
        header: Some(&header),
        remarks: &remarks,
        expected: Some(ExpectedBytes {
            seen: &seen,
            any: &any,
            timed: timed.and_then(|byte| byte.checked_sub(1)),
        }),
    };
    Ok(text(&finding.case, &page))
}

/// The tables of the manual that it is about, as the catalogue names them.
pub(crate) fn sources(finding: &Finding) -> Vec<String> {
    let tables = MANUAL.tables().unwrap_or_default();
    let table = tables
        .iter()
        .find(|table| table.section == finding.difference.section);
    let table = table.or(tables.iter().find(|table| table.section == "9.1"));
    table.map(|table| table.id.clone()).into_iter().collect()
}

/// Bytes that drives may answer in more than one way: what they hold and measure, and the checking bytes over it.
fn unknowable(case: &Case, seen: &MasterView) -> Vec<usize> {
    let Ok(size) = RingSize::new(u64::from(case.drives)) else {
        return Vec::new();
    };
    let mut any = Judge::new(case.ring(), size, true).foresee(case).open;
    any.retain(|index| *index < seen.received.len());
    any
}
