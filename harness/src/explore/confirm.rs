//! Whether a difference is seen again, and which drive it belongs to.

use super::record::FuzzSettings;
use super::target::{Rehearsal, Target};
use super::{Act, ActKind, Case, ExploreError, Finding, OnRecord, Talk, To, drive_name};
use harness_proto::time::Span;
use std::collections::BTreeMap;

/// How many times in a row a byte must be late before the drive is blamed. A busy computer sometimes delays the same byte twice.
const TIMES_LATE: u8 = 4;

/// The attempts at a finding after the first one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Confirmation<'k> {
    /// A finding is confirmed when it is seen again this often ...
    confirm: u8,
    /// ... in this many attempts.
    of: u8,
    /// How often each difference was seen before, by its key.
    known: &'k BTreeMap<String, u8>,
    /// How long the line was used.
    pub(crate) took: Span,
    /// Whether the last finding was at another byte when it was seen again.
    moves: bool,
}

/// A finding of a ring with ports as its attempts give it; `None` where it has none. `known` says how often each difference was found
/// before, by its key.
///
/// # Errors
/// Its attempts are not those of a run with these settings.
pub fn judged_again(
    finding: &Finding,
    settings: &FuzzSettings,
    known: &BTreeMap<String, u8>,
) -> Result<Option<Finding>, ExploreError> {
    let mut target = OnRecord::new(&finding.attempts);
    let Some(case) = target.next().cloned() else {
        return Ok(None);
    };
    let rehearsal = Rehearsal::default();
    let first = target.attempt(&case, &rehearsal)?;
    let wrong = |what: &str| ExploreError::File(what.to_owned());
    let difference = first.difference;
    let difference = difference.ok_or_else(|| wrong("nothing differs in its first attempt"))?;
    let mut again = Finding {
        difference,
        case,
        seen_again: 0,
        of: 0,
        confirmed: false,
        ..finding.clone()
    };
    let mut confirmation = Confirmation::new(settings.confirm, settings.of, known);
    let before = first.before.as_deref();
    confirmation.confirm(&mut again, &rehearsal, before, &mut target)?;
    match target.over() {
        Some(_) => Ok(Some(again)),
        None => Err(wrong("it has more attempts than a run makes")),
    }
}

impl<'k> Confirmation<'k> {
    /// That of a finding which is to be seen again `confirm` times in `of` attempts.
    pub(crate) const fn new(confirm: u8, of: u8, known: &'k BTreeMap<String, u8>) -> Self {
        Self {
            confirm,
            of,
            known,
            took: Span::ZERO,
            moves: false,
        }
    }

    /// Tries a case again with drives made ready for it, then with more and more of what was sent before it. A difference that several
    /// cases have shown counts as confirmed too: a disturbed line or a busy computer does not repeat itself in different cases.
    pub(crate) fn confirm(
        &mut self,
        finding: &mut Finding,
        rehearsal: &Rehearsal,
        before: Option<&[Act]>,
        target: &mut dyn Target,
    ) -> Result<(), ExploreError> {
        let alone = finding.case.clone();
        for most in PREFIXES {
            let acts = last_acts(before.unwrap_or_default(), alone.drives, most);
            finding.case.acts = [acts, &alone.acts[..]].concat();
            self.again(finding, rehearsal, target)?;
            let longer = before.is_some_and(|before| before.len() > acts.len());
            if finding.confirmed || !longer || target.over().is_some() {
                break;
            }
        }
        if finding.confirmed {
            return self.blame(finding, target);
        }
        finding.case = alone;
        let times = self.known.get(&finding.difference.key());
        let times = times.copied().unwrap_or(0);
        if times >= self.confirm && !finding.difference.time {
            (finding.seen_again, finding.of) = (times, times);
            finding.confirmed = true;
        }
        Ok(())
    }

    /// Repeats a case until it has shown the same kind of difference often enough, or no longer can.
    fn again(
        &mut self,
        finding: &mut Finding,
        rehearsal: &Rehearsal,
        target: &mut dyn Target,
    ) -> Result<(), ExploreError> {
        (finding.seen_again, finding.of) = (0, 0);
        self.moves = false;
        let (confirm, of) = match finding.difference.time {
            true => (TIMES_LATE, TIMES_LATE),
            false => (self.confirm, self.of),
        };
        let own = finding.difference.clone();
        while finding.of < of && target.over().is_none() {
            target.begin();
            let tried = target.attempt(&finding.case, rehearsal)?;
            self.took = self.took + tried.took;
            finding.attempts.extend(target.recorded());
            finding.of += 1;
            let Some(other) = tried.difference.filter(|other| other.is_like(&own)) else {
                if confirm > finding.seen_again + (of - finding.of) {
                    return Ok(());
                }
                continue;
            };
            // A late computer delays another byte the next time; a drive that counts is wrong at another byte too.
            let moved = other.byte != finding.difference.byte;
            self.moves |= finding.of > 1 && moved;
            let late = finding.difference.time && moved;
            finding.seen_again += u8::from(!late);
            finding.difference = if late {
                finding.difference.clone()
            } else {
                other
            };
            if finding.seen_again >= confirm {
                finding.confirmed = true;
                return Ok(());
            }
        }
        Ok(())
    }

    /// Checks whether the drive that the telegram addresses is to blame. If another drive on the byte's way is to blame, the same
    /// conversation with the drives' roles exchanged differs at that byte too.
    fn blame(
        &mut self,
        finding: &mut Finding,
        target: &mut dyn Target,
    ) -> Result<(), ExploreError> {
        let drives = finding.case.drives;
        let always = !self.moves && finding.seen_again == finding.of;
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
            self.took = self.took + tried.took;
            finding.attempts.extend(target.recorded());
            if tried.not_played.is_some()
                || tried
                    .difference
                    .is_some_and(|own| own.byte <= finding.difference.byte)
            {
                return Ok(());
            }
        }
        // A drive that is wrong only sometimes may have been right by chance.
        let rehearsal = target.rehearse(&finding.case)?;
        target.begin();
        let tried = target.attempt(&finding.case, &rehearsal)?;
        self.took = self.took + tried.took;
        finding.attempts.extend(target.recorded());
        let again = tried
            .difference
            .is_some_and(|own| own.byte == finding.difference.byte);
        if !again {
            return Ok(());
        }
        finding.difference.drive = Some(meant);
        let name = drive_name(finding.difference.ring, meant);
        finding.difference.about = format!("drive {name}, {}", finding.difference.about);
        Ok(())
    }
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
