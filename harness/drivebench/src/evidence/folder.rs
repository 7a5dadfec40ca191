//! The folder of a run, written as the run goes on.

use super::derive::{Settled, bare, derive, plain};
use super::error::EvidenceError;
use super::files::{
    CAPTURES, JUNIT, KNOWN_PROFILE, PAGE, RECORD, REPORT, RIG, SCENARIOS, SUMS, VERSIONS, sum, sums,
};
use super::keep::{Keep, Keeping};
use super::names::Names;
use super::part::SplitRun;
use super::record::{RecordLine, SCHEMA, Writer};
use super::signature;
use crate::bus_name::BusName;
use crate::buses::{named, report_of};
use crate::link::{Capability, LinkEvent, Sink};
use crate::rig::{Attempt, Keeper, Rig, state};
use crate::scenario::run::Outcome;
use crate::shown::{FileForm, ShownRun};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What a record begins with.
#[derive(Clone, Debug)]
pub struct AboutRun<'r> {
    pub rig: &'r Rig,
    /// Bits a second on its line.
    pub rate: u32,
    /// How exact its times are; zero where time is virtual.
    pub tolerance: Span,
    /// What the link can do.
    pub capabilities: Vec<Capability>,
    /// Whether drives are reset before each scenario.
    pub anew: bool,
    /// Whether each scenario is played on simulated rings of its own, as its text describes them.
    pub own_rings: bool,
    /// The command: `run` or `qualify`.
    pub purpose: &'static str,
    /// The texts of the scenarios that were selected, in order.
    pub selected: Vec<&'r str>,
    /// Which part of a run that was split it is; `None` for a whole run.
    pub part: Option<&'r SplitRun>,
    /// Which captures are kept.
    pub keep: Keep,
    /// The key to sign the folder with, a file of `ssh-keygen`; `None` for no signature.
    pub sign: Option<&'r Path>,
}

impl<'r> AboutRun<'r> {
    /// Of scenarios that are each played on simulated rings of their own.
    #[must_use]
    pub fn own_rings(rig: &'r Rig) -> Self {
        Self {
            rig,
            rate: Rate::default().bits_per_second(),
            tolerance: Span::ZERO,
            capabilities: named(BusName::DEFAULT).simulates.to_vec(),
            anew: false,
            own_rings: true,
            purpose: "run",
            selected: Vec::new(),
            part: None,
            keep: Keep::All,
            sign: None,
        }
    }
}

/// A folder of evidence that is being written.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    writer: Writer,
    names: Names,
    keeping: Keeping,
    /// How many captures were left out.
    left_out: usize,
    cases: Vec<Settled>,
    rig: String,
    /// When the run began, in UTC.
    began: String,
    /// The sum of the text of the last scenario.
    text: Option<String>,
    /// The key to sign it with.
    sign: Option<PathBuf>,
}

impl Folder {
    /// Begins a folder: it must not be there, or be empty.
    ///
    /// # Errors
    /// [`EvidenceError`].
    pub fn create(path: &Path, about: &AboutRun<'_>) -> Result<Self, EvidenceError> {
        about.sign.map_or(Ok(()), signature::ready)?;
        let failed = |error| EvidenceError::file(path, error);
        if fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some()) {
            return Err(EvidenceError::NotEmpty(path.display().to_string()));
        }
        for folder in ["", SCENARIOS, CAPTURES] {
            fs::create_dir_all(path.join(folder)).map_err(failed)?;
        }
        let file = fs::File::create(path.join(RECORD)).map_err(failed)?;
        let started = state::utc(SystemTime::now());
        let mut folder = Self {
            path: path.to_owned(),
            writer: Writer::new(file),
            names: about.part.map_or_else(Names::default, SplitRun::names),
            keeping: Keeping::new(about.keep),
            left_out: 0,
            cases: Vec::new(),
            rig: about.rig.id().to_owned(),
            began: started.clone(),
            text: None,
            sign: about.sign.map(Path::to_owned),
        };
        folder.write(RIG, &about.rig.text)?;
        // The profile that it names goes into the folder too, so that it stands for itself.
        if let Some(profile) = &about.rig.profile {
            folder.write(KNOWN_PROFILE, &profile.text)?;
        }
        folder.write(VERSIONS, &versions(&started))?;
        let selected = about.selected.iter().map(|text| sum(text.as_bytes()));
        let capabilities = about.capabilities.iter();
        let names = capabilities.map(|capability| capability.name().to_owned());
        folder.writer.line(&RecordLine::Run {
            schema: SCHEMA,
            drivebench: env!("CARGO_PKG_VERSION").to_owned(),
            rig: about.rig.id().to_owned(),
            rig_sha256: sum(about.rig.text.as_bytes()),
            started,
            rate: about.rate,
            rings: about.rig.sizes(),
            tolerance: about.tolerance.units(),
            simulated: about.rig.is_simulated(),
            capabilities: names.collect(),
            anew: about.anew,
            own_rings: about.own_rings,
            purpose: Some(about.purpose.to_owned()),
            selected: Some(selected.collect()),
            part: about.part.map(SplitRun::recorded),
            keep: Some(about.keep)
                .filter(|keep| *keep != Keep::All)
                .map(|keep| keep.to_string()),
        });
        folder.check()?;
        Ok(folder)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many captures were left out so far.
    #[must_use]
    pub const fn left_out(&self) -> usize {
        self.left_out
    }

    /// When the run began, as a date and time of day in UTC.
    #[must_use]
    pub fn began(&self) -> &str {
        &self.began
    }

    /// Keeps the attempts at a scenario of this name and text.
    pub fn keep<'f>(&'f mut self, name: &str, text: &'f str) -> KeptAttempts<'f> {
        let name = self.names.next(name);
        let file = format!("{SCENARIOS}/{name}.scn");
        self.text = Some(sum(text.as_bytes()));
        KeptAttempts {
            error: self.write(&file, text).err(),
            name,
            text,
            folder: self,
        }
    }

    /// Counts a scenario, all its attempts done.
    pub fn done(&mut self, name: &str, drives: &str, title: &str, outcome: &Outcome) {
        let case = RecordLine::of_case(name, title, drives, self.text.clone(), outcome);
        self.writer.line(&case);
        self.cases.extend(Settled::of(&case));
    }

    /// Adds a file of the run's own: a profile, findings.
    ///
    /// # Errors
    /// [`EvidenceError::File`].
    pub fn add(&mut self, file: &str, text: &str) -> Result<(), EvidenceError> {
        self.write(file, text)
    }

    /// Ends the folder: reports and sums.
    ///
    /// # Errors
    /// [`EvidenceError::File`].
    pub fn finish(mut self, safe: Option<bool>) -> Result<PathBuf, EvidenceError> {
        let verdicts = self.cases.iter().map(|case| case.verdict.name().to_owned());
        let verdicts = verdicts.collect();
        self.writer.line(&RecordLine::End { verdicts, safe });
        self.check()?;
        self.write(REPORT, &plain(&self.rig, &self.cases))?;
        // The verdicts and the sums are written even if the page cannot be made.
        let derived = derive(&self.path);
        let junit = match &derived {
            Ok(derived) => derived.junit.clone(),
            Err(_) => bare(&self.path, &self.rig, &self.cases),
        };
        self.write(JUNIT, &junit)?;
        let page = derived.and_then(|derived| self.write(PAGE, &derived.html));
        let sums = sums(&self.path)?;
        self.write(SUMS, &sums)?;
        if let Some(key) = &self.sign {
            signature::sign(&self.path, key)?;
        }
        page.map(|()| self.path)
    }

    /// Written beside and then renamed: a file is there whole or not at all.
    fn write(&self, file: &str, text: &str) -> Result<(), EvidenceError> {
        let path = self.path.join(file);
        let beside = self.path.join(format!("{file}.part"));
        let written = fs::write(&beside, text).and_then(|()| fs::rename(&beside, &path));
        written.map_err(|error| EvidenceError::file(&path, error))
    }

    fn check(&mut self) -> Result<(), EvidenceError> {
        match self.writer.failed() {
            None => Ok(()),
            Some(error) => Err(EvidenceError::File {
                path: self.path.join(RECORD).display().to_string(),
                error,
            }),
        }
    }
}

/// Attempts at one scenario, on their way into a folder.
#[derive(Debug)]
pub struct KeptAttempts<'f> {
    folder: &'f mut Folder,
    name: String,
    text: &'f str,
    error: Option<EvidenceError>,
}

impl KeptAttempts<'_> {
    /// Its name in the folder, once all attempts are kept.
    ///
    /// # Errors
    /// The first file that could not be written.
    pub fn finish(mut self) -> Result<String, EvidenceError> {
        match self.error.take() {
            Some(error) => Err(error),
            None => self.folder.check().map(|()| self.name),
        }
    }

    fn note(&mut self, result: Result<(), EvidenceError>) {
        if let Err(error) = result {
            self.error.get_or_insert(error);
        }
    }
}

impl Sink for KeptAttempts<'_> {
    fn take(&mut self, event: &LinkEvent) {
        self.folder.writer.take(event);
    }
}

impl Keeper for KeptAttempts<'_> {
    fn begins(&mut self, attempt: usize) {
        let line = RecordLine::of_scenario(&self.name, self.text, attempt);
        self.folder.writer.line(&line);
    }

    fn ends(&mut self, number: usize, attempt: &Attempt) {
        self.folder.writer.line(&RecordLine::of_verdict(attempt));
        let verdict = attempt.outcome.verdict.name();
        if !self.folder.keeping.keeps(verdict) {
            self.folder.left_out += 1;
            return;
        }
        let file = format!("{CAPTURES}/{}.{number}.json", self.name);
        let capture = capture(&attempt.traces, &attempt.outcome);
        let written = self.folder.write(&file, &capture);
        self.note(written);
    }
}

/// What the links carried and what was recorded, as a text.
pub(super) fn capture(traces: &[Trace], outcome: &Outcome) -> String {
    let mut capture = Vec::new();
    // Writing to a Vec cannot fail.
    let shown = ShownRun {
        title: "",
        traces,
        records: &outcome.records,
        rate: Rate::default(),
    };
    let _infallible = report_of(traces).write(&shown, FileForm::Json, &mut capture);
    String::from_utf8_lossy(&capture).into_owned()
}

fn versions(started: &str) -> String {
    let read = |path| fs::read_to_string(path).unwrap_or_default();
    let kernel = read("/proc/sys/kernel/osrelease");
    let value = serde_json::json!({
        "schema": 1,
        "drivebench": env!("CARGO_PKG_VERSION"),
        "os": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
        "kernel": kernel.trim(),
        "started": started,
    });
    format!("{value:#}\n")
}
