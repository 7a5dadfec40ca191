//! The section of the rule that a byte of the master's obeys.

use super::twin::Symptom;
use harness_proto::nd21::io::OUTPUTS;
use harness_proto::nd21::ram;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::role::Role;
use harness_proto::novobus::sync::{Addressing, SyncByte};
use std::ops::RangeInclusive;

/// The command bytes that read several cells (10.1).
const READ_WORD: u8 = 0xC1;
const READ_LONG: u8 = 0xC7;

/// The section of WriteIO.
const WRITE_IO: &str = "10.4";

/// The ports of the EEPROM (ND21 14.10.5): values written there persist over a reset.
pub(crate) const EEPROM: RangeInclusive<u16> = ram::EEPROM_BUFFER..=ram::EEPROM_CONTROL;

/// Bytes that the master sent into a ring, and what each is for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SentBytes<'a> {
    /// The bytes, and whether each went round whole.
    pub(crate) bytes: &'a [(u8, bool)],
    /// What each is for.
    pub(crate) roles: &'a [Role],
}

impl SentBytes<'_> {
    /// The section of the ND21 manual with the rule that the answer to a byte breaks, and the rule in a few words.
    pub(crate) fn broken(self, index: usize, what: Symptom) -> (&'static str, &'static str) {
        let role = self.roles.get(index).copied().unwrap_or(Role::Foreign);
        match (role, what) {
            (Role::Data { .. }, Symptom::Value) => match self.section(index, false) {
                "10.1" => role.rule(),
                section => (section, "contents of a cell"),
            },
            _ => role.rule(),
        }
    }

    /// The section of the rule that a byte obeys: for what a cell holds, that of the command by which it was written; for the checking byte of
    /// an answer that was refused before, that of the command.
    pub(crate) fn section(self, index: usize, refused: bool) -> &'static str {
        let role = self.roles[index];
        match role {
            Role::Data {
                drive: Some(drive),
                address,
            } => self.of_cell(index, drive, address),
            Role::Command { .. } | Role::Check { .. } if self.is_cut(index) => "9.5",
            Role::Check { drive, length, .. } if refused => {
                let in_command =
                    |role: &&Role| matches!(role, Role::Command { .. }) && role.drive() == drive;
                let mut command = self.roles[..index]
                    .iter()
                    .rev()
                    .take(length.into())
                    .filter(in_command);
                command.next().map_or("9.6", |role| role.rule().0)
            }
            _ => role.rule().0,
        }
    }

    /// The section of the addressing that the telegram of a byte has, if the rest of its command comes back as it was sent: then the drive has
    /// not taken the command for its own. `came` is what was received in the place of a byte.
    pub(crate) fn comes_back(
        &self,
        index: usize,
        came: &dyn Fn(usize) -> Option<u8>,
    ) -> Option<&'static str> {
        let is_check = |at: &usize| matches!(self.roles[*at], Role::Check { .. });
        let end = (index..self.roles.len().min(index + 4)).find(is_check)?;
        let unchanged = (index..=end).all(|at| came(at) == Some(self.bytes[at].0));
        let section = if self.is_short(index) { "9.2" } else { "9.3" };
        unchanged.then_some(section)
    }

    /// Whether a byte stands after the sync byte of a telegram with a short address (9.2).
    pub(crate) fn is_short(self, index: usize) -> bool {
        let start = (0..index).rev().find(|at| self.roles[*at] == Role::Sync);
        let header = start.map(|start| (start, SyncByte::decode(self.bytes[start].0)));
        match header {
            Some((start, Ok(SyncByte::Telegram(header)))) => {
                header.addressing() != Addressing::AddressFollows
                    && index < start + header.telegram_length()
            }
            _ => false,
        }
    }

    /// The section of the rule by which the byte of an error in front of `index` is one: the last byte that is a part of a telegram, or the
    /// one behind it.
    pub(crate) fn of_error(self, index: usize) -> &'static str {
        let part = |role: &&Role| !matches!(role, Role::Foreign | Role::Idle);
        match self.roles[..index].iter().rev().find(part) {
            Some(Role::Address { .. } | Role::ProcessData { .. }) => "9.5",
            Some(Role::Data { .. }) | None => "10.1",
            Some(role) => role.rule().0,
        }
    }

    /// Whether ReadWord or ReadLong reads the byte at `index`, of a cell that WriteByte was the last to write.
    pub(crate) fn is_word_of_bytes(self, index: usize) -> bool {
        let Role::Data {
            drive: Some(drive),
            address,
        } = self.roles[index]
        else {
            return false;
        };
        let of_it = |at: &usize| self.roles[*at].drive() == Some(drive);
        let places = (0..index).rev().filter(of_it);
        let is_part =
            |at: &usize| matches!(self.roles[*at], Role::Command { .. } | Role::Data { .. });
        let Some(command) = places.clone().take_while(is_part).last() else {
            return false;
        };
        let writes = |at: usize| match self.roles[at] {
            Role::Check {
                writes: Some((first, width)),
                ..
            } => (first..first.saturating_add(u16::from(width)))
                .contains(&address)
                .then_some(width),
            _ => None,
        };
        let is_wide = [READ_WORD, READ_LONG].contains(&self.bytes[command].0);
        is_wide && places.into_iter().find_map(writes) == Some(1)
    }

    /// The section of what a cell holds that is read at `index`.
    fn of_cell(self, index: usize, drive: u8, address: u16) -> &'static str {
        match address {
            0..0xFD80 => return "10.1",
            ram::STATUS => return "14.10.1",
            _ if (ram::ERRORCODE..ram::ERRORCODE + 2).contains(&address) => return "14.11.14",
            _ if EEPROM.contains(&address) => return "14.10.5",
            _ => {}
        }
        let mut was_right = false;
        for at in (0..index).rev() {
            match self.roles[at] {
                Role::Data {
                    drive: Some(of),
                    address: read,
                } if (of, read) == (drive, address) => {
                    was_right = true;
                }
                Role::Check {
                    drive: Some(of),
                    writes,
                    length,
                } if of == drive => {
                    let section = match at.checked_sub(1).map(|before| self.roles[before]) {
                        Some(Role::Command { section, .. }) => section,
                        _ => "10.1",
                    };
                    let writes = writes.is_some_and(|(first, width)| {
                        (first..first.saturating_add(u16::from(width))).contains(&address)
                    });
                    // WriteIO names no cell.
                    let writes = writes || section == WRITE_IO && address == OUTPUTS;
                    let right = self.is_right(at, drive, length);
                    match (section, right) {
                        ("10.5", true) => return "10.5",
                        // The cell was read correctly before and has not been written since.
                        (_, true) if writes && was_right => return "14.2.1",
                        (_, true) if writes => return section,
                        (_, false) if writes => return "9.6",
                        _ => {}
                    }
                }
                Role::ProcessData { drive: Some(of) } if of == drive && address >= 0xFF00 => {
                    return "9.4";
                }
                _ => {}
            }
        }
        "10.1"
    }

    /// Whether the checking byte of a command is right.
    fn is_right(self, check: usize, drive: u8, length: u8) -> bool {
        let in_command = |at: &usize| {
            matches!(self.roles[*at], Role::Command { .. } | Role::Data { .. })
                && self.roles[*at].drive() == Some(drive)
        };
        let command = (0..check).rev().filter(in_command);
        let command = command.take(usize::from(length).saturating_sub(1));
        let sum = command.fold(Checksum::EMPTY, |sum, at| sum.with(self.bytes[at].0));
        sum.plus() == self.bytes[check].0
    }

    /// Whether a command began in another telegram, or is not the first one of its telegram.
    fn is_cut(self, index: usize) -> bool {
        let start = (0..index).rev().find(|at| self.roles[*at] == Role::Sync);
        let Some(start) = start else { return false };
        let here = &self.roles[start..index];
        if here.iter().any(|role| matches!(role, Role::Check { .. })) {
            return true;
        }
        // The first parameter byte of this telegram goes on with a command of an earlier one.
        let drive = self.roles[index].drive();
        let before = self.roles[..start].iter().rev();
        let mut before = before.filter(|role| role.drive() == drive && drive.is_some());
        let goes_on = |role: &Role| matches!(role, Role::Command { .. } | Role::Data { .. });
        before.next().is_some_and(goes_on)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::plan::Exchange;
    use harness_proto::novobus::address::RingSize;
    use harness_proto::novobus::command::Command;
    use harness_proto::novobus::output::{Output, OutputChange};
    use harness_proto::novobus::role::roles;

    /// ND21 9.6, 10.4: what an output shows belongs to WriteIO, or to the checking byte that should have kept it from acting.
    #[test]
    fn an_output_belongs_to_write_io() {
        let output = Command::WriteIo(OutputChange {
            output: Output::Gpo2,
            set: true,
        });
        let read = Command::ReadByte { address: OUTPUTS };
        for (spoilt, section) in [(0, "10.4"), (1, "9.6")] {
            let bytes = [output, read].into_iter().flat_map(|command| {
                let exchange = Exchange::new(3, 1, command);
                exchange.expect("a drive").bytes
            });
            let mut bytes: Vec<_> = bytes.map(|byte| (byte, true)).collect();
            // The checking byte of WriteIO stands after a sync byte, an address byte, the command and its code.
            bytes[4].0 += spoilt;
            let sent = SentBytes {
                roles: &roles(RingSize::new(3).expect("a ring"), &bytes),
                bytes: &bytes,
            };
            let index = sent.bytes.len() - 2;
            let role = sent.roles[index];
            assert!(
                matches!(
                    role,
                    Role::Data {
                        address: OUTPUTS,
                        ..
                    }
                ),
                "{role:?}"
            );
            assert_eq!(sent.of_cell(index, 1, OUTPUTS), section);
        }
    }
}
