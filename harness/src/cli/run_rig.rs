//! Work on a rig in use: `run --rig` on a rig with ports, and `qualify`.

use super::junit::Cases;
use super::qualify::{Live, settle};
use super::run::{details, drives, line};
use super::tally::{EarlierVerdicts, Tally};
use crate::buses::commands::give_back_session as give_back;
use crate::buses::novobus::qualify::{Qualification, QualificationFacts};
use crate::buses::novobus::report::plot::plot;
use crate::buses::novobus::rig::wrong_parity;
use crate::buses::novobus::rig::{Run, Session};
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::write;
use crate::command::progress::progress_bar;
use crate::command::rig_failure::{alarm, exit_of};
use crate::counted::counted;
use crate::evidence::{AboutRun, EvidenceError, Folder, Keep, PAGE, SplitRun, size};
use crate::library::Entry;
use crate::link::{Capability, Line, Octets, Trouble};
use crate::report::pages::Head;
use crate::rig::{Keeper, PlayedScenario, Rig, SessionError, UseOptions};
use crate::scenario::run::{Outcome, Skip, Why};
use crate::signals::interrupt_flag;
use harness_proto::line::Rate;
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
    let options = UseOptions {
        purpose: job.purpose.to_owned(),
        wait: job.wait,
        allow_motion: job.allow_motion,
        ill_as_well: job.qualify,
        keeps_lines: false,
        interrupt: interrupt_flag(),
        alarm: alarm(),
    };
    let mut session = match Session::open(rig, &options) {
        Ok(session) => session,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    let mut folder = None;
    let exit = match all(
        &mut session,
        entries,
        job,
        (&mut folder, page.as_mut()),
        output,
    ) {
        Ok(exit) => exit,
        Err(EarlyEnd::Session(error)) => {
            output.complain(&error.to_string());
            exit_of(&error)
        }
        Err(EarlyEnd::Evidence(error)) => {
            output.complain(&error.to_string());
            folder = None;
            Exit::of_evidence(&error)
        }
        Err(EarlyEnd::Output(error)) => output.unwritable(&error),
    };
    let (end, exit) = give_back(session, exit, output);
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
    session: &mut Session,
    entries: &[Entry],
    job: &PlayOrder,
    (folder, page): (&mut Option<Folder>, Option<&mut Page>),
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    let needs = |entry: &Entry| {
        let plan = entry.plan.as_ref();
        plan.is_some_and(|plan| plan.needs.contains(&Capability::LineErrors))
    };
    if session.opening().is_some() && (job.qualify || entries.iter().any(needs)) {
        for why in wrong_parity::obstacles(session)? {
            output.say(&format!("{why}\n"));
        }
    }
    let mut run = match Run::new(session) {
        Ok(run) => run,
        Err(problems) => {
            output.mistakes(&problems);
            return Ok(Exit::Usage);
        }
    };
    if job.qualify {
        run.repeat();
    }
    if let Some(path) = &job.evidence {
        *folder = Some(Folder::create(path, &about(&mut run, job, entries))?);
    }
    let course = job.qualify.then(|| {
        let began = folder
            .as_ref()
            .map_or_else(String::new, |own| own.began().to_owned());
        Qualification::new(QualificationFacts::of(&mut run, began, job.thorough))
    });
    let mut course = OnRings { run, course };
    let mut exit = course_of(&mut course, entries, job, (folder.as_mut(), page), output)?;
    let OnRings { mut run, course } = course;
    if let Some(course) = course {
        let live = Live {
            run: &mut run,
            folder: folder.as_mut(),
            output,
        };
        exit = worse(exit, settle(course, live)?);
    }
    for gap in measured(&mut run) {
        output.say(&gap);
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

/// Reports the outcome of a conversation of a qualification.
pub(super) fn show(
    entry: &Entry,
    played: &PlayedScenario,
    output: &mut Output,
) -> std::io::Result<()> {
    let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
    let text = line(entry, &played.outcome, output);
    output.result(&text)?;
    output.say(&details(entry, &played.outcome, traces));
    Ok(())
}

/// A rig on which scenarios are played one after another.
pub(super) trait Course {
    /// The name of the rig.
    fn name(&mut self) -> String;

    /// Plays a scenario, into the folder where there is one, and returns its name there.
    ///
    /// # Errors
    /// Why nothing more is played.
    fn play(
        &mut self,
        entry: &Entry,
        folder: Option<&mut Folder>,
    ) -> Result<(String, PlayedScenario), EarlyEnd>;

    /// Notes what came of it.
    fn note(&mut self, entry: &Entry, name: &str, played: &PlayedScenario, output: &mut Output);

    /// Whether nothing more can or may be played; says why.
    fn over(&mut self, output: &mut Output) -> bool;
}

/// The rings of a rig, and what a qualification has found out so far.
struct OnRings<'s> {
    run: Run<'s>,
    course: Option<Qualification>,
}

impl Course for OnRings<'_> {
    fn name(&mut self) -> String {
        self.run.session().rig().id().to_owned()
    }

    fn play(
        &mut self,
        entry: &Entry,
        folder: Option<&mut Folder>,
    ) -> Result<(String, PlayedScenario), EarlyEnd> {
        play(&mut self.run, entry, folder)
    }

    fn note(&mut self, entry: &Entry, name: &str, played: &PlayedScenario, _: &mut Output) {
        // Those for another bus are no part of a qualification of this one.
        if let Some(course) = self.course.as_mut().filter(|_| entry.plan.is_some()) {
            course.note(name, played);
        }
    }

    fn over(&mut self, _: &mut Output) -> bool {
        over(&mut self.run)
    }
}

/// Plays scenarios one after another and reports each. Returns the exit code of their verdicts.
pub(super) fn course_of(
    course: &mut dyn Course,
    entries: &[Entry],
    job: &PlayOrder,
    (mut folder, mut page): (Option<&mut Folder>, Option<&mut Page>),
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    let bar = progress_bar(entries.len(), output.progress);
    let name = course.name();
    let mut cases = Cases::new(&name, job.junit.as_deref());
    let mut tally = Tally::of_named(&job.named, job.earlier.clone());
    let mut left = entries.iter();
    while let Some(entry) = left.next() {
        bar.set_message(entry.short_name().to_owned());
        let (name, played) = match course.play(entry, folder.as_deref_mut()) {
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
        course.note(entry, &name, &played, output);
        // Behind the last one nothing is cut short.
        if played.shows_an_ill_rig() || !left.as_slice().is_empty() && course.over(output) {
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
pub(super) fn play(
    run: &mut Run<'_>,
    entry: &Entry,
    folder: Option<&mut Folder>,
) -> Result<(String, PlayedScenario), EarlyEnd> {
    let own = || entry.short_name().to_owned();
    let Some(plan) = &entry.plan else {
        let outcome = Outcome::skipped(Skip::not_on_rig(entry.scenario.bus));
        let attempts = Vec::new();
        return Ok((own(), PlayedScenario { outcome, attempts }));
    };
    let Some(folder) = folder else {
        return Ok((own(), run.play(plan, None)?));
    };
    keep(entry, folder, |keeper| run.play(plan, Some(keeper)))
}

/// Plays a scenario into a folder, and returns its name there.
pub(super) fn keep(
    entry: &Entry,
    folder: &mut Folder,
    play: impl FnOnce(&mut dyn Keeper) -> Result<PlayedScenario, SessionError>,
) -> Result<(String, PlayedScenario), EarlyEnd> {
    let mut kept = folder.keep(entry.short_name(), &entry.source.text);
    let played = play(&mut kept);
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

/// Whether nothing more can or may be played.
pub(crate) fn over(run: &mut Run<'_>) -> bool {
    let session = run.session();
    session.end_if_overdue();
    session.link().trouble().is_some_and(Trouble::ends_a_run)
}

/// What a record begins with.
fn about<'r>(run: &'r mut Run<'_>, job: &'r PlayOrder, entries: &'r [Entry]) -> AboutRun<'r> {
    // Those for another bus are never begun.
    let selected = entries.iter().filter(|entry| entry.plan.is_some());
    let exactness = run.exactness();
    let way = run.way();
    let byte_time = run.session().link().byte_time();
    let capabilities = run.capabilities();
    let mut rates = Rate::ALL.into_iter();
    let rate = rates.find(|rate| rate.byte_time() == byte_time);
    AboutRun {
        rate: rate.unwrap_or_default().bits_per_second(),
        tolerance: exactness.tolerance,
        capabilities,
        anew: way.anew,
        own_rings: false,
        purpose: job.purpose,
        selected: selected.map(|entry| &*entry.source.text).collect(),
        part: job.part.as_ref(),
        keep: job.keep,
        sign: job.sign.as_deref(),
        rig: run.session().rig(),
    }
}

/// What bytes with a wrong parity bit and interposers have cost.
fn measured(run: &mut Run<'_>) -> Vec<String> {
    let Some(ports) = run.session().ports() else {
        return Vec::new();
    };
    let switches = ports.take_switches();
    let mut lines = Vec::new();
    if let Some(longest) = switches.iter().map(|switch| switch.idle).max() {
        lines.push(format!(
            "{} sent with a wrong parity bit; the line was idle for at most {:.1} ms around one\n",
            counted(switches.len(), "byte"),
            longest.as_secs_f64() * 1e3
        ));
    }
    let unknown: u64 = switches.iter().map(|switch| switch.unknown).sum();
    if unknown > 0 {
        let marked: u64 = switches.iter().map(|switch| switch.marked).sum();
        lines.push(format!(
            "{} came meanwhile or soon after, {marked} of them with an error: they are compared without their line status, since a UART has one parity \
             setting for both directions\n",
            counted(unknown, "byte")
        ));
    }
    for inner in ports.inner_links().iter().filter(|inner| inner.passes()) {
        let delay = inner.delay();
        lines.push(format!(
            "interposer: {} passed on, each delayed by a byte time and {:.3} ms (mean; {:.3} ms at most)\n",
            counted(delay.bytes, "byte"),
            delay.mean().as_secs_f64() * 1e3,
            delay.longest.as_secs_f64() * 1e3
        ));
    }
    lines
}
