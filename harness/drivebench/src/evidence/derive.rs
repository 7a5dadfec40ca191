//! Makes the reports of a folder again, from nothing but its record and its captures; that of a qualification shows the
//! files in which it says what it found, which `verify` compares with the record.
//!
//! A run makes them in the same way when it ends, so making them again gives the same bytes. A record does not have the expected bytes: as
//! in `verify`, each attempt is played again from what was received. If the result agrees with the record, the bytes that differ are shown.

use super::error::EvidenceError;
use super::files::{self, CAPTURES, DEVIATIONS, PROFILE, SCENARIOS};
use super::junit::{JunitCase, junit};
use super::merge::{MERGE, derive_merged};
use super::record::RecordLine;
use super::verify::{JudgedAttempt, OpenedFolder, is_name, scenarios};
use crate::buses::report_of;
use crate::capture::{MAX_FILE, read};
use crate::library::Entry;
use crate::library::finding::{class, explain};
use crate::scenario::problem;
use crate::scenario::run::{Mismatch, Outcome};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::shown::{Head, ScenarioView, ShownScenario, run, section};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

/// The reports of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Derived {
    /// The page for people.
    pub html: String,
    /// The verdicts for programs (JUnit).
    pub junit: String,
}

/// Makes the reports of a folder again; of a run that was killed, of what it came to.
///
/// # Errors
/// It is no folder of evidence, or its record or a capture is damaged; with the place.
pub fn derive(path: &Path) -> Result<Derived, EvidenceError> {
    if path.join(MERGE).exists() {
        return derive_merged(path);
    }
    let opened = OpenedFolder::open(path)?;
    let judged = opened.judged(&scenarios(path))?;
    derived(path, &opened, &judged)
}

/// Makes the reports of a folder whose attempts were played again.
pub(super) fn derived(
    path: &Path,
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
) -> Result<Derived, EvidenceError> {
    let all = case_reports(path, opened, judged, &|place| place + 1)?;
    let (cases, shown) = all
        .into_iter()
        .map(|report| (report.junit, report.shown))
        .unzip::<_, _, Vec<_>, _>();
    Ok(Derived {
        html: run(&head(path, opened), shown),
        junit: junit(&suite(opened.rig.id()), &cases),
    })
}

/// What the reports say of one scenario.
pub(super) struct CaseReport {
    pub(super) settled: Settled,
    pub(super) junit: JunitCase,
    pub(super) shown: ShownScenario,
}

impl CaseReport {
    /// Shows of which part it is: another part has played a scenario of the same name.
    pub(super) fn name_part(&mut self, part: &str) {
        let name = format!("{} (part {part})", self.settled.name);
        let rest = self.junit.name.strip_prefix(&self.settled.name);
        self.junit.name = format!("{name}{}", rest.unwrap_or_default());
        self.shown.rename(&name);
        self.settled.name = name;
    }
}

/// What the reports say of each scenario of a folder, in its order; `number` gives the number of a section by its place.
pub(super) fn case_reports(
    path: &Path,
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
    number: &dyn Fn(usize) -> usize,
) -> Result<Vec<CaseReport>, EvidenceError> {
    let mut attempts: BTreeMap<String, Attempt> = BTreeMap::new();
    for judged_attempt in judged {
        let again = judged_attempt.again.as_ref().ok();
        // The last attempt is shown.
        let attempt = Attempt {
            number: judged_attempt.recorded.attempt,
            text: again.map_or_else(String::new, |(text, _)| text.clone()),
            outcome: again.map(|(_, again)| again.attempt.outcome.clone()),
        };
        attempts.insert(judged_attempt.recorded.name.clone(), attempt);
    }
    let settled = opened.lines.iter().filter_map(Settled::of);
    let mut settled: Vec<_> = settled.collect();
    for (name, attempt) in &attempts {
        // A run that was killed has not settled its last scenario.
        if settled.iter().all(|case| case.name != *name) {
            settled.push(Settled::unsettled(name, attempt));
        }
    }
    let mut reports = Vec::new();
    let texts = scenarios(path);
    for (place, case) in settled.into_iter().enumerate() {
        let attempt = attempts.get(&case.name);
        let traces = match attempt {
            Some(attempt) if is_name(&case.name) => {
                traces(path, &case.name, attempt.number, opened.rate())?
            }
            _ => Vec::new(),
        };
        // Of a scenario that was not played there is only its text.
        let text = match attempt {
            Some(attempt) => Some(attempt.text.clone()),
            None => texts(&case.name).ok().filter(|_| is_name(&case.name)),
        };
        let entry = text.and_then(|text| entry(&case.name, &text));
        let judged = attempt.and_then(|attempt| attempt.outcome.as_ref());
        let outcome = case.outcome(judged);
        let junit = JunitCase {
            class: entry.as_ref().map_or_else(String::new, class),
            details: match (&entry, &outcome.finding) {
                (Some(entry), Some(found)) => explain(entry, found, &traces),
                _ => String::new(),
            },
            ..case.case(path, opened.rig.id())
        };
        reports.push(CaseReport {
            shown: show(number(place), &case, attempt, &outcome, &traces, opened),
            settled: case,
            junit,
        });
    }
    Ok(reports)
}

/// The verdict of this name.
pub(super) fn verdict_named(name: &str) -> Option<Verdict> {
    Verdict::ALL.into_iter().find(|known| known.name() == name)
}

/// The last attempt at a scenario.
struct Attempt {
    number: usize,
    text: String,
    /// What its record says when it is played again.
    outcome: Option<Outcome>,
}

/// The outcome of a scenario, as recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Settled {
    pub(super) name: String,
    title: String,
    drives: String,
    pub(super) verdict: Verdict,
    finding: Option<String>,
    remarks: Vec<String>,
    pub(super) took: Span,
}

impl Settled {
    /// A scenario that was to be played and was not, for this reason.
    pub(super) fn not_run(name: &str, why: &str) -> Self {
        Self {
            name: name.to_owned(),
            title: "not run".to_owned(),
            drives: String::new(),
            verdict: Verdict::Skipped,
            finding: None,
            remarks: vec![why.to_owned()],
            took: Span::ZERO,
        }
    }

    /// Reads its line; `None` for all others.
    pub(super) fn of(line: &RecordLine) -> Option<Self> {
        let RecordLine::Case {
            name,
            title,
            drives,
            verdict,
            finding,
            remarks,
            took,
            ..
        } = line
        else {
            return None;
        };
        let verdict = verdict_named(verdict)?;
        Some(Self {
            name: name.clone(),
            title: title.clone(),
            drives: drives.clone(),
            verdict,
            finding: finding.clone(),
            remarks: remarks.clone(),
            took: Span::from_units(*took),
        })
    }

    fn unsettled(name: &str, attempt: &Attempt) -> Self {
        let why = "the record ends before this scenario was settled";
        Self {
            name: name.to_owned(),
            title: entry(name, &attempt.text)
                .map_or_else(String::new, |entry| entry.scenario.title),
            drives: String::new(),
            verdict: Verdict::Aborted,
            finding: None,
            remarks: vec![why.to_owned()],
            took: attempt
                .outcome
                .as_ref()
                .map_or(Span::ZERO, |outcome| outcome.took),
        }
    }

    /// The case of JUnit, without class and details, with the files that the scenario left in a folder.
    pub(super) fn case(&self, path: &Path, rig: &str) -> JunitCase {
        let messages: Vec<_> = self.messages().map(String::as_str).collect();
        JunitCase {
            name: format!("{}[rig={rig},drives={}]", self.name, self.drives),
            class: String::new(),
            verdict: self.verdict,
            message: messages.join("; "),
            details: String::new(),
            took: Duration::from_nanos(self.took.as_nanos()),
            attachments: attachments(path, &self.name),
        }
    }

    /// The outcome as recorded, with the place and the bytes of the finding if `judged` has the same one.
    fn outcome(&self, judged: Option<&Outcome>) -> Outcome {
        let found = self.finding.as_ref().map(|message| {
            let same = judged.and_then(|outcome| outcome.finding.clone());
            same.filter(|mismatch| mismatch.message == *message)
                .unwrap_or_else(|| Mismatch {
                    span: problem::TextSpan { start: 0, end: 0 },
                    message: message.clone(),
                    difference: None,
                    in_error: String::new(),
                })
        });
        Outcome {
            verdict: self.verdict,
            finding: found,
            unmet: Vec::new(),
            remarks: self.remarks.clone(),
            took: self.took,
            records: judged.map_or_else(Vec::new, |outcome| outcome.records.clone()),
            unready: None,
            shows_nothing: false,
            skip: None,
        }
    }

    /// Whether it was skipped for a reason that begins with these words.
    pub(super) fn begins_with(&self, words: &str) -> bool {
        let first = self.remarks.first();
        self.verdict == Verdict::Skipped && first.is_some_and(|remark| remark.starts_with(words))
    }

    /// Whether the same came of another attempt at the scenario, whatever time it took.
    pub(super) fn says_the_same_as(&self, other: &Self) -> bool {
        (self.verdict, &self.finding) == (other.verdict, &other.finding)
    }

    /// What there is to say beside the verdict.
    pub(super) fn messages(&self) -> impl Iterator<Item = &String> {
        self.finding.iter().chain(&self.remarks)
    }
}

/// The verdicts for people, as plain text.
pub(super) fn plain(rig: &str, settled: &[Settled]) -> String {
    let mut text = format!("rig {rig}\n\n");
    for case in settled {
        text.push_str(&format!(
            "{:12} {}: {}\n",
            case.verdict, case.name, case.title
        ));
        for line in case.messages() {
            text.push_str(&format!("             {line}\n"));
        }
    }
    text
}

/// The verdicts as JUnit without details: for a folder whose record cannot be read again.
pub(super) fn bare(path: &Path, rig: &str, settled: &[Settled]) -> String {
    let cases: Vec<_> = settled.iter().map(|case| case.case(path, rig)).collect();
    junit(&suite(rig), &cases)
}

/// The name of the suite of a rig.
pub(super) fn suite(rig: &str) -> String {
    format!("rig {rig}")
}

/// The most attempts at a scenario that a rig's file can ask for.
const MOST_ATTEMPTS: usize = 10;

/// The text of a scenario and the captures of its attempts.
fn attachments(path: &Path, name: &str) -> Vec<String> {
    if !is_name(name) {
        return Vec::new();
    }
    let captures = (1..=MOST_ATTEMPTS).map(|attempt| format!("{CAPTURES}/{name}.{attempt}.json"));
    let captures = captures.filter(|file| path.join(file).is_file());
    let text = format!("{SCENARIOS}/{name}.scn");
    std::iter::once(text)
        .filter(|file| path.join(file).is_file())
        .chain(captures)
        .map(|file| path.join(file).display().to_string())
        .collect()
}

fn entry(name: &str, text: &str) -> Option<Entry> {
    let source = Source {
        name: format!("{SCENARIOS}/{name}.scn"),
        text: text.into(),
    };
    Entry::new(source, None).ok()
}

/// What the links carried; nothing where no capture was kept, or where it is longer than a capture that is read ([`MAX_FILE`]).
fn traces(
    path: &Path,
    name: &str,
    attempt: usize,
    rate: Rate,
) -> Result<Vec<Trace>, EvidenceError> {
    let file = format!("{CAPTURES}/{name}.{attempt}.json");
    let foreign = |error: String| {
        EvidenceError::Foreign(path.display().to_string(), format!("{file}: {error}"))
    };
    // A page with this many bytes could not be shown either. The record has them, so no verdict rests on the capture.
    if path
        .join(&file)
        .metadata()
        .is_ok_and(|file| file.len() > MAX_FILE)
    {
        return Ok(Vec::new());
    }
    let bytes = match files::read(path, &file) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        bytes => bytes.map_err(|error| foreign(error.to_string()))?,
    };
    let capture = read(&bytes, Some(rate)).map_err(|error| foreign(error.to_string()))?;
    Ok(capture.traces)
}

fn show(
    number: usize,
    case: &Settled,
    attempt: Option<&Attempt>,
    outcome: &Outcome,
    traces: &[Trace],
    opened: &OpenedFolder,
) -> ShownScenario {
    let entry = attempt.and_then(|attempt| entry(&case.name, &attempt.text));
    let report = entry
        .as_ref()
        .map_or_else(|| report_of(traces), |entry| entry.report);
    let sources = entry.map_or_else(Vec::new, |entry| {
        let sources = entry.scenario.sources.into_iter();
        sources.map(|source| source.text).collect()
    });
    let file = |attempt: &Attempt| format!("{CAPTURES}/{}.{}.json", case.name, attempt.number);
    let again = match attempt {
        Some(attempt) if opened.left_out.contains(&file(attempt)) => {
            format!("its capture was left out (--keep {})", opened.header.keep)
        }
        Some(attempt) => format!("drivebench import {} --format table", file(attempt)),
        None => "it was not played".to_owned(),
    };
    section(
        number,
        &ScenarioView {
            name: &case.name,
            title: &case.title,
            sources: &sources,
            drives: &case.drives,
            text: attempt.map_or("", |attempt| &attempt.text),
            outcome,
            traces,
            report,
            rate: opened.rate(),
            again: &again,
        },
    )
}

/// What stands above `deviations.txt` on the page, and above `profile.toml`.
pub(super) const DEVIATIONS_HEADING: &str = "Coverage and deviations";
pub(super) const PROFILE_HEADING: &str = "Profile";

/// What a qualification found, of its own files: what was compared, deviations, profile.
fn found(path: &Path) -> Vec<(&'static str, String)> {
    let files = [(DEVIATIONS_HEADING, DEVIATIONS), (PROFILE_HEADING, PROFILE)];
    let found = files.into_iter().filter_map(|(heading, file)| {
        let text = files::read_text(path, file).ok()?;
        Some((heading, text))
    });
    found.collect()
}

fn head(path: &Path, opened: &OpenedFolder) -> Head<'static> {
    let mut facts = vec![("Rig", opened.rig.id().to_owned())];
    if let Some(RecordLine::Run {
        drivebench,
        started,
        rate,
        rings,
        simulated,
        ..
    }) = opened.lines.first()
    {
        let rings: Vec<_> = rings.iter().map(u8::to_string).collect();
        facts.push(("Began", started.clone()));
        facts.push(("Played by", format!("drivebench {drivebench}")));
        facts.push(("Drives", rings.join("+")));
        facts.push(("Line", format!("{rate} bit/s")));
        facts.push((
            "Rings",
            if *simulated {
                "simulated"
            } else {
                "behind ports"
            }
            .to_owned(),
        ));
    }
    let safe = opened.lines.iter().find_map(|line| match line {
        RecordLine::End { safe, .. } => Some(*safe),
        _ => None,
    });
    facts.push((
        "End",
        match safe {
            None => "the record ends before the run did",
            Some(None) => "regular",
            Some(Some(true)) => "regular; the safe state was confirmed",
            Some(Some(false)) => "the safe state was not confirmed: look at the machine",
        }
        .to_owned(),
    ));
    Head {
        title: "drivebench: scenarios on a rig",
        facts,
        found: found(path),
    }
}
