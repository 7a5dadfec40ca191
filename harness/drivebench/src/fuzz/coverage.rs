//! Which transitions of a drive's end of the bus (ND21 9.1-9.9) the kept inputs reach, and which were reached on hardware; and what
//! the inputs of each target reach, summed up.

use super::input::{InputError, input};
use super::noting;
use harness_sim::fuzz::{Feature, Noting, features};
use harness_sim::novobus::fuzz::{WATCHING, of_cell};
use harness_sim::novobus::transitions::{
    CELLS, Event, RULES, Reached, State, Transition, why_unreachable,
};
use include_dir::{Dir, include_dir};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// The inputs that the binary carries.
static CORPUS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/fuzz");

/// What was reached on hardware.
const HARDWARE: &str = include_str!("../../../../corpora/fuzz/hardware.toml");

/// The largest input file that is read, in bytes.
const MAX_SIZE: u64 = 1 << 20;

/// Maximum number of files read from a folder.
const MAX_FILES: usize = 100_000;

/// Why there is no coverage.
#[derive(Debug, thiserror::Error)]
pub enum CoverageError {
    /// A folder or file cannot be read.
    #[error(
        "failed to read {name}: {error}; a corpus is a folder with a folder for each target, and inputs in these"
    )]
    Unreadable {
        /// The path of the folder or file.
        name: String,
        /// The system's error.
        error: std::io::Error,
    },
    /// A file cannot be written.
    #[error("failed to write {name}: {error}")]
    Unwritable {
        /// The path of the file.
        name: String,
        /// The system's error.
        error: std::io::Error,
    },
    /// A file that no input can be, or more files than are taken.
    #[error("{name} is too large: an input has at most 1 MiB, a folder 100000 files")]
    TooLarge {
        /// The path of the file or folder.
        name: String,
    },
    /// A file is no input.
    #[error("failed to read {name}: {error}")]
    Input {
        /// The path of the file.
        name: String,
        /// What is wrong with it.
        error: InputError,
    },
    /// An input breaks a rule of the manual; the panic before this says which.
    #[error("{name} breaks a rule, see above; `cargo test --test bus corpora` plays it too")]
    Rule {
        /// The path of the file.
        name: String,
    },
    /// There is no input.
    #[error("the corpus is empty: no folder of a target holds an input")]
    Empty,
    /// The list of what was reached on hardware is damaged.
    #[error("corpora/fuzz/hardware.toml: {0}")]
    Hardware(String),
}

/// An input, and how much it reaches.
#[derive(Clone, Debug)]
pub struct InputReach {
    /// Target and file name.
    pub name: String,
    /// The transitions that it reaches.
    pub reached: Reached,
}

/// What the inputs of a target reach.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Sum {
    pub target: &'static str,
    /// How many inputs it has.
    pub inputs: usize,
    /// How many bytes these have.
    pub bytes: usize,
    /// How many features they reach together; of a target that feeds drives raw bytes these are transitions of the matrix.
    pub reached: usize,
    /// How many there are, where that is known.
    pub of: Option<usize>,
}

/// What a corpus reaches.
#[derive(Clone, Debug)]
pub struct Coverage {
    /// Each input of the targets that feed drives raw bytes, in order of names.
    pub files: Vec<InputReach>,
    /// Each target that has inputs, in order of names.
    pub targets: Vec<Sum>,
    /// What the inputs reach together.
    pub corpus: Reached,
    /// What was reached on hardware.
    pub hardware: Reached,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HardwareList {
    #[serde(default)]
    reached: Vec<HardwareEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HardwareEntry {
    state: String,
    event: String,
    /// The evidence: the run in which it was seen.
    run: String,
}

impl Coverage {
    /// Plays the inputs that the binary carries.
    ///
    /// # Errors
    /// One of them is none, or breaks a rule.
    pub fn committed() -> Result<Self, CoverageError> {
        let mut files = Vec::new();
        for target in noting() {
            let folder = CORPUS.get_dir(target.name);
            for file in folder.iter().flat_map(|folder| folder.files()) {
                files.push((file.path().display().to_string(), file.contents().to_vec()));
            }
        }
        Self::of(files)
    }

    /// Plays the inputs of a folder that has a folder for each target; one that is missing holds nothing.
    ///
    /// # Errors
    /// It cannot be read, holds no input, or one breaks a rule.
    pub fn of_folder(folder: &Path) -> Result<Self, CoverageError> {
        let mut files = Vec::new();
        std::fs::read_dir(folder).map_err(unreadable(folder))?;
        for Noting { name, .. } in noting() {
            let inner = folder.join(name);
            if inner.is_dir() {
                let inputs = read_folder(&inner)?.into_iter();
                files.extend(inputs.map(|(file, content)| (format!("{name}/{file}"), content)));
            }
        }
        Self::of(files)
    }

    /// Plays inputs, each with `TARGET/FILE` as its name.
    fn of(mut inputs: Vec<(String, Vec<u8>)>) -> Result<Self, CoverageError> {
        inputs.sort();
        let mut files = Vec::new();
        let mut corpus = Reached::default();
        let mut tallies: Vec<_> = noting().map(CoverageTally::new).collect();
        tallies.sort_by_key(|tally| tally.target.name);
        for (name, content) in inputs {
            let target = name.split('/').next().unwrap_or_default();
            let tally = tallies.iter_mut().find(|tally| tally.target.name == target);
            let Some(tally) = tally else { continue };
            let data = input(&name, &content).map_err(|error| CoverageError::Input {
                name: name.clone(),
                error,
            })?;
            let played = std::panic::catch_unwind(|| play(&tally.target, &data));
            let Ok((reached, features)) = played else {
                return Err(CoverageError::Rule { name });
            };
            tally.add(data.len(), features);
            if let Some(reached) = reached {
                corpus.join(&reached);
                files.push(InputReach { name, reached });
            }
        }
        if tallies.iter().all(|tally| tally.inputs == 0) {
            return Err(CoverageError::Empty);
        }
        Ok(Self {
            files,
            targets: tallies.iter().filter_map(CoverageTally::sum).collect(),
            corpus,
            hardware: hardware(HARDWARE)?,
        })
    }

    /// Those of the reachable cells that no input reaches.
    #[must_use]
    pub fn missing(&self) -> Vec<Transition> {
        let missing = |cell: &Transition| !self.corpus.contains(*cell);
        Transition::reachable().filter(missing).collect()
    }

    /// How many percent of the reachable cells a set holds, rounded down to a tenth: 100.0 means all.
    #[must_use]
    pub fn percent(reached: &Reached) -> f64 {
        let all = Transition::reachable().count();
        let tenths = reached.count() * 1_000 / all.max(1);
        f64::from(u32::try_from(tenths).unwrap_or(0)) / 10.0
    }

    /// The matrix as a page: a row a state, a column an event, then what the signs mean, and the sums.
    #[must_use]
    pub fn page(&self) -> String {
        let mut text = String::from(
            "Transitions of a drive's end of the bus (ND21 9.1-9.9): a row a state, a column an event\n\n",
        );
        self.rows(&mut text);
        text.push_str(
            "\n#  reached by the corpus       @  and on hardware       h  on hardware only       -  missing\n\
             a letter: nothing can reach it, because\n",
        );
        // Writing to a String cannot fail.
        for (letter, rule) in ('a'..).zip(&RULES) {
            let (section, reason) = (rule.section, rule.reason);
            let _infallible = writeln!(text, "{letter}  {section:5} {reason}");
        }
        text.push_str("\nEvents\n");
        for event in Event::ALL {
            let (number, section, name) = (event.index() + 1, event.section(), event.name());
            let _infallible = writeln!(text, "{number:2} {section:5} {name}");
        }
        text.push('\n');
        text.push_str(&self.sums());
        text.push('\n');
        text.push_str(&self.targets());
        text
    }

    /// A row a target: its inputs, their bytes, and what they reach.
    #[must_use]
    pub fn targets(&self) -> String {
        let mut text = String::from("target            inputs    bytes  reached\n");
        for sum in &self.targets {
            let of = sum.of.map(|of| format!(" of {of}")).unwrap_or_default();
            let Sum {
                target,
                inputs,
                bytes,
                reached,
                ..
            } = sum;
            let _infallible = writeln!(text, "{target:16}{inputs:8}{bytes:9}  {reached}{of}");
        }
        text
    }

    fn rows(&self, text: &mut String) {
        let heading: String = (1..=Event::ALL.len()).map(|n| format!("{n:3}")).collect();
        let _infallible = writeln!(text, "{:68}{heading}", "");
        for state in State::ALL.iter().copied() {
            let sign = |event: &Event| format!("  {}", self.sign(state, *event));
            let signs: String = Event::ALL.iter().map(sign).collect();
            let _infallible = writeln!(text, "{:5} {:62}{signs}", state.section(), state.name());
        }
    }

    fn sign(&self, state: State, event: Event) -> char {
        let cell = Transition { state, event };
        if let Some(rule) = why_unreachable(cell) {
            let place = RULES.iter().position(|one| std::ptr::eq(one, rule));
            return place.and_then(|n| ('a'..='z').nth(n)).unwrap_or('?');
        }
        match (self.corpus.contains(cell), self.hardware.contains(cell)) {
            (true, false) => '#',
            (true, true) => '@',
            (false, true) => 'h',
            (false, false) => '-',
        }
    }

    /// The sums, and every cell that is missing.
    #[must_use]
    pub fn sums(&self) -> String {
        let all = Transition::reachable().count();
        let line = |reached: &Reached| {
            let percent = Self::percent(reached);
            format!("{} of {all} reachable ({percent:.1} %)", reached.count())
        };
        let nothing = if self.hardware.count() == 0 {
            "; nothing has been played on hardware yet"
        } else {
            ""
        };
        let mut text = format!(
            "cells                {CELLS}: {} states, {} events\nunreachable          {}, each with its reason\n\
             reached by corpus    {}, {} inputs\nreached on hardware  {}{nothing}\n",
            State::ALL.len(),
            Event::ALL.len(),
            CELLS - all,
            line(&self.corpus),
            self.files.len(),
            line(&self.hardware),
        );
        for cell in self.missing() {
            let _infallible = writeln!(text, "missing              {cell}");
        }
        text
    }
}

/// What a target's inputs reach, as far as they have been played.
struct CoverageTally {
    target: Noting,
    inputs: usize,
    bytes: usize,
    reached: BTreeSet<Feature>,
}

impl CoverageTally {
    const fn new(target: Noting) -> Self {
        Self {
            target,
            inputs: 0,
            bytes: 0,
            reached: BTreeSet::new(),
        }
    }

    fn add(&mut self, bytes: usize, reached: BTreeSet<Feature>) {
        self.inputs += 1;
        self.bytes += bytes;
        self.reached.extend(reached);
    }

    fn sum(&self) -> Option<Sum> {
        (self.inputs > 0).then(|| Sum {
            target: self.target.name,
            inputs: self.inputs,
            bytes: self.bytes,
            reached: self.reached.len(),
            of: self.target.of.map(|count| count()),
        })
    }
}

/// Plays an input once: the cells of the matrix, where its target feeds drives raw bytes, and what it reaches.
fn play(target: &Noting, data: &[u8]) -> (Option<Reached>, BTreeSet<Feature>) {
    let watching = WATCHING.iter().find(|(name, _)| *name == target.name);
    let Some((_, body)) = watching else {
        return (None, features(target.body, data));
    };
    let reached = body(data);
    let cells = Transition::reachable().filter(|cell| reached.contains(*cell));
    let features = cells.map(of_cell).collect();
    (Some(reached), features)
}

/// The files of a folder with their names, in order of these; folders in it are left out.
pub(crate) fn read_folder(folder: &Path) -> Result<Vec<(String, Vec<u8>)>, CoverageError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable(folder))? {
        let path = entry.map_err(unreadable(folder))?.path();
        let metadata = path.metadata().map_err(unreadable(&path))?;
        if !metadata.is_file() {
            continue;
        }
        if metadata.len() > MAX_SIZE || files.len() >= MAX_FILES {
            let name = path.display().to_string();
            return Err(CoverageError::TooLarge { name });
        }
        let content = std::fs::read(&path).map_err(unreadable(&path))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        files.push((file.into_owned(), content));
    }
    files.sort();
    Ok(files)
}

fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> CoverageError + use<> {
    let name = path.display().to_string();
    move |error| CoverageError::Unreadable { name, error }
}

/// Reads the list of what was reached on hardware.
fn hardware(text: &str) -> Result<Reached, CoverageError> {
    let list: HardwareList =
        toml::from_str(text).map_err(|error| CoverageError::Hardware(error.to_string()))?;
    let mut reached = Reached::default();
    for HardwareEntry { state, event, run } in list.reached {
        let wrong = |what: &str| {
            CoverageError::Hardware(format!(
                "`{state}`, `{event}`: {what}; `drivebench fuzz coverage` shows the names"
            ))
        };
        let cell = Transition {
            state: State::from_name(&state).ok_or_else(|| wrong("no such state"))?,
            event: Event::from_name(&event).ok_or_else(|| wrong("no such event"))?,
        };
        if why_unreachable(cell).is_some() {
            return Err(wrong("the matrix says that nothing can reach it"));
        }
        if run.is_empty() {
            return Err(wrong("names no run that shows it"));
        }
        reached.add(cell);
    }
    Ok(reached)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(state: &str, event: &str, run: &str) -> Result<Reached, CoverageError> {
        hardware(&format!(
            "[[reached]]\nstate = \"{state}\"\nevent = \"{event}\"\nrun = \"{run}\"\n"
        ))
    }

    #[test]
    fn hardware_is_a_checked_list() {
        assert_eq!(hardware("").expect("empty").count(), 0);
        let one = list("command byte due", "zero", "lab-1").expect("a cell");
        assert_eq!(one.count(), 1);
        for (state, event, run, says) in [
            ("command due", "zero", "lab-1", "no such state"),
            ("command byte due", "nought", "lab-1", "no such event"),
            ("command byte due", "SYNCO", "lab-1", "nothing can reach"),
            ("command byte due", "zero", "", "no run"),
        ] {
            let error = list(state, event, run).expect_err(says).to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
