//! `--html FILE` and `--svg FILE`: recorded values as curves.

use super::failure::Failure;
use super::file;
use crate::html::Html;
use crate::report::chart::Chart;
use clap::Args;
use std::path::{Path, PathBuf};

/// The first line of the csv of `scope`.
pub const SCOPE_HEADING: &str = "time_us,signal,name,raw,value,unit";

/// The files that curves are drawn into.
#[derive(Clone, Debug, Default, Args)]
pub struct DrawingArguments {
    /// Also draw the values into this file, as one HTML page with a cursor.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Also draw the values into this file, as a picture (SVG).
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
}

impl DrawingArguments {
    fn files(&self) -> impl Iterator<Item = &Path> {
        [&self.html, &self.svg]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
    }

    /// Whether something is to be drawn.
    pub fn wanted(&self) -> bool {
        self.files().next().is_some()
    }

    /// Refuses files that cannot be written, before a recording begins.
    ///
    /// # Errors
    /// [`Failure`] names the file.
    pub fn check(&self) -> Result<(), Failure> {
        self.files().try_for_each(file::check)
    }

    /// Writes the files.
    ///
    /// # Errors
    /// [`Failure`] names the file.
    pub fn write(&self, chart: &Chart<'_>) -> Result<(), Failure> {
        if let Some(path) = &self.html {
            file::write(path, &chart.page(&Html::new()))?;
        }
        if let Some(path) = &self.svg {
            file::write(path, &chart.picture())?;
        }
        Ok(())
    }
}
