//! What the drive watches: temperatures, DC rail, resolver, end switches, motor current (ND21 4.2.2,
//! 14.3.3, 14.5.7, 14.11).
//!
//! Choices: both end switches at once are error 314; the motor's sensor is too hot above its limit if it
//! is a PTC or an opener, below it if it is an NTC; a limit of the cooler's temperature is passed
//! downwards, since `TempKK` falls as it gets hotter (E114); a warning stands in `errorcode` and the history,
//! without the error mode (E132).

use super::world::World;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{hw_version, hw_version2, sw_version, sw_version2};
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{Ratio, cooler_to_raw, motor_sensor_to_raw};

/// Shut-off thresholds of the DC rail in V (4.2.2).
const OVER_VOLTAGE: u32 = 800;
const UNDER_VOLTAGE: u32 = 200;

/// Which end switches are active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EndSwitches {
    pub(super) positive: bool,
    pub(super) negative: bool,
}

impl EndSwitches {
    /// As `HwVersion2` bit 7 says: active high or active low (14.3.4).
    pub(super) fn new(world: &World, cells: &Cells) -> Self {
        let high = cells.byte(ram::HW_VERSION2) & hw_version2::END_SWITCH_HIGH != 0;
        Self {
            positive: world.inputs.is_high(Input::EschP) == high,
            negative: world.inputs.is_high(Input::EschN) == high,
        }
    }

    /// The speed that they leave of a nominal one, where they stop the drive (14.3.3).
    pub(super) fn restrain(self, speed: i16) -> i16 {
        let stopped = self.positive && speed > 0 || self.negative && speed < 0;
        if stopped { 0 } else { speed }
    }

    fn error(self) -> Option<ErrorCode> {
        match (self.positive, self.negative) {
            (true, true) => Some(ErrorCode::EndSchalter),
            (true, false) => Some(ErrorCode::EndSchaltP),
            (false, true) => Some(ErrorCode::EndSchaltN),
            (false, false) => None,
        }
    }
}

/// The temperatures in their cells; both stand still between two changes.
pub(super) fn show_temperatures(world: &World, cells: &mut Cells) {
    let celsius = Ratio::decimal(i64::from(world.cooler), 1);
    if let Some(raw) = celsius.and_then(|celsius| cooler_to_raw(celsius).ok()) {
        cells.put(ram::TEMP_KK, raw);
    }
    let ohm = i32::try_from(world.motor_sensor).unwrap_or(i32::MAX);
    if let Ok(raw) = motor_sensor_to_raw(Ratio::whole(ohm)) {
        cells.put(ram::TEMP_MOT, raw);
    }
}

/// The error that the present situation is.
pub(super) fn error(world: &World, switches: EndSwitches, cells: &Cells) -> Option<ErrorCode> {
    if world.rail > OVER_VOLTAGE {
        return Some(ErrorCode::ZkUeberSp);
    }
    if world.rail < UNDER_VOLTAGE {
        return Some(ErrorCode::ZkUnterSp);
    }
    if world.short {
        return Some(ErrorCode::UeberStrom);
    }
    if !world.resolver {
        return Some(ErrorCode::ResolvKabel);
    }
    if cells.byte(ram::TEMP_KK) < cells.byte(ram::MAX_TEMP_KK) {
        return Some(ErrorCode::OverTempKk);
    }
    let hardware = cells.byte(ram::HW_VERSION);
    let (motor, most) = (cells.byte(ram::TEMP_MOT), cells.byte(ram::MAX_TEMP_MOT));
    let hot = match hardware & hw_version::SENSOR {
        0b00 => false,
        0b01 => motor < most,
        _ => motor > most,
    };
    if hot {
        return Some(ErrorCode::OverTempMot);
    }
    if impulses_too_fast(world, cells)
        && cells.byte(ram::SW_VERSION2) & sw_version2::IMPULSE_ERROR != 0
    {
        return Some(ErrorCode::ImpulsEingang);
    }
    if hardware & hw_version::END_SWITCH_BLOCKS != 0 {
        return switches.error();
    }
    None
}

/// The warning that the present situation is: an error at the impulse input, which does not switch off the
/// power stage (14.3.2 bit 6 = 0).
pub(super) fn warning(world: &World, cells: &Cells) -> Option<ErrorCode> {
    let only_warned = cells.byte(ram::SW_VERSION2) & sw_version2::IMPULSE_ERROR == 0;
    (only_warned && impulses_too_fast(world, cells)).then_some(ErrorCode::ImpulsEingang)
}

fn impulses_too_fast(world: &World, cells: &Cells) -> bool {
    cells.byte(ram::SW_VERSION) & sw_version::SOURCE == sw_version::SOURCE_FREQUENCY
        && world.frequency > super::source::FASTEST_IMPULSES
}
