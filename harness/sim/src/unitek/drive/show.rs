//! What the registers show of inputs and plant.

use super::Drive;
use crate::unitek::plant::Control;
use harness_proto::unitek::Register;
use harness_proto::unitek::properties::{EnableAfterLock, StatusBits};
use harness_proto::unitek::words::{
    ERROR_NO_POWER, ERROR_TIME_OUT, ERRORS_FAULT, ERRORS_NOT_READY, MODE_LOCK, status,
};
use std::hash::{DefaultHasher, Hash, Hasher as _};
use std::sync::Arc;

/// Speeds below this count as standing: 1 % (F5).
const STANDING: i64 = 328;

impl Drive {
    /// A checksum of all that decides what it does from now on, but its properties, what its registers hold, and where its axis stands.
    /// Times in it count from the present.
    #[must_use]
    pub fn state(&self) -> u64 {
        let mut state = DefaultHasher::new();
        let levels = self
            .eeprom
            .each_ref()
            .map(|level| level.as_ref().map(Arc::as_ptr));
        (levels, self.identifiers, self.second).hash(&mut state);
        (self.on_bus, self.control, &self.inputs, self.homing).hash(&mut state);
        (self.calibrated, self.timed_out, self.released).hash(&mut state);
        (self.last_status, self.sets_up, self.powered).hash(&mut state);
        self.plant.moves().hash(&mut state);
        let waits = self.next.map(|next| next.saturating_sub(self.scans));
        waits.hash(&mut state);
        if self.times_out_at().is_some() {
            let now = self.power_up + super::SCAN * self.scans;
            now.since(self.last_frame).units().hash(&mut state);
        }
        self.cycles
            .state(self.scans)
            .for_each(|cycle| cycle.hash(&mut state));
        state.finish()
    }

    /// The contents of a register as a read gives them, with the bits that the register has.
    #[must_use]
    pub fn register(&self, number: u8) -> u32 {
        let position = self.plant.position().cast_unsigned();
        let destination = self.cells[0x6E];
        let follows = self.control == Control::Position && self.is_enabled();
        let command = if follows { destination } else { position };
        let inputs = &self.inputs;
        let raw = match number {
            0x20 | 0x27 | 0x5F => self.current(),
            0x30 | 0x32 | 0xA8 => (self.speed() & 0xFFFF) as u32,
            0x40 => self.status(),
            0x49 => inputs.motor_temperature.into(),
            0x4A => inputs.igbt_temperature.into(),
            0x4B => inputs.air_temperature.into(),
            0x6D => position,
            0x70 => command.wrapping_sub(position),
            0x8F => self.errors(),
            0x91 => command,
            0xCE => self.cells[0xC8],
            0xD8 => self.io(),
            0xE2 => self.is_ready().into(),
            0xE3 => self.is_enabled().into(),
            0xE4 => inputs.limit1.into(),
            0xE5 => inputs.limit2.into(),
            0xE6 => inputs.din1.into(),
            0xE7 => inputs.din2.into(),
            0xE8 => inputs.run.into(),
            0xEB => inputs.bus_voltage().into(),
            0xEF => (self.errors() & ERRORS_FAULT == 0).into(),
            0xF2 => (!self.is_enabled()).into(),
            0xF3 => inputs.icns.into(),
            0xF4 => self.in_tolerance().into(),
            0xF5 => self.is_standing().into(),
            _ => self.cells[usize::from(number)],
        };
        raw & Register::of(number).mask()
    }

    fn errors(&self) -> u32 {
        let mut errors = self.inputs.faults;
        if self.timed_out {
            errors |= ERROR_TIME_OUT;
        }
        if !self.inputs.dc_bus {
            errors |= ERROR_NO_POWER;
        }
        errors
    }

    /// Whether the drive is ready: E2 (BTB).
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.errors() & ERRORS_NOT_READY == 0
    }

    /// Whether the drive is enabled: both inputs closed, ready, not locked; and the lock released, where it needs that.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        let locked = self.cell16(0x51) & MODE_LOCK != 0;
        let released = self.properties.enable_after_lock == EnableAfterLock::No || self.released;
        self.inputs.run && self.inputs.rfe && self.is_ready() && !locked && released
    }

    /// Whether homing runs (ex 12).
    #[must_use]
    pub const fn is_homing(&self) -> bool {
        self.homing.is_some()
    }

    /// The speed that it measures.
    fn speed(&self) -> i64 {
        self.inputs
            .speed
            .map_or_else(|| self.plant.speed(), i64::from)
    }

    fn is_standing(&self) -> bool {
        self.speed().abs() < STANDING
    }

    fn is_calibrated(&self) -> bool {
        self.inputs.calibrated.unwrap_or(self.calibrated)
    }

    fn in_tolerance(&self) -> bool {
        if let Some(forced) = self.inputs.tolerance {
            return forced;
        }
        let destination = i64::from(self.cells[0x6E].cast_signed());
        let away = (destination - i64::from(self.plant.position())).abs();
        self.control == Control::Position
            && self.homing.is_none()
            && away <= i64::from(self.cell16(0x79))
    }

    /// STATUS (40).
    pub(super) fn status(&self) -> u32 {
        let printed = [
            (status::ENABLED, self.is_enabled()),
            (status::LIMIT_PLUS, self.inputs.limit1),
            (status::LIMIT_MINUS, self.inputs.limit2),
            (status::CONTINUOUS, self.inputs.icns),
            (status::POSITION, self.control == Control::Position),
            (status::SPEED, self.control != Control::Torque),
            (status::CALIBRATED, self.is_calibrated()),
            (status::TOLERANCE, self.in_tolerance()),
        ];
        let full = [
            (status::OK | status::READY, self.is_ready()),
            (status::TORQUE, self.control == Control::Torque),
            (status::STANDING, self.is_standing()),
            (status::HOMING, self.homing.is_some()),
        ];
        let more = self.properties.status_bits == StatusBits::Full;
        let full = full.iter().filter(|_| more);
        printed
            .iter()
            .chain(full)
            .filter(|(_, set)| *set)
            .map(|(bits, _)| bits)
            .sum()
    }

    /// Inputs and outputs (D8).
    fn io(&self) -> u32 {
        let inputs = &self.inputs;
        let bits = [
            (0, inputs.limit1),
            (1, inputs.limit2),
            (2, inputs.din2),
            (3, inputs.din1),
            (4, inputs.run),
            (5, inputs.rfe),
            (10, self.is_ready()),
            (11, self.is_enabled()),
        ];
        bits.iter().map(|(bit, set)| u32::from(*set) << bit).sum()
    }

    /// The current in units of the converter (20, 27, 5F).
    fn current(&self) -> u32 {
        if self.control != Control::Torque || !self.is_enabled() {
            return 0;
        }
        let torque = i64::from(self.cell16(0x90).cast_signed());
        let size = torque.abs() * i64::from(self.cell16(0xD9)) / 43_690;
        ((torque.signum() * size) & 0xFFFF) as u32
    }
}
