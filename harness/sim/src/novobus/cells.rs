//! The memory of a drive, byte by byte (ND21 14.2).

use harness_proto::nd21;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::{Memory, RAM, ROM_WORDS};
use harness_proto::novobus::output::{Output, OutputChange};
use std::hash::{Hash, Hasher};

/// Where RAM starts; the register field follows it up to FFFF (ND21 10.1).
const RAM_START: u16 = *RAM.start();
const RAM_AND_REGISTERS: usize = 0x1_0000 - RAM_START as usize;
const ROM_START: u16 = *ROM_WORDS.start();
const ROM_SIZE: usize = (*ROM_WORDS.end() - ROM_START) as usize + 1;

/// The memory of a drive: RAM and registers, a ROM window and the EEPROM, without any rule of access.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cells {
    ram: [u8; RAM_AND_REGISTERS],
    rom: [u8; ROM_SIZE],
    eeprom: [u8; 256],
}

impl Hash for Cells {
    fn hash<H: Hasher>(&self, state: &mut H) {
        // ROM and EEPROM are those of other memories most often.
        self.ram.hash(state);
    }
}

impl Cells {
    /// A memory with an EEPROM as given, and nothing in RAM.
    #[inline]
    pub(crate) fn with_eeprom(eeprom: [u8; 256]) -> Self {
        Self {
            ram: [0; RAM_AND_REGISTERS],
            rom: [0; ROM_SIZE],
            eeprom,
        }
    }

    /// Restarts with empty registers; ROM and EEPROM stay, because the bus cannot change them. It works in place, which avoids the copy of
    /// a newly created memory.
    pub(crate) fn restart(&mut self) {
        self.ram = [0; RAM_AND_REGISTERS];
        self.load();
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

    /// The addresses of RAM and the register field (FD80 to FFFF, ND21 10.1) at which two memories differ, in order.
    pub fn differences<'c>(&'c self, other: &'c Self) -> impl Iterator<Item = u16> + 'c {
        const RUN: usize = 32;
        const { assert!(RAM_AND_REGISTERS.is_multiple_of(RUN)) }
        // Runs of a fixed length are compared without a call.
        let runs = |cells: &'c Self| cells.ram.as_chunks::<RUN>().0.iter();
        let runs = runs(self).zip(runs(other));
        let runs = (RAM_START..=u16::MAX).step_by(RUN).zip(runs);
        // Most of a memory is the same, which a comparison of whole runs shows at once.
        let runs = runs.filter(|(_, (own, other))| own != other);
        runs.flat_map(|(start, (own, other))| {
            let bytes = (start..=u16::MAX).zip(own.iter().zip(other));
            bytes.filter_map(|(address, (own, other))| (own != other).then_some(address))
        })
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

    /// RAM and the register field, FD80 to FFFF (ND21 10.1).
    #[must_use]
    pub fn ram_and_registers(&self) -> &[u8; RAM_AND_REGISTERS] {
        &self.ram
    }

    /// The byte at an address of RAM or the register field.
    #[inline]
    pub(crate) fn byte(&self, address: u16) -> u8 {
        self.ram[usize::from(address - RAM_START)]
    }

    /// Sets a byte of RAM or the register field.
    #[inline]
    pub(crate) fn put(&mut self, address: u16, byte: u8) {
        self.ram[usize::from(address - RAM_START)] = byte;
    }

    /// Sets and clears bits of a byte of RAM or the register field.
    #[inline]
    pub(crate) fn put_bits(&mut self, address: u16, mask: u8, bits: u8) {
        self.put(address, self.byte(address) & !mask | bits & mask);
    }

    /// Sets a byte's bits where `set`, and clears them where not.
    #[inline]
    pub(crate) fn set_bits(&mut self, address: u16, mask: u8, set: bool) {
        self.put_bits(address, mask, if set { mask } else { 0 });
    }

    /// The word at an address of RAM, its high byte first.
    #[inline]
    pub(crate) fn word(&self, address: u16) -> u16 {
        u16::from_be_bytes([self.byte(address), self.byte(address + 1)])
    }

    /// The word at an address of RAM as a number with a sign.
    #[inline]
    pub(crate) fn signed(&self, address: u16) -> i16 {
        self.word(address).cast_signed()
    }

    /// Sets a word of RAM, its high byte first.
    #[inline]
    pub(crate) fn put_word(&mut self, address: u16, word: u16) {
        let [high, low] = word.to_be_bytes();
        self.put(address, high);
        self.put(address + 1, low);
    }

    /// The double word at an address of RAM, its highest byte first.
    #[inline]
    pub(crate) fn long(&self, address: u16) -> u32 {
        u32::from(self.word(address)) << 16 | u32::from(self.word(address + 2))
    }

    /// Sets a double word of RAM, its highest byte first.
    #[inline]
    pub(crate) fn put_long(&mut self, address: u16, long: u32) {
        let [a, b, c, d] = long.to_be_bytes();
        self.put_word(address, u16::from_be_bytes([a, b]));
        self.put_word(address + 2, u16::from_be_bytes([c, d]));
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
        self.load();
    }

    /// Loads the parameters, and switches the monitoring on where the EEPROM says so.
    fn load(&mut self) {
        let count = usize::from(nd21::PARAMETER_COUNT);
        let kept = &self.eeprom[usize::from(nd21::EE_PARAMETERS)..][..count];
        self.ram[usize::from(nd21::PARAMETERS - RAM_START)..][..count].copy_from_slice(kept);
        let monitoring =
            self.eeprom[usize::from(nd21::ee::SELFTEST)] & nd21::bits::selftest::MONITORING != 0;
        if monitoring {
            self.write(nd21::ram::FLAGS2, nd21::bits::flags2::MONITORING);
        }
    }
}

impl Memory for Cells {
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
            Output::Gpo1 => nd21::io::GPO1,
            Output::Gpo2 => nd21::io::GPO2,
        };
        let others = self.peek(nd21::io::OUTPUTS) & !bit;
        self.write(nd21::io::OUTPUTS, others | if change.set { bit } else { 0 });
    }

    fn reset(&mut self) {
        self.start();
    }

    fn bus_error(&mut self, error: BusError) {
        let [high, low] = error.code().to_be_bytes();
        self.write(nd21::ram::ERRORCODE, high);
        self.write(nd21::ram::ERRORCODE + 1, low);
    }

    fn monitors_time_out(&self) -> bool {
        self.peek(nd21::ram::FLAGS2) & nd21::bits::flags2::MONITORING != 0
    }
}
