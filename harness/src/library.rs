//! Where scenarios come from: the files and folders that are named, or the built-in ones.

use crate::bus::Bus;
use crate::buses::novobus::language::plan::Plan;
use crate::buses::novobus::language::syntax::Scenario;
use crate::buses::settle;
use crate::regular;
use crate::scenario::parse::{self, parse};
use crate::scenario::plan::plan;
use crate::scenario::problem::{Problems, nearest};
use crate::scenario::settled::Settled;
use crate::scenario::source::{LibraryError, MAX_DEPTH, MAX_FILES, Source};
use crate::traffic::SegmentReport;
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The scenarios that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/corpora/scenarios");

/// The ending of a scenario's file name.
pub const ENDING: &str = "scn";

/// A scenario, read and settled, and not yet played.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Where it comes from, for messages: a path or the name of a built-in scenario.
    pub name: String,
    /// Its text.
    pub source: Source,
    /// What it says; of another bus than [`Bus::DEFAULT`] only what it says in the words of every bus.
    pub scenario: Scenario,
    /// The same settled for a bench of a given size; `None` for another bus.
    pub plan: Option<Plan>,
    /// The same of another bus; `None` for [`Bus::DEFAULT`], and for a bus that is not built.
    pub other: Option<Arc<dyn Settled>>,
}

impl Entry {
    /// Reads and settles a scenario, for a ring of `size` where that is given.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn new(source: Source, size: Option<u8>) -> Result<Self, Box<Problems>> {
        let bus = parse::bus(&source);
        if bus != Bus::DEFAULT {
            let found = settle(bus, &source, size)?;
            return Ok(Self::of_other(source, found));
        }
        Self::of_ring(parse(&source)?, source, size)
    }

    /// A scenario of [`Bus::DEFAULT`], settled.
    fn of_ring(
        scenario: Scenario,
        source: Source,
        size: Option<u8>,
    ) -> Result<Self, Box<Problems>> {
        let own = plan(&scenario, &source, size)?;
        Ok(Self {
            name: source.name.clone(),
            source,
            scenario,
            plan: Some(own),
            other: None,
        })
    }

    /// A scenario of another bus than [`Bus::DEFAULT`], read and settled.
    pub(crate) fn of_other(source: Source, found: (Scenario, Arc<dyn Settled>)) -> Self {
        let (scenario, other) = found;
        Self {
            name: source.name.clone(),
            source,
            scenario,
            plan: None,
            other: Some(other),
        }
    }

    /// Reads and settles a scenario, for a ring of this many drives where it is for several sizes and that is one of them.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn fitting(source: Source, drives: Option<u8>) -> Result<Self, Box<Problems>> {
        if parse::bus(&source) != Bus::DEFAULT {
            return Self::new(source, None);
        }
        let scenario: Scenario = parse(&source)?;
        let range = scenario.header.rings.first();
        let fits = |drives: &u8| range.is_some_and(|own| own.contains(*drives));
        let size = drives.filter(fits);
        Self::of_ring(scenario, source, size)
    }

    /// The name without folders and ending.
    #[must_use]
    pub fn short_name(&self) -> &str {
        last(&self.name)
    }

    /// The scenario settled, of whichever bus; `None` for a bus that is not built.
    #[must_use]
    pub fn settled(&self) -> Option<&dyn Settled> {
        let own = self.plan.as_ref().map(|plan| plan as &dyn Settled);
        own.or(self.other.as_deref())
    }

    /// How what it carries is shown; `None` for a ring.
    #[must_use]
    pub fn report(&self) -> Option<&'static dyn SegmentReport> {
        self.settled()?.report()
    }

    /// How many drives its bench has, as `3+1`; empty for a bus that is not built yet.
    #[must_use]
    pub fn drives(&self) -> String {
        self.settled().map_or(String::new(), Settled::size)
    }

    /// Whether the text occurs in the name, the title or a source.
    #[must_use]
    pub fn matches(&self, text: &str) -> bool {
        let text = text.to_lowercase();
        let mut places = self
            .scenario
            .sources
            .iter()
            .map(|source| source.text.as_str());
        [self.name.as_str(), self.scenario.title.as_str()]
            .into_iter()
            .chain(places.by_ref())
            .any(|place| place.to_lowercase().contains(&text))
    }
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
pub(crate) fn is_named(names: &[PathBuf], scenario: &str) -> bool {
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
    let bus = Bus::NAMES.iter().position(|(own, _)| Some(*own) == folder);
    (bus.unwrap_or(Bus::NAMES.len()), natural(bare(name)))
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
fn last(name: &str) -> &str {
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
            .map(|own| own.name.split('/').next().unwrap_or_default());
        let mut folders: Vec<_> = folders.collect();
        folders.dedup();
        assert_eq!(folders, Bus::NAMES.map(|(name, _)| name));
        let bus = |own: &&Source| own.name.starts_with(folders[0]);
        let names: Vec<_> = sources
            .iter()
            .filter(bus)
            .map(|own| natural(bare(&own.name)))
            .collect();
        assert!(names.is_sorted());
    }

    /// `run --ring N` reads every scenario for the size where it allows it: none may be wrong at an end of its range.
    #[test]
    fn built_in_scenarios_hold_at_both_ends_of_their_sizes() {
        let (mut ends, mut wrong) = (0, Vec::new());
        for source in sources(&[]).expect("the built-in ones") {
            let name = source.name.clone();
            let entry = Entry::new(source, None).expect("a scenario");
            let Some(own) = entry.scenario.header.rings.first() else {
                continue;
            };
            for size in [own.smallest, own.largest] {
                if let Err(problems) = Entry::new(entry.source.clone(), Some(size)) {
                    wrong.push(format!("{name} on a ring of {size}: {problems}"));
                }
                ends += usize::from(own.smallest != own.largest);
            }
        }
        assert_eq!(wrong, [""; 0]);
        assert!(ends > 50, "{ends} ends of ranges");
    }
}
