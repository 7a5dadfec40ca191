//! Where the nominal speed comes from (ND21 14.3.1, 14.7.2, 14.7.3), and the reversing test mode.
//!
//! Choices: the analogue input resolves 10 V / 2048 (11 bit and sign; the print has lost a digit, E13);
//! GPIN8 high is the negative direction of the frequency input; above 500 kHz its impulses are an error
//! (5.3.4; 4.1 has 150 kHz, E07); one unit of `ReversTakt` is 64 cycles (27.648 ms), counted by
//! `CntRevers`.

use super::world::World;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{sw_version, sw_version2};
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;

/// Impulses a second that the frequency input can follow.
pub(super) const FASTEST_IMPULSES: u32 = 500_000;
/// Cycles of one unit of `ReversTakt`.
const REVERSING_UNIT: u8 = 64;

/// The source of the nominal value.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Source {
    /// `HwVersion` bit 7 at reset: the counter serves the analogue input (14.3.3).
    analogue: bool,
    /// What is left of the impulses, in parts of a raw unit.
    rest: i64,
    /// Reversing mode: cycles since the last unit, and the direction.
    reversing: u8,
    backwards: bool,
}

/// Denominator of the nominal speed from impulses.
const PARTS: i64 = 512 * 1_000_000;

impl Source {
    /// As after a reset.
    pub(super) fn new(analogue: bool) -> Self {
        Self {
            analogue,
            ..Self::default()
        }
    }

    /// The nominal speed of this cycle, limited to `nMax`; `nsoll` shows it where it comes from an input for good,
    /// and not where `RdPos` (`analogue`) asks for that of the analogue input.
    pub(super) fn cycle(&mut self, world: &World, analogue: bool, cells: &mut Cells) -> i16 {
        let software = cells.byte(ram::SW_VERSION);
        let narrow = cells.byte(ram::SW_VERSION2) & sw_version2::TO_8000 != 0;
        let source = if analogue {
            sw_version::SOURCE_ANALOGUE
        } else {
            software & sw_version::SOURCE
        };
        let from_input = match source {
            sw_version::SOURCE_NOVOBUS => None,
            sw_version::SOURCE_ANALOGUE if self.analogue || analogue => {
                Some(analogue_speed(world.analogue, narrow, cells))
            }
            sw_version::SOURCE_FREQUENCY if !self.analogue => {
                Some(self.frequency_speed(world, narrow, cells))
            }
            _ => Some(0),
        };
        let nominal = match from_input {
            // `RdPos` switches over as long as it is held; then the digital nominal value holds again
            // (13.1.4, 13.1.9.5).
            Some(speed) if analogue => speed,
            Some(speed) => {
                cells.put_word(ram::NSOLL, speed.cast_unsigned());
                speed
            }
            None => cells.signed(ram::NSOLL),
        };
        let most = cells.word(ram::N_MAX).min(0x7FFF).cast_signed();
        let speed = nominal.clamp(-most, most);
        if software & sw_version::REVERSING == 0 {
            return speed;
        }
        self.reverse(cells);
        if self.backwards { -speed } else { speed }
    }

    /// The reversing mode turns round after `ReversTakt` units.
    fn reverse(&mut self, cells: &mut Cells) {
        self.reversing += 1;
        if self.reversing < REVERSING_UNIT {
            return;
        }
        self.reversing = 0;
        let count = cells.byte(ram::CNT_REVERS).saturating_add(1);
        let over = count >= cells.byte(ram::REVERS_TAKT);
        cells.put(ram::CNT_REVERS, if over { 0 } else { count });
        self.backwards ^= over;
    }

    /// An impulse moves the shaft by (`VCOlin` x 256 + `VCOlinL`) / 512 increments (14.7.3).
    fn frequency_speed(&mut self, world: &World, narrow: bool, cells: &Cells) -> i16 {
        let [high, low] = [cells.byte(ram::VCO_LIN), cells.byte(ram::VCO_LIN_L)];
        let increments = i64::from(u16::from_be_bytes([high, low]));
        let frequency = i64::from(world.frequency.min(FASTEST_IMPULSES));
        let units = if narrow { 8 } else { 4 };
        let step = frequency * increments * 432 * units;
        let negative = world.inputs.is_high(Input::Gpin8);
        let sum = self.rest + if negative { -step } else { step };
        self.rest = sum % PARTS;
        clamp(sum / PARTS)
    }
}

/// `VCOlin` is the speed at 10 V, in 60 rpm (14.7.2).
fn analogue_speed(millivolts: i32, narrow: bool, cells: &Cells) -> i16 {
    let bits = i64::from(millivolts) * 2_048 / 10_000;
    let rpm = i64::from(cells.byte(ram::VCO_LIN)) * 60;
    // 7.5 / (65536 x 432 us) rpm a bit (14.5.3.1): x 65536 x 432 / 7.5e6.
    let scale = if narrow { 1 } else { 2 };
    clamp(bits * rpm * 65_536 * 4_320 / (2_048 * 75_000_000 * scale))
}

fn clamp(speed: i64) -> i16 {
    i16::try_from(speed.clamp(-0x7FFF, 0x7FFF)).unwrap_or(0)
}
