//! What counts time: `RealTimeClock`, the cycle counters, the hours in the EEPROM (ND21 14.2.1, 14.8.2).
//!
//! Choices: `RealTimeClock` counts cycles of 432 us; `Cnt2` is its low byte; `CntBlink` counts 256 cycles
//! (110.6 ms); `uP` is the time in us that the processor needs of a cycle, 150 with the regulator blocked
//! and 250 with it released.

use super::eeprom_controller::count_in;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::flags;
use harness_proto::nd21::{ee, ram};

/// Cycles of 432 us in an hour, rounded down.
const HOUR: u64 = 3_600_000_000 / 432;
/// `uP` with the regulator blocked and released.
const LOAD: [u16; 2] = [150, 250];

/// Hours that are not yet full, in cycles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    active: u64,
    blocked: u64,
}

impl Clock {
    /// Advances by this number of cycles.
    #[inline]
    pub(super) fn pass(&mut self, cycles: u64, released: bool, cells: &mut Cells) {
        let [low, high, ..] = cycles.to_le_bytes();
        let before = cells.word(ram::REAL_TIME_CLOCK);
        let now = before.wrapping_add(u16::from_le_bytes([low, high]));
        cells.put_word(ram::REAL_TIME_CLOCK, now);
        let [high, low] = now.to_be_bytes();
        cells.put(ram::CNT2, low);
        cells.put(ram::CNT_BLINK, high);
        cells.put_bits(ram::FLAGS, flags::TIMING, low);
        cells.put_word(ram::UP, LOAD[usize::from(released)]);
        let (count, address) = if released {
            (&mut self.active, ee::BETRIEB_STD)
        } else {
            (&mut self.blocked, ee::SPERRE_STD)
        };
        *count += cycles;
        if *count >= HOUR {
            let hours = *count / HOUR;
            *count %= HOUR;
            add_hours(hours, address, cells);
        }
    }
}

/// The hours in the EEPROM have the low byte first (14.8.2, E115).
fn add_hours(hours: u64, address: u8, cells: &mut Cells) {
    let first = usize::from(address);
    count_in(cells.eeprom_mut(), |eeprom| {
        let before = u16::from_le_bytes([eeprom[first], eeprom[first + 1]]);
        let sum = u16::try_from(u64::from(before) + hours).unwrap_or(u16::MAX);
        [eeprom[first], eeprom[first + 1]] = sum.to_le_bytes();
    });
}
