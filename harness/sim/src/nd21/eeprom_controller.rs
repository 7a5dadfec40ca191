//! The EEPROM controller (ND21 14.10.5): commands in the cell `EEPROMcontrol`, done when a bit of it is 1;
//! and the cycle control's own way to store a position, which leaves the cells of the bus alone.
//!
//! Choice (E124): `EE_parity` is the exclusive or of the other 255 bytes and FF. It is wrong while something is
//! being written and put right after it: a power failure in mid-write leaves FF where it was writing, and a
//! wrong test byte.

use super::properties::Nd21Properties;
use crate::novobus::cells::Cells;
use harness_proto::nd21::{self, cells, ee, ram};
use harness_proto::time::Instant;

/// `EEPROMbuffer`: the EEPROM address goes in here, and a byte that was read comes out.
const BUFFER: u16 = ram::EEPROM_BUFFER;
/// The byte behind it: what is to be written.
const DATA: u16 = ram::EEPROM_BUFFER + 1;
const CONTROL: u16 = ram::EEPROM_CONTROL;

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

/// A command that is being done: with the address and the byte that stood in the buffer when it was given.
#[derive(Clone, Copy, Debug)]
struct EepromJob {
    command: Command,
    address: u8,
    data: u8,
    until: Instant,
}

#[derive(Clone, Debug, Default)]
pub(super) struct EepromController {
    busy: Option<EepromJob>,
    /// Where a position is being stored, which, and until when.
    storing: Option<(u8, [u8; 4], Instant)>,
}

impl EepromController {
    /// As after power-up.
    pub(super) fn start(&mut self, memory: &mut Cells) {
        *self = Self::default();
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
            EepromJob {
                command,
                address: memory.peek(BUFFER),
                data: memory.peek(DATA),
                until: now + time,
            }
        });
    }

    /// When something that is being done is done.
    pub(super) fn busy_until(&self) -> Option<Instant> {
        let bus = self.busy.map(|job| job.until);
        let storing = self.storing.map(|(_, _, until)| until);
        bus.into_iter().chain(storing).min()
    }

    /// Begins to store a position for the cycle control; false while another is being stored.
    pub(super) fn store(
        &mut self,
        now: Instant,
        address: u8,
        position: [u8; 4],
        properties: &Nd21Properties,
    ) -> bool {
        if self.storing.is_some() {
            return false;
        }
        let until = now + properties.eeprom_write_time * position.len() as u64;
        self.storing = Some((address, position, until));
        true
    }

    /// A position is being stored.
    pub(super) fn storing(&self) -> bool {
        self.storing.is_some()
    }

    /// Finishes what is due.
    pub(super) fn advance(&mut self, now: Instant, memory: &mut Cells) {
        if let Some((address, position, _)) = self.storing.filter(|(_, _, until)| *until <= now) {
            self.storing = None;
            let first = usize::from(address);
            memory.eeprom_mut()[first..first + position.len()].copy_from_slice(&position);
            set_parity(memory.eeprom_mut());
        }
        let Some(job) = self.busy.filter(|job| job.until <= now) else {
            return;
        };
        self.busy = None;
        let address = usize::from(job.address);
        match job.command {
            Command::ReadByte => {
                let byte = memory.eeprom()[address];
                put(memory, BUFFER, byte);
                put(memory, CONTROL, READ);
            }
            Command::WriteByte => {
                // 14.3.5: this byte is a read only byte.
                if address != usize::from(ee::VERSION) {
                    memory.eeprom_mut()[address] = job.data;
                }
                // An explicit write of the test byte is kept.
                if address != usize::from(ee::PARITY) {
                    set_parity(memory.eeprom_mut());
                }
                put(memory, CONTROL, READY);
            }
            Command::ProgParam => {
                for i in 0..nd21::PARAMETER_COUNT {
                    let byte = memory.peek(nd21::PARAMETERS + i);
                    memory.eeprom_mut()[usize::from(u16::from(nd21::EE_PARAMETERS) + i)] = byte;
                }
                set_parity(memory.eeprom_mut());
                put(memory, CONTROL, READY);
            }
        }
    }

    /// The power fails: what has been written stays, the byte that is being written is lost (it reads FF),
    /// and the test byte is wrong.
    pub(super) fn damage(&mut self, now: Instant, properties: &Nd21Properties, memory: &mut Cells) {
        let parameters = |memory: &Cells| {
            let cells = nd21::PARAMETERS..nd21::PARAMETERS + nd21::PARAMETER_COUNT;
            cells.map(|cell| memory.peek(cell)).collect::<Vec<_>>()
        };
        let storing = self.storing.take();
        let storing = storing.map(|(address, position, until)| (address, position.to_vec(), until));
        let bus = self.busy.take().and_then(|job| match job.command {
            Command::ReadByte => None,
            Command::WriteByte => Some((job.address, vec![job.data], job.until)),
            Command::ProgParam => Some((nd21::EE_PARAMETERS, parameters(memory), job.until)),
        });
        for (address, bytes, until) in storing.into_iter().chain(bus) {
            let left = if until > now {
                until.since(now).units()
            } else {
                0
            };
            let byte_time = properties.eeprom_write_time.units().max(1);
            let left = usize::try_from(left.div_ceil(byte_time)).unwrap_or(bytes.len());
            let written = bytes.len().saturating_sub(left.max(1));
            let first = usize::from(address);
            let eeprom = memory.eeprom_mut();
            eeprom[first..first + written].copy_from_slice(&bytes[..written]);
            eeprom[first + written] = 0xFF;
            eeprom[usize::from(ee::PARITY)] = !parity(eeprom);
        }
    }
}

fn parity(eeprom: &[u8; 256]) -> u8 {
    eeprom.iter().fold(0xFF, |sum, byte| sum ^ byte) ^ eeprom[usize::from(ee::PARITY)]
}

/// Puts the test byte `EE_parity` right.
pub fn set_parity(eeprom: &mut [u8; 256]) {
    eeprom[usize::from(ee::PARITY)] = parity(eeprom);
}

/// Whether the test byte is right (14.11.2).
pub(super) fn parity_is_right(eeprom: &[u8; 256]) -> bool {
    eeprom[usize::from(ee::PARITY)] == parity(eeprom)
}

/// Changes bytes that the drive counts up by itself; a test byte that is wrong stays wrong.
pub(super) fn count_in(eeprom: &mut [u8; 256], change: impl FnOnce(&mut [u8; 256])) {
    let before = parity(eeprom);
    change(eeprom);
    eeprom[usize::from(ee::PARITY)] ^= before ^ parity(eeprom);
}

fn put(memory: &mut Cells, address: u16, byte: u8) {
    let known = memory.poke(address, byte);
    debug_assert!(known && cells::cell_at(address).is_some());
}
