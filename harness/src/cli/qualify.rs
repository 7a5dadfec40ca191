//! `drivebench qualify`: every scenario that fits, every open property settled, every deviation named, and a folder of
//! evidence.

use super::args::QualifyArguments;
use super::exit::Exit;
use super::findings::Findings;
use super::output::Output;
use super::page::Page;
use super::rig_failure::find_rig;
use super::run::{details, line, select};
use super::run_rig::{Job, Stop, over, play, work};
use crate::buses::syntax::Header;
use crate::evidence::Folder;
use crate::library::Entry;
use crate::link::Link as _;
use crate::qualify::{
    Answer, Asked, Probe, Profile, answer, conversations, deviating_masters, dumps, exchange,
    marches, name, probes, questions, thorough,
};
use crate::rig::{Played, Run, state};
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::SystemTime;

/// The most deviations of the master that are listed.
const MOST_TOLD: usize = 8;

/// The file of a folder of evidence that says what was compared and which deviations explain it.
pub(crate) const DEVIATIONS: &str = "deviations.txt";

/// The message if a run ended early.
pub(crate) const ENDED: &str = "the run ended before everything was played";

/// How often a probe is played until a value explains it: a busy computer is late sometimes.
const PROBED: usize = 3;

/// Qualifies a rig.
pub(crate) fn qualify(arguments: &QualifyArguments, output: &mut Output) -> std::io::Result<Exit> {
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
        thorough: arguments.thorough,
        sign: arguments.sign.clone(),
    };
    work(&rig, &entries, &job, page, output)
}

/// Plays what is judged by the model alone, settles what the manual leaves open, and names the deviations of drives.
pub(crate) fn settle(
    run: &mut Run<'_>,
    findings: &mut Findings,
    (ill, long): (bool, bool),
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Exit, Stop> {
    let drives = run.session().rig().file.ring.first.drives;
    let mut ended = false;
    if ill {
        findings.note_open("the ring is ill: nothing more was played".to_owned());
    } else {
        let reached: Vec<bool> = (0..usize::from(drives))
            .map(|place| place == 0 || run.session().link().reaches(0, place))
            .collect();
        let reaches = |place: usize| reached.get(place) == Some(&true);
        let mut entries = conversations(drives, &reaches).unwrap_or_default();
        if long {
            entries.extend(thorough(drives).unwrap_or_default());
        }
        for entry in entries {
            ended =
                ended || compare(run, findings, &entry, folder.as_deref_mut(), output)?.is_none();
        }
        let read = if long { dumps(drives) } else { Vec::new() };
        for (drive, entry) in read {
            if ended {
                break;
            }
            ended = march(
                run,
                findings,
                (drive, &entry),
                folder.as_deref_mut(),
                output,
            )?;
        }
    }
    let (profile, settled) = match ill {
        true => (None, Header::default()),
        false => {
            let (profile, settled) = profile(run, findings, folder.as_deref_mut(), output)?;
            (Some(profile), settled)
        }
    };
    if !ill && !ended {
        ask_ring(run, findings, folder.as_deref_mut(), output)?;
        exchange_roles(run, findings, folder.as_deref_mut(), output)?;
    }
    if ended || over(run, output) {
        findings.note_open(ENDED.to_owned());
        ended = true;
    }
    let named = format!(
        "{}{}",
        name_master(findings, output)?,
        name_drives(run, findings, (!ended).then_some(&settled), output)?
    );
    let exit = findings.exit();
    if let Some(folder) = folder {
        if let Some(profile) = profile {
            let text = toml::to_string(&profile).unwrap_or_default();
            folder.add("profile.toml", &text)?;
        }
        folder.add(DEVIATIONS, &named)?;
    }
    Ok(exit)
}

/// Plays a conversation that is judged by the model; `None` where nothing more can or may be played.
fn compare(
    run: &mut Run<'_>,
    findings: &mut Findings,
    entry: &Entry,
    folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Option<Played>, Stop> {
    let played = play(run, entry, folder)?;
    let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
    output.result(&line(entry, &played.outcome, output))?;
    output.say(&details(entry, &played.outcome, traces));
    findings.note(entry.short_name(), &played);
    Ok((!over(run, output)).then_some(played))
}

/// Reads the EEPROM of a drive, and writes and restores its cells one by one. Whether nothing more can or may be played.
fn march(
    run: &mut Run<'_>,
    findings: &mut Findings,
    (drive, read): (u8, &Entry),
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<bool, Stop> {
    let drives = run.session().rig().file.ring.first.drives;
    let Some(played) = compare(run, findings, read, folder.as_deref_mut(), output)? else {
        return Ok(true);
    };
    let right = played.outcome.verdict == Verdict::Passed;
    let Some(last) = played.last_played().filter(|_| right) else {
        return Ok(false);
    };
    for entry in marches(drives, drive, &last.conversations) {
        if compare(run, findings, &entry, folder.as_deref_mut(), output)?.is_none() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Names the deviation of the bench's own master, if it is wrong.
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
        text.push_str("the bench's master differs from the master of the manual, and no single known deviation explains it\n");
    }
    text.push_str(
        "the bench is wrong, not a drive: its own master deviates, so nothing follows for the drives\n",
    );
    output.result(&text)?;
    Ok(text)
}

/// Asks the ring about what differed, so that it shows which drive it was.
fn ask_ring(
    run: &mut Run<'_>,
    findings: &mut Findings,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<(), Stop> {
    if !run.way().anew {
        return Ok(());
    }
    let drives = run.session().rig().file.ring.first.drives;
    let sightings = findings.sightings().to_vec();
    for question in questions(drives, &sightings) {
        if over(run, output) {
            break;
        }
        let played = play(run, &question.entry, folder.as_deref_mut())?;
        let last = played.last_played().filter(|own| own.was_played());
        let shown = last.and_then(|own| question.answer(&own.conversations));
        shown.into_iter().for_each(|own| findings.note_pinned(own));
    }
    Ok(())
}

/// Plays again what differed, with the drives' roles exchanged, so that it shows which drive it was. Only where every drive is reset before:
/// what was written to one must not stay.
fn exchange_roles(
    run: &mut Run<'_>,
    findings: &mut Findings,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<(), Stop> {
    let drives = run.session().rig().file.ring.first.drives;
    if !run.way().anew || drives < 2 {
        return Ok(());
    }
    let sightings = findings.sightings().to_vec();
    let trials = exchange(drives, sightings, &mut |entry: &Entry| {
        if over(run, output) {
            return Ok(None);
        }
        let played = play(run, entry, folder.as_deref_mut())?;
        Ok::<_, Stop>(findings.note_exchanged(&played))
    })?;
    findings.note_trials(trials);
    Ok(())
}

/// The deviations that explain every byte, and what was compared. The drives of the model have the properties of the bus that this header
/// settles; `None` where the run ended early, and no deviation is looked for.
fn name_drives(
    run: &mut Run<'_>,
    findings: &Findings,
    settled: Option<&Header>,
    output: &mut Output,
) -> Result<String, Stop> {
    let rig = run.session().rig();
    let drives = rig.file.ring.first.drives;
    let known = rig.file.deviation.iter();
    let known: Vec<_> = known.map(|entry| entry.name.clone()).collect();
    let seen = findings.seen(drives, run.exactness());
    let settled = settled.filter(|_| findings.differ());
    let named = settled.map(|settled| {
        let twin = |header: &Header| run.twin_with(&settled.and(header));
        name(&seen, &twin)
    });
    Ok(findings.tell(named.as_deref(), &known, output)?)
}

/// Asks by probes how the drives behave where the manual leaves it open. What has been settled of the bus is part of every later
/// question and is the second value; a time of a drive is the middle of a span, and no later answer rests on it.
fn profile(
    run: &mut Run<'_>,
    findings: &mut Findings,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<(Profile, Header), Stop> {
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
    let mut known = Header::default();
    let mut ended = false;
    for probe in probes(drives).unwrap_or_default() {
        ended = ended || over(run, output);
        if ended {
            profile.leave_open(probe.property, "not asked: the run ended before");
            continue;
        }
        let section = format!("nd21 {}", probe.section);
        let property = probe.property;
        let (whose, of) = match probe.asked {
            Asked::Drive(drive, _) => (format!("drive {drive}: "), format!(" of drive {drive}")),
            Asked::Ring => (String::new(), String::new()),
        };
        let why = match ask(run, findings, &probe, &known, folder.as_deref_mut(), output)? {
            Asking::Answer(Answer::Settled { value, header }) => {
                findings.note_probe();
                output.result(&format!("{property} ({section}): {whose}{value}\n"))?;
                if probe.asked == Asked::Ring {
                    known = known.and(&header);
                }
                profile.settle(property, &section, &format!("{whose}{value}"), &header);
                continue;
            }
            Asking::Answer(Answer::NoDifference) => {
                findings.note_probe();
                "every value of it gives the bytes that came: the drive was not in a state that shows it".to_owned()
            }
            Asking::Answer(Answer::NotDone(time)) => {
                findings.note_probe();
                format!("longer than {time}: not finished when asked for the last time")
            }
            Asking::Answer(Answer::Unexplained) => {
                let why = "no value of it gives the bytes that came";
                findings.note_probe();
                findings.note_open(format!("the probe of {property}{of}: {why}"));
                why.to_owned()
            }
            Asking::Not(why) => format!("not asked: {why}"),
        };
        output.result(&format!("{property} ({section}): {whose}{why}\n"))?;
        profile.leave_open(property, &format!("{whose}{why}"));
    }
    Ok((profile, known))
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
    known: &Header,
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
                findings.note_attempts(entry.short_name(), &played);
                return Ok(Asking::Not(played.outcome.remarks.join("; ")));
            };
            conversations.push(attempt.conversations.clone());
            last.push((entry.short_name(), played));
        }
        let twin = |header: &Header| run.twin_with(&known.and(header));
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
        .for_each(|(name, played)| findings.note_attempts(name, played));
    Ok(Asking::Answer(Answer::Unexplained))
}
