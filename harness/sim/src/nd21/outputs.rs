//! What the drive shows outside: GPO2, the analogue output, the encoder emulation, the ready contact (ND21
//! 5.3, 14.7).
//!
//! Choice: the motor idles when `nist` is less than `Window` in either direction; the manual compares only
//! the lower byte (14.7.5.4, E133), which would call a motor at 256 units idle too.

use super::positioning::Positioning;
use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{hw_version, hw_version2, status};
use harness_proto::nd21::io::{GPO2, OUTPUTS};
use harness_proto::nd21::ram;

/// GPO2 by `HwVersion` bits 6 and 5 (14.7.5); with 00 it stays as the bus has set it.
pub(super) fn show_gpo2(positioning: &Positioning, cells: &mut Cells) {
    let high = match cells.byte(ram::HW_VERSION) & hw_version::GPO2 {
        hw_version::GPO2_BUS => return,
        hw_version::GPO2_CURRENT_LIMIT => cells.byte(ram::STATUS) & status::CURRENT_LIMIT != 0,
        hw_version::GPO2_IN_POSITION => positioning.in_position(cells),
        _ => cells.signed(ram::NIST).unsigned_abs() < u16::from(cells.byte(ram::WINDOW)),
    };
    cells.set_bits(OUTPUTS, GPO2, high);
}

/// The analogue output in mV: the cell FF00 + `AnOut` as a signed byte, 127 for 10 V, and the offset
/// (14.7.4). 0 where it is not active.
pub(super) fn analogue(cells: &Cells) -> i32 {
    if cells.byte(ram::HW_VERSION2) & hw_version2::NO_ANALOGUE_OUTPUT != 0 {
        return 0;
    }
    let signal = cells.byte(ram::STATUS + u16::from(cells.byte(ram::AN_OUT)));
    let sum =
        i32::from(signal.cast_signed()) + i32::from(cells.byte(ram::AN_OUT_OFFSET).cast_signed());
    sum.clamp(-127, 127) * 10_000 / 127
}

/// The encoder emulation (5.3.6, 14.7.1.1). Another number of impulses a turn counts from the place where it became active: impulses that
/// were given before stay given.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Encoder {
    per_turn: u16,
    /// Impulses given before this number became active, and the place of the motor at which it did, in increments.
    given: i64,
    from: i64,
}

impl Encoder {
    /// The power comes back at this place: counting starts there.
    pub(super) fn power_on(&mut self, increments: i64) {
        *self = Self {
            per_turn: self.per_turn,
            given: 0,
            from: increments,
        };
    }

    /// A reset at this place makes the number of impulses a turn active.
    pub(super) fn start(&mut self, increments: i64, per_turn: u16) {
        // Outside the range of 14.7.1.1 there is no emulation: a choice.
        let per_turn = if per_turn <= 0x400 { per_turn } else { 0 };
        if per_turn != self.per_turn {
            *self = Self {
                per_turn,
                given: self.impulses(increments),
                from: increments,
            };
        }
    }

    /// Impulses since power-up, backward ones counted down.
    pub(super) fn impulses(&self, increments: i64) -> i64 {
        let turned = (increments - self.from) * i64::from(self.per_turn);
        self.given + turned.div_euclid(65_536)
    }
}

/// The ready for operation contact is closed while the drive is neither in reset nor in error (5.3.7).
pub(super) fn ready(mode: Mode) -> bool {
    !matches!(mode, Mode::Reset | Mode::Error)
}
