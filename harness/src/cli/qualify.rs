//! `drivebench qualify`: every scenario that fits, every open property settled, every deviation named, and a folder of
//! evidence.

use super::args::QualifyArguments;
use super::exit::Exit;
use super::output::Output;
use super::page::Page;
use super::rig_failure::find_rig;
use super::run::{details, line, select};
use super::run_rig::{Job, Stop, over, play, work};
use crate::evidence::Folder;
use crate::link::Link as _;
use crate::qualify::{
    Answer, Asked, Probe, Profile, answer, conversations, deviating, deviating_masters,
    explaining_most, probes,
};
use crate::rig::{Driven, Played, Run, state};
use crate::scenario::verdict::Verdict;
use crate::twin::Conversation;
use harness_proto::time::Span;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::SystemTime;

/// The most attempts that are explained: each is asked of every deviation of every drive.
const MOST_ATTEMPTS: usize = 12;

/// The most explanations that are told.
const MOST_TOLD: usize = 8;

/// How often a probe is played until a value explains it: a busy computer is late now and then.
const PROBED: usize = 3;

/// What was played and was otherwise than the model.
#[derive(Default)]
pub(super) struct Findings {
    /// The conversations of each attempt that diverged.
    diverged: Vec<Vec<Conversation>>,
    /// Those in which the driver had a part: it waits and tries again, which takes long to be explained and says no more.
    with_driver: Vec<Vec<Conversation>>,
    /// The drives that were named.
    suspects: Vec<u8>,
    /// What the bench's own master did, and whether it was ever wrong.
    driven: Vec<Driven>,
    master_is_wrong: bool,
}

impl Findings {
    /// The attempts that are to be explained.
    fn attempts(&self) -> &[Vec<Conversation>] {
        match self.diverged.is_empty() {
            true => &self.with_driver,
            false => &self.diverged,
        }
    }

    /// Notes what came of a scenario on a rig that states this tolerance of times.
    pub(super) fn note(&mut self, played: &Played, tolerance: Span) {
        for attempt in &played.attempts {
            self.driven.extend(attempt.driven.clone());
            self.master_is_wrong |= !attempt.master_is_right;
        }
        if let Some((attempt, divergences)) = played.telling(tolerance) {
            let own = match attempt.driven {
                Some(_) => &mut self.with_driver,
                None => &mut self.diverged,
            };
            own.push(attempt.conversations.clone());
            let drives = divergences.iter().filter_map(|there| there.drive);
            self.suspects.extend(drives);
        }
        self.suspects.sort_unstable();
        self.suspects.dedup();
    }
}

/// Qualifies a rig.
pub(super) fn qualify(arguments: &QualifyArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(rig) = find_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    let size = rig.file.ring.first.drives;
    let entries = match select(&arguments.selection, Some(size)) {
        Ok(entries) => entries,
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            return Ok(Exit::Usage);
        }
    };
    let Ok(page) = Page::new(arguments.html.as_deref(), output) else {
        return Ok(Exit::Usage);
    };
    let stamp = state::utc(SystemTime::now()).replace([':', ' '], "-");
    let evidence = arguments
        .evidence
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("evidence-{}-{stamp}", rig.id())));
    let job = Job {
        purpose: "qualify",
        allow_motion: arguments.allow_motion,
        wait: arguments.wait.unwrap_or_default(),
        evidence: Some(evidence),
        records: false,
        require_all: arguments.require_all,
        junit: None,
        qualify: true,
        sign: arguments.sign.clone(),
    };
    work(&rig, &entries, &job, page, output)
}

/// Plays what is judged by the model alone, settles what the manual leaves open, and names what drives do otherwise.
pub(super) fn settle(
    run: &mut Run<'_>,
    findings: &mut Findings,
    ill: bool,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Exit, Stop> {
    let drives = run.session().rig().file.ring.first.drives;
    let tolerance = run.exactness().tolerance;
    let mut open = 0;
    if !ill {
        let reached: Vec<bool> = (0..usize::from(drives))
            .map(|place| place == 0 || run.session().link().reaches(0, place))
            .collect();
        let reaches = |place: usize| reached.get(place) == Some(&true);
        for entry in conversations(drives, &reaches).unwrap_or_default() {
            let played = play(run, &entry, folder.as_deref_mut())?;
            let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
            output.result(&line(&entry, &played.outcome, output))?;
            output.say(&details(&entry, &played.outcome, traces));
            findings.note(&played, tolerance);
            let settles_nothing = [Verdict::Flaky, Verdict::Inconclusive];
            open += usize::from(settles_nothing.contains(&played.outcome.verdict));
            if over(run, output) {
                break;
            }
        }
    }
    let profile = match ill {
        true => None,
        false => Some(profile(run, findings, folder.as_deref_mut(), output)?),
    };
    let mut named = format!(
        "{}{}",
        name_master(findings, output)?,
        name(run, findings, ill, output)?
    );
    if open > 0 {
        let text =
            format!("conversations that settle nothing: {open}; see what is said of them above\n");
        output.result(&text)?;
        named.push_str(&text);
    }
    let exit = match (findings.master_is_wrong, findings.attempts().is_empty()) {
        (true, _) => Exit::RigError,
        (false, true) if open > 0 => Exit::Incomplete,
        (false, true) => Exit::Passed,
        (false, false) => Exit::Failed,
    };
    if let Some(folder) = folder {
        if let Some(profile) = profile {
            let text = toml::to_string(&profile).unwrap_or_default();
            folder.add("profile.toml", &text)?;
        }
        folder.add("deviations.txt", &named)?;
    }
    Ok(exit)
}

/// What the bench's own master does otherwise, if it does.
fn name_master(findings: &Findings, output: &mut Output) -> std::io::Result<String> {
    if !findings.master_is_wrong {
        return Ok(String::new());
    }
    let mut text = String::new();
    for deviation in deviating_masters(&findings.driven).iter().take(MOST_TOLD) {
        text.push_str(&format!(
            "the master: {} (ND21 {}): {}\n",
            deviation.name, deviation.section, deviation.about
        ));
    }
    if text.is_empty() {
        text.push_str("the master: it is otherwise than the master of the manual, and no single known deviation explains it\n");
    }
    text.push_str(
        "the bench is wrong, not a drive: what its master did says nothing of the drives\n",
    );
    output.result(&text)?;
    Ok(text)
}

/// The deviations that explain every byte of every attempt that diverged.
fn name(
    run: &mut Run<'_>,
    findings: &Findings,
    ill: bool,
    output: &mut Output,
) -> Result<String, Stop> {
    if findings.attempts().is_empty() {
        let known = &run.session().rig().file.deviation;
        let text = match known.is_empty() {
            _ if ill => {
                "deviations: not known; the run ended with a rig error before its last scenario\n"
                    .to_owned()
            }
            true => "deviations: none; every byte is as the model of the manual says\n".to_owned(),
            false => {
                let names: Vec<_> = known.iter().map(|entry| entry.name.as_str()).collect();
                format!(
                    "deviations: none beside the known ones: {}\n",
                    names.join(", ")
                )
            }
        };
        output.result(&text)?;
        return Ok(text);
    }
    let drives = run.session().rig().file.ring.first.drives;
    let exactness = run.exactness();
    let twin = |lines: &[String]| run.twin_with(lines);
    let all = deviating(drives, &findings.suspects);
    let attempts = findings.attempts();
    let attempts = &attempts[..attempts.len().min(MOST_ATTEMPTS)];
    let found = explaining_most(all, attempts, exactness, &twin);
    let mut text = String::new();
    match found.as_slice() {
        [] => text.push_str("deviations: the ring is otherwise than the model, and no single known deviation explains it\n"),
        found => {
            for hypothesis in found.iter().take(MOST_TOLD) {
                text.push_str(&format!("deviation: {}\n", hypothesis.name));
            }
            if found.len() > MOST_TOLD {
                text.push_str(&format!("and {} more that explain it as well\n", found.len() - MOST_TOLD));
            }
        }
    }
    output.result(&text)?;
    Ok(text)
}

/// Asks by probes how the drives behave where the manual leaves it open. What has been settled of the bus is part of every later
/// question; a time of a drive is the middle of a span, and no later answer rests on it.
fn profile(
    run: &mut Run<'_>,
    findings: &mut Findings,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Profile, Stop> {
    let rings: Vec<u8> = run.session().rings().iter().map(|r| r.drives()).collect();
    let drives = rings.first().copied().unwrap_or(1);
    let mut profile = Profile {
        schema: 1,
        rig: run.session().rig().id().to_owned(),
        date: state::utc(SystemTime::now()),
        rings,
        property: BTreeMap::new(),
        open: BTreeMap::new(),
    };
    let mut known = Vec::new();
    let mut ended = false;
    for probe in probes(drives).unwrap_or_default() {
        ended = ended || over(run, output);
        if ended {
            profile.leave_open(probe.property, "not asked: the run ended before");
            continue;
        }
        let section = format!("nd21 {}", probe.section);
        let property = probe.property;
        let whose = match probe.asked {
            Asked::Drive(drive, _) => format!("drive {drive}: "),
            Asked::Ring => String::new(),
        };
        let why = match ask(run, findings, &probe, &known, folder.as_deref_mut(), output)? {
            Asking::Answer(Answer::Settled { value, lines }) => {
                output.result(&format!("{property} ({section}): {whose}{value}\n"))?;
                if probe.asked == Asked::Ring {
                    known.extend(lines.iter().cloned());
                }
                profile.settle(property, &section, &format!("{whose}{value}"), lines);
                continue;
            }
            Asking::Answer(Answer::NoDifference) => {
                "every value of it gives the bytes that came: the drive was not in a state that shows it".to_owned()
            }
            Asking::Answer(Answer::NotDone(time)) => {
                format!("longer than {time}: it was not done when it was asked for the last time")
            }
            Asking::Answer(Answer::Unexplained) => {
                "no value of it gives the bytes that came".to_owned()
            }
            Asking::Not(why) => format!("not asked: {why}"),
        };
        output.result(&format!("{property} ({section}): {whose}{why}\n"))?;
        profile.leave_open(property, &format!("{whose}{why}"));
    }
    Ok(profile)
}

/// What came of asking.
enum Asking {
    Answer(Answer),
    /// It could not be asked, and why.
    Not(String),
}

/// Plays a probe, and again where no value explains it.
fn ask(
    run: &mut Run<'_>,
    findings: &mut Findings,
    probe: &Probe,
    known: &[String],
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Asking, Stop> {
    let drives = run.session().rig().file.ring.first.drives;
    let exactness = run.exactness();
    // Simulated drives answer alike each time.
    let most = match exactness.tolerance {
        Span::ZERO => 1,
        _ => PROBED,
    };
    let mut last = Vec::new();
    for _ in 0..most {
        let mut conversations = Vec::new();
        last.clear();
        for entry in &probe.entries {
            let played = play(run, entry, folder.as_deref_mut())?;
            let Some(attempt) = played.last_played().filter(|own| own.was_played()) else {
                findings.note(&played, exactness.tolerance);
                return Ok(Asking::Not(played.outcome.remarks.join("; ")));
            };
            conversations.push(attempt.conversations.clone());
            last.push(played);
        }
        let twin = |lines: &[String]| run.twin_with(&[known, lines].concat());
        match answer(probe, drives, &conversations, exactness, &twin) {
            Ok(Answer::Unexplained) => {}
            Ok(answer) => return Ok(Asking::Answer(answer)),
            Err(problems) => return Ok(Asking::Not(problems.to_string())),
        }
        if over(run, output) {
            break;
        }
    }
    last.iter()
        .for_each(|played| findings.note(played, exactness.tolerance));
    Ok(Asking::Answer(Answer::Unexplained))
}
