//! The files of a qualification, made again from its record.

use super::derive::verdict_named;
use super::files::{DEVIATIONS, PROFILE, read_text};
use super::record::RecordLine;
use super::selection;
use super::verify::{JudgedAttempt, OpenedFolder};
use crate::rig::playing::{QualificationRecord, Qualified, RecordJudge, RecordedCase};
use crate::rig::{Attempt, PlayedScenario};
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use std::collections::VecDeque;
use std::path::Path;

/// What a qualification comes to by its record: each outcome that it allows. Or what is wrong, in a sentence.
pub(super) type QualifiedAgain = Result<Vec<Qualified>, String>;

/// What the record of a qualification comes to.
pub(super) fn again(
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
    judge: &mut dyn RecordJudge,
) -> QualifiedAgain {
    let header = &opened.header;
    let record = QualificationRecord::Run {
        cases: cases(opened, judged)?,
        selected: header.selected.as_ref().map_or(0, Vec::len),
        whole: selection::compare(opened).missing.is_none(),
    };
    judge.qualified(&header.started, record)
}

/// What of `profile.toml` and `deviations.txt` does not follow from the record, in sentences.
pub(super) fn differences(path: &Path, made: QualifiedAgain) -> Vec<String> {
    let made = match made {
        Ok(made) => made,
        Err(why) => return vec![why],
    };
    let mut differences = made.iter().map(|made| compare(path, made));
    let Some(first) = differences.next() else {
        let why = "the record ends within a probe, which leaves no such file";
        let there = [PROFILE, DEVIATIONS];
        let there = there.into_iter().filter(|file| path.join(file).exists());
        return there.map(|file| format!("{file}: {why}")).collect();
    };
    match first.is_empty() || differences.any(|wrong| wrong.is_empty()) {
        true => Vec::new(),
        false => first,
    }
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
    let same = lines.take_while(|(stated, made)| stated == made).count();
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

/// The scenarios of a record in order.
pub(super) fn cases(
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
) -> Result<VecDeque<RecordedCase>, String> {
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
                let (judged, rest) = left.split_at(pending.min(left.len()));
                (left, pending) = (rest, 0);
                let attempts: Option<Vec<Attempt>> =
                    judged.iter().map(JudgedAttempt::attempt).collect();
                let attempts = attempts
                    .ok_or_else(|| format!("case {name}: an attempt cannot be judged again"))?;
                let played = match attempts.is_empty() {
                    true => not_played(verdict, remarks),
                    false => PlayedScenario::of(attempts),
                };
                cases.push_back(RecordedCase {
                    name: name.clone(),
                    sum: sha256.clone().unwrap_or_default(),
                    played,
                    ends_the_run: judged.iter().any(JudgedAttempt::ends_the_run),
                });
            }
            _ => {}
        }
    }
    Ok(cases)
}

fn not_played(verdict: &str, remarks: &[String]) -> PlayedScenario {
    let verdict = verdict_named(verdict);
    PlayedScenario {
        outcome: Outcome {
            verdict: verdict.unwrap_or(Verdict::Skipped),
            remarks: remarks.to_vec(),
            ..Outcome::rig_error(String::new())
        },
        attempts: Vec::new(),
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
