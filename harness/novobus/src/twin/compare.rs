//! Byte for byte: what a ring sent back, and what its twin says.

use super::comparison::{
    AdoptedCell, Comparison, Divergence, Exactness, OwnByte, Symptom, UnaskedByte,
};
use super::follow::{Conversation, TwinBytes};
use super::known::{ByteRead, CellByte, Knowledge, writes};
use super::places::{answered, collapsed, heard, known_places, what_of};
use super::rows::{Rows, answer_of};
use super::silence::answers_in_race;
use super::unasked::{Race, SentTimes, after_a_race};
use harness_proto::line::Received;
use harness_proto::nd21::cells::changes_by_itself;
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::role::Role;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

/// How much later than its model a drive may detect a time-out: after 20 ms instead of 10 (ND21 9.9).
const TIME_OUT_RANGE: Span = Span::from_millis(10);

/// The comparison of a conversation, ring by ring.
pub(crate) struct Comparer<'a> {
    pub(crate) exactness: Exactness,
    pub(crate) byte_time: Span,
    pub(super) knowledge: &'a mut Knowledge,
    /// Drives whose oscilloscope (14.10.6) may have recorded: it writes to its buffer only then.
    pub(crate) recording: BTreeSet<(usize, u8)>,
    /// As [`Conversation::unwatched`].
    pub(crate) unwatched: &'a [(Instant, Instant)],
    pub(crate) comparison: Comparison,
}

impl Comparer<'_> {
    /// Compares what came from a ring with what its twin received.
    pub(crate) fn ring(
        &mut self,
        ring: usize,
        size: RingSize,
        conversation: &Conversation,
        answer: &TwinBytes,
    ) {
        self.ring_from(0, ring, size, conversation, answer);
    }

    /// Compares the last part of a conversation; `before` is the number of bytes received before it.
    fn ring_from(
        &mut self,
        before: usize,
        ring: usize,
        size: RingSize,
        conversation: &Conversation,
        answer: &TwinBytes,
    ) {
        let expected = &answer.bytes[..];
        let sent = conversation.sent_in(ring);
        let received = &conversation.received_in(ring);
        let way = self.byte_time * (u64::from(size.drives()) + 1);
        let starts = conversation.sent_at(ring);
        let all = answered(size, &sent);
        let (places, roles) = heard(all, &starts, expected, way);
        let answered: Vec<u8> = places.iter().map(|place| sent[*place].0).collect();
        // A ring that gives back a byte for a byte (9.1) has each role at its place.
        let aligned = received.len() == roles.len() && expected.len() == roles.len();
        let known = match aligned {
            true => roles.len(),
            false => known_places(&sent, &places, &roles, expected, received),
        };
        let real_time = self.exactness.tolerance > Span::ZERO;
        let answered_at: Vec<_> = places.iter().map(|place| starts[*place]).collect();
        let times = SentTimes {
            answered: &answered_at,
            all: &starts,
            way,
        };
        let monitors = self.monitoring(ring, size).any(|does| does == Some(true));
        let tolerance = self.exactness.tolerance;
        let race = || times.judge(size, answer, received, tolerance, monitors);
        let unasked = real_time.then(race).flatten();
        // Bytes that come one way round the ring after those of the master answer one by one.
        let in_step = |race: &Race| {
            let answers = expected.iter().zip(&answered_at).take(race.first);
            let all = answers.clone().count() == race.first;
            all && answers
                .into_iter()
                .all(|((due, _), start)| *due == *start + way)
        };
        let known = match &unasked {
            Some(race) if in_step(race) => known.max(race.first),
            _ => known,
        };
        // No byte from the first unasked one on answers one of the master's.
        let asked = unasked
            .as_ref()
            .map_or(roles.len(), |race| race.first.min(roles.len()));
        let whole = (expected, &received[..]);
        let in_place = aligned || unasked.is_some() || !real_time;
        let (shorter, short);
        // A race of clocks is compared up to its first byte, and the long runs after it do not matter.
        let (expected, received) = if in_place {
            whole
        } else {
            (shorter, short) = (collapsed(expected), collapsed(received));
            (&shorter[..], &short[..])
        };
        let tail = conversation.end - self.exactness.tolerance;
        let rows = Rows {
            ring,
            before,
            size,
            roles: &roles[..asked],
            sent: &answered,
            known: known.min(asked),
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
                let of_the_model = expected.get(index..).unwrap_or(&[]);
                let first = at.map(|(at, _)| UnaskedByte {
                    ring,
                    at: *at,
                    until: None,
                    answers: answers_in_race(of_the_model, size),
                });
                self.comparison.unasked.extend(first);
                if let (None, Some((place, fault))) = (&what, &race.fault) {
                    (index, what) = (*place, Some(*fault));
                }
            }
            let Some(what) = what else {
                if race.is_none() {
                    continue;
                }
                self.after_a_race(before, ring, size, conversation, answer);
                return;
            };
            let role = rows.role(index);
            let came = received.get(index).copied();
            let mut due = expected.get(index).copied();
            // What the drive itself has shown before, where the model agrees with the byte that differs from it.
            if let (Some((_, due)), Some((_, came)), Role::Data { drive, address }) =
                (&mut due, came, role)
                && due.byte == came.byte
                && let Some(drive) = drive
            {
                due.byte = self
                    .knowledge
                    .held((ring, drive, address))
                    .unwrap_or(due.byte);
            }
            // It looks at the bytes after this one, with what is known then.
            let drive = match size.drives() {
                1 => Some(0),
                _ => aligned.then(|| self.culprit(&rows, index)).flatten(),
            };
            let found = Divergence {
                ring,
                byte: before + index + 1,
                what,
                expected: due,
                received: came,
                role,
                rule: rows.broken(index, what),
                step: step_at(index),
                drive,
            };
            let early = if race.is_some() {
                TIME_OUT_RANGE
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
            if self.comparison.divergence.is_none() {
                self.comparison.divergence = Some(found);
            }
            return;
        }
    }

    /// Whether each drive of a ring monitors time-outs, where that is known.
    fn monitoring(&self, ring: usize, size: RingSize) -> impl Iterator<Item = Option<bool>> {
        (0..size.drives()).map(move |drive| self.knowledge.monitors(ring, drive))
    }

    /// Compares what comes after a check sequence that ends a race of clocks, if one does.
    fn after_a_race(
        &mut self,
        before: usize,
        ring: usize,
        size: RingSize,
        conversation: &Conversation,
        answer: &TwinBytes,
    ) {
        if self.monitoring(ring, size).any(|does| does.is_none()) {
            return;
        }
        let does = |monitors: &Option<bool>| *monitors == Some(true);
        let alone = self.monitoring(ring, size).filter(does).count() == 1;
        let tolerance = self.exactness.tolerance;
        let rest = after_a_race(conversation, ring, size, answer, tolerance, alone);
        if let Some((conversation, answer, left)) = rest {
            if let Some(race) = self.comparison.unasked.last_mut() {
                race.until = conversation.received.first().map(|(_, at, _)| *at);
            }
            self.ring_from(before + left, ring, size, &conversation, &answer);
        }
    }

    /// The drive whose answers contain every differing byte from `first` on, in a ring that returns one byte for each byte sent. A single
    /// differing byte proves something only where the checking byte of its answer agrees with it: a drive that damages forwarded bytes does
    /// not correct that.
    fn culprit(&mut self, rows: &Rows<'_>, first: usize) -> Option<u8> {
        let answering = |index: usize| match rows.role(index) {
            Role::Data { drive, .. } | Role::Check { drive, .. } | Role::ProcessData { drive } => {
                drive
            }
            _ => None,
        };
        let drive = answering(first)?;
        let before = self.comparison.clone();
        let after = first + 1..rows.received.len();
        let differing: Vec<_> = after
            .filter(|index| self.row(rows, *index, || None).is_some())
            .collect();
        self.comparison = before;
        let answers = |index: &usize| answering(*index) == Some(drive);
        let several = !differing.is_empty() && differing.iter().all(answers);
        let sums_up = || differing.is_empty() && rows.is_summed_up(first, drive);
        (several || sums_up()).then_some(drive)
    }

    /// What differs at one place, apart from the time.
    fn row(
        &mut self,
        rows: &Rows<'_>,
        index: usize,
        step: impl FnOnce() -> Option<usize>,
    ) -> Option<Symptom> {
        let Rows {
            ring,
            expected,
            received,
            ..
        } = *rows;
        let role = rows.role(index);
        let (due, wanted, at, found) = match (expected.get(index), received.get(index)) {
            (Some((due, wanted)), Some((at, found))) => (*due, *wanted, *at, *found),
            (Some(_), None) => return Some(Symptom::Missing),
            (None, _) => return Some(Symptom::Surplus),
        };
        self.knowledge.proceed_to(due);
        let found_good = found.error.is_none() || !self.exactness.line_errors;
        let wanted_good = wanted.error.is_none() || !self.exactness.line_errors;
        let right = match index < rows.known {
            true => self.is_right(rows, wanted.byte, found.byte, index),
            false => None,
        };
        let equal = wanted.byte == found.byte;
        let same = match right {
            Some(right) => {
                right || equal && (rows.is_refused(index) || rows.is_last_of_long(index))
            }
            None => equal,
        };
        self.note_write(ring, rows, index);
        match (same, wanted_good == found_good) {
            (true, true) => {
                let index = rows.before + index;
                self.time(ring, index, role, step, (due, wanted), (at, found));
                None
            }
            (true, false) => Some(Symptom::LineStatus),
            // The model's byte, where the drive itself has shown another one.
            (false, _) if equal => Some(Symptom::Value),
            (false, _) => Some(what_of(expected, received, index)),
        }
    }

    /// Whether a byte is right that need not be the model's: data that the model cannot know, or their checking byte. `None` for a byte
    /// that must be the model's.
    fn is_right(&mut self, rows: &Rows<'_>, wanted: u8, value: u8, index: usize) -> Option<bool> {
        let Rows { ring, roles, .. } = *rows;
        match roles[index] {
            Role::Data {
                drive: Some(drive),
                address,
            } => self.data_are_right((ring, drive, address), wanted, value),
            Role::ProcessData { drive: Some(drive) } if !self.exactness.knows_cells => {
                let pointer = self.knowledge.target(ring, drive, ram::DATA_OUT);
                let Some(target) = pointer else {
                    self.comparison.measured += 1;
                    return Some(true);
                };
                let second = u16::from(rows.is_second_of_process_data(index));
                let place = (ring, drive, target.wrapping_add(second));
                self.data_are_right(place, wanted, value)
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
                let right = answer().any(other).then(|| sum.minus() == value);
                // No checking byte is 00 (9.6).
                if value != 0 && right.unwrap_or(wanted == value) {
                    self.learn_zeros(ring, drive, answer_of(&roles[..index], drive, length));
                }
                right
            }
            _ => None,
        }
    }

    /// Learns the zeros of an answer whose checking byte is right.
    fn learn_zeros<'r>(
        &mut self,
        ring: usize,
        drive: u8,
        answer: impl Iterator<Item = (usize, &'r Role)>,
    ) {
        for (_, role) in answer {
            if let Role::Data { address, .. } = role {
                self.knowledge.confirm_zero((ring, drive, *address));
            }
        }
    }

    /// Whether a cell may hold a value, where the model's holds `wanted`; `None` where it must be the model's.
    fn data_are_right(&mut self, place: CellByte, wanted: u8, value: u8) -> Option<bool> {
        let (ring, drive, address) = place;
        if let Some((asked, looks)) = self.exactness.looks
            && let Some(look) = looks.iter().find(|look| look.address == address)
            && asked == drive
        {
            return Some((value ^ wanted) & look.mask == 0);
        }
        if self.exactness.knows_cells {
            return None;
        }
        match self.knowledge.read(place, wanted, value) {
            _ if self.is_recorded(place) => self.comparison.measured += 1,
            ByteRead::Wrong => return Some(false),
            ByteRead::Own => self.comparison.measured += 1,
            ByteRead::Right => {
                let written = self.knowledge.written_now(place, value);
                self.comparison.against += u64::from(value != wanted && written == 0xFF);
            }
            ByteRead::Learned if value == wanted => {}
            ByteRead::Learned => self.comparison.adopted.push(AdoptedCell {
                ring,
                drive,
                address,
                value,
            }),
        }
        Some(true)
    }

    /// Whether a drive's oscilloscope may be writing to a cell (ND21 14.10.6).
    fn is_recorded(&self, (ring, drive, address): CellByte) -> bool {
        own::is_of_the_scope(address) && self.recording.contains(&(ring, drive))
    }

    /// Notes a byte whose value is the drive's choice.
    fn note_own(&mut self, rows: &Rows<'_>, index: usize, place: Option<usize>) {
        let Some((place, (at, _))) = place.zip(rows.received.get(index)) else {
            return;
        };
        if self.exactness.knows_cells || index >= rows.known {
            return;
        }
        let ring = rows.ring;
        let known = |drive, address, value| {
            let place = (ring, drive, address);
            let written = self.knowledge.written_now(place, value);
            if self.is_recorded(place) { 0 } else { written }
        };
        let value = rows.received[index].1.byte;
        let (drive, address, known) = match rows.role(index) {
            Role::Data {
                drive: Some(drive),
                address,
            } => (drive, Some(address), known(drive, address, value)),
            Role::ProcessData { drive: Some(drive) } => {
                match self.knowledge.target(ring, drive, ram::DATA_OUT) {
                    Some(target) => {
                        let second = u16::from(rows.is_second_of_process_data(index));
                        let address = target.wrapping_add(second);
                        (drive, Some(address), known(drive, address, value))
                    }
                    None => (drive, None, 0),
                }
            }
            Role::Check {
                drive: Some(drive),
                length,
                ..
            } => {
                let mut answer = answer_of(&rows.roles[..index], drive, length);
                let data = answer.find_map(|(place, role)| match role {
                    Role::Data { address, .. } => {
                        let value = rows.received.get(place)?.1.byte;
                        (known(drive, *address, value) != 0xFF).then_some(*address)
                    }
                    _ => None,
                });
                match data {
                    Some(address) => (drive, Some(address), 0),
                    None => return,
                }
            }
            _ => return,
        };
        if known == 0xFF {
            return;
        }
        self.comparison.own.push(OwnByte {
            ring,
            at: *at,
            place,
            drive,
            address,
            known,
            value,
        });
    }

    /// Notes which cells the master has written, by a command or as process data.
    fn note_write(&mut self, ring: usize, rows: &Rows<'_>, index: usize) {
        match rows.role(index) {
            Role::Check {
                drive: Some(drive),
                length,
                ..
            } => {
                let Some(command) = rows.command(index, drive, length) else {
                    return;
                };
                for (address, write) in writes(&command) {
                    let place = (ring, drive, address);
                    // Behind a fault it is not known which byte stands for which.
                    match index < rows.known {
                        true => self.knowledge.write(place, write),
                        false => self.knowledge.may_write(place, write),
                    }
                }
                if command == Command::ResetH8 {
                    self.knowledge.reset(ring, drive);
                }
            }
            Role::ProcessData { drive: Some(drive) } if rows.is_second_of_process_data(index) => {
                let data = [rows.sent[index - 1], rows.sent[index]];
                self.knowledge.take_process_data(ring, drive, data);
            }
            _ => {}
        }
    }

    /// Notes how far two times are apart; never ends the comparison.
    fn time(
        &mut self,
        ring: usize,
        index: usize,
        role: Role,
        step: impl FnOnce() -> Option<usize>,
        expected: (Instant, Received),
        received: (Instant, Received),
    ) {
        let unwatched = self.unwatched.iter().copied();
        let came = |span: &(Instant, Instant)| (span.0..=span.1).contains(&received.0);
        let read = (received.0, received.0);
        let (earliest, latest) = unwatched.rev().find(came).unwrap_or(read);
        let apart = |(earliest, latest): (Instant, Instant)| {
            expected.0.since(latest).max(earliest.since(expected.0))
        };
        let (times, read) = (apart((earliest, latest)), apart(read));
        self.comparison.apart = self.comparison.apart + times;
        if read <= self.exactness.tolerance {
            return;
        }
        let found = Divergence {
            ring,
            byte: index + 1,
            what: Symptom::Time,
            expected: Some(expected),
            received: Some(received),
            role,
            rule: role.rule(),
            step: step(),
            drive: None,
        };
        if times > self.exactness.tolerance {
            self.comparison.untimely.get_or_insert(found.clone());
        }
        self.comparison.held_up.get_or_insert(found);
    }
}

/// Whether no model knows what a cell of a real drive holds from one moment to the next.
pub(crate) fn unknowable(address: u16) -> bool {
    own::is_own(address) || changes_by_itself(address)
}

#[cfg(test)]
#[path = "compare_tests.rs"]
mod tests;
