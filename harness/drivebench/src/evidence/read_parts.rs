//! The parts of a run that was split, read from their folders: whether they are of one run.

use super::error::EvidenceError;
use super::files::{self, CAPTURES, SCENARIOS, SIGNATURE, SUMS, sum};
use super::record::{PartItem, RecordLine};
use super::verify::OpenedFolder;
use crate::link::Capability;
use crate::partition::Partition;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the parts.
pub(super) const PARTS: &str = "parts";

/// A part that was read.
pub(super) struct ReadPart {
    pub(super) path: PathBuf,
    pub(super) partition: Partition,
    pub(super) opened: OpenedFolder,
}

/// Where a part stands in a merged folder.
pub(super) fn place(path: &Path, number: u32) -> PathBuf {
    path.join(PARTS).join(number.to_string())
}

/// The names in a folder, in order.
pub(super) fn entries(path: &Path) -> Result<Vec<String>, EvidenceError> {
    let all = fs::read_dir(path).map_err(failed(path))?;
    let mut names = Vec::new();
    for entry in all {
        names.push(
            entry
                .map_err(failed(path))?
                .file_name()
                .to_string_lossy()
                .into_owned(),
        );
    }
    names.sort();
    Ok(names)
}

pub(super) fn failed(path: &Path) -> impl Fn(std::io::Error) -> EvidenceError {
    move |error| EvidenceError::file(path, error)
}

/// Copies the files of a folder of evidence.
pub(super) fn copy(from: &Path, to: &Path) -> Result<(), EvidenceError> {
    for folder in ["", SCENARIOS, CAPTURES] {
        let path = to.join(folder);
        fs::create_dir_all(&path).map_err(failed(&path))?;
    }
    let mut names = files::names(from);
    names.extend([SUMS, SIGNATURE].map(str::to_owned));
    for name in names.iter().filter(|name| from.join(name).exists()) {
        let bytes = files::read(from, name).map_err(failed(&from.join(name)))?;
        fs::write(to.join(name), bytes).map_err(failed(&to.join(name)))?;
    }
    Ok(())
}

/// Reads folders that are to be parts of one run, in the order of their numbers.
pub(super) fn read(folders: &[PathBuf]) -> Result<Vec<ReadPart>, EvidenceError> {
    let mut parts: Vec<ReadPart> = Vec::new();
    for path in folders {
        let opened = OpenedFolder::open(path)?;
        let Some(partition) = opened.header.partition() else {
            return Err(EvidenceError::Merge(format!(
                "{} is no part of a run: its record has no partition; `run` or `qualify` with `--partition slice:M/N --evidence FOLDER` writes one",
                path.display()
            )));
        };
        let part = ReadPart {
            path: path.clone(),
            partition,
            opened,
        };
        if let Some(first) = parts.first() {
            part.is_of_one_run_with(first)?;
        }
        if let Some(other) = parts.iter().find(|other| other.partition == partition) {
            return Err(EvidenceError::Merge(format!(
                "{} and {} are both {partition}; name each part once",
                other.path.display(),
                path.display()
            )));
        }
        parts.push(part);
    }
    parts.sort_by_key(|part| part.partition.number);
    match parts.is_empty() {
        true => Err(EvidenceError::Merge("there is no part".to_owned())),
        false => Ok(parts),
    }
}

impl ReadPart {
    /// What must be the same in all parts of a run: the name of each fact, and what it is here.
    pub(super) fn fingerprint(&self) -> Vec<(&'static str, String)> {
        let header = &self.opened.header;
        let part = header.part.as_ref();
        let names = header.capabilities.iter().copied();
        let names: Vec<_> = names.map(Capability::name).collect();
        vec![
            ("version of drivebench", header.program.clone()),
            ("schema", header.schema.to_string()),
            ("spread", self.partition.spread.name().to_owned()),
            ("number of parts", self.partition.of.to_string()),
            ("rig", self.opened.rig.id().to_owned()),
            (
                "sum of the rig's file",
                sum(self.opened.rig.text.as_bytes()),
            ),
            (
                "purpose",
                if header.qualified { "qualify" } else { "run" }.to_owned(),
            ),
            (
                "filter",
                part.and_then(|part| part.filter.clone())
                    .unwrap_or_else(|| "none".to_owned()),
            ),
            (
                "corpus",
                part.map_or_else(String::new, |part| part.corpus.clone()),
            ),
            ("list of capabilities", names.join(", ")),
            ("rate", header.rate.bits_per_second().to_string()),
            (
                "choice of drives",
                match header.own_rings {
                    true => "simulated drives for each scenario",
                    false => "those of the rig",
                }
                .to_owned(),
            ),
            (
                "sum of the profile that the rig's file names",
                self.opened
                    .rig
                    .profile
                    .as_ref()
                    .map_or_else(|| "none".to_owned(), |profile| sum(profile.text.as_bytes())),
            ),
        ]
    }

    fn is_of_one_run_with(&self, first: &Self) -> Result<(), EvidenceError> {
        let both = first.fingerprint().into_iter().zip(self.fingerprint());
        let mut differing = both.filter(|((_, theirs), (_, ours))| theirs != ours);
        match differing.next() {
            None => Ok(()),
            Some(((what, theirs), (_, ours))) => Err(EvidenceError::Merge(format!(
                "{} and {} are no parts of one run: the {what} is {theirs} in the first and {ours} in the second",
                first.path.display(),
                self.path.display()
            ))),
        }
    }

    /// All scenarios of the run, those of other parts included.
    pub(super) fn scenarios(&self) -> &[PartItem] {
        self.opened
            .header
            .part
            .as_ref()
            .map_or(&[], |part| &part.scenarios)
    }
}

/// Refuses what is no folder of its own: a link would let what is elsewhere be checked.
fn is_folder(path: &Path) -> Result<(), EvidenceError> {
    let kind = fs::symlink_metadata(path)
        .map_err(failed(path))?
        .file_type();
    let what = match (kind.is_dir(), kind.is_symlink()) {
        (true, _) => return Ok(()),
        (_, true) => "a symbolic link, which has no place in evidence",
        _ => "not a folder",
    };
    let path = path.display();
    Err(EvidenceError::Merge(format!("{path} is {what}")))
}

/// The parts of a merged folder.
pub(super) fn parts_of(path: &Path) -> Result<Vec<ReadPart>, EvidenceError> {
    let folder = path.join(PARTS);
    is_folder(&folder)?;
    let names = entries(&folder)?;
    let all: Vec<_> = names.iter().map(|name| folder.join(name)).collect();
    for folder in &all {
        is_folder(folder)?;
    }
    let parts = read(&all)?;
    match parts
        .iter()
        .find(|part| place(path, part.partition.number) != part.path)
    {
        None => Ok(parts),
        Some(part) => Err(EvidenceError::Merge(format!(
            "{} holds {}, which belongs into {PARTS}/{}",
            part.path.display(),
            part.partition,
            part.partition.number
        ))),
    }
}

impl ReadPart {
    /// Whether the safe state was confirmed at the end, if it has one.
    fn end(&self) -> Option<Option<bool>> {
        match self.opened.lines.last() {
            Some(RecordLine::End { safe, .. }) => Some(*safe),
            _ => None,
        }
    }

    /// Whether it has come to its end.
    pub(super) fn has_ended(&self) -> bool {
        self.end().is_some() && self.path.join(SUMS).exists()
    }

    /// Whether its drives were left in a state that is not known to be safe.
    pub(super) fn is_unsafe(&self) -> bool {
        self.end() == Some(Some(false))
    }
}
