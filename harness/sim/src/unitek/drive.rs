//! A UNITEK drive on its bus: registers, requests, cycles, events, supervision, and the motor behind them.
//!
//! The drive works in scans of 1 ms. In each of them it runs the plant, the supervision of the bus, the event frame and then the
//! cyclic frames. Frames from the bus act at once, between two scans. A drive in which nothing changes skips scans, so that it
//! costs nothing.

mod show;
mod write;

use super::cycles::Cycles;
use super::inputs::Inputs;
use super::outbox::{Cause, Outbox, Waiting};
use super::plant::{Control, Motor, PlantInputs};
use harness_proto::can::{BitRate, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::bit_timing::Nbt;
use harness_proto::unitek::frame::CYCLES;
use harness_proto::unitek::properties::{
    CanCounters, CyclicFirst, EventEdges, EventMask, IdChange, LockAtPowerUp, OneshotStops,
    PowerUpMode, Properties, RateChange, SecondIdentifiers,
};
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK};
use harness_proto::unitek::{Ignored, REGISTERS, Register, Request};
use std::sync::Arc;

/// One scan of the drive.
const SCAN: Span = Span::from_millis(1);
/// The position at power-up: 6D of the dump.
const POWER_UP_POSITION: i32 = 0x86B9;

/// The contents of all registers.
type RegisterContents = [u32; 256];

/// The simulated drive.
#[derive(Clone, Debug)]
pub struct Drive {
    properties: Properties,
    /// The inputs; change them by [`Drive::set_inputs`].
    inputs: Inputs,
    cells: RegisterContents,
    /// Levels 0 and 1; level 1 is empty at first.
    eeprom: [Option<Arc<RegisterContents>>; 2],
    /// On which it receives and sends now.
    identifiers: (u16, u16),
    /// On which it also receives now and sends single replies (88, 89), as the registers hold them; 0 is none.
    second: (u32, u32),
    /// The bit rate of the bus, and 73 as the drive was set up for it.
    bus: (BitRate, u16),
    /// Whether the drive uses the bit rate of the bus; with another one it neither hears nor sends.
    on_bus: bool,
    control: Control,
    plant: Motor,
    /// Scans until homing ends.
    homing: Option<u64>,
    calibrated: bool,
    /// The time-out of the bus has occurred and was not cleared.
    timed_out: bool,
    /// A lock was released while the drive was ready, and it has been ready since.
    released: bool,
    /// The end of the last accepted frame.
    last_frame: Instant,
    cycles: Cycles,
    outbox: Outbox,
    /// STATUS in the last scan.
    last_status: u32,
    /// Sending by event was switched on since the last scan, and that may be an event itself (`event-at-set-up`).
    sets_up: bool,
    /// Whether it has its supply; without it, it does not even acknowledge.
    powered: bool,
    power_up: Instant,
    /// Scans since power-up.
    scans: u64,
    /// The next scan that is not the same as the last one; `None` while the drive only waits for frames.
    next: Option<u64>,
}

impl Drive {
    /// A drive that is switched on at `power_up`, with the EEPROM of the dump.
    #[must_use]
    pub fn new(properties: Properties, inputs: Inputs, power_up: Instant) -> Self {
        let dump = REGISTERS.map(|register| register.dump);
        let mut drive = Self {
            properties,
            inputs,
            cells: dump,
            eeprom: [Some(Arc::new(dump)), None],
            identifiers: (0, 0),
            second: (0, 0),
            bus: (BitRate::K500, Nbt::DEFAULT.0),
            on_bus: true,
            control: Control::Speed,
            plant: Motor::new(POWER_UP_POSITION),
            homing: None,
            calibrated: false,
            timed_out: false,
            released: false,
            last_frame: power_up,
            cycles: Cycles::default(),
            outbox: Outbox::default(),
            last_status: 0,
            sets_up: false,
            powered: true,
            power_up,
            scans: 0,
            next: None,
        };
        drive.restart(power_up);
        drive
    }

    /// Sets registers before the drive is used, as its manufacturer or NDrive does: contents and EEPROM.
    ///
    /// Bits that a register has not are dropped. 6D is where the axis stands.
    #[must_use]
    pub fn with_setup(mut self, setup: &[(u8, u32)]) -> Self {
        for &(number, raw) in setup {
            let raw = raw & Register::of(number).mask();
            if let Some(level) = &mut self.eeprom[0] {
                Arc::make_mut(level)[usize::from(number)] = raw;
            }
            self.cells[usize::from(number)] = raw;
        }
        self.plant.preset(self.cells[0x6D].cast_signed());
        self.bus.1 = self.cell16(0x73);
        self.use_bus_settings(true);
        self.last_status = self.status();
        self
    }

    /// The drive on a bus of this bit rate; 500 kbit/s by default. It is set up for that rate, whatever 73 holds, until 73 changes.
    #[must_use]
    pub fn on_bus_of(mut self, rate: BitRate) -> Self {
        self.bus.0 = rate;
        self.use_bus_settings(true);
        self
    }

    /// The drive with what it controls at the first power-up, whatever its properties say.
    #[must_use]
    pub fn with_control(mut self, control: Control) -> Self {
        self.control = control;
        self.last_status = self.status();
        self
    }

    /// The drive with a lock that was released after its power-up.
    #[must_use]
    pub fn with_release(mut self) -> Self {
        self.released = self.is_ready();
        self.last_status = self.status();
        self
    }

    /// The drive with the error of a time-out of the bus that was before (D0).
    #[must_use]
    pub fn with_time_out(mut self) -> Self {
        self.timed_out = true;
        self.last_status = self.status();
        self
    }

    /// Switches the drive off: nothing is heard, sent or moved until [`Drive::restart`].
    pub fn switch_off(&mut self, at: Instant) {
        self.advance(at);
        self.powered = false;
        self.outbox.clear();
        self.next = None;
    }

    /// Whether the drive has its supply.
    #[must_use]
    pub const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Switches the drive on at `at`, after switching it off if it is on. What is not in the EEPROM is as at the first power-up.
    pub fn restart(&mut self, at: Instant) {
        self.cells = REGISTERS.map(|register| register.dump);
        self.load(0);
        for command in [0x21, 0x31, 0x51, 0x6E, 0x90, 0xD0] {
            self.cells[command] = 0;
        }
        self.cells[0x52] = match self.properties.event_mask {
            EventMask::CalTol => 0x3000,
            EventMask::Dump => 0xF811,
            EventMask::Printed => 0x0030,
        };
        if self.properties.lock_at_power_up == LockAtPowerUp::Yes {
            self.cells[0x51] = MODE_LOCK.into();
        }
        self.use_bus_settings(true);
        self.control = match self.properties.power_up_mode {
            PowerUpMode::Speed => Control::Speed,
            PowerUpMode::Position => Control::Position,
        };
        self.plant = Motor::new(POWER_UP_POSITION);
        self.homing = None;
        self.calibrated = false;
        self.timed_out = false;
        self.released = false;
        self.last_frame = at;
        self.cycles = Cycles::default();
        self.outbox.clear();
        self.powered = true;
        self.power_up = at;
        self.scans = 0;
        self.next = Some(1);
        self.last_status = self.status();
        self.sets_up = false;
    }

    /// Its properties.
    #[must_use]
    pub const fn properties(&self) -> &Properties {
        &self.properties
    }

    /// Its inputs.
    #[must_use]
    pub const fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// Changes the inputs at `at`. The drive sees them in its next scan, and in what it is asked from now on.
    pub fn set_inputs(&mut self, at: Instant, inputs: Inputs) {
        self.advance(at);
        self.inputs = inputs;
        self.next = self.powered.then_some(self.scans + 1);
    }

    /// The identifiers on which it receives and sends now.
    #[must_use]
    pub const fn identifiers(&self) -> (u16, u16) {
        self.identifiers
    }

    /// Whether it uses the bit rate of the bus. With another one it neither hears, sends nor acknowledges.
    #[must_use]
    pub const fn is_on_bus(&self) -> bool {
        self.on_bus
    }

    /// Takes identifiers and bit timing over from the registers, as far as they are used at once, or all of them `at_power_up`.
    fn use_bus_settings(&mut self, at_power_up: bool) {
        let properties = &self.properties;
        if at_power_up || properties.id_change == IdChange::Immediate {
            self.identifiers = (self.cell16(0x68), self.cell16(0x69));
        }
        let second = match properties.second_identifiers {
            SecondIdentifiers::Stored => false,
            SecondIdentifiers::Immediate => true,
            SecondIdentifiers::Restart => at_power_up,
        };
        if second {
            self.second = (self.cells[0x88], self.cells[0x89]);
        }
        if at_power_up || properties.rate_change == RateChange::Immediate {
            let (rate, set_up) = self.bus;
            let timing = self.cell16(0x73);
            self.on_bus = timing == set_up || Nbt(timing).rate() == Some(rate);
            if !self.on_bus {
                self.outbox.clear();
            }
        }
    }

    /// What it reads out of a frame on the bus, and the identifier on which it answers that.
    ///
    /// # Errors
    /// [`Ignored`] where it does nothing with it.
    pub fn reads(&self, frame: &Frame) -> Result<(Request, u16), Ignored> {
        if !self.on_bus {
            return Err(Ignored::OtherRate);
        }
        let (rx, tx) = self.identifiers;
        let dlc4 = self.properties.dlc4;
        match Request::decode(frame, rx, dlc4) {
            Err(Ignored::OtherIdentifier) if self.second.0 != 0 => {
                let identifier = |raw: u32| {
                    u16::try_from(raw)
                        .ok()
                        .filter(|id| (1..=0x7FF).contains(id))
                };
                let rx = identifier(self.second.0).ok_or(Ignored::OtherIdentifier)?;
                let request = Request::decode(frame, rx, dlc4)?;
                Ok((request, identifier(self.second.1).unwrap_or(tx)))
            }
            read => Ok((read?, tx)),
        }
    }

    /// The cycles that run: register, interval in ms.
    pub fn running_cycles(&self) -> impl Iterator<Item = (u8, u8)> {
        self.cycles
            .running()
            .map(|cycle| (cycle.register, cycle.every))
    }

    /// What it controls.
    #[must_use]
    pub const fn control(&self) -> Control {
        self.control
    }

    /// What all registers hold; what a read gives can differ.
    #[must_use]
    pub const fn held(&self) -> &[u32; 256] {
        &self.cells
    }

    /// Overwrites the contents of a register from outside the bus, as a test or a deviation does.
    pub fn poke(&mut self, number: u8, raw: u32) {
        self.cells[usize::from(number)] = raw & Register::of(number).mask();
        match number {
            0x6D => self.plant.preset(raw.cast_signed()),
            0x68 | 0x69 | 0x73 | 0x88 | 0x89 => self.use_bus_settings(false),
            _ => {}
        }
        self.next = self.powered.then_some(self.scans + 1);
    }

    /// A frame has ended on the bus at `at`.
    ///
    /// # Errors
    /// [`Ignored`] where the drive does nothing with it.
    pub fn receive(&mut self, at: Instant, frame: &Frame) -> Result<Request, Ignored> {
        self.advance(at);
        let (request, tx) = match self.reads(frame) {
            Ok(read) => read,
            Err(ignored) => {
                let reached = !matches!(
                    ignored,
                    Ignored::Extended | Ignored::OtherIdentifier | Ignored::OtherRate
                );
                self.count(0x97, reached);
                return Err(ignored);
            }
        };
        self.count(0x95, true);
        self.last_frame = at;
        // What the frame changes shows in the next scan.
        self.next = Some(self.scans + 1);
        match request {
            Request::Read { register } => {
                if self.properties.oneshot_stops == OneshotStops::Yes {
                    self.cycles.stop(register);
                }
                self.reply(at, register, Cause::Asked, tx);
            }
            Request::Cycle { register, every } => {
                let full = self.properties.table_full;
                let started = self.cycles.start(register, every, self.scans, full);
                if started && self.properties.cyclic_first == CyclicFirst::AtOnce {
                    self.send(at, register, Cause::Cycle(register));
                }
            }
            Request::Stop { register } => self.cycles.stop(register),
            Request::Write { register, data } => self.write(register, data),
        }
        Ok(request)
    }

    /// The next frame that it wants to send, and from when on.
    #[must_use]
    pub fn wants(&self) -> Option<&Waiting> {
        self.outbox.first()
    }

    /// Its next frame was sent.
    pub fn sent(&mut self) -> Option<Waiting> {
        self.count(0x96, true);
        self.outbox.take()
    }

    /// When its next scan may do something; `None` while it only waits for frames.
    #[must_use]
    pub fn next_scan(&self) -> Option<Instant> {
        self.next.map(|scan| self.power_up + SCAN * scan)
    }

    /// Runs all scans up to and including `to`; none without its supply.
    pub fn advance(&mut self, to: Instant) {
        if !self.powered {
            return;
        }
        let last = to.since(self.power_up).units() / SCAN.units();
        while self.scans < last {
            let next = self.next.filter(|scan| *scan <= last);
            let idle = next.map_or(last, |scan| scan - 1) - self.scans;
            if idle > 0 {
                self.plant.skip(&self.demand(), idle);
                self.scans += idle;
            }
            if next.is_some() {
                self.scan();
                self.next = self.next_busy();
            }
        }
    }

    /// The next scan that is not the same as the last one, if no frame comes and no input changes before it.
    fn next_busy(&self) -> Option<u64> {
        if !self.plant.is_settled(&self.demand(), self.homing.is_some()) {
            return Some(self.scans + 1);
        }
        let times_out = self.times_out_at().map(|at| {
            // The first scan at or after that instant.
            at.since(self.power_up).units().div_ceil(SCAN.units())
        });
        let next = [self.cycles.next_due(), times_out]
            .into_iter()
            .flatten()
            .min();
        next.map(|scan| scan.max(self.scans + 1))
    }

    fn scan(&mut self) {
        self.scans += 1;
        let now = self.power_up + SCAN * self.scans;
        self.run_plant();
        if self.times_out_at().is_some_and(|at| at <= now) {
            self.timed_out = true;
        }
        self.released &= self.is_ready();
        let status = self.status();
        if self.cell16(0x51) & MODE_EVENT != 0 && self.is_event(status) {
            self.send(now, 0x40, Cause::Event);
        }
        self.last_status = status;
        self.sets_up = false;
        for place in 0..CYCLES {
            let accuracy = self.properties.interval_accuracy;
            if let Some(register) = self.cycles.take_due(place, self.scans, accuracy) {
                self.send(now, register, Cause::Cycle(register));
            }
        }
    }

    /// Whether STATUS is to be sent, where sending by event is switched on.
    fn is_event(&self, status: u32) -> bool {
        let last = self.last_status;
        let edges = match self.properties.event_edges {
            EventEdges::Both => status ^ last,
            EventEdges::Rising => status & !last,
            EventEdges::Falling => last & !status,
        };
        let set = if self.sets_up { status } else { 0 };
        (edges | set) & self.cells[0x52] != 0
    }

    fn run_plant(&mut self) {
        if !self.is_enabled() {
            self.homing = None;
        }
        let demand = self.demand();
        self.plant.step(&demand, self.homing.is_some());
        self.homing = match self.homing {
            Some(left) if left > 1 => Some(left - 1),
            Some(_) => {
                let home = self.cells[0x72];
                self.plant.home(home.cast_signed());
                self.cells[0x6E] = home;
                self.calibrated = true;
                None
            }
            None => None,
        };
    }

    /// When the supervision of the bus would find a time-out (D0).
    fn times_out_at(&self) -> Option<Instant> {
        let limit = self.cell16(0xD0);
        let armed = limit != 0 && !self.timed_out;
        armed.then(|| self.last_frame + Span::from_millis(limit.into()))
    }

    fn demand(&self) -> PlantInputs {
        let signed = |number| self.cell16(number).cast_signed();
        PlantInputs {
            enabled: self.is_enabled(),
            control: self.control,
            speed: signed(0x31),
            torque: signed(0x90),
            destination: self.cells[0x6E].cast_signed(),
            limit: signed(0x34),
            rpm_max: self.cell16(0xC8),
            accelerate: self.cell16(0x35),
            decelerate: self.cell16(0xED),
            limit_ramp: self.cell16(0xC7),
            limit_plus: self.inputs.limit1,
            limit_minus: self.inputs.limit2,
        }
    }

    /// The lower half of a cell.
    fn cell16(&self, number: u8) -> u16 {
        (self.cells[usize::from(number)] & 0xFFFF) as u16
    }

    fn count(&mut self, number: usize, counts: bool) {
        if counts && self.properties.can_counters == CanCounters::Live {
            self.cells[number] = (self.cells[number] + 1) & 0xFFFF;
        }
    }
}
