//! Where scenarios come from: the files and folders that are named, or the built-in ones.

use super::problem::{Problems, nearest};
use super::source::{Source, SourceError};
use crate::bus_name::BusName;
use crate::regular;
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// The scenarios that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/scenarios");

/// The ending of a scenario's file name.
pub(crate) const ENDING: &str = "scn";

/// The most files that are taken from a folder.
const MAX_FILES: usize = 10_000;

/// How deep folders are searched.
const MAX_DEPTH: usize = 16;

/// Why a scenario cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// Neither a path nor the name of a built-in scenario.
    #[error("failed to find {name}: neither a file or folder nor a built-in scenario; {remedy}")]
    NotFound {
        /// The name as given.
        name: String,
        /// What to do about it.
        remedy: String,
    },
    /// A folder cannot be read.
    #[error("failed to read the folder {folder}: {error}")]
    Folder {
        folder: String,
        error: std::io::Error,
    },
    /// A folder holds more than we take.
    #[error(
        "{folder} holds more than {MAX_FILES} scenarios, or folders nest deeper than {MAX_DEPTH}"
    )]
    TooMany { folder: String },
    /// A file is no scenario.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// A scenario has mistakes.
    #[error(transparent)]
    Mistakes(#[from] Box<Problems>),
}

/// The text of every scenario named: files, folders with all that is in them, built-in ones by name. A
/// path wins. Without names, all built-in ones.
///
/// # Errors
/// Something named is not there or cannot be read.
pub fn sources(names: &[PathBuf]) -> Result<Vec<Source>, LibraryError> {
    if names.is_empty() {
        return built_in();
    }
    let mut sources = Vec::new();
    for name in names {
        if name.is_dir() {
            let mut files = Vec::new();
            search(name, 0, &mut files)?;
            files.sort();
            for file in files {
                sources.push(Source::read(&file)?);
            }
        } else if name.exists() {
            sources.push(Source::read(name)?);
        } else {
            sources.push(built_in_named(name)?);
        }
    }
    Ok(sources)
}

/// Whether the scenario of this name was named itself, and is not one of a folder or of all built-in ones.
pub fn is_named(names: &[PathBuf], scenario: &str) -> bool {
    let is = |name: &str| name == scenario || name == last(scenario);
    names.iter().any(|name| name.to_str().is_some_and(is))
}

fn search(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), LibraryError> {
    let unreadable = |error| LibraryError::Folder {
        folder: folder.display().to_string(),
        error,
    };
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.is_dir() && depth < MAX_DEPTH {
            search(&path, depth + 1, files)?;
        } else if path.extension().is_some_and(|ending| ending == ENDING) {
            files.push(path);
        }
        if files.len() > MAX_FILES || depth == MAX_DEPTH {
            return Err(LibraryError::TooMany {
                folder: folder.display().to_string(),
            });
        }
    }
    Ok(())
}

/// The names of the built-in scenarios, in order.
#[must_use]
pub fn names() -> Vec<String> {
    let mut files = Vec::new();
    collect(&BUILT_IN, &mut files);
    let mut names: Vec<_> = files
        .iter()
        .map(|(name, _)| last(name).to_owned())
        .collect();
    names.sort_by(|a, b| natural(a).cmp(&natural(b)));
    names
}

fn built_in() -> Result<Vec<Source>, LibraryError> {
    let mut files = Vec::new();
    collect(&BUILT_IN, &mut files);
    let mut files: Vec<_> = files
        .iter()
        .map(|(name, bytes)| (in_order(name), name, bytes))
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|(_, name, bytes)| Ok(Source::from_bytes(name.clone(), bytes.to_vec())?))
        .collect()
}

/// What built-in scenarios are sorted by: the bus of their folder, in the order of the table of buses, then their names.
fn in_order(name: &str) -> (usize, Vec<(u64, &str)>) {
    let folder = name.split('/').next();
    let bus = BusName::NAMES
        .iter()
        .position(|(name, _)| Some(*name) == folder);
    (bus.unwrap_or(BusName::NAMES.len()), natural(bare(name)))
}

/// The remedy for a name that is part of the names of built-in scenarios, or of none.
fn containing(wanted: &str, known: &[&str]) -> String {
    let parts: Vec<_> = known.iter().filter(|name| name.contains(wanted)).collect();
    match parts.as_slice() {
        [] => "`drivebench list` shows the built-in ones".to_owned(),
        [only] => format!("did you mean `{only}`?"),
        [first, ..] => format!(
            "{} built-in ones have this text in their name, such as `{first}`; `drivebench list --filter {wanted}` shows them",
            parts.len()
        ),
    }
}

/// A name without folders and ending.
pub fn last(name: &str) -> &str {
    bare(name).rsplit('/').next().unwrap_or_default()
}

/// A name without the ending.
fn bare(name: &str) -> &str {
    name.strip_suffix(".scn").unwrap_or(name)
}

/// Numbers in a name sort as numbers: 9.7 before 10.1.
fn natural(name: &str) -> Vec<(u64, &str)> {
    name.split_inclusive(|c: char| !c.is_ascii_digit())
        .map(|part| {
            let digits = part.trim_end_matches(|c: char| !c.is_ascii_digit());
            (digits.parse().unwrap_or(u64::MAX), part)
        })
        .collect()
}

fn collect<'a>(dir: &'a Dir<'a>, files: &mut Vec<(String, &'a [u8])>) {
    for file in dir.files() {
        if file
            .path()
            .extension()
            .is_some_and(|ending| ending == ENDING)
        {
            files.push((file.path().display().to_string(), file.contents()));
        }
    }
    for inner in dir.dirs() {
        collect(inner, files);
    }
}

fn built_in_named(name: &Path) -> Result<Source, LibraryError> {
    let wanted = name.display().to_string();
    let sources = built_in()?;
    let found = sources
        .iter()
        .find(|source| [bare(&source.name), last(&source.name)].contains(&bare(&wanted)));
    if let Some(source) = found {
        return Ok(source.clone());
    }
    let known: Vec<_> = sources.iter().map(|source| last(&source.name)).collect();
    let near = regular::near_in_folder(name);
    let remedy = match near.as_deref().or(nearest(last(&wanted), &known)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => containing(&wanted, &known),
    };
    Err(LibraryError::NotFound {
        name: wanted,
        remedy,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `list`, `run` and `manual` begin with the first bus of the table.
    #[test]
    fn built_in_scenarios_stand_bus_by_bus() {
        let sources = sources(&[]).expect("the built-in ones");
        let folders = sources
            .iter()
            .map(|source| source.name.split('/').next().unwrap_or_default());
        let mut folders: Vec<_> = folders.collect();
        folders.dedup();
        assert_eq!(folders, BusName::NAMES.map(|(name, _)| name));
        let bus = |source: &&Source| source.name.starts_with(folders[0]);
        let names: Vec<_> = sources
            .iter()
            .filter(bus)
            .map(|source| natural(bare(&source.name)))
            .collect();
        assert!(names.is_sorted());
    }
}
