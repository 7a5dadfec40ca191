//! Byte for byte: what a ring sent back, and what its twin says.

use super::comparison::{Adopted, Comparison, Divergence, Exactness, Own, Unasked, What};
use super::follow::{Conversation, Expected};
use super::unasked::Sent;
use harness_proto::line::Received;
use harness_proto::nd21::cells::{Access, cell_at, changes_by_itself};
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Kind, PAGE, layout};
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::novobus::sync::PAUSE;
use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, BTreeSet};

/// The longest run of one byte in which each counts: more than the 25 zeros of 9.7.
const LONGEST_RUN: usize = 32;

/// How much later than its model a drive may detect a time-out: after 20 ms instead of 10 (ND21 9.9).
const LATEST_TIME_OUT: Span = Span::from_millis(10);

/// What a ring sent back, beside what its twin received.
struct Rows<'a> {
    ring: usize,
    /// What each byte is for, as far as that is known.
    roles: &'a [Role],
    /// Up to which byte the roles stand at their places.
    known: usize,
    expected: &'a [(Instant, Received)],
    received: &'a [(Instant, Received)],
}

impl Rows<'_> {
    fn role(&self, index: usize) -> Role {
        self.roles.get(index).copied().unwrap_or(Role::Foreign)
    }

    /// Whether the conversation ended before a byte that is missing could be called late. One that came although the twin does not send it,
    /// not even later, is never excused.
    fn cut_short(&self, index: usize, what: &What, tail: Instant) -> bool {
        match (what, self.expected.get(index), self.received.get(index)) {
            (What::Missing, Some((at, _)), None) => *at >= tail,
            _ => false,
        }
    }
}

/// What is compared, ring by ring.
pub(crate) struct Comparer<'a> {
    pub(crate) exactness: Exactness,
    /// Cells that were written in the rig's session: of these the model knows what they hold.
    pub(crate) written: &'a mut BTreeSet<(usize, u8, u16)>,
    /// Cells that were written in the present attempt.
    pub(crate) written_now: &'a mut BTreeSet<(usize, u8, u16)>,
    /// Cells taken over.
    pub(crate) held: &'a mut BTreeMap<(usize, u8, u16), u8>,
    /// Where the incoming process data (14.10.3) of a drive go, in page FF, where the master has written it.
    pub(crate) targets: &'a mut BTreeMap<(usize, u8), u8>,
    /// Drives whose outgoing process data (14.10.3) change by themselves.
    pub(crate) moving: BTreeSet<(usize, u8)>,
    /// Drives whose oscilloscope (14.10.6) may have recorded: it writes to its buffer only then.
    pub(crate) recording: BTreeSet<(usize, u8)>,
    pub(crate) comparison: Comparison,
}

impl Comparer<'_> {
    /// Compares what came from a ring with what its twin received.
    pub(crate) fn ring(
        &mut self,
        ring: usize,
        size: RingSize,
        conversation: &Conversation,
        answer: &Expected,
    ) {
        let expected = &answer.bytes[..];
        let sent = conversation.sent_in(ring);
        let received = &conversation.received_in(ring);
        let (places, roles) = answered(size, &sent);
        // A ring that gives back a byte for a byte (9.1) has each role at its place.
        let aligned = received.len() == roles.len() && expected.len() == roles.len();
        let known = match aligned {
            true => roles.len(),
            false => known_places(&sent, (&places, &roles), expected, received),
        };
        let real_time = self.exactness.tolerance > Span::ZERO;
        let unasked = real_time.then(|| {
            let all = conversation.sent_at(ring);
            let answered: Vec<_> = places.iter().map(|place| all[*place]).collect();
            let (all, answered) = (&all[..], &answered[..]);
            Sent { answered, all }.judge(size, (answer, received), self.exactness.tolerance)
        });
        let unasked = unasked.flatten();
        let (shorter, short);
        // A race of clocks is compared up to its first byte, and the long runs behind it do not matter.
        let (expected, received) = if aligned || unasked.is_some() || !real_time {
            (expected, &received[..])
        } else {
            (shorter, short) = (collapsed(expected), collapsed(received));
            (&shorter[..], &short[..])
        };
        let tail = conversation.end - self.exactness.tolerance;
        let rows = Rows {
            ring,
            roles: &roles,
            known,
            expected,
            received,
        };
        for index in 0..received.len().max(expected.len()) {
            let step_at = |index: usize| {
                let place = places.get(index).copied().unwrap_or(index);
                conversation.step_at(ring, place)
            };
            let step = || step_at(index);
            let race = unasked.as_ref().filter(|unasked| unasked.first == index);
            let compared = race.is_none_or(|race| race.in_both);
            let mut what = None;
            if compared {
                self.note_own(&rows, index, places.get(index).copied());
                what = self.row(&rows, index, step);
                self.comparison.compared += 1;
            }
            let mut index = index;
            if let Some(race) = race {
                let at = received.get(index).or(expected.get(index));
                let at = at.map(|(at, _)| Unasked { ring, at: *at });
                self.comparison.unasked.extend(at);
                if let (None, Some((place, fault))) = (&what, &race.fault) {
                    (index, what) = (*place, Some(fault.clone()));
                }
            }
            let Some(what) = what else {
                match race {
                    Some(_) => return,
                    None => continue,
                }
            };
            let role = rows.role(index);
            let drive = match size.drives() {
                1 => Some(0),
                _ => aligned.then(|| self.culprit(&rows, index)).flatten(),
            };
            let found = Divergence {
                ring,
                byte: index + 1,
                what,
                expected: expected.get(index).copied(),
                received: received.get(index).copied(),
                role,
                step: step_at(index),
                drive,
            };
            let early = if race.is_some() {
                LATEST_TIME_OUT
            } else {
                Span::ZERO
            };
            if real_time && rows.cut_short(index, &found.what, tail - early) {
                // An unasked byte may come later still. Any other is late, or it is lost.
                if race.is_none() {
                    self.comparison.untimely.get_or_insert(found);
                }
                return;
            }
            self.comparison.divergence.get_or_insert(found);
            return;
        }
    }

    /// The drive whose answers are all that differs from the `first` byte on that does, in a ring that gives a byte for a byte. A drive that
    /// damages what it forwards leaves the answer's checking byte as it was: of a single byte nothing is known.
    fn culprit(&mut self, rows: &Rows<'_>, first: usize) -> Option<u8> {
        let answering = |index: usize| match rows.role(index) {
            Role::Data { drive, .. } | Role::Check { drive, .. } | Role::ProcessData { drive } => {
                drive
            }
            _ => None,
        };
        let drive = answering(first)?;
        let before = self.comparison.clone();
        let behind = first + 1..rows.received.len();
        let differing: Vec<_> = behind
            .filter(|index| self.row(rows, *index, || None).is_some())
            .collect();
        self.comparison = before;
        let own = |index: &usize| answering(*index) == Some(drive);
        (!differing.is_empty() && differing.iter().all(own)).then_some(drive)
    }

    /// What is otherwise at one place, apart from the time.
    fn row(
        &mut self,
        rows: &Rows<'_>,
        index: usize,
        step: impl FnOnce() -> Option<usize>,
    ) -> Option<What> {
        let Rows {
            ring,
            expected,
            received,
            ..
        } = *rows;
        let role = rows.role(index);
        let (due, wanted, at, found) = match (expected.get(index), received.get(index)) {
            (Some((due, wanted)), Some((at, found))) => (*due, *wanted, *at, *found),
            (Some(_), None) => return Some(What::Missing),
            (None, _) => return Some(What::Surplus),
        };
        let found_good = found.error.is_none() || !self.exactness.line_errors;
        let wanted_good = wanted.error.is_none() || !self.exactness.line_errors;
        let same = wanted.byte == found.byte
            || index < rows.known && self.may_differ(rows, (wanted.byte, found.byte), index);
        self.note_write(ring, rows, index);
        self.note_reset(ring, rows.roles, index);
        match (same, wanted_good == found_good) {
            (true, true) => {
                self.time((ring, index), role, step, ((due, wanted), (at, found)));
                None
            }
            (true, false) => Some(What::LineStatus),
            (false, _) => Some(what_of(expected, received, index)),
        }
    }

    /// Whether a byte may be another one than the model's: it is data that the model cannot know, or their checking
    /// byte.
    fn may_differ(&mut self, rows: &Rows<'_>, (wanted, value): (u8, u8), index: usize) -> bool {
        let Rows { ring, roles, .. } = *rows;
        let looks_at = |drive, address| {
            let (asked, looks) = self.exactness.looks?;
            let mut own = looks.iter().filter(|_| asked == drive);
            own.find(|look| look.address == address)
        };
        match roles[index] {
            Role::Data {
                drive: Some(drive),
                address,
            } => {
                if let Some(look) = looks_at(drive, address) {
                    return (value ^ wanted) & look.mask == 0;
                }
                let writes = !self.exactness.knows_cells && self.may_write(ring, drive, address);
                if measured(address) || writes {
                    self.comparison.measured += 1;
                    return true;
                }
                let cell = (ring, drive, address);
                if self.exactness.knows_cells || self.written.contains(&cell) {
                    return false;
                }
                if let Some(held) = self.held.get(&cell) {
                    return *held == value;
                }
                self.held.insert(cell, value);
                self.comparison.adopted.push(Adopted {
                    ring,
                    drive,
                    address,
                    value,
                });
                true
            }
            Role::ProcessData { drive: Some(drive) } => {
                let moves = !self.exactness.knows_cells && self.moving.contains(&(ring, drive));
                self.comparison.measured += u64::from(moves);
                moves
            }
            Role::Check {
                drive: Some(drive),
                length,
                ..
            } => {
                // Only over data that differ: to a command that the model refuses (9.6) there is no other answer.
                let answer = || answer_of(&roles[..index], drive, length).map(|(place, _)| place);
                let other =
                    |place: usize| rows.expected[place].1.byte != rows.received[place].1.byte;
                let bytes = answer().map(|place| rows.received[place].1.byte);
                let sum = bytes.fold(Checksum::EMPTY, Checksum::with);
                sum.minus() == value && answer().any(other)
            }
            _ => false,
        }
    }

    /// Whether a drive may have written to a cell by itself. The oscilloscope changes its buffer and its settings only while it runs.
    fn may_write(&self, ring: usize, drive: u8, address: u16) -> bool {
        let of_the_scope = own::SCOPE_BUFFER.contains(&address) || own::SCOPE.contains(&address);
        match of_the_scope && address != ram::SCOPE_STATUS {
            true => {
                let status = (ring, drive, ram::SCOPE_STATUS);
                self.recording.contains(&(ring, drive)) || self.written.contains(&status)
            }
            false => unknowable(address),
        }
    }

    /// Notes a byte whose value the drive decides.
    fn note_own(&mut self, rows: &Rows<'_>, index: usize, place: Option<usize>) {
        let Some((place, (at, _))) = place.zip(rows.received.get(index)) else {
            return;
        };
        if self.exactness.knows_cells || index >= rows.known {
            return;
        }
        let ring = rows.ring;
        let is_own = |drive, address| {
            measured(address)
                || self.may_write(ring, drive, address)
                || !self.written_now.contains(&(ring, drive, address))
        };
        let (drive, address) = match rows.role(index) {
            Role::Data {
                drive: Some(drive),
                address,
            } if is_own(drive, address) => (drive, Some(address)),
            Role::ProcessData { drive: Some(drive) } if self.moving.contains(&(ring, drive)) => {
                (drive, None)
            }
            Role::Check {
                drive: Some(drive),
                length,
                ..
            } => {
                let mut answer = answer_of(&rows.roles[..index], drive, length);
                let own = answer.find_map(|(_, role)| match role {
                    Role::Data { address, .. } if is_own(drive, *address) => Some(*address),
                    _ => None,
                });
                match own {
                    Some(address) => (drive, Some(address)),
                    None => return,
                }
            }
            _ => return,
        };
        self.comparison.own.push(Own {
            ring,
            at: *at,
            place,
            drive,
            address,
        });
    }

    /// Notes which cells the master has written, by a command or as process data.
    fn note_write(&mut self, ring: usize, rows: &Rows<'_>, index: usize) {
        let before = index.checked_sub(1).map(|before| rows.role(before));
        let (drive, address, width) = match rows.role(index) {
            Role::Check {
                drive: Some(drive),
                writes: Some((address, width)),
                length,
            } => {
                if (address..address.saturating_add(width.into())).contains(&ram::DATA_IN) {
                    match data_written(rows, index, drive, length) {
                        Some(target) => self.targets.insert((ring, drive), target),
                        None => self.targets.remove(&(ring, drive)),
                    };
                }
                (drive, address, width)
            }
            // The second of the two bytes.
            Role::ProcessData { drive: Some(drive) } if before == Some(rows.role(index)) => {
                match self.targets.get(&(ring, drive)) {
                    Some(target) => (drive, PAGE | u16::from(*target), 2),
                    None => return,
                }
            }
            _ => return,
        };
        for offset in 0..u16::from(width) {
            let cell = (ring, drive, address.wrapping_add(offset));
            self.written.insert(cell);
            self.written_now.insert(cell);
            self.held.remove(&cell);
        }
    }

    /// Forgets what the cells of a drive hold where a `ResetH8` ends (ND21 10.5): they are loaded from its EEPROM, and how long the drive took
    /// to write that is its choice (14.10.5).
    fn note_reset(&mut self, ring: usize, roles: &[Role], index: usize) {
        let command = index.checked_sub(1).and_then(|before| roles.get(before));
        if let (
            Some(Role::Check {
                drive: Some(drive), ..
            }),
            Some(Role::Command {
                drive: Some(of),
                section: "10.5",
            }),
        ) = (roles.get(index), command)
            && drive == of
        {
            let others = |cell: &(usize, u8, u16)| (cell.0, cell.1) != (ring, *drive);
            self.written.retain(others);
            self.held.retain(|cell, _| others(cell));
            self.targets.remove(&(ring, *drive));
        }
    }

    /// Notes how far two times are apart; never ends the comparison.
    fn time(
        &mut self,
        (ring, index): (usize, usize),
        role: Role,
        step: impl FnOnce() -> Option<usize>,
        (expected, received): ((Instant, Received), (Instant, Received)),
    ) {
        let apart = expected
            .0
            .since(received.0)
            .max(received.0.since(expected.0));
        self.comparison.apart = self.comparison.apart + apart;
        if apart > self.exactness.tolerance && self.comparison.untimely.is_none() {
            self.comparison.untimely = Some(Divergence {
                ring,
                byte: index + 1,
                what: What::Time,
                expected: Some(expected),
                received: Some(received),
                role,
                step: step(),
                drive: None,
            });
        }
    }
}

/// The bytes of an answer of a drive in front of its checking byte, the last one first, with their places. A command may be cut over
/// several telegrams (9.5): its bytes need not stand together.
fn answer_of(roles: &[Role], drive: u8, length: u8) -> impl Iterator<Item = (usize, &Role)> {
    let own = move |(_, role): &(usize, &Role)| {
        matches!(role, Role::Command { .. } | Role::Data { .. }) && role.drive() == Some(drive)
    };
    let before = roles.iter().enumerate().rev().filter(own);
    before.take(usize::from(length).saturating_sub(1))
}

/// The byte that an echoed `WriteByte` (10.2) whose checking byte stands at `index` has written; `None` for any other command.
fn data_written(rows: &Rows<'_>, index: usize, drive: u8, length: u8) -> Option<u8> {
    let answer = answer_of(rows.roles.get(..index)?, drive, length);
    let mut bytes: Vec<u8> = Vec::new();
    for (place, _) in answer {
        bytes.insert(0, rows.received.get(place)?.1.byte);
    }
    let layout = layout(*bytes.first()?, ReadLongAnswer::default())?;
    let data = |field: &Field| matches!(field, Field::Data(0));
    let data = layout.command.iter().position(data)?;
    let byte = (layout.kind == Kind::WriteByte).then_some(data + 1)?;
    bytes.get(byte).copied()
}

/// The bytes that are answered, by their places among those sent, and their roles: a PAUSE where a sync byte is due is swallowed (9.2).
fn answered(size: RingSize, sent: &[(u8, bool)]) -> (Vec<usize>, Vec<Role>) {
    let all = roles(size, sent).into_iter().zip(sent).enumerate();
    let answered = all.filter(|(_, (role, (byte, _)))| (*role, *byte) != (Role::Idle, PAUSE));
    answered.map(|(place, (role, _))| (place, role)).unzip()
}

/// Up to where each byte received is known to stand for a byte sent, in a ring that does not give back a byte for a byte: up to the
/// first one that meets a fault, or that is left out of a long run.
fn known_places(
    sent: &[(u8, bool)],
    (places, roles): (&[usize], &[Role]),
    expected: &[(Instant, Received)],
    received: &[(Instant, Received)],
) -> usize {
    let damaged = places.iter().position(|place| !sent[*place].1);
    let known = match damaged {
        Some(damaged) => damaged,
        // Without a fault it is the drives that lose bytes, or swallow or send some where they report an error.
        None if expected.len() == places.len() => places.len(),
        // Up to the error: a sync byte, or a byte of a command that is echoed, does not come back as it was.
        None => {
            let lost = |(index, role): (usize, &Role)| match role {
                Role::Foreign => true,
                Role::Sync | Role::Command { .. } => expected
                    .get(index)
                    .is_none_or(|(_, byte)| !byte.is(sent[places[index]].0)),
                _ => false,
            };
            let error = roles.iter().enumerate().position(lost);
            error.unwrap_or(roles.len())
        }
    };
    let short = |bytes: &[(Instant, Received)]| {
        let same = |run: &[(Instant, Received)]| run.iter().all(|byte| byte.1 == run[0].1);
        let long = bytes.windows(LONGEST_RUN + 1).position(same);
        long.map_or(usize::MAX, |from| from + LONGEST_RUN)
    };
    known.min(short(expected)).min(short(received))
}

/// Drives that report an error send for ever (9.9), and a real clock does not cut that off at a byte: of a long run of
/// one byte only the beginning is compared.
fn collapsed(bytes: &[(Instant, Received)]) -> Vec<(Instant, Received)> {
    let mut kept: Vec<(Instant, Received)> = Vec::new();
    let mut run = 0;
    for byte in bytes {
        let same = kept.last().is_some_and(|last| last.1 == byte.1);
        run = if same { run + 1 } else { 1 };
        if run <= LONGEST_RUN {
            kept.push(*byte);
        }
    }
    kept
}

/// Whether no model knows what a cell of a real drive holds from one moment to the next.
pub(crate) fn unknowable(address: u16) -> bool {
    own::is_own(address) || changes_by_itself(address)
}

/// Whether the drive itself writes a cell (14.2: read only), so that no model knows what it holds.
fn measured(address: u16) -> bool {
    cell_at(address).is_some_and(|cell| cell.access != Access::Write)
}

/// Whether a byte is another one, or one too many or too few.
pub(crate) fn what_of(
    expected: &[(Instant, Received)],
    received: &[(Instant, Received)],
    index: usize,
) -> What {
    const ALIKE: usize = 4;
    fn rest(bytes: &[(Instant, Received)], from: usize) -> &[(Instant, Received)] {
        bytes.get(from..).unwrap_or_default()
    }
    match (expected.get(index), received.get(index)) {
        (_, None) => return What::Missing,
        (None, _) => return What::Surplus,
        (Some((_, wanted)), Some((_, found))) if wanted.byte == found.byte => {
            return What::LineStatus;
        }
        _ => {}
    }
    let run = |a: &[(Instant, Received)], b: &[(Instant, Received)]| {
        a.len() >= ALIKE
            && b.len() >= ALIKE
            && a[..ALIKE].iter().zip(b).all(|(a, b)| a.1.byte == b.1.byte)
    };
    if run(rest(expected, index + 1), rest(received, index)) {
        What::Missing
    } else if run(rest(expected, index), rest(received, index + 1)) {
        What::Surplus
    } else {
        What::Value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{Line, Link};
    use crate::scenario::simulate::bench;
    use crate::scenario::source::Source;

    /// ND21 14.2.1: what a drive changes by itself, while it stands and while it turns, is compared with nobody's.
    #[test]
    fn what_changes_by_itself_is_not_compared() {
        let text = "title x\nring 1\ndrive 0 model nd21\ndrive 0 input GPIN3 GPIN5 high\nwrite-word 0 nsoll = 0400\n";
        let source = Source {
            name: "test".to_owned(),
            text: text.to_owned().into(),
        };
        let plan = crate::library::Entry::new(source, None)
            .expect("no mistakes")
            .plan;
        let mut link = bench(&plan.expect("novobus"));
        // 9.3, 10.2: nsoll of drive 0 becomes 0400.
        let turn = [0x8C, 0xFF, 0x63, 0x00, 0x04, 0x08, 0xFF, 0x6E];
        let cells = |link: &crate::link::SimulatedLink| -> Vec<(u16, Option<u8>)> {
            (0xFD80..=0xFF7F)
                .map(|cell| (cell, link.peek(0, 0, cell)))
                .collect()
        };
        let mut changed = BTreeSet::new();
        for sent in [&[][..], &turn] {
            link.send(0, sent);
            link.run_until(link.now() + Span::from_millis(10));
            let before = cells(&link);
            for _ in 0..300 {
                link.run_until(link.now() + Span::from_millis(1));
                let pairs = cells(&link).into_iter().zip(&before);
                changed.extend(pairs.filter(|(now, was)| now != *was).map(|(now, _)| now.0));
            }
        }
        assert!(
            changed.contains(&ram::CNT2) && changed.contains(&ram::LAGEIST),
            "{changed:04X?}"
        );
        let compared: Vec<_> = changed
            .iter()
            .filter(|cell| !measured(**cell) && !changes_by_itself(**cell))
            .collect();
        assert!(compared.is_empty(), "{compared:04X?}");
    }
}
