//! Commands that were sent and are not answered yet: an answer has half of its address (ND21 10.1), so it is read beside its command.

use super::effect::DriveAct;
use super::known::KnownDrive;
use super::limits::Limits;
use crate::nd21::ram;
use alloc::collections::VecDeque;

/// The most commands that are on their way.
const MOST: usize = 4_096;

/// Commands in the order in which they were sent.
#[derive(Clone, Debug, Default)]
pub(super) struct SentCommands(VecDeque<SentCommand>);

#[derive(Clone, Copy, Debug)]
struct SentCommand {
    address: u8,
    act: DriveAct,
    /// How many reads of the EEPROM its drive had begun.
    reads: u32,
}

impl SentCommands {
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// A command was sent to the drive of this address byte. False where more are not answered than are kept.
    pub(super) fn sent(&mut self, address: u8, act: DriveAct, known: &KnownDrive) -> bool {
        let reads = known.eeprom.reads();
        self.0.push_back(SentCommand {
            address,
            act,
            reads,
        });
        self.0.len() <= MOST
    }

    /// Takes what an answer tells, its checking byte left out. False where it answers none of the commands in their order.
    pub(super) fn answered(
        &mut self,
        address: u8,
        answer: &[u8],
        known: &mut KnownDrive,
        limits: &Limits,
    ) -> bool {
        let Some(command) = self.0.pop_front() else {
            return false;
        };
        match (command.act, answer) {
            _ if command.address != address => return false,
            (DriveAct::Read(cell), [code, low, data, ..]) => {
                let [_, cell_low] = cell.to_be_bytes();
                if cell_low != *low || !matches!(code, 0xC0 | 0xC1 | 0xC7) {
                    return false;
                }
                match (code, cell) {
                    (0xC0, ram::EEPROM_CONTROL) => known.eeprom.control(command.reads, *data),
                    (0xC0, ram::DATA_IN) => known.learn_data_in(*data, limits),
                    _ => {}
                }
            }
            // The answer to any other has the bytes of the command (10.2 to 10.5).
            (act, answer) if DriveAct::of(answer) == Some(act) => {
                if let DriveAct::WriteByte(ram::DATA_IN, data) = act {
                    known.learn_data_in(data, limits);
                }
            }
            _ => return false,
        }
        true
    }
}
