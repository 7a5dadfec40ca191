//! What a write does, and how a register is sent.

use super::Drive;
use crate::unitek::outbox::{Cause, Waiting};
use crate::unitek::plant::Control;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{Occasion, reply_data};
use harness_proto::unitek::properties::{
    EventAtSetUp, IdRange, LockClearsCommand, TimeOutClear, UnknownRegister,
};
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK};
use harness_proto::unitek::{Access, Data, REGISTERS, Register, Reply};
use std::sync::Arc;

/// What a cell without a meaning reads (dump).
const UNASSIGNED: u32 = 0xFACE;

impl Drive {
    pub(super) fn write(&mut self, number: u8, data: Data) {
        let register = Register::of(number);
        let held = self.cells[usize::from(number)];
        let raw = data.written_to(register, held, self.properties.short_write);
        match register.access {
            Access::RO | Access::UK => {}
            Access::FN => self.call(number, raw),
            Access::RW | Access::SP => {
                if self.takes(number, raw) {
                    self.cells[usize::from(number)] = raw;
                    let new = raw & !held;
                    if number == 0x51 && new & u32::from(MODE_EVENT) != 0 {
                        self.sets_up = self.properties.event_at_set_up == EventAtSetUp::AtOnce;
                    }
                    self.act(number, raw, held);
                }
            }
        }
    }

    /// Whether a register takes a value; only identifiers refuse some.
    fn takes(&self, number: u8, raw: u32) -> bool {
        match (number, self.properties.id_range) {
            (0x68 | 0x69, IdRange::Any) => (1..=0x7FF).contains(&raw),
            (0x68, IdRange::Printed) => (0x201..=0x27F).contains(&raw),
            (0x69, IdRange::Printed) => (0x181..=0x1FF).contains(&raw),
            _ => true,
        }
    }

    /// What a write causes besides the new contents.
    fn act(&mut self, number: u8, raw: u32, held: u32) {
        match number {
            0x31 => self.control = Control::Speed,
            0x90 => self.control = Control::Torque,
            0x6E => self.control = Control::Position,
            0x35 | 0xED | 0xC7 => self.plant.forget_ramp(),
            0x51 if raw & u32::from(MODE_LOCK) != 0 => self.lock(),
            0x51 if held & u32::from(MODE_LOCK) != 0 => self.release(),
            0x68 | 0x69 | 0x73 | 0x88 | 0x89 => self.use_bus_settings(false),
            0x7A => self.plant.preset(raw.cast_signed()),
            _ => {}
        }
    }

    fn lock(&mut self) {
        if self.properties.lock_clears_command == LockClearsCommand::Yes {
            self.cells[0x31] = 0;
            self.cells[0x90] = 0;
        }
    }

    fn release(&mut self) {
        if self.properties.time_out_clear == TimeOutClear::Lock {
            self.timed_out = false;
        }
        self.released = self.is_ready();
    }

    /// A function; values that it does not know are ignored.
    fn call(&mut self, number: u8, value: u32) {
        match (number, value) {
            (0x78, 1) if self.is_enabled() => {
                self.control = Control::Position;
                self.cells[0x6E] = self.plant.position().cast_unsigned();
                self.homing = Some(self.properties.homing_time.units() / super::SCAN.units());
            }
            (0x83, 0 | 1) => {
                self.load(usize::from(value == 1));
                self.use_bus_settings(false);
            }
            (0x84, 0 | 1) => {
                self.eeprom[usize::from(value == 1)] = Some(Arc::new(self.cells));
            }
            (0x8E, _) => self.timed_out &= self.properties.time_out_clear == TimeOutClear::Lock,
            _ => {}
        }
    }

    /// Brings the parameters (RW) of a level back; an empty level changes nothing.
    pub(super) fn load(&mut self, level: usize) {
        let Some(stored) = &self.eeprom[level] else {
            return;
        };
        for (place, register) in REGISTERS.iter().enumerate() {
            if register.access == Access::RW {
                self.cells[place] = stored[place];
            }
        }
    }

    /// Sends a register on the identifier of 69.
    pub(super) fn send(&mut self, at: Instant, number: u8, cause: Cause) {
        self.reply(at, number, cause, self.identifiers.1);
    }

    /// Sends a register on identifier `tx`.
    pub(super) fn reply(&mut self, at: Instant, number: u8, cause: Cause, tx: u16) {
        let register = Register::of(number);
        let unassigned = register.dump == UNASSIGNED;
        let silent = self.properties.unknown_register == UnknownRegister::Silent;
        if !self.on_bus || unassigned && silent {
            return;
        }
        let occasion = match cause {
            Cause::Event => Occasion::Event,
            Cause::Asked | Cause::Cycle(_) => Occasion::Asked,
        };
        let wide = self.cell16(0xDC) & 0x0100 != 0;
        let raw = self.register(number);
        let reply = Reply {
            register: number,
            data: reply_data(register, raw, occasion, wide, &self.properties),
            stuff: self.properties.stuff,
        };
        let delay = match cause {
            Cause::Asked => self.properties.reply_delay,
            Cause::Cycle(_) | Cause::Event => Span::ZERO,
        };
        if let Ok(frame) = reply.encode(tx) {
            self.outbox.put(Waiting {
                ready: at + delay,
                cause,
                frame,
            });
        }
    }
}
