//! The EEPROM controller (ND21 14.10.5): commands in the cell `EEPROMcontrol`, done when a bit of it is 1.

use super::properties::Nd21Properties;
use crate::cells::Cells;
use harness_proto::nd21::{self, cells};
use harness_proto::time::Instant;

/// `EEPROMbuffer`: the EEPROM address goes in here, and a byte that was read comes out.
const BUFFER: u16 = 0xFD88;
/// The byte behind it: what is to be written.
const DATA: u16 = 0xFD89;
/// `EEPROMcontrol`.
pub(super) const CONTROL: u16 = 0xFD8A;

/// Bit 4 of `EEPROMcontrol`: writing is completed; nothing is going on.
const READY: u8 = 1 << 4;
/// Bit 5: a byte has been read.
const READ: u8 = 1 << 5;

/// A command (ND21 14.10.5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    ReadByte,
    WriteByte,
    ProgParam,
}

impl Command {
    const fn from_code(code: u8) -> Option<Self> {
        match code {
            0x81 => Some(Self::ReadByte),
            0x82 => Some(Self::WriteByte),
            0x84 => Some(Self::ProgParam),
            _ => None,
        }
    }
}

/// The EEPROM controller.
#[derive(Clone, Debug, Default)]
pub(super) struct EepromController {
    busy: Option<(Command, Instant)>,
}

impl EepromController {
    /// As after power-up.
    pub(super) fn start(&mut self, memory: &mut Cells) {
        self.busy = None;
        put(memory, CONTROL, READY);
    }

    /// A byte is written to `EEPROMcontrol`. While a command is being done, nothing else is taken.
    pub(super) fn control(
        &mut self,
        now: Instant,
        code: u8,
        properties: Nd21Properties,
        memory: &mut Cells,
    ) {
        if self.busy.is_some() {
            return;
        }
        put(memory, CONTROL, code);
        self.busy = Command::from_code(code).map(|command| {
            let time = match command {
                Command::ReadByte => properties.eeprom_read_time,
                Command::WriteByte => properties.eeprom_write_time,
                Command::ProgParam => {
                    properties.eeprom_write_time * u64::from(nd21::PARAMETER_COUNT)
                }
            };
            (command, now + time)
        });
    }

    /// When the command that is being done is done.
    pub(super) fn busy_until(&self) -> Option<Instant> {
        self.busy.map(|(_, until)| until)
    }

    /// Finishes what is due.
    pub(super) fn advance(&mut self, now: Instant, memory: &mut Cells) {
        let Some((command, _)) = self.busy.filter(|(_, until)| *until <= now) else {
            return;
        };
        self.busy = None;
        let address = usize::from(memory.peek(BUFFER));
        match command {
            Command::ReadByte => {
                let byte = memory.eeprom()[address];
                put(memory, BUFFER, byte);
                put(memory, CONTROL, READ);
            }
            Command::WriteByte => {
                memory.eeprom_mut()[address] = memory.peek(DATA);
                put(memory, CONTROL, READY);
            }
            Command::ProgParam => {
                for i in 0..nd21::PARAMETER_COUNT {
                    let byte = memory.peek(nd21::PARAMETERS + i);
                    memory.eeprom_mut()[usize::from(u16::from(nd21::EE_PARAMETERS) + i)] = byte;
                }
                put(memory, CONTROL, READY);
            }
        }
    }

    /// The power fails: bytes that are being written are lost (they read FF). True where there are some.
    pub(super) fn damage(&self, memory: &mut Cells) -> bool {
        let written = match self.busy {
            Some((Command::WriteByte, _)) => {
                let address = usize::from(memory.peek(BUFFER));
                address..address + 1
            }
            Some((Command::ProgParam, _)) => {
                let first = usize::from(nd21::EE_PARAMETERS);
                first..first + usize::from(nd21::PARAMETER_COUNT)
            }
            _ => return false,
        };
        memory.eeprom_mut()[written].fill(0xFF);
        true
    }
}

fn put(memory: &mut Cells, address: u16, byte: u8) {
    let known = memory.poke(address, byte);
    debug_assert!(known && cells::cell_at(address).is_some());
}
