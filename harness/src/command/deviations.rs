//! A row of `drivebench deviations`.

use serde::Serialize;

/// A deviation of a drive or of the bench's own master.
#[derive(Serialize)]
pub(crate) struct DeviationRow {
    pub(crate) name: &'static str,
    pub(crate) section: &'static str,
    pub(crate) about: &'static str,
    /// Which models can deviate in this way, where a drive has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) models: Option<&'static [&'static str]>,
}
