//! The scenario of a finding on a ring.

use crate::buses::novobus::explore::judge::Judge;
use crate::buses::novobus::explore::text::{ExpectedBytes, Surroundings, text};
use crate::buses::novobus::language::syntax::Header;
use crate::buses::novobus::manual::MANUAL;
use crate::explore::ExploreError;
use crate::explore::MasterView;
use crate::explore::{AttemptRecord, Case, Finding};
use harness_proto::novobus::address::RingSize;
use std::path::{Path, PathBuf};

/// Maximum number of attempts of a finding.
const MOST_ATTEMPTS: usize = 1_000;

impl Finding {
    /// The finding of a file: its JSON, or the scenario beside it.
    ///
    /// # Errors
    /// There is no finding, or it is damaged.
    pub fn read(path: &Path) -> Result<(Self, PathBuf), ExploreError> {
        Self::read_as(path)
    }

    /// Whether it is within the bounds of what a run writes.
    pub(super) fn is_bounded(&self) -> bool {
        self.case.is_kept()
            && self.attempts.len() <= MOST_ATTEMPTS
            && self.attempts.iter().all(AttemptRecord::is_sound)
    }

    /// The text of the scenario that stands beside it.
    ///
    /// # Errors
    /// The model cannot be made.
    pub fn text(&self) -> Result<String, ExploreError> {
        let title = format!("Found by fuzzing: {}", self.difference.kind());
        self.scenario(&title, &self.sources())
    }

    /// The scenario, which passes if every byte is as the model predicts, and fails if one is not.
    ///
    /// # Errors
    /// The model cannot be made.
    pub fn scenario(&self, title: &str, sources: &[String]) -> Result<String, ExploreError> {
        self.scenario_on(&self.setup.header, title, sources)
    }

    /// The same for rings with another header.
    pub(crate) fn scenario_on(
        &self,
        header: &Header,
        title: &str,
        sources: &[String],
    ) -> Result<String, ExploreError> {
        let seen = self.setup.model_answers(&self.case)?;
        let any = match self.ports {
            true => unknowable(&self.case, &seen),
            false => Vec::new(),
        };
        let timed = self.difference.byte.filter(|_| self.difference.time);
        let mut remarks = vec![self.difference.about.clone()];
        for planted in &self.setup.deviates {
            remarks.push(format!("found on {}", planted.line()));
        }
        let page = Surroundings {
            title,
            sources,
            header: Some(header),
            remarks: &remarks,
            expected: Some(ExpectedBytes {
                seen: &seen,
                any: &any,
                timed: timed.and_then(|byte| byte.checked_sub(1)),
            }),
        };
        Ok(text(&self.case, &page))
    }

    /// The tables of the manual that it is about, as the catalogue names them.
    #[must_use]
    pub fn sources(&self) -> Vec<String> {
        let tables = MANUAL.tables().unwrap_or_default();
        let own = tables
            .iter()
            .find(|table| table.section == self.difference.section);
        let own = own.or(tables.iter().find(|table| table.section == "9.1"));
        own.map(|table| table.id.clone()).into_iter().collect()
    }
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
