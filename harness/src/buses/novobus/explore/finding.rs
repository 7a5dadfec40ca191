//! A finding: a case, the difference, and how to reproduce it. It is stored as JSON next to its scenario.

use crate::buses::novobus::explore::judge::Judge;
use crate::buses::novobus::explore::text::{ExpectedBytes, Surroundings, text};
use crate::buses::novobus::language::syntax::Header;
use crate::explore::AttemptRecord;
use crate::explore::Case;
use crate::explore::Difference;
use crate::explore::ExploreError;
use crate::explore::MasterView;
use crate::explore::RingSetup;
use crate::explore::files::{read_text, write_whole};
use crate::manual::tables;
use harness_proto::novobus::address::RingSize;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The version of the format.
const SCHEMA: u32 = 1;

/// Maximum number of attempts of a finding.
const MOST_ATTEMPTS: usize = 1_000;

/// A finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// The version of the format: 1.
    pub schema: u32,
    /// The rig's name, as it was given.
    pub rig: String,
    /// Whether that rig has ports: deviations cannot be planted in its drives.
    pub ports: bool,
    /// The seed of the run.
    pub seed: u64,
    /// Which case of the run it was, counted from 0.
    pub number: u64,
    /// How many attempts reproduced it.
    pub seen_again: u8,
    /// The number of attempts to reproduce it.
    pub of: u8,
    /// Whether enough attempts reproduced it.
    pub confirmed: bool,
    /// The number of runs used to shrink it; `None` if shrinking was not tried.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shrunk_in: Option<u32>,
    /// How the ring differs from the expected behaviour.
    pub difference: Difference,
    /// What its rings are made of.
    pub setup: RingSetup,
    /// The conversation.
    pub case: Case,
    /// The attempts that the finding rests on, the first one first; none where drives are simulated, which do the same again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attempts: Vec<AttemptRecord>,
}

impl Finding {
    /// The version of the format.
    pub const SCHEMA: u32 = SCHEMA;

    /// The finding of a file: its JSON, or the scenario beside it.
    ///
    /// # Errors
    /// There is no finding, or it is damaged.
    pub fn read(path: &Path) -> Result<(Self, PathBuf), ExploreError> {
        let file = match path.extension() {
            Some(ending) if ending == "scn" => path.with_extension("json"),
            _ => path.to_owned(),
        };
        if file.is_dir() || !file.exists() {
            return Err(ExploreError::Usage(format!(
                "there is no finding {}: name a file `finding-....json` of a folder that `drivebench fuzz run` has written",
                file.display()
            )));
        }
        let json = read_text(&file)?;
        let finding: Self = serde_json::from_str(&json).map_err(|error| {
            ExploreError::Usage(format!("{} is not a finding: {error}", file.display()))
        })?;
        let attempts = finding.attempts.iter();
        let sound = finding.schema == SCHEMA
            && finding.case.is_kept()
            && attempts.clone().count() <= MOST_ATTEMPTS
            && attempts.into_iter().all(AttemptRecord::is_sound);
        if !sound {
            return Err(ExploreError::Usage(format!(
                "{} is not a finding of schema {SCHEMA} within the bounds of a case",
                file.display()
            )));
        }
        Ok((finding, file))
    }

    /// Writes the finding and its scenario into a folder; returns the paths of the two files.
    ///
    /// # Errors
    /// They cannot be written, or the model cannot be made.
    pub fn write(&self, folder: &Path, name: &str) -> Result<[PathBuf; 2], ExploreError> {
        let json = folder.join(format!("{name}.json"));
        let scenario = folder.join(format!("{name}.scn"));
        let text = self.text()?;
        let form = self
            .form()
            .map_err(|error| ExploreError::file("write", &json, &error))?;
        write_whole(&scenario, &text)?;
        write_whole(&json, &form)?;
        Ok([json, scenario])
    }

    /// Its JSON, with a line for each attempt: they are long, and seldom read.
    fn form(&self) -> serde_json::Result<String> {
        let mut short = self.clone();
        let attempts = std::mem::take(&mut short.attempts);
        let mut form = serde_json::to_string_pretty(&short)?;
        if !attempts.is_empty() {
            let lines = attempts.iter().map(serde_json::to_string);
            let lines = lines.collect::<Result<Vec<_>, _>>()?.join(",\n    ");
            form.truncate(form.len() - "\n}".len());
            form.push_str(&format!(",\n  \"attempts\": [\n    {lines}\n  ]\n}}"));
        }
        form.push('\n');
        Ok(form)
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
        let tables = tables().unwrap_or_default();
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
