//! Which drive differs from the manual where no known deviation explains what it does.
//!
//! Between the sync byte of a telegram and its end only the addressed drive changes a byte (ND21 9.3). A byte that differs there is that
//! drive's, unless another drive damages the bytes that it passes on: then bytes differ in telegrams to any drive. To tell these cases
//! apart, the attempt is played again with the drives' roles exchanged.

use super::diagnose::{AccusedDrives, NamedDeviation, proven};
use super::exchange::{AttemptBytes, begin};
use super::pinned::PinnedDrive;
use crate::calm::calm;
use crate::language::read::RingScenario;
use crate::twin::{Comparison, Conversation, Divergence, Symptom};
use harness_bench::scenario::source::Source;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::Role;
use harness_proto::novobus::sync::{Addressing, PAUSE, SYNCO, SyncByte};
use harness_proto::time::Span;
use std::collections::BTreeSet;
use std::fmt;

/// How the byte at which an attempt differed belongs to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Meant {
    /// It stands in a telegram with the address of this drive.
    Own(u8),
    /// It stands behind such a telegram with an error in it, and nothing but SYNCO between: this drive and those behind it are in the error
    /// mode (9.7).
    Behind(u8),
    /// The bytes do not say.
    Nobody,
}

/// An attempt that differed from the model.
#[derive(Clone, Debug)]
pub(crate) struct Sighting {
    /// The drive that the byte belongs to.
    pub meant: Meant,
    /// The section of the broken rule.
    pub section: &'static str,
    /// What was seen, as a sentence.
    pub about: String,
    /// The byte that the model expects, and the one that came.
    pub(super) values: (u8, u8),
    /// What the byte is for.
    pub(super) role: Role,
    /// The byte that the master sent.
    pub(super) byte: u8,
    /// The drives, if any, whose telegrams the byte and the zeros directly in front of it belong to, apart from sync and address bytes.
    pub(super) addressed: Vec<Option<u8>>,
    /// The address byte of its telegram, where that is for no drive.
    pub(super) to_nobody: Option<u8>,
    /// Whether ReadWord or ReadLong reads it, of a cell that WriteByte has written.
    pub(super) word_of_bytes: bool,
    /// Whether zeros have come from it on, and not only in its place.
    pub(super) is_refused: bool,
    /// Whether it stands in a telegram with a short address.
    pub(super) is_short: bool,
    sent: AttemptBytes,
    /// How many bytes are sent until the difference is seen and the telegram is complete.
    count: usize,
    /// The same with an address byte in every telegram, where the one of the byte has a short address: another drive may take a short
    /// address for its own (9.2).
    long: Option<(AttemptBytes, usize)>,
}

impl Sighting {
    /// The byte of a conversation at which an attempt on a ring of `drives` differed from the model; `None` where the attempt cannot be
    /// sent again, or no other value came.
    #[must_use]
    pub(crate) fn of(
        attempt: &[Conversation],
        (place, compared): (usize, &Comparison),
        drives: u8,
        byte_time: Span,
    ) -> Option<Self> {
        let found = compared.divergence.as_ref()?;
        // The computer may cause a missing or late byte, but not another value.
        let values = found.expected.zip(found.received);
        let alike = |((_, due), (_, came)): ((_, Received), (_, Received))| due.byte == came.byte;
        if found.ring != 0 || found.what != Symptom::Value && values.is_none_or(alike) {
            return None;
        }
        let first = begin(attempt, drives);
        let before = match place.checked_sub(1) {
            _ if place < first => return None,
            Some(before) if before >= first => {
                AttemptBytes::of(attempt, before, drives, byte_time)?
                    .bytes
                    .len()
            }
            _ => 0,
        };
        let sent = AttemptBytes::of(attempt, place, drives, byte_time)?;
        let all = sent.roles.iter().zip(&sent.bytes).enumerate().skip(before);
        let answered = all.filter(|(_, (role, (byte, _)))| (**role, *byte) != (Role::Idle, PAUSE));
        let answered: Vec<usize> = answered.map(|(index, _)| index).collect();
        let received = &attempt[place].received;
        // Bytes that nobody asked for answer none that was sent. Behind a check sequence that ends them every byte has come back.
        let unasked = match compared.is_after_a_race(found) {
            true => received.len().checked_sub(answered.len())?,
            false => 0,
        };
        let index = *answered.get((found.byte - 1).checked_sub(unasked)?)?;
        let came = |at: usize| {
            let place = (found.byte - 1 + at).checked_sub(index)?;
            received.get(place).map(|(_, _, answer)| answer.byte)
        };
        let (meant, section, end) = sent.blame(index, drives, found, &came);
        let word_of_bytes = sent.sent_bytes().is_word_of_bytes(index);
        let is_short = sent.sent_bytes().is_short(index);
        let (role, byte) = (sent.roles[index], sent.bytes[index].0);
        let is_refused = (index..index + 2).all(|at| came(at).is_none_or(|byte| byte == 0));
        let zeros = (before..index).rev().take_while(|at| came(*at) == Some(0));
        let first = zeros.last().unwrap_or(index);
        let addressed = (first..=index).filter_map(|at| sent.addressed(at));
        let addressed = addressed.collect();
        let to_nobody = sent.to_nobody(index);
        let count = end.max(index + 1).min(sent.bytes.len());
        let long = is_short
            .then(|| sent.with_addresses(count, drives))
            .flatten();
        let meant = match long {
            None if is_short => Meant::Nobody,
            _ => meant,
        };
        let (sent, count) = match meant {
            Meant::Own(drive) => sent.shortened(count, drive),
            _ => (sent, count),
        };
        Some(Self {
            meant,
            section,
            about: found.to_string(),
            values: values.map(|((_, due), (_, came))| (due.byte, came.byte))?,
            role,
            byte,
            addressed,
            to_nobody,
            word_of_bytes,
            is_refused,
            is_short,
            count,
            sent,
            long,
        })
    }

    /// How many bytes are sent until the difference is seen.
    pub(super) const fn length(&self) -> usize {
        self.count
    }

    /// The text of a scenario that sends the same bytes again.
    pub(super) fn again(&self, drives: u8) -> Option<String> {
        self.sent.exchanged(self.count, drives, 0)
    }
}

/// A sighting that was played again with exchanged roles, step by step, and the owner of the differing byte in each step, if one differed.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// The drive that the byte belonged to in the attempt.
    pub meant: Meant,
    /// The offset of the addresses and the result, one for each other drive. An offset of 0 is the attempt without short addresses.
    pub steps: Vec<(u8, Option<Meant>)>,
}

/// Maximum number of differing attempts that are played again with exchanged roles.
const MOST_TRIED: usize = 3;

/// Maximum number of drives whose roles are exchanged.
const MOST_EXCHANGED: u8 = 8;

/// Plays a scenario and returns the owner of the byte that differed from the model, if one did; `None` if the run shows nothing.
type Ask<'a, E> = &'a mut dyn FnMut(&RingScenario) -> Result<Option<Option<Meant>>, E>;

/// Plays differing attempts again with exchanged roles, the clearest and shortest first. Each sighting has the name of its scenario. `ask`
/// plays a scenario.
///
/// # Errors
/// Those of `ask`.
pub(crate) fn exchange<E>(
    drives: u8,
    mut sightings: Vec<(String, Sighting)>,
    ask: Ask<'_, E>,
) -> Result<Vec<Trial>, E> {
    sightings.retain(|(_, sighting)| sighting.meant != Meant::Nobody);
    sightings
        .sort_by_key(|(_, sighting)| (matches!(sighting.meant, Meant::Behind(_)), sighting.count));
    let mut trials: Vec<Trial> = Vec::new();
    let mut tried = BTreeSet::new();
    for (name, sighting) in &sightings {
        if trials.len() == MOST_TRIED || !tried.insert(name) {
            continue;
        }
        let mut steps = Vec::new();
        let (sent, count, offsets) = match &sighting.long {
            Some((long, count)) => (long, *count, 0..drives.min(MOST_EXCHANGED)),
            None => (
                &sighting.sent,
                sighting.count,
                1..drives.min(MOST_EXCHANGED),
            ),
        };
        for step in offsets.clone() {
            let text = sent.exchanged(count, drives, step);
            let Some(text) = text else { break };
            let source = Source {
                name: format!("{}{name}-by-{step}", super::EXCHANGED),
                text: text.into(),
            };
            let Ok(entry) = RingScenario::new(source, Some(drives)) else {
                break;
            };
            let Some(found) = ask(&entry)? else { break };
            steps.push((step, found));
        }
        if !steps.is_empty() && steps.len() == offsets.len() {
            let meant = sighting.meant;
            trials.push(Trial { meant, steps });
        }
    }
    Ok(trials)
}

/// A drive that is to blame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Culprit {
    pub drive: u8,
    /// Whether every drive of the ring may be as wrong as this one.
    pub perhaps_of_all: bool,
}

impl fmt::Display for Culprit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let more = match self.perhaps_of_all {
            true => " (the bytes do not say whether other drives do the same)",
            false => "",
        };
        write!(f, "drive {}{more}", self.drive)
    }
}

/// The drive that explains where attempts differed: `seen` are all of them, some were tried again with the roles exchanged, and `pinned` is
/// what the ring has shown when it was asked.
#[must_use]
pub(crate) fn culprit(
    drives: u8,
    seen: &[Meant],
    trials: &[Trial],
    pinned: &[PinnedDrive],
) -> Option<Culprit> {
    let mut shown = pinned.iter().filter(|pinned| pinned.names_the_drive);
    if let Some(first) = shown.next() {
        let same = shown.all(|pinned| pinned.drive == first.drive);
        return same.then_some(Culprit {
            drive: first.drive,
            perhaps_of_all: false,
        });
    }
    if drives == 1 && !seen.is_empty() {
        return Some(Culprit {
            drive: 0,
            perhaps_of_all: false,
        });
    }
    let owner = |meant: &Meant| match meant {
        Meant::Own(drive) => Some(*drive),
        _ => None,
    };
    let owners: BTreeSet<u8> = seen.iter().filter_map(owner).collect();
    if let Some(first) = owners.first().copied() {
        let mut own_trials = trials
            .iter()
            .filter(|trial| trial.meant == Meant::Own(first));
        let alone = |trial: &Trial| {
            let mut steps = trial.steps.iter();
            steps.all(|(step, found)| match found {
                None => *step != 0,
                Some(found) => *found == Meant::Own(first),
            })
        };
        let tried = own_trials.clone().next().is_some();
        let blamed = owners.len() == 1 && tried && own_trials.all(alone);
        return blamed.then_some(Culprit {
            drive: first,
            perhaps_of_all: false,
        });
    }
    let trials = trials.iter().filter_map(|trial| errors_of(drives, trial));
    let trials: Vec<BTreeSet<u8>> = trials.collect();
    let may_be = |drive: &u8| trials.iter().all(|wrong| may_be(drives, *drive, wrong));
    let left: Vec<u8> = (0..drives).filter(may_be).collect();
    let [drive] = left[..] else { return None };
    (!trials.is_empty()).then_some(Culprit {
        drive,
        perhaps_of_all: trials
            .iter()
            .all(|wrong| wrong.len() == usize::from(drives)),
    })
}

/// The drive to blame, and the deviations that agree with it. Where none agrees with the drive, no drive is proven: all deviations are
/// returned, and each may be one of any drive that one of them accuses.
#[must_use]
pub(crate) fn agreed(
    culprit: Option<Culprit>,
    named: &[NamedDeviation],
) -> (Option<Culprit>, Vec<NamedDeviation>) {
    let Some(blamed) = culprit else {
        return (None, proven(named.to_vec()));
    };
    let may_be = |named: &&NamedDeviation| matches!(&named.whose, AccusedDrives::OneOf(all) if all.contains(&blamed.drive));
    let agreed: Vec<_> = named.iter().filter(may_be).cloned().collect();
    if agreed.is_empty() && !named.is_empty() {
        return (None, proven(named.to_vec()));
    }
    let of_it = agreed.into_iter().map(|named| NamedDeviation {
        whose: AccusedDrives::OneOf(vec![blamed.drive]),
        ..named
    });
    (culprit, of_it.collect())
}

/// Behind errors of which drives a ring differed, where they were provoked in one drive after the other; `None` where that was not done for
/// every drive, or something else differed.
fn errors_of(drives: u8, trial: &Trial) -> Option<BTreeSet<u8>> {
    let Meant::Behind(first) = trial.meant else {
        return None;
    };
    let mut wrong = BTreeSet::from([first]);
    for (_, found) in &trial.steps {
        match found {
            None => {}
            Some(Meant::Behind(drive)) => {
                wrong.insert(*drive);
            }
            Some(_) => return None,
        }
    }
    (trial.steps.len() + 1 == usize::from(drives)).then_some(wrong)
}

/// Whether a drive alone may make a ring differ behind errors of these drives. The drives in front of an error pass everything on; those
/// behind it follow into the error mode. A drive may be wrong as the first one, as a follower, or as both.
fn may_be(drives: u8, drive: u8, wrong: &BTreeSet<u8>) -> bool {
    let first = BTreeSet::from([drive]);
    let follower: BTreeSet<u8> = (drive + 1..drives).collect();
    [&first, &follower, &(&first | &follower)].contains(&wrong)
}

impl AttemptBytes {
    /// The drive that a differing byte belongs to, the section of the broken rule, and where the telegram ends. `came` is what was received
    /// in the place of a byte.
    fn blame(
        &self,
        index: usize,
        drives: u8,
        found: &Divergence,
        came: &dyn Fn(usize) -> Option<u8>,
    ) -> (Meant, &'static str, usize) {
        let (meant, end) = self.meant(index, drives);
        let refused = came(index) == Some(0);
        let expected = found.expected.map(|(_, due)| due.byte);
        // Behind an error the byte of the master has come: the drive with the error has passed it on.
        let passed = expected == Some(0) && !refused && came(index) == Some(self.bytes[index].0);
        match meant {
            Meant::Behind(drive) if passed => {
                return (Meant::Own(drive), self.sent_bytes().of_error(index), end);
            }
            _ => {}
        }
        // Answers of the first drive of the ring pass the second one before all others: a 00 may be that drive's, which takes them for
        // an error. A question to the ring tells them apart.
        let meant = match meant {
            Meant::Own(drive) if refused && drives > 1 && drive + 1 == drives => Meant::Nobody,
            meant => meant,
        };
        let before = index.checked_sub(1).and_then(came);
        // The drive has found the error, and its zeros begin one byte late.
        let of_own = matches!(
            self.roles[index],
            Role::Command { .. } | Role::Data { .. } | Role::Check { .. }
        );
        // A 00 of the master's is an error by itself, and is answered so by a drive that has found none before.
        let next = self.bytes.get(index + 1).map_or(0, |(byte, _)| *byte);
        let tells = next != 0 || came(index) == Some(self.bytes[index].0);
        // Zeros of an error go on to the checking byte at least, which is none of data (9.6).
        let is_check = |at: &usize| matches!(self.roles.get(*at), Some(Role::Check { .. }));
        let check = (index + 1..index + 6).find(is_check).unwrap_or(index + 1);
        let zeros = (index + 1..=check).all(|at| came(at) == Some(0));
        let late = expected == Some(0) && !refused && zeros && tells;
        let section = (of_own && late)
            .then_some("9.7")
            .or_else(|| (refused && self.is_behind_a_silence(index)).then_some("9.9"))
            .or_else(|| self.sent_bytes().comes_back(index, came))
            .unwrap_or_else(|| {
                self.sent_bytes()
                    .section(index, refused && before == Some(0))
            });
        (meant, section, end)
    }

    /// The drive that a byte belongs to, and where its telegram ends.
    fn meant(&self, index: usize, drives: u8) -> (Meant, usize) {
        let is_sync = |at: &usize| self.roles[*at] == Role::Sync;
        let calm = RingSize::new(drives.into()).map(|size| calm(size, &self.bytes[..=index]));
        let begins = (0..=index).rev().find(is_sync);
        // Drives in the error mode read no telegrams (9.7).
        let is_calm = |start: &usize| calm.as_ref().is_ok_and(|calm| calm[*start]);
        let Some(start) = begins.filter(is_calm) else {
            return (Meant::Nobody, index + 1);
        };
        let Ok(SyncByte::Telegram(header)) = SyncByte::decode(self.bytes[start].0) else {
            return (Meant::Nobody, index + 1);
        };
        let end = start + header.telegram_length();
        let first = match header.addressing() {
            Addressing::AddressFollows => start + 2,
            Addressing::SameDrive => start + 1,
            // Which drive is the next one depends on two drives.
            Addressing::NextDrive => return (Meant::Nobody, end),
        };
        let Some(drive) = self.roles.get(start + 1).and_then(|role| role.drive()) else {
            return (Meant::Nobody, end);
        };
        let whole = self.bytes[..=index]
            .iter()
            .skip(start)
            .all(|(_, whole)| *whole);
        let idle = |(byte, _): &(u8, bool)| *byte == SYNCO;
        let meant = match index {
            _ if !whole || index < first => Meant::Nobody,
            _ if index < end => Meant::Own(drive),
            _ if first == start + 2 && self.bytes[end..=index].iter().all(idle) => {
                Meant::Behind(drive)
            }
            _ => Meant::Nobody,
        };
        (meant, end)
    }

    /// The address byte of the telegram of a byte, where it is for no drive.
    fn to_nobody(&self, index: usize) -> Option<u8> {
        let is_for_nobody = self.addressed(index) == Some(None);
        let is_address = |at: &usize| matches!(self.roles[*at], Role::Address { .. });
        let address = (0..index).rev().find(is_address)?;
        is_for_nobody.then(|| self.bytes[address].0)
    }

    /// The drive that the telegram of a byte behind an address byte is addressed to, if any; `None` for every other byte.
    fn addressed(&self, index: usize) -> Option<Option<u8>> {
        let start = (0..index).rev().find(|at| self.roles[*at] == Role::Sync)?;
        let Ok(SyncByte::Telegram(header)) = SyncByte::decode(self.bytes[start].0) else {
            return None;
        };
        let within = (start + 2..start + header.telegram_length()).contains(&index);
        match (header.addressing(), self.roles[start + 1]) {
            (Addressing::AddressFollows, Role::Address { drive }) if within => Some(drive),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(meant: Meant, steps: &[(u8, Option<Meant>)]) -> Trial {
        Trial {
            meant,
            steps: steps.to_vec(),
        }
    }

    fn blamed(seen: &[Meant], trials: &[Trial]) -> Option<u8> {
        culprit(3, seen, trials, &[]).map(|culprit| culprit.drive)
    }

    #[test]
    fn a_drive_is_to_blame_that_differs_in_every_role_and_no_other_one_does() {
        let own = Meant::Own(1);
        let alone = trial(own, &[(1, None), (2, None)]);
        assert_eq!(blamed(&[own, own], std::slice::from_ref(&alone)), Some(1));
        // A short address is meant for it only where it differs with an address byte too.
        let long = |found| trial(own, &[(0, found), (1, None), (2, None)]);
        assert_eq!(blamed(&[own], &[long(Some(own))]), Some(1));
        assert_eq!(blamed(&[own], &[long(None)]), None);
        // It is met in another place of the conversation, too.
        let again = trial(own, &[(1, Some(own)), (2, None)]);
        assert_eq!(blamed(&[own], &[again]), Some(1));
        // Another drive differs in the same role.
        let other = trial(own, &[(1, Some(Meant::Own(2))), (2, None)]);
        assert_eq!(blamed(&[own], &[other]), None);
        assert_eq!(blamed(&[own, Meant::Own(0)], &[alone]), None);
        // Nothing was tried.
        assert_eq!(blamed(&[own], &[]), None);
    }

    #[test]
    fn in_the_error_mode_a_drive_is_to_blame_that_no_other_one_explains() {
        let found = |at: &[u8]| {
            let step = |step: u8| (step, at.contains(&step).then_some(Meant::Behind(step)));
            let tried = trial(Meant::Behind(0), &[step(1), step(2)]);
            culprit(3, &[Meant::Behind(0)], &[tried], &[])
                .map(|culprit| (culprit.drive, culprit.perhaps_of_all))
        };
        // Drive 0 alone is in the error mode where the error is in drive 0.
        assert_eq!(found(&[]), Some((0, false)));
        assert_eq!(found(&[1, 2]), Some((0, true)));
        let last = trial(Meant::Behind(2), &[(1, None), (2, None)]);
        // The last one as the first in error, or the one behind it as a follower.
        assert_eq!(blamed(&[Meant::Behind(2)], &[last]), None);
        let middle = trial(Meant::Behind(1), &[(1, None), (2, None)]);
        assert_eq!(blamed(&[Meant::Behind(1)], &[middle]), Some(1));
    }
}
