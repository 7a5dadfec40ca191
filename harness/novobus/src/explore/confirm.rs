//! Whether a difference on a ring is seen again, and which drive it belongs to.

use super::case::{Act, ActKind, Case, Talk, To};
use super::on_record::OnRecord;
use super::setup::drive_name;
use crate::explore::{Finding, FuzzSettings, Rehearsal};
use harness_bench::explore::{Confirmation, ExploreError, Target, tried_again};
use std::collections::BTreeMap;

/// A finding of a ring with ports as its attempts give it; `None` where it has none. `known` says how often each difference was found
/// before, by its key.
///
/// # Errors
/// Its attempts are not those of a run with these settings.
pub(crate) fn judged_again(
    finding: &Finding,
    settings: &FuzzSettings,
    known: &BTreeMap<String, u8>,
) -> Result<Option<Finding>, ExploreError> {
    let mut target = OnRecord::new(&finding.attempts);
    let Some(case) = target.next().cloned() else {
        return Ok(None);
    };
    let first = Finding {
        case,
        ..finding.clone()
    };
    let wrong = |what: &str| ExploreError::File(what.to_owned());
    let again = tried_again(first, settings, known, &mut target)?;
    let again = again.ok_or_else(|| wrong("nothing differs in its first attempt"))?;
    match target.over() {
        Some(_) => Ok(Some(again)),
        None => Err(wrong("it has more attempts than a run makes")),
    }
}

/// Tries a case again with drives made ready for it, then with more and more of what was sent before it.
pub(super) fn on_ring(
    confirmation: &mut Confirmation<'_>,
    finding: &mut Finding,
    rehearsal: &Rehearsal,
    before: Option<&[Act]>,
    target: &mut dyn Target<Case>,
) -> Result<(), ExploreError> {
    let alone = finding.case.clone();
    for most in PREFIXES {
        let acts = last_acts(before.unwrap_or_default(), alone.drives, most);
        finding.case.acts = [acts, &alone.acts[..]].concat();
        confirmation.again(finding, rehearsal, target)?;
        let longer = before.is_some_and(|before| before.len() > acts.len());
        if finding.confirmed || !longer || target.over().is_some() {
            break;
        }
    }
    if finding.confirmed {
        return blame(confirmation, finding, target);
    }
    finding.case = alone;
    confirmation.by_others(finding);
    Ok(())
}

/// Checks whether the drive that the telegram addresses is to blame. If another drive on the byte's way is to blame, the same
/// conversation with the drives' roles exchanged differs at that byte too. An address byte is another one then: it blames no drive.
fn blame(
    confirmation: &mut Confirmation<'_>,
    finding: &mut Finding,
    target: &mut dyn Target<Case>,
) -> Result<(), ExploreError> {
    let drives = finding.case.drives;
    let always = !confirmation.moves && finding.seen_again == finding.of;
    let Some(meant) = finding
        .difference
        .meant
        .filter(|_| always && finding.difference.drive.is_none())
    else {
        return Ok(());
    };
    for step in 1..drives.min(MOST_EXCHANGED) {
        let case = exchanged(&finding.case, step);
        let rehearsal = target.rehearse(&case)?;
        if rehearsal.denied.is_some() || target.over().is_some() {
            return Ok(());
        }
        target.begin();
        let tried = target.attempt(&case, &rehearsal)?;
        confirmation.took = confirmation.took + tried.took;
        finding.attempts.extend(target.recorded());
        if tried.not_played.is_some()
            || tried
                .difference
                .is_some_and(|difference| difference.byte <= finding.difference.byte)
        {
            return Ok(());
        }
    }
    // A drive that is wrong only sometimes may have been right by chance.
    let rehearsal = target.rehearse(&finding.case)?;
    target.begin();
    let tried = target.attempt(&finding.case, &rehearsal)?;
    confirmation.took = confirmation.took + tried.took;
    finding.attempts.extend(target.recorded());
    let again = tried
        .difference
        .is_some_and(|difference| difference.byte == finding.difference.byte);
    if !again {
        return Ok(());
    }
    finding.difference.drive = Some(meant);
    let name = drive_name(finding.difference.ring, meant);
    finding.difference.about = format!("drive {name}, {}", finding.difference.about);
    Ok(())
}

/// How many earlier bytes are sent again before a case that shows nothing by itself.
const PREFIXES: [usize; 3] = [0, 2_000, 8_000];

/// The maximum number of drives to exchange roles with.
const MOST_EXCHANGED: u8 = 8;

/// The last acts that fit into `most` bytes.
fn last_acts(acts: &[Act], drives: u8, most: usize) -> &[Act] {
    let mut left = most;
    let mut from = acts.len();
    while let Some(act) = from.checked_sub(1).map(|before| &acts[before]) {
        match left.checked_sub(act.length(drives)) {
            Some(rest) if most > 0 => left = rest,
            _ => break,
        }
        from -= 1;
    }
    &acts[from..]
}

/// The same conversation with each telegram addressed to the drive `step` addresses further on.
fn exchanged(case: &Case, step: u8) -> Case {
    let mut new = case.clone();
    for act in &mut new.acts {
        if let ActKind::Talk(Talk {
            to: To::Drive(drive),
            ..
        }) = &mut act.what
        {
            let other = (u16::from(*drive) + u16::from(step)) % u16::from(case.drives);
            *drive = u8::try_from(other).unwrap_or(*drive);
        }
    }
    new
}
