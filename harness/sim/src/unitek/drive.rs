//! A UNITEK drive on its bus: registers, requests, cycles, events, supervision, and the motor behind them.
//!
//! The drive works in scans of 1 ms. In each of them it runs the plant, the supervision of the bus, the event frame and then the
//! cyclic frames. Frames from the bus act at once, between two scans. A drive in which nothing changes skips scans, so that it
//! costs nothing.

use super::cycles::Cycles;
use super::inputs::Inputs;
use super::outbox::{Cause, Outbox, Waiting};
use super::plant::{Control, Demand, Plant};
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::bit_timing::Nbt;
use harness_proto::unitek::frame::{CYCLES, Occasion, reply_data};
use harness_proto::unitek::properties::{
    CanCounters, CyclicFirst, EventMask, IdChange, IdRange, LockAtPowerUp, LockClearsCommand,
    OneshotStops, PowerUpMode, Properties, StatusBits, UnknownRegister,
};
use harness_proto::unitek::words::{
    ERROR_NO_POWER, ERROR_TIME_OUT, ERRORS_FAULT, ERRORS_NOT_READY, MODE_EVENT, MODE_LOCK, status,
};
use harness_proto::unitek::{Access, Data, Ignored, REGISTERS, Register, Reply, Request};

/// One scan of the drive.
const SCAN: Span = Span::from_millis(1);
/// Speeds below this count as standing: 1 % (F5).
const STANDING: i64 = 328;
/// What a cell without a meaning reads (dump).
const UNASSIGNED: u32 = 0xFACE;
/// The position at power-up: 6D of the dump.
const POWER_UP_POSITION: i32 = 0x86B9;

/// The contents of all registers.
type Cells = [u32; 256];

/// The simulated drive.
#[derive(Clone, Debug)]
pub struct Drive {
    properties: Properties,
    /// The inputs; change them by [`Drive::set_inputs`].
    inputs: Inputs,
    cells: Cells,
    /// Levels 0 and 1; level 1 is empty at first.
    eeprom: [Option<Box<Cells>>; 2],
    /// On which it receives and sends now.
    identifiers: (u16, u16),
    control: Control,
    plant: Plant,
    /// Scans until homing ends.
    homing: Option<u64>,
    calibrated: bool,
    /// The time-out of the bus has occurred and was not cleared.
    timed_out: bool,
    /// The end of the last accepted frame.
    last_frame: Instant,
    cycles: Cycles,
    outbox: Outbox,
    /// STATUS in the last scan.
    last_status: u32,
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
            eeprom: [Some(Box::new(dump)), None],
            identifiers: (0, 0),
            control: Control::Speed,
            plant: Plant::new(POWER_UP_POSITION),
            homing: None,
            calibrated: false,
            timed_out: false,
            last_frame: power_up,
            cycles: Cycles::default(),
            outbox: Outbox::default(),
            last_status: 0,
            power_up,
            scans: 0,
            next: None,
        };
        drive.restart(power_up);
        drive
    }

    /// Sets registers before the drive is used, as its manufacturer or NDrive does: contents and EEPROM.
    ///
    /// Bits that a register has not are dropped.
    #[must_use]
    pub fn with_setup(mut self, setup: &[(u8, u32)]) -> Self {
        for &(number, raw) in setup {
            let raw = raw & Register::of(number).mask();
            if let Some(level) = &mut self.eeprom[0] {
                level[usize::from(number)] = raw;
            }
            self.cells[usize::from(number)] = raw;
        }
        self.identifiers = (self.cell16(0x68), self.cell16(0x69));
        self.last_status = self.status();
        self
    }

    /// Switches the drive off and on at `at`.
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
        self.identifiers = (self.cell16(0x68), self.cell16(0x69));
        self.control = match self.properties.power_up_mode {
            PowerUpMode::Speed => Control::Speed,
            PowerUpMode::Position => Control::Position,
        };
        self.plant = Plant::new(POWER_UP_POSITION);
        self.homing = None;
        self.calibrated = false;
        self.timed_out = false;
        self.last_frame = at;
        self.cycles = Cycles::default();
        self.outbox.clear();
        self.power_up = at;
        self.scans = 0;
        self.next = Some(1);
        self.last_status = self.status();
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
        self.next = Some(self.scans + 1);
    }

    /// The identifiers on which it receives and sends now.
    #[must_use]
    pub const fn identifiers(&self) -> (u16, u16) {
        self.identifiers
    }

    /// The bit timing that it uses at the next power-up, if 73 is stored.
    #[must_use]
    pub fn bit_timing(&self) -> Nbt {
        Nbt(self.cell16(0x73))
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
            0x30 | 0x32 | 0xA8 => (self.plant.speed() & 0xFFFF) as u32,
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

    /// Overwrites the contents of a register from outside the bus, as a test or a deviation does.
    pub fn poke(&mut self, number: u8, raw: u32) {
        self.cells[usize::from(number)] = raw & Register::of(number).mask();
        self.next = Some(self.scans + 1);
    }

    /// A frame has ended on the bus at `at`.
    ///
    /// # Errors
    /// [`Ignored`] where the drive does nothing with it.
    pub fn receive(&mut self, at: Instant, frame: &Frame) -> Result<Request, Ignored> {
        self.advance(at);
        let request = match Request::decode(frame, self.identifiers.0, self.properties.dlc4) {
            Ok(request) => request,
            Err(ignored) => {
                let own = !matches!(ignored, Ignored::Extended | Ignored::OtherIdentifier);
                self.count(0x97, own);
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
                self.reply(at, register, Cause::Asked);
            }
            Request::Cycle { register, every } => {
                let full = self.properties.table_full;
                let started = self.cycles.start(register, every, self.scans, full);
                if started && self.properties.cyclic_first == CyclicFirst::AtOnce {
                    self.reply(at, register, Cause::Cycle(register));
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

    /// Runs all scans up to and including `to`.
    pub fn advance(&mut self, to: Instant) {
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
        let status = self.status();
        let differs = (status ^ self.last_status) & self.cells[0x52] != 0;
        if differs && self.cell16(0x51) & MODE_EVENT != 0 {
            self.reply(now, 0x40, Cause::Event);
        }
        self.last_status = status;
        for place in 0..CYCLES {
            if let Some(register) = self.cycles.take_due(place, self.scans) {
                self.reply(now, register, Cause::Cycle(register));
            }
        }
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

    fn demand(&self) -> Demand {
        let signed = |number| self.cell16(number).cast_signed();
        Demand {
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

/// What a write does.
impl Drive {
    fn write(&mut self, number: u8, data: Data) {
        let register = Register::of(number);
        let held = self.cells[usize::from(number)];
        let raw = data.written_to(register, held, self.properties.short_write);
        match register.access {
            Access::RO | Access::UK => {}
            Access::FN => self.call(number, raw),
            Access::RW | Access::SP => {
                if self.takes(number, raw) {
                    self.cells[usize::from(number)] = raw;
                    self.act(number, raw);
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
    fn act(&mut self, number: u8, raw: u32) {
        match number {
            0x31 => self.control = Control::Speed,
            0x90 => self.control = Control::Torque,
            0x6E => self.control = Control::Position,
            0x35 | 0xED | 0xC7 => self.plant.forget_ramp(),
            0x51 if raw & u32::from(MODE_LOCK) != 0 => self.lock(),
            0x68 | 0x69 => self.use_identifiers(),
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

    fn use_identifiers(&mut self) {
        if self.properties.id_change == IdChange::Immediate {
            self.identifiers = (self.cell16(0x68), self.cell16(0x69));
        }
    }

    /// A function; values that it does not know are ignored.
    fn call(&mut self, number: u8, value: u32) {
        match (number, value) {
            (0x78, 1) if self.is_enabled() => {
                self.control = Control::Position;
                self.cells[0x6E] = self.plant.position().cast_unsigned();
                self.homing = Some(self.properties.homing_time.units() / SCAN.units());
            }
            (0x83, 0 | 1) => {
                self.load(usize::from(value == 1));
                self.use_identifiers();
            }
            (0x84, 0 | 1) => {
                self.eeprom[usize::from(value == 1)] = Some(Box::new(self.cells));
            }
            (0x8E, _) => self.timed_out = false,
            _ => {}
        }
    }

    /// Brings the parameters (RW) of a level back; an empty level changes nothing.
    fn load(&mut self, level: usize) {
        let Some(stored) = &self.eeprom[level] else {
            return;
        };
        for (place, register) in REGISTERS.iter().enumerate() {
            if register.access == Access::RW {
                self.cells[place] = stored[place];
            }
        }
    }

    fn reply(&mut self, at: Instant, number: u8, cause: Cause) {
        let register = Register::of(number);
        let unassigned = register.dump == UNASSIGNED;
        if unassigned && self.properties.unknown_register == UnknownRegister::Silent {
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
        if let Ok(frame) = reply.encode(self.identifiers.1) {
            self.outbox.put(Waiting {
                ready: at + delay,
                cause,
                frame,
            });
        }
    }
}

/// What the registers show of inputs and plant.
impl Drive {
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

    /// Whether the drive is enabled: both inputs closed, ready, not locked.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        let locked = self.cell16(0x51) & MODE_LOCK != 0;
        self.inputs.run && self.inputs.rfe && self.is_ready() && !locked
    }

    fn is_standing(&self) -> bool {
        self.plant.speed().abs() < STANDING
    }

    fn in_tolerance(&self) -> bool {
        let destination = i64::from(self.cells[0x6E].cast_signed());
        let away = (destination - i64::from(self.plant.position())).abs();
        self.control == Control::Position
            && self.homing.is_none()
            && away <= i64::from(self.cell16(0x79))
    }

    /// STATUS (40).
    fn status(&self) -> u32 {
        let printed = [
            (status::ENABLED, self.is_enabled()),
            (status::LIMIT_PLUS, self.inputs.limit1),
            (status::LIMIT_MINUS, self.inputs.limit2),
            (status::CONTINUOUS, self.inputs.icns),
            (status::POSITION, self.control == Control::Position),
            (status::SPEED, self.control != Control::Torque),
            (status::CALIBRATED, self.calibrated),
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
