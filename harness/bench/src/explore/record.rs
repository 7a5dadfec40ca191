//! The folder of a run: events are written as they happen, line by line, so that a killed run resumes where it was.
//!
//! `run.jsonl` is the record. Everything before a line of progress is settled; what follows the last one is
//! done again when a run is resumed.

use super::FuzzCase;
use super::error::ExploreError;
use super::files::read_text;
use super::finding::bus_in;
use crate::bus_name::BusName;
use crate::regular;
use rustix::fs::FlockOperation;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The record's name in its folder.
pub const RECORD: &str = "run.jsonl";

/// What a run is: all that decides which cases are tried, and how they are judged.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct FuzzSettings<C: FuzzCase> {
    /// The version of the form: 1.
    pub schema: u32,
    /// The rig as it was named.
    pub rig: String,
    /// How many drives its ring has.
    pub drives: u8,
    /// How many drives its second ring has, where it has two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<u8>,
    /// Whether it has ports.
    pub ports: bool,
    pub seed: u64,
    /// A finding is confirmed when it is seen again this often ...
    pub confirm: u8,
    /// ... in this many attempts.
    pub of: u8,
    /// What the drives are made of.
    pub setup: C::Setup,
    /// What cases may have, by name.
    pub spices: Vec<String>,
}

impl<C: FuzzCase> FuzzSettings<C> {
    /// The version of the form.
    pub const SCHEMA: u32 = 1;
}

/// A line of the record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", bound = "")]
pub enum LogLine<C: FuzzCase> {
    /// The first line.
    Run(FuzzSettings<C>),
    /// A round begins.
    Swarm {
        /// Which, counted from 0.
        round: u64,
        /// What its cases may have.
        spices: Vec<String>,
    },
    /// A case is kept.
    Kept {
        number: u64,
        /// How many features are new.
        new: usize,
        case: C,
    },
    /// Something was found; its files are in the folder.
    Finding {
        /// The number of its case.
        number: u64,
        /// What makes it one with others.
        signature: String,
        /// Whether it was seen again often enough.
        confirmed: bool,
        /// The name of its files.
        file: String,
    },
    /// So far everything is settled.
    Progress(Progress),
}

/// The progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Progress {
    /// How many cases were made.
    pub cases: u64,
    /// How many of them the rig does not allow or cannot do: they were not sent.
    pub not_sent: u64,
    /// How many showed again what had been found.
    pub repeats: u64,
    /// How long the line was used, in nanoseconds.
    pub wire_ns: u64,
}

/// What a record holds.
#[derive(Clone, Debug)]
pub struct KeptRun<C: FuzzCase> {
    /// The first line.
    pub about: FuzzSettings<C>,
    /// The lines after it, up to the last one of progress.
    pub lines: Vec<LogLine<C>>,
    /// The last line of progress.
    pub progress: Progress,
    /// All lines of progress, in order.
    pub history: Vec<Progress>,
}

/// The record of a run under way.
#[derive(Debug)]
pub struct FuzzRecord {
    folder: PathBuf,
    file: File,
}

impl FuzzRecord {
    /// A record in a folder that is not there or is empty.
    ///
    /// # Errors
    /// It is there with something in it, or cannot be written.
    pub fn create<C: FuzzCase>(
        folder: &Path,
        about: &FuzzSettings<C>,
    ) -> Result<Self, ExploreError> {
        let unusable = |error: std::io::Error| {
            let error = regular::in_words(folder, error);
            ExploreError::unwritten("make the folder", folder, &error)
        };
        std::fs::create_dir_all(folder).map_err(unusable)?;
        if std::fs::read_dir(folder)
            .map_err(unusable)?
            .next()
            .is_some()
        {
            return Err(ExploreError::File(format!(
                "{} is not empty; name another folder, or go on with the run in it: --resume {}",
                folder.display(),
                folder.display()
            )));
        }
        let path = folder.join(RECORD);
        let file =
            File::create_new(&path).map_err(|e| ExploreError::unwritten("make", &path, &e))?;
        hold(&file, folder)?;
        let mut record = Self {
            folder: folder.to_owned(),
            file,
        };
        record.line(&LogLine::Run(about.clone()))?;
        record.line(&LogLine::<C>::Progress(Progress::default()))?;
        Ok(record)
    }

    /// Opens the record of a run that is resumed, and reads it. What follows the last line of progress is cut off.
    ///
    /// # Errors
    /// There is no record, or a line of it is damaged. Half a line at its end is no damage.
    pub fn resume<C: FuzzCase>(folder: &Path) -> Result<(Self, KeptRun<C>), ExploreError> {
        let path = folder.join(RECORD);
        let (kept, length) = read_as(folder)?;
        let file = File::options()
            .append(true)
            .open(&path)
            .map_err(|error| ExploreError::unwritten("write", &path, &error))?;
        hold(&file, folder)?;
        // A record only grows: cut off at its last settled line it is as if the rest had never been written.
        file.set_len(length as u64)
            .map_err(|error| ExploreError::unwritten("write", &path, &error))?;
        let record = Self {
            folder: folder.to_owned(),
            file,
        };
        unsettled(folder, kept.progress.cases);
        Ok((record, kept))
    }

    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes a line.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn line<C: FuzzCase>(&mut self, line: &LogLine<C>) -> Result<(), ExploreError> {
        let path = self.folder.join(RECORD);
        let failed = |error: std::io::Error| ExploreError::unwritten("write", &path, &error);
        let mut text = serde_json::to_string(line).map_err(|error| failed(error.into()))?;
        text.push('\n');
        // One write a line: a process that is killed leaves whole lines, or half of the last one.
        self.file
            .write_all(text.as_bytes())
            .and_then(|()| self.file.flush())
            .map_err(failed)
    }
}

/// Removes the files of findings whose lines were cut off: their cases are tried again.
fn unsettled(folder: &Path, cases: u64) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let stem = Path::new(&name).file_stem().and_then(|stem| stem.to_str());
        let number = stem.and_then(|stem| stem.strip_prefix("finding-")?.parse::<u64>().ok());
        if number.is_some_and(|number| number >= cases) {
            // One that stays is refused by `verify`, or written anew.
            let _removed = std::fs::remove_file(entry.path());
        }
    }
}

/// Keeps other processes out of a run's folder for as long as its record is open.
fn hold(file: &File, folder: &Path) -> Result<(), ExploreError> {
    rustix::fs::flock(file, FlockOperation::NonBlockingLockExclusive).map_err(|_| {
        ExploreError::Usage(format!(
            "another process works on the run in {}; wait for its end",
            folder.display()
        ))
    })
}

/// The rig of the run in a folder, whatever its bus.
///
/// # Errors
/// There is no record, or its first line is damaged.
pub fn rig_of(folder: &Path) -> Result<String, ExploreError> {
    let path = folder.join(RECORD);
    let text = record_of(folder)?;
    let first = text.lines().next().unwrap_or_default();
    let line: Option<serde_json::Value> = serde_json::from_str(first).ok();
    let rig = line.and_then(|line| Some(line.get("rig")?.as_str()?.to_owned()));
    rig.ok_or_else(|| {
        ExploreError::File(format!(
            "{}, line 1: a record begins with what the run is",
            path.display()
        ))
    })
}

/// The bus of the run in a folder, by its name; a run on rings says none.
#[must_use]
pub fn bus_of_run(folder: &Path) -> Option<BusName> {
    bus_in(record_of(folder).ok()?.lines().next()?)
}

/// The text of the record in a folder.
fn record_of(folder: &Path) -> Result<String, ExploreError> {
    regular::has_run(folder, RECORD)
        .map_err(|why| ExploreError::Usage(format!("{} holds no run: {why}", folder.display())))?;
    read_text(&folder.join(RECORD))
}

/// What the folder of a run holds, and how long its record is up to the last line of progress.
///
/// # Errors
/// There is no record, or it is damaged.
pub fn read_as<C: FuzzCase>(folder: &Path) -> Result<(KeptRun<C>, usize), ExploreError> {
    let path = folder.join(RECORD);
    let text = record_of(folder)?;
    let damaged = |number: usize, why: &str| {
        ExploreError::File(format!(
            "{}, line {}: {why}; the run cannot go on from a damaged record, begin another one",
            path.display(),
            number + 1
        ))
    };
    let mut about = None;
    let mut lines = Vec::new();
    let mut settled = None;
    let mut history = Vec::new();
    let mut at = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        at += line.len();
        if !line.ends_with('\n') {
            // Its writer was killed.
            break;
        }
        let line: LogLine<C> =
            serde_json::from_str(line).map_err(|error| damaged(number, &error.to_string()))?;
        match line {
            LogLine::Run(run) if number == 0 && run.schema == FuzzSettings::<C>::SCHEMA => {
                about = Some(run)
            }
            LogLine::Run(_) => return Err(damaged(number, "another kind of record")),
            LogLine::Progress(progress) => {
                history.push(progress);
                settled = Some((progress, at, lines.len()));
            }
            other => lines.push(other),
        }
        if about.is_none() {
            return Err(damaged(number, "a record begins with what the run is"));
        }
    }
    let (Some(about), Some((progress, length, count))) = (about, settled) else {
        return Err(damaged(0, "the record is cut off before its first case"));
    };
    lines.truncate(count);
    let kept = KeptRun {
        about,
        lines,
        progress,
        history,
    };
    Ok((kept, length))
}
