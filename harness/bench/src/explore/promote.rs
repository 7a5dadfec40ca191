//! A finding that is kept: a scenario, the table that it leaves, and where the bus has one an input of its fuzz targets, in a checkout of the
//! repository.

use super::files::write_whole;
use super::{ExploreError, Finding, FuzzCase};
use crate::manual::Manual;
use crate::scenario::verdict::Verdict;
use std::path::{Path, PathBuf};

/// The folders of a checkout that the files go into; the name of the bus follows them.
const SCENARIOS: &str = "corpora/scenarios";
const SNAPSHOTS: &str = "snapshots/scenarios";

/// What a promoted finding is called.
#[derive(Clone, Debug)]
pub struct Naming {
    /// The name of its files.
    pub name: String,
    /// Its title; by default that of the finding.
    pub title: Option<String>,
    /// The table of the manual that it covers; by default that of the finding.
    pub source: Option<String>,
}

/// The files that promoting wrote, and its result.
#[derive(Clone, Debug)]
pub struct Promoted {
    /// The scenario, the input where there is one, and the snapshot.
    pub files: Vec<PathBuf>,
    pub text: String,
    /// Whether the drives with the planted deviations fail the scenario; `None` where none was planted.
    pub fails_on_deviating: Option<bool>,
}

/// Plays a scenario with this name and text on simulated drives. Returns the verdict, the reason and the page.
pub(crate) type Plays = fn(&str, &str) -> Result<(Verdict, String, String), ExploreError>;

/// The top folder of the checkout that contains `from`.
///
/// # Errors
/// It is not in a checkout.
pub fn checkout(from: &Path) -> Result<PathBuf, ExploreError> {
    let is_top =
        |folder: &&Path| folder.join(SCENARIOS).is_dir() && folder.join(SNAPSHOTS).is_dir();
    from.ancestors()
        .find(is_top)
        .map(Path::to_owned)
        .ok_or_else(|| {
            ExploreError::Usage(format!(
                "{} is in no checkout of the repository: {SCENARIOS} and {SNAPSHOTS} must be there",
                from.display()
            ))
        })
}

/// Turns a finding into a scenario and a snapshot, and an input where its bus has them. Nothing is written where anything is amiss, or where
/// one of the files is there.
///
/// # Errors
/// The name or the table is invalid, a file exists, or the scenario does not pass on the model.
pub fn promote<C: FuzzCase>(
    finding: &Finding<C>,
    naming: &Naming,
    (top, played): (&Path, Plays),
) -> Result<Promoted, ExploreError> {
    let (name, bus) = (&naming.name, C::MANUAL.bus);
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '.';
    if name.is_empty() || name.len() > 80 || !name.chars().all(plain) || name.starts_with('.') {
        return Err(ExploreError::Usage(format!(
            "`{name}` is not a name: small letters, digits, `-` and `.`, such as 9.6-checksum-of-a-read"
        )));
    }
    if let Some(source) = &naming.source {
        known(C::MANUAL, source)?;
    }
    let title = naming.title.clone();
    let title = title.unwrap_or_else(|| C::title(finding));
    let source = naming.source.as_deref();
    let text = C::scenario(finding, &title, source, false)?;
    let table = snapshot(played(name, &text)?)?;
    let file = |folder: &str, ending: &str| {
        let folder = top.join(folder).join(bus.name());
        folder.join(format!("{name}.{ending}"))
    };
    let mut files = vec![(file(SCENARIOS, "scn"), text.clone())];
    if let Some((folder, input)) = C::input(finding, &title) {
        files.push((top.join(folder).join(format!("{name}.hex")), input));
    }
    files.push((file(SNAPSHOTS, "snap"), table));
    if let Some((there, _)) = files.iter().find(|(file, _)| file.exists()) {
        return Err(ExploreError::Usage(format!(
            "{} is there already; choose another --name",
            there.display()
        )));
    }
    let fails = || {
        let text = C::scenario(finding, &title, source, true)?;
        let played = played("the drives under test", &text);
        played.map(|(verdict, ..)| verdict == Verdict::Failed)
    };
    let fails_on_deviating = C::deviates(&finding.setup).then(fails).transpose()?;
    for (file, text) in &files {
        if let Err(error) = write_whole(file, text) {
            // All of them or none: none was there before.
            for (written, _) in &files {
                let _gone = std::fs::remove_file(written);
            }
            return Err(error);
        }
    }
    Ok(Promoted {
        files: files.into_iter().map(|(file, _)| file).collect(),
        text,
        fails_on_deviating,
    })
}

/// Refuses a table that the catalogue of a bus does not have.
fn known(manual: Manual, source: &str) -> Result<(), ExploreError> {
    let tables = manual.tables().unwrap_or_default();
    match tables.iter().any(|table| table.id == source) {
        true => Ok(()),
        false => Err(ExploreError::Usage(format!(
            "the catalogue has no `{source}`; `drivebench manual --filter {}` shows what there is",
            manual.bus.name()
        ))),
    }
}

/// The snapshot of a scenario, as `cargo test --test files scenarios` compares it; the model must pass the scenario.
fn snapshot((verdict, why, page): (Verdict, String, String)) -> Result<String, ExploreError> {
    if verdict != Verdict::Passed {
        return Err(ExploreError::Usage(format!(
            "the model itself does not pass this scenario ({verdict}: {why}); nothing was written"
        )));
    }
    Ok(format!(
        "---\nsource: harness/drivebench/tests/files/scenarios.rs\n---\n{}\n",
        page.trim_end_matches('\n')
    ))
}
