//! What a ring sent back, beside what its twin received.

use super::comparison::Symptom;
use crate::calm::calm;
use crate::section::SentBytes;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::role::Role;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Instant;

/// How many bytes the longest answer has (10.1). A run of that many zeros is not an answer.
pub(super) const LONGEST_ANSWER: usize = 6;

/// What a ring sent back, beside what its twin received.
pub(super) struct Rows<'a> {
    pub(super) ring: usize,
    /// How many bytes were received in front of the first.
    pub(super) before: usize,
    pub(super) size: RingSize,
    /// What each byte is for, as far as that is known.
    pub(super) roles: &'a [Role],
    /// The bytes that the master sent, one for each role.
    pub(super) sent: &'a [u8],
    /// Up to which byte the roles stand at their places.
    pub(super) known: usize,
    pub(super) expected: &'a [(Instant, Received)],
    pub(super) received: &'a [(Instant, Received)],
}

impl Rows<'_> {
    pub(super) fn role(&self, index: usize) -> Role {
        self.roles.get(index).copied().unwrap_or(Role::Foreign)
    }

    /// The section of the manual with the rule that a byte breaks, and the rule in a few words.
    pub(super) fn broken(&self, index: usize, what: Symptom) -> (&'static str, &'static str) {
        let bytes: Vec<_> = self.sent.iter().map(|byte| (*byte, true)).collect();
        let sent = SentBytes {
            bytes: &bytes,
            roles: self.roles,
        };
        sent.broken(index, what)
    }

    /// Whether the model refuses the command of an answer, or is in the error mode: then 00 stands in the place of data too (ND21 9.7).
    pub(super) fn is_refused(&self, index: usize) -> bool {
        let after = self.expected.iter().skip(index).take(LONGEST_ANSWER);
        if after.clone().all(|(_, due)| due.byte == 0) {
            return true;
        }
        let sent = self.sent.iter().take(index + 1).chain(&[SYNCO]);
        let sent: Vec<_> = sent.map(|byte| (*byte, true)).collect();
        calm(self.size, &sent).last() == Some(&false)
    }

    /// Whether a byte is the third or fourth of the data of ReadLong. The manual leaves open which cells they show (ND21 10.1).
    pub(super) fn is_last_of_long(&self, index: usize) -> bool {
        let before = index.checked_sub(2).map(|before| self.role(before));
        match (before, self.role(index)) {
            (
                Some(Role::Data {
                    drive: before,
                    address: first,
                }),
                Role::Data { drive, address },
            ) => before == drive && first.wrapping_add(2) == address,
            _ => false,
        }
    }

    /// Whether a byte is the low byte of process data (ND21 9.4).
    pub(super) fn is_second_of_process_data(&self, index: usize) -> bool {
        let sync_before = |back: usize| index.checked_sub(back).map(|before| self.role(before));
        let role = Some(self.role(index));
        sync_before(1) == role && sync_before(2) != role
    }

    /// Whether the checking byte of the answer in which a byte stands agrees with all of it, and is not the model's: the drive itself has sent
    /// that byte, and no other one has damaged it on its way.
    pub(super) fn is_summed_up(&self, data: usize, drive: u8) -> bool {
        let of_drive = |place: usize| match self.role(place) {
            Role::Check {
                drive: Some(other),
                length,
                ..
            } if other == drive => Some((place, length)),
            _ => None,
        };
        let Some((check, length)) = (data..self.known).find_map(of_drive) else {
            return false;
        };
        let value = |heard: &[(Instant, Received)], place: usize| {
            heard.get(place).map(|(_, byte)| byte.byte)
        };
        let answer: Vec<usize> = answer_of(&self.roles[..check], drive, length)
            .map(|(place, _)| place)
            .collect();
        let bytes = answer
            .iter()
            .filter_map(|place| value(self.received, *place));
        let sum = bytes.fold(Checksum::EMPTY, Checksum::with).minus();
        let came = value(self.received, check);
        answer.contains(&data) && came == Some(sum) && came != value(self.expected, check)
    }

    /// The command whose checking byte the master sent at `index`, if that byte is right.
    pub(super) fn command(&self, index: usize, drive: u8, length: u8) -> Option<Command> {
        let before = answer_of(self.roles.get(..index)?, drive, length);
        let mut bytes: Vec<u8> = before.map(|(place, _)| self.sent[place]).collect();
        bytes.reverse();
        bytes.push(*self.sent.get(index)?);
        Command::decode(&bytes).value()
    }

    /// Whether the conversation ended before a byte that is missing could be called late, or while others were still coming. One that came
    /// although the twin does not send it, not even later, is never excused.
    pub(super) fn cut_short(&self, index: usize, what: &Symptom, tail: Instant) -> bool {
        match (what, self.expected.get(index), self.received.get(index)) {
            (Symptom::Missing, Some((at, _)), None) => {
                let last = self.received.last().map(|(came, _)| came);
                at.max(last.unwrap_or(at)) >= &tail
            }
            _ => false,
        }
    }
}

/// The bytes of an answer of a drive in front of its checking byte, the last one first, with their places. A command may be cut over
/// several telegrams (9.5): its bytes need not stand together.
pub(super) fn answer_of(
    roles: &[Role],
    drive: u8,
    length: u8,
) -> impl Iterator<Item = (usize, &Role)> {
    let answers = move |(_, role): &(usize, &Role)| {
        matches!(role, Role::Command { .. } | Role::Data { .. }) && role.drive() == Some(drive)
    };
    let before = roles.iter().enumerate().rev().filter(answers);
    before.take(usize::from(length).saturating_sub(1))
}
