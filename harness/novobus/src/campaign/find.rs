//! Where campaigns come from: the files that are named, or the built-in ones.

use super::run::Campaign;
use harness_bench::scenario::problem::{Problems, nearest};
use harness_bench::scenario::source::{Source, SourceError};
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// The campaigns that the binary carries, and their scenarios.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns");

/// Why a campaign cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum FindCampaignError {
    /// Neither a file nor the name of a built-in campaign.
    #[error("failed to find {name}: neither a file nor a built-in campaign; {remedy}")]
    NotFound {
        /// The name as given.
        name: String,
        /// What to do about it.
        remedy: String,
    },
    /// A file is no text.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// It, or its scenario, has mistakes.
    #[error(transparent)]
    Mistakes(#[from] Box<Problems>),
}

/// The names of the built-in campaigns, in order.
#[must_use]
pub fn names() -> Vec<&'static str> {
    let mut names: Vec<_> = BUILT_IN
        .files()
        .filter_map(|file| file.path().to_str()?.strip_suffix(".toml"))
        .collect();
    names.sort_unstable();
    names
}

/// Finds and reads a campaign: a file, or a built-in one by its name.
///
/// # Errors
/// There is none, or it cannot be played.
pub fn find(name: &Path) -> Result<Campaign, FindCampaignError> {
    if name.is_file() {
        let folder = name.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        return Ok(Campaign::load(&Source::read(name)?, &folder)?);
    }
    let wanted = name.display().to_string();
    let bare = wanted.strip_suffix(".toml").unwrap_or(&wanted);
    let Some(file) = BUILT_IN.get_file(format!("{bare}.toml")) else {
        let known = names();
        let near = nearest(bare, &known).map(|near| format!("did you mean `{near}`? "));
        let known = known.join(", ");
        return Err(FindCampaignError::NotFound {
            name: wanted,
            remedy: format!("{}there are {known}", near.unwrap_or_default()),
        });
    };
    let source = Source::from_bytes(format!("{bare}.toml"), file.contents().to_vec())?;
    Ok(Campaign::load(&source, Path::new(""))?)
}
