//! Where campaigns come from: the files that are named, or the built-in ones.

use super::run::Campaign;
use harness_bench::campaign::{self, CampaignError};
use harness_bench::scenario::source::{Source, SourceError};
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// The campaigns that the binary carries, and their scenarios.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns");

/// The names of the built-in campaigns, in order.
pub(crate) fn names() -> Vec<String> {
    campaign::names(&BUILT_IN, "")
}

/// Finds and reads a campaign: a file, or a built-in one by its name. `None` where it is neither.
pub(crate) fn find(name: &Path) -> Option<Result<Campaign, CampaignError>> {
    let said = |error: SourceError| CampaignError::Said(error.to_string());
    let (source, folder) = if name.is_file() {
        let folder = name.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        (Source::read(name), folder)
    } else {
        let wanted = name.display().to_string();
        let bare = wanted.strip_suffix(".toml").unwrap_or(&wanted);
        let file = BUILT_IN.get_file(format!("{bare}.toml"))?;
        let text = file.contents().to_vec();
        (
            Source::from_bytes(format!("{bare}.toml"), text),
            PathBuf::new(),
        )
    };
    let read = source.map_err(said);
    Some(read.and_then(|source| Campaign::load(&source, &folder).map_err(CampaignError::Mistakes)))
}

/// The same, as a campaign of any bus.
pub(crate) fn found(name: &Path) -> Option<Result<Box<dyn campaign::Campaign>, CampaignError>> {
    Some(find(name)?.map(|campaign| -> Box<dyn campaign::Campaign> { Box::new(campaign) }))
}
