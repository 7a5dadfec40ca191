//! The files of a qualification, made again from its record.

use super::attempt::reached;
use super::files::{DEVIATIONS, PROFILE, read_text, sum};
use super::record::RecordLine;
use super::verify::{Judged, Opened};
use crate::buses::novobus::language::read::RingScenario;
use crate::buses::novobus::qualify::{Qualification, QualificationFacts, QualifiedBench, thorough};
use crate::buses::novobus::rig::run::twin;
use crate::buses::syntax::Header;
use crate::buses::twin::Twin;
use crate::rig::segment::Qualified;
use crate::rig::{Attempt, PlayedScenario};
use crate::scenario::problem::Problems;
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use std::collections::VecDeque;
use std::path::Path;

/// What of `profile.toml` and `deviations.txt` does not follow from the record, in sentences.
pub(super) fn differences(path: &Path, opened: &Opened, judged: &[Judged]) -> Vec<String> {
    let cases = match cases(opened, judged) {
        Ok(cases) => cases,
        Err(why) => return vec![why],
    };
    let mut differences = None;
    // A record shows that a run ended early where a scenario is missing; behind the last one it may have ended too, by `max_run`.
    for ended in [false, true] {
        match qualified(opened, cases.clone(), ended) {
            Err(Stop::Missing) => {}
            Err(Stop::Other(name)) => {
                return vec![format!(
                    "case {name}: a qualification with the scenarios before it plays another one here"
                )];
            }
            Ok(made) => {
                let wrong = compare(path, &made);
                if wrong.is_empty() {
                    return wrong;
                }
                differences.get_or_insert(wrong);
            }
        }
    }
    differences.unwrap_or_else(|| {
        let why = "the record ends within a probe, which leaves no such file";
        let there = [PROFILE, DEVIATIONS];
        let there = there.into_iter().filter(|file| path.join(file).exists());
        there.map(|file| format!("{file}: {why}")).collect()
    })
}

/// Compares the files of a folder with those that its record gives.
pub(super) fn compare(path: &Path, made: &Qualified) -> Vec<String> {
    let mut wrong = Vec::new();
    match &made.profile {
        Some(profile) => wrong.extend(difference(path, PROFILE, profile)),
        None if path.join(PROFILE).exists() => {
            wrong.push(format!(
                "{PROFILE}: the drives were not asked, so there is none"
            ));
        }
        None => {}
    }
    wrong.extend(difference(path, DEVIATIONS, &made.deviations));
    wrong
}

/// The first line of a file that is another one in what the record gives.
fn difference(path: &Path, file: &str, made: &str) -> Option<String> {
    let stated = match read_text(path, file) {
        Ok(stated) => stated,
        Err(why) => return Some(why),
    };
    if stated == made {
        return None;
    }
    let (stated, made): (Vec<_>, Vec<_>) =
        (stated.split('\n').collect(), made.split('\n').collect());
    let lines = stated.iter().zip(&made);
    let same = lines.take_while(|(own, other)| own == other).count();
    let shown = |lines: &[&str]| match lines.get(same) {
        Some(line) => format!("\"{line}\""),
        None => "no such line".to_owned(),
    };
    Some(format!(
        "{file}, line {}: the file has {}, the record gives {}",
        same + 1,
        shown(&stated),
        shown(&made)
    ))
}

/// A scenario as it was played.
#[derive(Clone)]
pub(super) struct Case {
    pub(super) name: String,
    /// The sum of its text.
    pub(super) sum: String,
    pub(super) played: PlayedScenario,
    /// Whether the rig's line was lost in it, or the like.
    pub(super) ends_the_run: bool,
}

/// The scenarios of a record in order.
pub(super) fn cases(opened: &Opened, judged: &[Judged]) -> Result<VecDeque<Case>, String> {
    let mut left = judged;
    let mut pending = 0;
    let mut cases = VecDeque::new();
    for line in &opened.lines {
        match line {
            RecordLine::Scenario { .. } => pending += 1,
            RecordLine::Case {
                name,
                verdict,
                remarks,
                sha256,
                ..
            } => {
                let (own, rest) = left.split_at(pending.min(left.len()));
                (left, pending) = (rest, 0);
                let attempts: Option<Vec<Attempt>> = own.iter().map(Judged::attempt).collect();
                let attempts = attempts
                    .ok_or_else(|| format!("case {name}: an attempt cannot be judged again"))?;
                let played = match attempts.is_empty() {
                    true => not_played(verdict, remarks),
                    false => PlayedScenario::of(attempts),
                };
                cases.push_back(Case {
                    name: name.clone(),
                    sum: sha256.clone().unwrap_or_default(),
                    played,
                    ends_the_run: own.iter().any(Judged::ends_the_run),
                });
            }
            _ => {}
        }
    }
    Ok(cases)
}

fn not_played(verdict: &str, remarks: &[String]) -> PlayedScenario {
    let verdict = Verdict::ALL.into_iter().find(|own| own.name() == verdict);
    PlayedScenario {
        outcome: Outcome {
            verdict: verdict.unwrap_or(Verdict::Skipped),
            remarks: remarks.to_vec(),
            ..Outcome::rig_error(String::new())
        },
        attempts: Vec::new(),
    }
}

/// Whether the long conversations are among the scenarios of a record.
pub(super) fn is_thorough(opened: &Opened, cases: &VecDeque<Case>) -> bool {
    let drives = opened.header.drives.first().copied().unwrap_or(1);
    let long = thorough(drives).unwrap_or_default();
    let long = long.first().map(|entry| sum(entry.source.text.as_bytes()));
    long.is_some_and(|long| cases.iter().any(|case| case.sum == long))
}

/// A qualification like that of a record, of which nothing was noted yet.
pub(super) fn course(opened: &Opened, thorough: bool, began: String) -> Qualification {
    let header = &opened.header;
    let reached = reached(&opened.rig, header);
    Qualification::new(QualificationFacts {
        rig: opened.rig.clone(),
        byte_time: header.rate.byte_time(),
        exactness: header.exactness,
        resets: header.way.anew,
        reached: reached
            .into_iter()
            .filter_map(|(ring, place)| (ring == 0).then_some(place))
            .collect(),
        began,
        thorough,
    })
}

/// What a record comes to. Where it has `ended`, nothing may be played behind its last scenario.
fn qualified(opened: &Opened, mut cases: VecDeque<Case>, ended: bool) -> Result<Qualified, Stop> {
    let header = &opened.header;
    let thorough = is_thorough(opened, &cases);
    let mut course = course(opened, thorough, header.started.clone());
    let selected = header.selected.as_ref().map_or(0, Vec::len);
    let mut over = false;
    for case in cases.drain(..selected.min(cases.len())) {
        over |= case.ends_the_run;
        course.note(&case.name, &case.played);
    }
    let mut record = Record {
        opened,
        cases,
        ended,
        over,
    };
    let made = course.settle(&mut record)?;
    match record.cases.pop_front() {
        Some(case) => Err(Stop::Other(case.name)),
        None => Ok(made),
    }
}

/// A record in place of a rig.
struct Record<'o> {
    opened: &'o Opened,
    /// What was not asked for yet.
    cases: VecDeque<Case>,
    /// Whether nothing may be played behind the last one.
    ended: bool,
    over: bool,
}

/// Why a record does not go on.
enum Stop {
    /// It has no more scenarios.
    Missing,
    /// It has another scenario, of this name.
    Other(String),
}

impl QualifiedBench for Record<'_> {
    type Stop = Stop;

    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, Stop> {
        let case = self.cases.pop_front().ok_or(Stop::Missing)?;
        if case.sum != sum(entry.source.text.as_bytes()) {
            return Err(Stop::Other(case.name));
        }
        self.over |= case.ends_the_run;
        Ok(case.played)
    }

    fn over(&mut self) -> bool {
        self.over || self.ended && self.cases.is_empty()
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        twin(&self.opened.rig, header)
    }

    fn tell(&mut self, _: &str) -> Result<(), Stop> {
        Ok(())
    }

    fn show(&mut self, _: &RingScenario, _: &PlayedScenario) -> Result<(), Stop> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn both_files_of_a_qualification_are_compared() {
        let folder = tempfile::tempdir().expect("room");
        let path = folder.path();
        let put = |file: &str, text: &str| fs::write(path.join(file), text).expect("room");
        let wrong = |profile: Option<&str>| {
            let made = Qualified {
                profile: profile.map(str::to_owned),
                deviations: "deviations: none\ncompared: 3\n".to_owned(),
                verdict: Verdict::Passed,
            };
            compare(path, &made)
        };
        let asked = Some("schema = 1\n");
        let missing = wrong(asked);
        let starts = |place: usize, file: &str| missing[place].starts_with(file);
        assert!(starts(0, PROFILE) && starts(1, DEVIATIONS), "{missing:?}");
        put(PROFILE, "schema = 1\n");
        put(DEVIATIONS, "deviations: none\ncompared: 3\n");
        assert_eq!(wrong(asked), [""; 0]);
        let not_asked = "profile.toml: the drives were not asked, so there is none";
        assert_eq!(wrong(None), [not_asked]);
        put(PROFILE, "schema = 2\n");
        put(DEVIATIONS, "deviations: none\ncompared: 4\n");
        assert_eq!(
            wrong(asked),
            [
                "profile.toml, line 1: the file has \"schema = 2\", the record gives \"schema = 1\"",
                "deviations.txt, line 2: the file has \"compared: 4\", the record gives \"compared: 3\""
            ]
        );
    }
}
