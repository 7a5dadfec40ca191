//! A row of `drivebench deviations`.

use harness_sim::deviation::{Deviation, DeviationTable};
use serde::Serialize;

/// A deviation of a drive or of the bench's own master.
#[derive(Serialize)]
pub struct DeviationRow {
    pub name: &'static str,
    pub section: &'static str,
    pub about: &'static str,
    /// Which models can deviate in this way, where a drive has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub models: Option<&'static [&'static str]>,
}

impl DeviationRow {
    /// The row of a deviation on a bus with one model of a drive.
    #[must_use]
    pub const fn of<Injection>(deviation: &Deviation<Injection>) -> Self {
        Self {
            name: deviation.name,
            section: deviation.section,
            about: deviation.about,
            models: None,
        }
    }

    /// The rows of a table on a bus with one model of a drive.
    #[must_use]
    pub fn all<Injection>(table: &DeviationTable<Injection>) -> Vec<Self> {
        table.all().map(Self::of).collect()
    }
}
