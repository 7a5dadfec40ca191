//! What of a drive the bus reaches: its memory and the rules for reaching it (ND21 10.1-10.5).

use super::command::Kind;
use super::error::BusError;
use super::output::OutputChange;
use core::ops::RangeInclusive;

/// ROM that can be read byte by byte (ND21 10.1; 12.3 names another range).
pub const ROM_BYTES: RangeInclusive<u16> = 0x2F00..=0x2FBF;
/// ROM that can be read word by word (ND21 10.1).
pub const ROM_WORDS: RangeInclusive<u16> = 0x2F00..=0x2FDF;
/// RAM (ND21 10.1-10.2).
pub const RAM: RangeInclusive<u16> = 0xFD80..=0xFF7F;
/// RAM and, above it, the on-chip register field (ND21 10.1).
pub const RAM_AND_REGISTERS: RangeInclusive<u16> = 0xFD80..=0xFFFF;
/// The part of that page that the bit commands may touch (ND21 10.3).
pub const PAGE_RAM: RangeInclusive<u16> = 0xFF00..=0xFF7F;

/// The ranges that a command may touch (ND21 10.1-10.3); none for one that touches no memory.
#[must_use]
pub const fn ranges(kind: Kind) -> &'static [RangeInclusive<u16>] {
    match kind {
        Kind::ReadByte => &[ROM_BYTES, RAM_AND_REGISTERS],
        Kind::ReadWord => &[ROM_WORDS, RAM],
        Kind::ReadLong | Kind::WriteByte | Kind::WriteWord => &[RAM],
        Kind::And | Kind::Or => &[PAGE_RAM],
        Kind::WriteIo | Kind::ResetH8 => &[],
    }
}

/// The ND21's own rule (ND21 10.1-10.3): whether a command may touch all of the `kind.width()` bytes
/// from `address` on.
#[must_use]
pub fn in_range(kind: Kind, address: u16) -> bool {
    let last = u32::from(address) + u32::from(kind.width()).max(1) - 1;
    kind.width() == 0
        || ranges(kind)
            .iter()
            .any(|range| range.contains(&address) && last <= u32::from(*range.end()))
}

/// A drive as its bus end sees it.
///
/// The bus end asks [`permits`](Self::permits) before it reads or writes for a command; the cells that
/// belong to the bus itself (`BusAddr`, `DataIn`, `DataOut`) and process data it reaches without asking.
pub trait Memory {
    /// The byte at `address`; every address has one, 00 where nothing is.
    fn read(&mut self, address: u16) -> u8;

    /// Writes a byte; where nothing can be written, nothing happens.
    fn write(&mut self, address: u16, data: u8);

    /// Whether a command may access `address`; if not, the drive reports error 0506.
    fn permits(&self, kind: Kind, address: u16) -> bool {
        in_range(kind, address)
    }

    /// `WriteIO` (ND21 10.4).
    fn write_output(&mut self, change: OutputChange);

    /// `ResetH8` (ND21 10.5): everything that is not in the EEPROM is lost.
    fn reset(&mut self);

    /// The bus end has detected an error and stops answering (ND21 9.7).
    fn bus_error(&mut self, error: BusError);

    /// Whether time-out monitoring is on: bit 2 of `Flags2` (ND21 14.10.2).
    fn monitors_time_out(&self) -> bool;
}
