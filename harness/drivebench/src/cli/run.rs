//! `drivebench run`.

use super::args::{RunArguments, Selection};
use super::junit::Cases;
use super::run_rig::{PlayOrder, reports, state_size, work};
use super::tally::{EarlierVerdicts, Tally};
use crate::buses::{bus_of, find_any_rig, is_bare};
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::writable;
use crate::command::play::{PlayedOnce, play_entry};
use crate::command::progress::progress_bar;
use crate::counted::counted;
use crate::evidence::{AboutRun, Earlier, EvidenceError, Folder, SplitRun, too_large};
use crate::library::Entry;
use crate::library::finding::explain;
use crate::link::Recording;
use crate::report::plot::plot;
use crate::rig::{Attempt, Keeper, Rig};
use crate::scenario::files::{LibraryError, is_named, sources};
use crate::scenario::problem::Problems;
use crate::scenario::run::{AtMismatch, Outcome};
use crate::scenario::source::Source;
use crate::shown::Head;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// Reads every scenario selected; the size of a rig's ring is taken where the scenario allows it.
///
/// # Errors
/// The first file that is not there, or the mistakes of every scenario that has some.
pub(crate) fn select(
    selection: &Selection,
    ring: Option<u8>,
) -> Result<Vec<Entry>, Vec<LibraryError>> {
    select_by(selection, |source| Entry::fitting(source, ring))
}

/// Reads every scenario selected, for rings of the size that the user asked for. A scenario that was named itself must allow it; one of a
/// folder or of all that does not is played on a ring of its own size.
fn select_of_size(selection: &Selection, ring: u8) -> Result<Vec<Entry>, Vec<LibraryError>> {
    select_by(selection, |source| {
        match is_named(&selection.paths, &source.name) {
            true => Entry::new(source, Some(ring)),
            false => Entry::fitting(source, Some(ring)),
        }
    })
}

fn select_by(
    selection: &Selection,
    read: impl Fn(Source) -> Result<Entry, Box<Problems>>,
) -> Result<Vec<Entry>, Vec<LibraryError>> {
    let mut sources = sources(&selection.paths).map_err(|error| vec![error])?;
    // Built-in scenarios have no mistakes to report, so those that cannot match need not be read.
    if let (true, Some(text)) = (selection.paths.is_empty(), &selection.filter) {
        sources.retain(|source| may_match(source, text));
    }
    let mut entries = Vec::new();
    let mut errors: Vec<LibraryError> = Vec::new();
    for source in sources {
        match read(source) {
            Ok(entry) => entries.push(entry),
            Err(problems) => errors.push(problems.into()),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    if let Some(text) = &selection.filter {
        entries.retain(|entry| entry.matches(text));
    }
    Ok(entries)
}

/// Whether [`Entry::matches`] can hold: titles and sources stand in the text, with any white space between their words.
fn may_match(source: &Source, filter: &str) -> bool {
    let places = [source.name.to_lowercase(), source.text.to_lowercase()];
    let filter = filter.to_lowercase();
    filter
        .split_whitespace()
        .all(|word| places.iter().any(|place| place.contains(word)))
}

/// The scenarios for the bus of a rig; says how many others were selected.
pub(crate) fn of_rig(mut entries: Vec<Entry>, rig: &Rig, output: &mut Output) -> Vec<Entry> {
    let bus = bus_of(rig).name;
    let all = entries.len();
    entries.retain(|entry| entry.scenario.bus == bus);
    let left_out = all - entries.len();
    if left_out > 0 {
        let count = counted(left_out, "scenario");
        output.say(&format!(
            "left out, for other buses than the rig's: {count}\n"
        ));
    }
    entries
}

/// The rig and the scenarios of a run.
struct RunSelection {
    rig: Option<Rig>,
    entries: Vec<Entry>,
    part: Option<SplitRun>,
    earlier: EarlierVerdicts,
}

impl RunSelection {
    /// The rig, if it is more than a number of drives.
    fn in_use(&self) -> Option<&Rig> {
        self.rig.as_ref().filter(|rig| !is_bare(rig))
    }
}

/// Reads the rig and the scenarios that the filter selects; those for other buses are left out. The exit code where there is nothing to play,
/// which has been reported.
fn read_rig_and_scenarios(
    arguments: &RunArguments,
    output: &mut Output,
) -> Result<(Option<Rig>, Vec<Entry>), Exit> {
    let rig = match arguments.rig.as_deref() {
        None => None,
        Some(name) => Some(find_any_rig(name, output).ok_or(Exit::Usage)?),
    };
    let size = rig.as_ref().map(Rig::ring_size).filter(|size| *size > 0);
    let selected = match arguments.ring {
        Some(asked) => select_of_size(&arguments.selection, asked),
        None => select(&arguments.selection, size),
    };
    let entries = selected.map_err(|errors| {
        errors.iter().for_each(|error| output.library_error(error));
        output.say("nothing was played\n");
        Exit::Usage
    })?;
    let entries = match rig.as_ref().filter(|rig| !is_bare(rig)) {
        Some(rig) => of_rig(entries, rig, output),
        None => entries,
    };
    if entries.is_empty() {
        output.complain("no scenario was selected; `drivebench list` shows what there is");
        return Err(Exit::NothingSelected);
    }
    Ok((rig, entries))
}

/// Chooses what is played of the selected scenarios: what no earlier run has shown, and of this the part. The exit code where there is
/// nothing to play, which has been reported.
fn choose(arguments: &RunArguments, output: &mut Output) -> Result<RunSelection, Exit> {
    let (rig, mut entries) = read_rig_and_scenarios(arguments, output)?;
    let none = Cases::new(
        rig.as_ref().map_or("sim", Rig::id),
        arguments.junit.as_deref(),
    );
    let mut earlier = EarlierVerdicts::default();
    if let Some(rig) = rig.as_ref().filter(|_| !arguments.rerun.is_empty()) {
        let known = Earlier::read(&arguments.rerun, rig).map_err(|error| {
            output.complain(&error.to_string());
            Exit::of_evidence(&error)
        })?;
        (entries, earlier) = EarlierVerdicts::of(&known, entries);
        if entries.is_empty() {
            output.say(&earlier.to_string());
            let exit = Tally::after(earlier).exit(arguments.require_all);
            return Err(none.write(exit, output));
        }
    }
    let filter = arguments.selection.filter.as_deref();
    let named = &arguments.selection.paths;
    let part = arguments.partition.map(|partition| {
        SplitRun::new(partition, filter, &entries, |entry| {
            is_named(named, &entry.name)
        })
    });
    if let Some(part) = &part {
        entries = part.share(entries);
        if entries.is_empty() {
            output.complain(&format!(
                "{} has no scenario; `merge` needs no folder of it",
                part.partition
            ));
            return Err(none.write(Exit::NothingSelected, output));
        }
    }
    Ok(RunSelection {
        rig,
        entries,
        part,
        earlier,
    })
}

/// Plays scenarios, one line each.
pub(crate) fn run(arguments: &RunArguments, output: &mut Output) -> std::io::Result<Exit> {
    let mut chosen = match choose(arguments, output) {
        Ok(chosen) => chosen,
        Err(exit) => return Ok(exit),
    };
    let junit = arguments.junit.as_deref();
    let writable = junit.is_none_or(|path| writable(path, output).is_ok());
    let (true, Ok(page)) = (writable, Page::new(arguments.html.as_deref(), output)) else {
        return Ok(Exit::Usage);
    };
    let job = PlayOrder {
        purpose: "run",
        named: arguments.selection.paths.clone(),
        allow_motion: arguments.allow_motion,
        wait: arguments.wait.unwrap_or_default(),
        evidence: arguments.evidence.clone(),
        records: arguments.records,
        require_all: arguments.require_all,
        junit: arguments.junit.clone(),
        qualify: false,
        thorough: false,
        sign: arguments.sign.clone(),
        part: chosen.part.take(),
        keep: arguments.keep.unwrap_or_default(),
        earlier: std::mem::take(&mut chosen.earlier),
    };
    let rig = chosen.rig.as_ref();
    let not_too_large = |entry: &&Entry| rig.is_none_or(|rig| too_large(entry, rig).is_none());
    let played = chosen.entries.iter().filter(not_too_large);
    state_size(played, &job, output);
    match chosen.in_use() {
        Some(rig) => work(rig, &chosen.entries, &job, page, output),
        None => {
            let done = on_simulated(&job, &chosen.entries, chosen.rig.as_ref(), page, output);
            output.say(&other_sizes(&chosen.entries, arguments.ring));
            done
        }
    }
}

/// Plays scenarios on simulated drives, each of its own, and keeps evidence where it is asked for.
fn on_simulated(
    job: &PlayOrder,
    entries: &[Entry],
    rig: Option<&Rig>,
    mut page: Option<Page>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let folder = rig.zip(job.evidence.as_deref());
    let folder = folder.map(|(rig, path)| {
        let about = AboutRun {
            sign: job.sign.as_deref(),
            part: job.part.as_ref(),
            keep: job.keep,
            selected: entries.iter().map(|entry| &*entry.source.text).collect(),
            ..AboutRun::own_rings(rig)
        };
        Folder::create(path, &about)
    });
    let mut folder = match folder.transpose() {
        Ok(folder) => folder,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::of_evidence(&error));
        }
    };
    let bar = progress_bar(entries.len(), output.progress);
    let mut tally = Tally::after(job.earlier.clone());
    let name = rig.map_or("sim", |rig| rig.id());
    let mut cases = Cases::new(name, job.junit.as_deref());
    for entry in entries {
        bar.set_message(entry.short_name().to_owned());
        let played = match keep(entry, rig, folder.as_mut()) {
            Ok(played) => played,
            Err(error) => {
                output.complain(&error.to_string());
                return Ok(Exit::of_evidence(&error));
            }
        };
        let outcome = &played.outcome;
        tally.note(entry, outcome);
        cases.note(entry, outcome, &played.traces);
        let mut line = line(entry, outcome, output);
        if job.records || entries.len() == 1 {
            line.push_str(&records(outcome));
        }
        bar.suspend(|| output.result(&line))?;
        let details = details(entry, outcome, &played.traces);
        bar.suspend(|| output.say(&details));
        if let Some(page) = &mut page {
            page.add(entry, outcome, &played.traces);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    output.result(&tally.summary())?;
    let head = Head {
        found: Vec::new(),
        title: "drivebench: scenarios on simulated drives",
        facts: Vec::new(),
    };
    let written = match (rig, folder) {
        (Some(rig), Some(folder)) => reports(rig, Some(folder), page, None, output),
        _ => page.is_none_or(|page| page.write(&head, output)),
    };
    if !written {
        return Ok(Exit::RigError);
    }
    Ok(cases.write(tally.exit(job.require_all), output))
}

/// How many scenarios were not played on rings of the size that was asked for.
fn other_sizes(entries: &[Entry], asked: Option<u8>) -> String {
    let Some(asked) = asked else {
        return String::new();
    };
    let drives = |entry: &Entry| entry.settled.rings()?.drives.first().copied();
    let other = entries.iter().filter(|entry| drives(entry) != Some(asked));
    match other.count() {
        0 => String::new(),
        count => format!(
            "on benches of their own sizes, because they are not for rings of {}: {}\n",
            counted(usize::from(asked), "drive"),
            counted(count, "scenario")
        ),
    }
}

/// Plays a scenario on simulated rings of its own, into the folder where there is one.
fn keep(
    entry: &Entry,
    rig: Option<&Rig>,
    folder: Option<&mut Folder>,
) -> Result<PlayedOnce, EvidenceError> {
    let too_large = rig.and_then(|rig| too_large(entry, rig));
    let not_played = |why| PlayedOnce {
        outcome: Outcome::skipped(why),
        traces: Vec::new(),
    };
    let Some(folder) = folder else {
        return Ok(match too_large {
            Some(why) => not_played(why),
            None => play_entry(entry, AtMismatch::Stop),
        });
    };
    let mut kept = folder.keep(entry.short_name(), &entry.source.text);
    let plan = &entry.settled;
    let played = match too_large {
        Some(why) => not_played(why),
        None => {
            kept.begins(1);
            let mut link = plan.simulate();
            let played = {
                let mut recording = Recording::whole(&mut *link, &mut kept);
                plan.play(&mut recording, AtMismatch::Stop)
            };
            let traces = (0..plan.ports()).map(|port| link.trace(port)).collect();
            let attempt = Attempt::new(played, traces);
            kept.ends(1, &attempt);
            PlayedOnce {
                outcome: attempt.outcome,
                traces: attempt.traces,
            }
        }
    };
    let name = kept.finish()?;
    folder.done(
        &name,
        &drives(entry),
        &entry.scenario.title,
        &played.outcome,
    );
    Ok(played)
}

/// What a scenario recorded, indented below its line.
fn records(outcome: &Outcome) -> String {
    let lines = outcome.records.iter().map(plot).collect::<String>();
    lines.lines().map(|line| format!("  {line}\n")).collect()
}

/// How many drives the rings of a scenario have: `3+1`.
pub(crate) fn drives(entry: &Entry) -> String {
    entry.drives()
}

pub(crate) fn line(entry: &Entry, outcome: &Outcome, output: &Output) -> String {
    let drives = drives(entry);
    format!(
        "{} {:44} {:>5} {:6} {:>12}  {}\n",
        output.verdict(outcome.verdict).trim_end_matches(' '),
        entry.short_name(),
        drives,
        if drives == "1" { "drive" } else { "drives" },
        outcome.took.to_string(),
        entry.scenario.title
    )
}

/// What there is to say about a scenario beside its line, for people.
pub(crate) fn details(entry: &Entry, outcome: &Outcome, traces: &[Trace]) -> String {
    let mut text = String::new();
    for remark in &outcome.remarks {
        let _infallible = writeln!(text, "  note: {remark}");
    }
    if let Some(finding) = &outcome.finding {
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "\n{}", explain(entry, finding, traces));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A filter does not look at steps, although the first look at a text does.
    #[test]
    fn what_does_not_match_is_not_selected() {
        let selected = |text: &str| {
            let selection = Selection {
                paths: Vec::new(),
                filter: Some(text.to_owned()),
            };
            let entries = select_by(&selection, |source| Entry::new(source, None));
            entries.expect("no mistakes").len()
        };
        assert_eq!(selected("10.5-silent-self-test"), 1);
        let step = "read-byte 1 FE10";
        let built_in = sources(&[]).expect("the built-in ones");
        assert!(built_in.iter().any(|source| may_match(source, step)));
        assert_eq!(selected(step), 0);
    }

    /// Every scenario that a filter selects is read.
    #[test]
    fn what_matches_may_match() {
        for source in sources(&[]).expect("the built-in ones") {
            let entry = Entry::new(source.clone(), None).expect("a scenario");
            let cited = entry.scenario.sources.iter();
            let cited = cited.map(|source| source.text.as_str());
            for place in cited.chain([entry.name.as_str(), &entry.scenario.title]) {
                assert!(entry.matches(place) && may_match(&source, place), "{place}");
            }
        }
    }
}
