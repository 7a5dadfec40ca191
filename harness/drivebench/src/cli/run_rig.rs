//! Work on a rig in use: `run --rig` on a rig with ports, and `qualify`.

use super::junit::Cases;
use super::run::{details, drives, line};
use super::tally::{EarlierVerdicts, Tally};
use crate::buses::run_on;
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::write;
use crate::command::progress::progress_bar;
use crate::command::rig_failure::{alarm, exit_of_end, tell_end, tell_session};
use crate::counted::counted;
use crate::evidence::{
    AboutRun, DEVIATIONS, EvidenceError, Folder, Keep, PAGE, PROFILE, SplitRun, size,
};
use crate::library::Entry;
use crate::link::Capability;
use crate::report::plot::plot;
use crate::rig::playing::{Play, QualificationKeeper, QualificationStopped, RigRun};
use crate::rig::{Keeper, PlayedScenario, Rig, SessionError, UseOptions};
use crate::scenario::run::{Outcome, Why};
use crate::scenario::source::Source;
use crate::shown::Head;
use crate::signals::interrupt_flag;
use std::path::PathBuf;
use std::time::Duration;

/// What is to be done.
pub(crate) struct PlayOrder {
    pub(crate) purpose: &'static str,
    /// The scenarios, files and folders that the user named, where a denied one is wrong usage.
    pub(crate) named: Vec<PathBuf>,
    pub(crate) allow_motion: bool,
    pub(crate) wait: Duration,
    pub(crate) evidence: Option<PathBuf>,
    pub(crate) records: bool,
    pub(crate) require_all: bool,
    /// Where the verdicts go as JUnit's XML, beside the evidence.
    pub(crate) junit: Option<PathBuf>,
    /// Also settle what the manual leaves open, and name the deviations.
    pub(crate) qualify: bool,
    /// Play the long conversations of a qualification, too.
    pub(crate) thorough: bool,
    /// The key to sign the evidence with.
    pub(crate) sign: Option<PathBuf>,
    /// Which part of a run that is split it is.
    pub(crate) part: Option<SplitRun>,
    /// Which captures the evidence keeps.
    pub(crate) keep: Keep,
    /// What earlier runs have shown of the scenarios that are not played again.
    pub(crate) earlier: EarlierVerdicts,
}

/// Why work ends early.
pub(crate) enum EarlyEnd {
    Session(SessionError),
    Evidence(EvidenceError),
    Output(std::io::Error),
}

impl From<SessionError> for EarlyEnd {
    fn from(error: SessionError) -> Self {
        Self::Session(error)
    }
}

impl From<EvidenceError> for EarlyEnd {
    fn from(error: EvidenceError) -> Self {
        Self::Evidence(error)
    }
}

impl From<std::io::Error> for EarlyEnd {
    fn from(error: std::io::Error) -> Self {
        Self::Output(error)
    }
}

/// Does it, and gives the rig back in its safe state.
pub(crate) fn work(
    rig: &Rig,
    entries: &[Entry],
    job: &PlayOrder,
    mut page: Option<Page>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let needs = |entry: &Entry| entry.settled.needs().contains(&Capability::LineErrors);
    let options = UseOptions {
        purpose: job.purpose.to_owned(),
        wait: job.wait,
        allow_motion: job.allow_motion,
        ill_as_well: job.qualify,
        tries_line_errors: job.qualify || entries.iter().any(needs),
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..UseOptions::default()
    };
    let mut run = match run_on(rig, &options) {
        Ok(run) => run,
        Err(error) => return Ok(tell_session(&error, output)),
    };
    let mut folder = None;
    let exit = match all(
        rig,
        &mut *run,
        entries,
        job,
        &mut folder,
        page.as_mut(),
        output,
    ) {
        Ok(exit) => exit,
        Err(EarlyEnd::Session(error)) => tell_session(&error, output),
        Err(EarlyEnd::Evidence(error)) => {
            output.complain(&error.to_string());
            folder = None;
            Exit::of_evidence(&error)
        }
        Err(EarlyEnd::Output(error)) => output.unwritable(&error),
    };
    let exit = exit_of_end(run.trouble().as_ref(), exit, output);
    let end = run.close(matches!(exit, Exit::RigError | Exit::Interlock));
    let exit = tell_end(&end, exit, output);
    let safe = end.safe.as_ref().map(|_| exit != Exit::NotSafe);
    Ok(match reports(rig, folder, page, safe, output) {
        true => exit,
        false => exit.with_rig_error(),
    })
}

/// From this estimate on the size of the evidence is stated before the run, in bytes.
const LARGE: u64 = 200_000_000;

/// A size in megabytes.
fn megabytes(bytes: u64) -> String {
    let tenths = bytes.div_ceil(100_000);
    format!("{}.{} MB", tenths / 10, tenths % 10)
}

/// States before a run how large the captures of these scenarios may become, where `--keep` is given or where they may become large.
pub(super) fn state_size<'e>(
    played: impl Iterator<Item = &'e Entry>,
    job: &PlayOrder,
    output: &mut Output,
) {
    let Some(path) = &job.evidence else { return };
    let estimate = job.keep.estimate(played);
    let beside = match job.keep {
        Keep::All if estimate < LARGE => return,
        Keep::All => "; --keep 10 keeps those of every tenth attempt that passes",
        _ => ", and those of attempts that do not pass",
    };
    output.say(&format!(
        "captures in {}: about {} (an estimate){beside}\n",
        path.display(),
        megabytes(estimate)
    ));
}

/// Ends the folder and writes the page. Returns false after reporting a failure. A run with a folder writes the folder's page.
pub(crate) fn reports(
    rig: &Rig,
    folder: Option<Folder>,
    page: Option<Page>,
    safe: Option<bool>,
    output: &mut Output,
) -> bool {
    let Some(folder) = folder else {
        let head = Head {
            found: Vec::new(),
            title: "drivebench: scenarios on a rig",
            facts: vec![("Rig", rig.id().to_owned())],
        };
        return page.is_none_or(|page| page.write(&head, output));
    };
    let left_out = folder.left_out();
    match folder.finish(safe) {
        Ok(path) => {
            output.say(&format!("evidence in {}\n", path.display()));
            if left_out > 0 {
                let count = counted(left_out, "capture");
                let (all, captures) = size(&path);
                let (all, captures) = (megabytes(all), megabytes(captures));
                output.say(&format!(
                    "{all}, {captures} of them captures; {count} left out\n"
                ));
            }
            let Some(page) = page else { return true };
            match std::fs::read_to_string(path.join(PAGE)) {
                Ok(text) => write(page.path(), &text, output),
                Err(error) => {
                    output.complain(&format!("failed to read the folder's {PAGE}: {error}"));
                    false
                }
            }
        }
        Err(error) => {
            output.complain(&error.to_string());
            false
        }
    }
}

fn all(
    rig: &Rig,
    run: &mut dyn RigRun,
    entries: &[Entry],
    job: &PlayOrder,
    folder: &mut Option<Folder>,
    page: Option<&mut Page>,
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    for why in run.obstacles()? {
        output.say(&format!("{why}\n"));
    }
    if let Some(path) = &job.evidence {
        let segment = run.segment();
        let about = AboutRun {
            rig,
            rate: segment.rate,
            tolerance: segment.tolerance,
            capabilities: segment.capabilities,
            anew: segment.anew,
            own_rings: false,
            purpose: job.purpose,
            selected: entries.iter().map(|entry| &*entry.source.text).collect(),
            part: job.part.as_ref(),
            keep: job.keep,
            sign: job.sign.as_deref(),
        };
        *folder = Some(Folder::create(path, &about)?);
    }
    let mut exit = selected(rig, &mut *run, entries, job, folder.as_mut(), page, output)?;
    if job.qualify {
        exit = worse(exit, qualify(rig, &mut *run, job, folder.as_mut(), output)?);
    }
    for line in run.measured() {
        output.say(&line);
    }
    Ok(exit)
}

/// The exit code of a qualification, with that of its scenarios: what a drive does wrong is the drive's fault, whatever the outcome.
pub(super) fn worse(scenarios: Exit, all: Exit) -> Exit {
    match (scenarios, all) {
        // What is not settled takes no failure back.
        (_, Exit::Failed) | (Exit::Failed, Exit::Incomplete) => Exit::Failed,
        _ => scenarios.max(all),
    }
}

/// Plays the selected scenarios one after another and reports each. Returns the exit code of their verdicts.
fn selected(
    rig: &Rig,
    run: &mut dyn RigRun,
    entries: &[Entry],
    job: &PlayOrder,
    mut folder: Option<&mut Folder>,
    mut page: Option<&mut Page>,
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    let bar = progress_bar(entries.len(), output.progress);
    let mut cases = Cases::new(rig.id(), job.junit.as_deref());
    let mut tally = Tally::of_named(&job.named, job.earlier.clone());
    let mut left = entries.iter();
    while let Some(entry) = left.next() {
        bar.set_message(entry.short_name().to_owned());
        let mut play = |keeper: Option<&mut dyn Keeper>| run.play(&entry.source, keeper);
        let (name, played) = match keep(entry, folder.as_deref_mut(), &mut play) {
            Err(EarlyEnd::Session(error)) => {
                cases.note(entry, &Outcome::rig_error(error.to_string()), &[]);
                cases.write(Exit::RigError, output);
                return Err(EarlyEnd::Session(error));
            }
            played => played?,
        };
        let outcome = &played.outcome;
        let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
        tally.note(entry, outcome);
        cases.note(entry, outcome, traces);
        let mut text = line(entry, outcome, output);
        if job.records || entries.len() == 1 {
            text.extend(outcome.records.iter().map(plot));
        }
        bar.suspend(|| output.result(&text))?;
        let told = details(entry, outcome, traces);
        bar.suspend(|| output.say(&told));
        if let (Some(page), None) = (&mut page, &folder) {
            page.add(entry, outcome, traces);
        }
        bar.inc(1);
        run.note(&name, &played);
        for note in run.notes() {
            output.say(&format!("  note: {note}\n"));
        }
        // Behind the last one nothing is cut short.
        let more = !left.as_slice().is_empty();
        if played.shows_an_ill_rig() || more && run.is_over(&mut |why| output.complain(why)) {
            break;
        }
    }
    bar.finish_and_clear();
    for entry in left {
        let outcome = Outcome::skipped(Why::RunEnded.into());
        tally.not_reached(entry, &outcome);
        cases.note(entry, &outcome, &[]);
    }
    output.result(&tally.summary())?;
    Ok(cases.write(tally.exit(job.require_all), output))
}

/// Plays a scenario, into the folder where there is one, and returns its name there.
fn keep(
    entry: &Entry,
    folder: Option<&mut Folder>,
    play: &mut Play<'_>,
) -> Result<(String, PlayedScenario), EarlyEnd> {
    let Some(folder) = folder else {
        return Ok((entry.short_name().to_owned(), play(None)?));
    };
    let mut kept = folder.keep(entry.short_name(), &entry.source.text);
    let played = play(Some(&mut kept));
    let name = kept.finish()?;
    let lost;
    let outcome = match &played {
        Ok(played) => &played.outcome,
        Err(error) => {
            lost = Outcome::rig_error(error.to_string());
            &lost
        }
    };
    folder.done(&name, &drives(entry), &entry.scenario.title, outcome);
    Ok((name, played?))
}

/// Plays what a qualification plays behind the selected scenarios, and writes what all of it comes to.
fn qualify(
    rig: &Rig,
    run: &mut dyn RigRun,
    job: &PlayOrder,
    folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    let mut shell = QualificationShell {
        rig,
        folder,
        output,
        end: None,
    };
    let qualified = run.qualify(job.thorough, &mut shell);
    let QualificationShell {
        folder,
        output,
        end,
        ..
    } = shell;
    let qualified = match (qualified, end) {
        (Ok(qualified), _) => qualified,
        (Err(QualificationStopped), Some(end)) => return Err(end),
        (Err(QualificationStopped), None) => return Ok(Exit::RigError),
    };
    if let Some(folder) = folder {
        if let Some(profile) = &qualified.profile {
            folder.add(PROFILE, profile)?;
        }
        folder.add(DEVIATIONS, &qualified.deviations)?;
    }
    output.result(&qualified.deviations)?;
    Ok(Exit::of(&[qualified.verdict], false))
}

/// Keeps and shows what a qualification plays.
struct QualificationShell<'s> {
    rig: &'s Rig,
    folder: Option<&'s mut Folder>,
    output: &'s mut Output,
    /// Why it was stopped.
    end: Option<EarlyEnd>,
}

impl QualificationShell<'_> {
    fn entry(&mut self, source: &Source) -> Result<Entry, QualificationStopped> {
        let drives = Some(self.rig.ring_size()).filter(|size| *size > 0);
        Entry::fitting(source.clone(), drives).map_err(|problems| {
            self.output.mistakes(&problems);
            QualificationStopped
        })
    }

    fn unless<T>(
        &mut self,
        done: Result<T, impl Into<EarlyEnd>>,
    ) -> Result<T, QualificationStopped> {
        done.map_err(|why| {
            self.end = Some(why.into());
            QualificationStopped
        })
    }
}

impl QualificationKeeper for QualificationShell<'_> {
    fn began(&self) -> String {
        let folder = self.folder.as_ref();
        folder.map_or_else(String::new, |folder| folder.began().to_owned())
    }

    fn play(
        &mut self,
        source: &Source,
        play: &mut Play<'_>,
    ) -> Result<PlayedScenario, QualificationStopped> {
        let entry = self.entry(source)?;
        let done = keep(&entry, self.folder.as_deref_mut(), play);
        self.unless(done).map(|(_, played)| played)
    }

    fn show(
        &mut self,
        source: &Source,
        played: &PlayedScenario,
    ) -> Result<(), QualificationStopped> {
        let entry = self.entry(source)?;
        let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
        let text = line(&entry, &played.outcome, self.output);
        self.tell(&text)?;
        self.say(&details(&entry, &played.outcome, traces));
        Ok(())
    }

    fn tell(&mut self, text: &str) -> Result<(), QualificationStopped> {
        let done = self.output.result(text);
        self.unless(done)
    }

    fn say(&mut self, text: &str) {
        self.output.say(text);
    }

    fn complain(&mut self, why: &str) {
        self.output.complain(why);
    }
}
