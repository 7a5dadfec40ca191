//! Which known deviation explains how a ring differed from the model; and which one of the master does, where the bench's own master is wrong.

use super::hypothesis::{Fit, fit, judge};
use crate::language::syntax::{DriveRange, Header, Setup};
use crate::rig::DriverAttempt;
use crate::twin::{Conversation, Exactness, Twin};
use harness_sim::novobus::deviation::{
    DEVIATIONS, Deviation, MASTER_DEVIATIONS, MasterDeviation, RELATIVES,
};
use std::collections::BTreeSet;
use std::fmt;

/// Largest ring in which every drive is tried. In larger rings only drives addressed by telegrams are tried.
const SMALL: u8 = 16;

/// Maximum number of attempts on simulated drives to explain.
const MOST_SIMULATED: usize = 12;

/// Number of attempts for which every candidate is tried on simulated drives, even if it has explained none.
const ASKED_OF_ALL: usize = 3;

/// How many cells may hold what the master wrote although a wrong drive's would not: a cell may have held that byte before.
const MOST_AGAINST: u64 = 2;

/// A deviation that explains every byte.
#[derive(Clone, Debug)]
pub(crate) struct NamedDeviation {
    pub deviation: &'static Deviation,
    /// Which drives have it.
    pub whose: AccusedDrives,
    /// Whether every byte would be the same if all drives had it: then that drive has it, and perhaps others.
    pub perhaps_of_all: bool,
}

/// Which drives have a deviation, as far as the bytes tell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum AccusedDrives {
    /// One of these; more than one where the bytes do not tell which.
    OneOf(Vec<u8>),
    /// All drives: a deviation of one drive alone does not explain the bytes.
    Every,
}

impl fmt::Display for NamedDeviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Deviation {
            name,
            section,
            about,
            ..
        } = self.deviation;
        let more = match self.perhaps_of_all {
            true => "; the bytes do not say whether other drives do the same",
            false => "",
        };
        let what = format!("{name} (ND21 {section}): {about}{more}");
        match &self.whose {
            AccusedDrives::Every => write!(f, "every drive: {what}"),
            AccusedDrives::OneOf(drives) => match drives.as_slice() {
                [drive] => write!(f, "drive {drive}: {what}"),
                drives => {
                    let drives: Vec<_> = drives.iter().map(u8::to_string).collect();
                    write!(
                        f,
                        "{what}; not known which drive: one of {}",
                        drives.join(", ")
                    )
                }
            },
        }
    }
}

/// What a ring was seen to do, attempt by attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RingSeen<'s> {
    /// How many drives the ring has.
    pub drives: u8,
    /// The drives that are tried one by one in a large ring.
    pub suspects: &'s [u8],
    /// The attempts in which a byte differed from the model.
    pub differing: &'s [Vec<Conversation>],
    /// Attempts in which none did.
    pub alike: &'s [Vec<Conversation>],
    /// How exactly is compared.
    pub exactness: Exactness,
}

/// A deviation of one drive, or of every drive, that has explained everything so far.
struct Candidate {
    deviation: &'static Deviation,
    drive: Option<u8>,
    timely: bool,
    /// How many attempts it has explained.
    explained: usize,
}

impl Candidate {
    /// What makes simulated drives behave so.
    fn header(&self) -> Header {
        let whom = self.drive.map(|drive| DriveRange::one(0, drive));
        let whom = whom.unwrap_or_else(|| DriveRange::all(0));
        Setup::deviates(whom, self.deviation).into()
    }
}

/// The deviations that explain every byte of every attempt, including attempts in which nothing differed. `twin` returns a ring with
/// this header behind its own. A deviation of one drive is simpler than one of all drives, which is returned only if no single drive
/// explains everything. An attempt that the model of the manual explains from its power-up on can refute a deviation, but not prove it.
///
/// Simulated drives keep their state from earlier scenarios, which a fresh twin does not have, so no twin may give every byte. For them
/// the deviation that explains the most attempts is named. Relatives of deviations with other numbers are named only if no other
/// deviation explains everything, or if they accuse another drive: then it is not proven which drive it is.
pub(crate) fn name<E>(
    seen: &RingSeen<'_>,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Vec<NamedDeviation> {
    let mut named = name_among(seen, candidates(seen, DEVIATIONS.all()), twin);
    if !named.is_empty() && seen.exactness.knows_cells {
        return named;
    }
    let mut relatives = name_among(seen, candidates(seen, RELATIVES.all()), twin);
    let of_all = |named: &[NamedDeviation]| {
        named
            .iter()
            .any(|named| named.whose == AccusedDrives::Every)
    };
    if named.is_empty() || of_all(&named) && !of_all(&relatives) && !relatives.is_empty() {
        return relatives;
    }
    let accused = drives(&named);
    relatives.retain(|relative| match &relative.whose {
        AccusedDrives::Every => false,
        AccusedDrives::OneOf(some) => some.iter().any(|drive| !accused.contains(drive)),
    });
    named.extend(relatives.into_iter().filter(|_| !accused.is_empty()));
    named
}

/// The drives that some of these accuse.
fn drives(named: &[NamedDeviation]) -> BTreeSet<u8> {
    let whose = named.iter().map(|deviation| &deviation.whose);
    let some = whose.filter_map(|whose| match whose {
        AccusedDrives::OneOf(some) => Some(some),
        AccusedDrives::Every => None,
    });
    some.flatten().copied().collect()
}

/// What is proven by deviations that each explain everything: a drive only if all of them accuse it alone. Where they do not, each may be
/// a deviation of any drive that one of them accuses.
pub(super) fn proven(mut named: Vec<NamedDeviation>) -> Vec<NamedDeviation> {
    let all: Vec<u8> = drives(&named).into_iter().collect();
    for deviation in &mut named {
        if deviation.whose != AccusedDrives::Every {
            deviation.whose = AccusedDrives::OneOf(all.clone());
        }
    }
    named
}

fn name_among<E>(
    seen: &RingSeen<'_>,
    mut candidates: Vec<Candidate>,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Vec<NamedDeviation> {
    let explains = |header: &Header, attempt: &[Conversation]| -> Option<Fit> {
        judge(twin(header).ok()?, attempt, seen.exactness)
    };
    let manual = Header::default();
    let (simulated, mut differed) = (seen.exactness.knows_cells, 0);
    // What earlier scenarios have left in simulated drives grows with each.
    let most = if simulated {
        MOST_SIMULATED
    } else {
        usize::MAX
    };
    let mut differing: Vec<_> = seen.differing.iter().take(most).collect();
    // The shortest first: it refutes most, and costs least.
    let length = |conversation: &Conversation| conversation.done.len();
    differing.sort_by_key(|attempt| attempt.iter().map(length).sum::<usize>());
    for attempt in differing {
        if simulated && differed == MOST_SIMULATED {
            break;
        }
        let right = twin(&manual).map(|twin| fit(twin, attempt, seen.exactness));
        // What is not compared up to the byte that differs explains nothing, and neither does a drive that is right where this one is wrong.
        let better = |fit: &Fit| match right {
            Ok(Ok(right)) => fit.timely && !right.timely,
            Ok(Err(differs)) => fit.compared >= differs && fit.against <= MOST_AGAINST,
            Err(_) => true,
        };
        if matches!(right, Ok(Ok(right)) if right.timely) {
            continue;
        }
        differed += 1;
        candidates.retain_mut(|candidate| {
            let fit = explains(&candidate.header(), attempt).filter(better);
            candidate.timely &= fit.is_none_or(|fit| fit.timely);
            candidate.explained += usize::from(fit.is_some());
            candidate.explained == differed || simulated
        });
        let mut explained = candidates.iter().map(|candidate| candidate.explained);
        let whole = explained.any(|explained| explained == differed);
        if whole && differed >= ASKED_OF_ALL {
            candidates.retain(|candidate| candidate.explained > 0);
        }
    }
    let most = candidates.iter().map(|candidate| candidate.explained).max();
    candidates.retain(|candidate| candidate.explained > 0 && Some(candidate.explained) == most);
    for attempt in seen.alike {
        let right = explains(&manual, attempt).filter(|_| !simulated && !candidates.is_empty());
        let Some(right) = right else { continue };
        candidates.retain(|candidate| {
            let fit = explains(&candidate.header(), attempt);
            fit.is_some_and(|fit| fit.against <= right.against + MOST_AGAINST)
        });
    }
    simplest(candidates)
}

fn candidates(
    seen: &RingSeen<'_>,
    deviations: impl Iterator<Item = &'static Deviation>,
) -> Vec<Candidate> {
    let single: Vec<u8> = match seen.drives <= SMALL {
        true => (0..seen.drives).collect(),
        false => seen.suspects.to_vec(),
    };
    let every = (seen.drives > 1).then_some(None);
    let whose: Vec<_> = single.into_iter().map(Some).chain(every).collect();
    let of = |deviation| {
        let candidate = move |drive: &Option<u8>| Candidate {
            deviation,
            drive: *drive,
            timely: true,
            explained: 0,
        };
        whose.iter().map(candidate)
    };
    deviations.flat_map(of).collect()
}

/// Those that explain the times too if any does, and of these those of single drives if there are some; one entry for each deviation.
fn simplest(mut candidates: Vec<Candidate>) -> Vec<NamedDeviation> {
    if candidates.iter().any(|candidate| candidate.timely) {
        candidates.retain(|candidate| candidate.timely);
    }
    let of_one = |candidate: &Candidate| candidate.drive.is_some();
    let of_all = candidates.iter().filter(|candidate| !of_one(candidate));
    let of_all: BTreeSet<&str> = of_all.map(|candidate| candidate.deviation.name).collect();
    if candidates.iter().any(of_one) {
        candidates.retain(of_one);
    }
    let of_one = candidates.chunk_by(|one, other| one.deviation.name == other.deviation.name);
    let named = of_one.map(|alike| {
        let drives = alike.iter().filter_map(|candidate| candidate.drive);
        let drives: Vec<u8> = drives.collect();
        NamedDeviation {
            deviation: alike[0].deviation,
            perhaps_of_all: !drives.is_empty() && of_all.contains(alike[0].deviation.name),
            whose: match drives.is_empty() {
                true => AccusedDrives::Every,
                false => AccusedDrives::OneOf(drives),
            },
        }
    });
    named.collect()
}

/// The deviations of the master under which everything is as it was recorded, in every attempt in which the driver had a part.
#[must_use]
pub(crate) fn deviating_masters(attempts: &[DriverAttempt]) -> Vec<&'static MasterDeviation> {
    let explains = |deviation: &&'static MasterDeviation| {
        let mut all = attempts.iter();
        all.all(|driven| driven.is_explained_by(Some(deviation)))
    };
    MASTER_DEVIATIONS.all().filter(explains).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::novobus::deviation::deviation;

    fn named(name: &str, drives: &[u8]) -> NamedDeviation {
        NamedDeviation {
            deviation: deviation(name).expect("a deviation"),
            whose: AccusedDrives::OneOf(drives.to_vec()),
            perhaps_of_all: false,
        }
    }

    /// A drive is accused only where every explanation accuses it.
    #[test]
    fn a_drive_is_proven_only_if_all_explanations_agree() {
        let text = |named: Vec<NamedDeviation>| -> Vec<String> {
            let proven = proven(named);
            proven.iter().map(NamedDeviation::to_string).collect()
        };
        let zeros = |drives: &[u8]| named("increments-zeros-only", drives);
        let none = |drives: &[u8]| named("adds-0-in-error-mode", drives);
        for lines in [text(vec![none(&[1])]), text(vec![none(&[1]), zeros(&[1])])] {
            assert!(
                lines.iter().all(|line| line.starts_with("drive 1: ")),
                "{lines:?}"
            );
        }
        for lines in [
            text(vec![none(&[1]), zeros(&[0])]),
            text(vec![none(&[0, 1]), zeros(&[0])]),
        ] {
            let unknown = "not known which drive: one of 0, 1";
            let open = |line: &String| line.ends_with(unknown) && !line.starts_with("drive");
            assert!(lines.iter().all(open), "{lines:?}");
        }
    }
}
