//! A plain drive: the ND21's memory and bus, and nothing that turns.

use crate::device::Device;
use harness_proto::line::Received;
use harness_proto::nd21;
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Step};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::{Memory, RAM, ROM_WORDS};
use harness_proto::novobus::output::{Output, OutputChange};
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Instant;

/// Where RAM starts; the register field follows it up to FFFF (ND21 10.1).
const RAM_START: u16 = *RAM.start();
const RAM_AND_REGISTERS: usize = 0x1_0000 - RAM_START as usize;
const ROM_START: u16 = *ROM_WORDS.start();
const ROM_SIZE: usize = (*ROM_WORDS.end() - ROM_START) as usize + 1;

/// The memory of a plain drive: RAM and registers, a ROM window and the EEPROM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlainMemory {
    ram: [u8; RAM_AND_REGISTERS],
    rom: [u8; ROM_SIZE],
    eeprom: [u8; 256],
}

impl PlainMemory {
    fn new() -> Self {
        Self {
            ram: [0; RAM_AND_REGISTERS],
            rom: [0; ROM_SIZE],
            eeprom: [0; 256],
        }
    }

    /// A memory with an EEPROM as given, and nothing in RAM.
    pub(crate) fn with_eeprom(eeprom: [u8; 256]) -> Self {
        Self {
            eeprom,
            ..Self::new()
        }
    }

    fn cell(&mut self, address: u16) -> Option<&mut u8> {
        if let Some(offset) = address.checked_sub(RAM_START) {
            return self.ram.get_mut(usize::from(offset));
        }
        self.rom
            .get_mut(usize::from(address.checked_sub(ROM_START)?))
    }

    /// The byte at `address`; 00 where nothing is.
    #[must_use]
    pub fn peek(&self, address: u16) -> u8 {
        if let Some(offset) = address.checked_sub(RAM_START) {
            return self.ram[usize::from(offset)];
        }
        address
            .checked_sub(ROM_START)
            .and_then(|offset| self.rom.get(usize::from(offset)).copied())
            .unwrap_or(0)
    }

    /// Sets the byte at `address`, ROM too; false where there is no memory.
    #[must_use]
    pub fn poke(&mut self, address: u16, byte: u8) -> bool {
        let Some(cell) = self.cell(address) else {
            return false;
        };
        *cell = byte;
        true
    }

    /// The EEPROM.
    pub fn eeprom_mut(&mut self) -> &mut [u8; 256] {
        &mut self.eeprom
    }

    /// The EEPROM.
    #[must_use]
    pub fn eeprom(&self) -> &[u8; 256] {
        &self.eeprom
    }

    /// What the drive's program does at power-up and reset: RAM is lost (the registers above it show the
    /// outside world, and keep what the scenario has set), the parameters are loaded from
    /// the EEPROM (ND21 14.2), and `EE_selftest` bit 7 switches time-out monitoring on (14.10.2).
    pub(crate) fn start(&mut self) {
        let ram = RAM.len();
        self.ram[..ram].fill(0);
        for i in 0..nd21::PARAMETER_COUNT {
            let byte = self.eeprom[usize::from(u16::from(nd21::EE_PARAMETERS) + i)];
            self.write(nd21::PARAMETERS + i, byte);
        }
        let monitoring =
            self.eeprom[usize::from(nd21::EE_SELFTEST)] & nd21::EE_SELFTEST_MONITORING != 0;
        if monitoring {
            self.write(nd21::FLAGS2, nd21::FLAGS2_MONITORING);
        }
    }
}

impl Memory for PlainMemory {
    fn read(&mut self, address: u16) -> u8 {
        self.peek(address)
    }

    fn write(&mut self, address: u16, data: u8) {
        if let Some(offset) = address.checked_sub(RAM_START) {
            self.ram[usize::from(offset)] = data;
        }
    }

    fn write_output(&mut self, change: OutputChange) {
        let bit = match change.output {
            Output::Gpo1 => nd21::GPO1,
            Output::Gpo2 => nd21::GPO2,
        };
        let others = self.peek(nd21::OUTPUTS) & !bit;
        self.write(nd21::OUTPUTS, others | if change.set { bit } else { 0 });
    }

    fn reset(&mut self) {
        self.start();
    }

    fn bus_error(&mut self, error: BusError) {
        let [high, low] = error.code().to_be_bytes();
        self.write(nd21::ERROR_CODE, high);
        self.write(nd21::ERROR_CODE + 1, low);
    }

    fn monitors_time_out(&self) -> bool {
        self.peek(nd21::FLAGS2) & nd21::FLAGS2_MONITORING != 0
    }
}

/// A plain drive.
#[derive(Clone, Debug)]
pub struct PlainDrive {
    bus_end: BusEnd,
    memory: PlainMemory,
    properties: Properties,
}

impl PlainDrive {
    /// A drive with an EEPROM as given, after power-up.
    #[must_use]
    pub fn new(properties: Properties, eeprom: [u8; 256]) -> Self {
        let mut memory = PlainMemory::with_eeprom(eeprom);
        memory.start();
        Self {
            bus_end: BusEnd::new(properties),
            memory,
            properties,
        }
    }

    /// Its memory.
    #[must_use]
    pub fn memory(&self) -> &PlainMemory {
        &self.memory
    }

    /// Its memory.
    pub fn memory_mut(&mut self) -> &mut PlainMemory {
        &mut self.memory
    }

    /// Its end of the bus.
    #[must_use]
    pub fn bus_end(&self) -> &BusEnd {
        &self.bus_end
    }
}

impl Default for PlainDrive {
    fn default() -> Self {
        Self::new(Properties::default(), [0; 256])
    }
}

impl Device for PlainDrive {
    #[inline]
    fn receive(&mut self, now: Instant, received: Received) -> Step {
        self.bus_end.receive(now, received, &mut self.memory)
    }

    #[inline]
    fn deadline(&self) -> Option<Deadline> {
        self.bus_end.deadline(&self.memory)
    }

    fn handle_deadline(&mut self, now: Instant) -> Step {
        self.bus_end.handle_deadline(now, &mut self.memory)
    }

    fn power_on(&mut self) {
        self.memory.start();
        self.bus_end = BusEnd::new(self.properties);
    }

    fn in_error(&self) -> bool {
        self.bus_end.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.bus_end.cause()
    }
}
