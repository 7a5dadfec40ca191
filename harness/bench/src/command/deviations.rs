//! A row of `drivebench deviations`.

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
    /// A row of a bus with one model of a drive.
    #[must_use]
    pub const fn new(name: &'static str, section: &'static str, about: &'static str) -> Self {
        Self {
            name,
            section,
            about,
            models: None,
        }
    }
}
