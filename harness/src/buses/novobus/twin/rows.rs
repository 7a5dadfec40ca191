//! What a ring sent back, beside what its twin received.

use super::comparison::Symptom;
use harness_proto::line::Received;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::role::Role;
use harness_proto::time::Instant;

/// What a ring sent back, beside what its twin received.
pub(super) struct Rows<'a> {
    pub(super) ring: usize,
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

    /// Whether the model refuses the command of an answer: then 00 stands in the place of data and of the checking byte too (ND21 9.7), and
    /// no checking byte is 00 (9.6). Also where no checking byte follows.
    pub(super) fn is_refused(&self, index: usize) -> bool {
        let drive = self.role(index).drive();
        let is_check =
            |at: &usize| matches!(self.role(*at), Role::Check { drive: own, .. } if own == drive);
        let check = (index..self.roles.len()).find(is_check);
        let due = check.and_then(|check| self.expected.get(check));
        due.is_none_or(|(_, due)| due.byte == 0)
    }

    /// Whether a byte is the low byte of process data (ND21 9.4).
    pub(super) fn is_second_of_process_data(&self, index: usize) -> bool {
        let sync_before = |back: usize| index.checked_sub(back).map(|before| self.role(before));
        let own = Some(self.role(index));
        sync_before(1) == own && sync_before(2) != own
    }

    /// The command whose checking byte the master sent at `index`, if that byte is right.
    pub(super) fn command(&self, index: usize, drive: u8, length: u8) -> Option<Command> {
        let before = answer_of(self.roles.get(..index)?, drive, length);
        let mut bytes: Vec<u8> = before.map(|(place, _)| self.sent[place]).collect();
        bytes.reverse();
        bytes.push(*self.sent.get(index)?);
        Command::decode(&bytes).value()
    }

    /// Whether the conversation ended before a byte that is missing could be called late. One that came although the twin does not send it,
    /// not even later, is never excused.
    pub(super) fn cut_short(&self, index: usize, what: &Symptom, tail: Instant) -> bool {
        match (what, self.expected.get(index), self.received.get(index)) {
            (Symptom::Missing, Some((at, _)), None) => *at >= tail,
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
    let own = move |(_, role): &(usize, &Role)| {
        matches!(role, Role::Command { .. } | Role::Data { .. }) && role.drive() == Some(drive)
    };
    let before = roles.iter().enumerate().rev().filter(own);
    before.take(usize::from(length).saturating_sub(1))
}
