//! A finding: a case, the difference, and how to reproduce it. It is stored as JSON next to its scenario.

use super::files::{read_text, write_whole};
use super::{ExploreError, FuzzCase};
use crate::bus_name::BusName;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The version of the format.
const SCHEMA: u32 = 1;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Finding<C: FuzzCase> {
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
    /// How the drives differ from the expected behaviour.
    pub difference: C::Difference,
    /// What its drives are made of.
    pub setup: C::Setup,
    pub case: C,
    /// The attempts that the finding rests on, the first one first; none where drives are simulated, which do the same again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attempts: Vec<C::Attempt>,
}

impl<C: FuzzCase> Finding<C> {
    /// The version of the format.
    pub const SCHEMA: u32 = SCHEMA;

    /// Reads the finding of a file: its JSON, or the scenario beside it.
    ///
    /// # Errors
    /// There is no finding, or it is damaged.
    pub fn read_as(path: &Path) -> Result<(Self, PathBuf), ExploreError> {
        let file = json_of(path);
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
        let sound = finding.schema == SCHEMA && C::is_sound(&finding);
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
        let text = C::text(self)?;
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
}

/// The JSON of a finding that is named by it, or by the scenario beside it.
fn json_of(path: &Path) -> PathBuf {
    match path.extension() {
        Some(ending) if ending == "scn" => path.with_extension("json"),
        _ => path.to_owned(),
    }
}

/// The bus of a finding, by its name; that of rings says none.
#[must_use]
pub fn bus_of(path: &Path) -> Option<BusName> {
    bus_in(&read_text(&json_of(path)).ok()?)
}

/// The bus that the JSON of a finding, or of the settings of a run, names.
pub(super) fn bus_in(text: &str) -> Option<BusName> {
    let json: serde_json::Value = serde_json::from_str(text).ok()?;
    let name = json.get("setup")?.get("bus")?.as_str()?;
    let known = BusName::NAMES.iter().find(|(known, _)| *known == name);
    known.map(|(_, bus)| *bus)
}
