//! Judges the folder of a run again: its findings on simulated drives, and whether its lines can be those of a run.

use super::confirm::Confirmation;
use super::record::{KeptRun, LogLine, Progress};
use super::swarm::ROUND;
use super::{Differing as _, ExploreError, Finding, FuzzCase, FuzzSettings, JudgedAgain, Target};
use crate::counted::counted;
use std::collections::BTreeMap;

/// Tries the case of a finding, and again until it is confirmed or is not, as the run did; `None` if nothing differs at first. `known` says how
/// often each difference was found before, by its key.
///
/// # Errors
/// The target fails.
pub fn tried_again<C: FuzzCase>(
    finding: Finding<C>,
    about: &FuzzSettings<C>,
    known: &BTreeMap<String, u8>,
    target: &mut dyn Target<C>,
) -> Result<Option<Finding<C>>, ExploreError> {
    let rehearsal = target.rehearse(&finding.case)?;
    let tried = target.attempt(&finding.case, &rehearsal)?;
    let Some(difference) = tried.difference else {
        return Ok(None);
    };
    let mut again = Finding {
        difference,
        seen_again: 0,
        of: 0,
        confirmed: false,
        ..finding
    };
    let mut confirmation = Confirmation::new(about.confirm, about.of, known);
    let before = tried.before.as_deref();
    C::confirm(&mut confirmation, &mut again, &rehearsal, before, target)?;
    Ok(Some(again))
}

/// The same on simulated drives, and whether it gives the same finding.
///
/// # Errors
/// The model cannot be made.
pub fn played_again<C: FuzzCase>(
    finding: &Finding<C>,
    about: &FuzzSettings<C>,
    known: &BTreeMap<String, u8>,
    target: &mut dyn Target<C>,
) -> Result<JudgedAgain, ExploreError> {
    let first = Finding {
        shrunk_in: None,
        attempts: Vec::new(),
        ..finding.clone()
    };
    let Some(again) = tried_again(first, about, known, target)? else {
        return Ok(JudgedAgain::Differs(
            "nothing differs in its conversation".to_owned(),
        ));
    };
    if again == *finding {
        return Ok(JudgedAgain::Same);
    }
    let (kept, found) = (told(finding), told(&again));
    Ok(JudgedAgain::Differs(match kept == found {
        true => "its conversation does not differ as the finding says".to_owned(),
        false => format!("the file has \"{kept}\", its conversation gives \"{found}\""),
    }))
}

/// A finding in a line.
fn told<C: FuzzCase>(finding: &Finding<C>) -> String {
    let Finding { seen_again, of, .. } = finding;
    format!(
        "{}: {}; seen again {seen_again} of {of} times",
        finding.difference.signature(),
        finding.difference.about()
    )
}

/// The name of the files of a case's finding.
#[must_use]
pub(crate) fn file_of(number: u64) -> String {
    format!("finding-{number:06}")
}

/// What in the lines of a record no run writes, in sentences: cases out of order or twice, rounds that are missing, counts that cannot be.
#[must_use]
pub fn impossible<C: FuzzCase>(kept: &KeptRun<C>) -> Vec<String> {
    let mut wrong = Vec::new();
    let (mut next, mut shown, mut rounds) = (0, 0, 0);
    for line in &kept.lines {
        match line {
            LogLine::Swarm { round, spices } => {
                // A round that began with nothing left of its bounds begins again when the run is resumed.
                if *round != rounds && round.checked_add(1) != Some(rounds) {
                    wrong.push(format!("round {round} is not the one that follows"));
                }
                rounds = round.saturating_add(1);
                let mut spices = spices.iter();
                if let Some(spice) = spices.find(|spice| !kept.about.spices.contains(spice)) {
                    wrong.push(format!("round {round}: the run has no `{spice}`"));
                }
            }
            LogLine::Kept { number, .. } | LogLine::Finding { number, .. } => {
                if *number < next {
                    wrong.push(format!("case {number} is not behind the one before it"));
                }
                if number / ROUND + 1 != rounds {
                    wrong.push(format!("case {number} is not of its round"));
                }
                if *number >= kept.progress.cases {
                    wrong.push(format!(
                        "case {number} is none of the first {}",
                        kept.progress.cases
                    ));
                }
                next = number.saturating_add(1);
                shown += 1;
            }
            LogLine::Run(_) | LogLine::Progress(_) => {}
        }
        if let LogLine::Kept { number, case, .. } = line
            && !case.is_of(&kept.about)
        {
            wrong.push(format!(
                "case {number} is for other drives than the run has"
            ));
        }
    }
    let Progress {
        cases,
        not_sent,
        repeats,
        ..
    } = kept.progress;
    let first = rounds.saturating_sub(1).saturating_mul(ROUND);
    if !(first..=rounds.saturating_mul(ROUND)).contains(&cases) {
        wrong.push(format!(
            "the record has {} and {}, which do not fit",
            counted(rounds, "round"),
            counted(cases, "case")
        ));
    }
    let counted = [not_sent, repeats, shown].into_iter();
    if counted.fold(0, u64::saturating_add) > cases {
        wrong.push("more came of the cases than there are".to_owned());
    }
    let counts = |row: &Progress| [row.cases, row.not_sent, row.repeats, row.wire_ns];
    let falls = |pair: &[Progress]| {
        let pairs = counts(&pair[0]).into_iter().zip(counts(&pair[1]));
        pairs.into_iter().any(|(before, behind)| before > behind)
    };
    let begins = kept.history.first() == Some(&Progress::default());
    if !begins || kept.history.windows(2).any(falls) {
        wrong.push("the counts do not begin at 0, or one of them falls".to_owned());
    }
    wrong
}
