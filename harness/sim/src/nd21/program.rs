//! The drive's program: its memory and its cycle of 432 us (ND21 4.1, 11.8).
//!
//! If a cycle changes only the clocks, later cycles change only the clocks as well until an input changes. The program is
//! quiet then, and cycles are only counted.

use super::cycle_control::{CycleControl, Orders};
use super::eeprom_controller::{EepromController, parity_is_right};
use super::error_state;
use super::invariants::{CheckedState, InvariantWatch};
use super::monitor::{self, EndSwitches};
use super::motion::{Demand, Motion, Outside};
use super::outputs::{self, Encoder};
use super::plant::Plant;
use super::positioning::{Positioning, Situation};
use super::properties::{BusErrors, Nd21Properties, PsPosition, SelfTestBus};
use super::referencing::{Referencing, Run};
use super::s_ramp::{SRampRun, SRampWire};
use super::scope::Scope;
use super::source::Source;
use super::world::{Mode, OutputLevels, Stimulus, World};
use super::{clock::Clock, memory_rules};
use crate::novobus::cells::Cells;
use harness_proto::nd21;
use harness_proto::nd21::bits::{
    flags, flags2, hw_version, hw_version2, status, sw_version, sw_version2,
};
use harness_proto::nd21::eeprom::LINKS;
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::{GPO1, GPO2, Input, Inputs, OUTPUTS};
use harness_proto::nd21::s_ramp::{Direction, SRamp, Status};
use harness_proto::nd21::units::{CYCLE_US, SpeedRange, limit_maximum_raw, torque_from_raw};
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::output::{Output, OutputChange};
use harness_proto::time::{Instant, Span};

/// The cycle of the regulators (4.1).
const CYCLE: Span = Span::from_micros(CYCLE_US as u64);
/// The clock of the oscilloscope (14.10.6.2): four scans to a cycle.
const SCAN: Span = Span::from_micros(CYCLE_US as u64 / 4);
/// The settings of the current regulator that can be read in the ASIC, and where the EEPROM has them; they
/// become active at reset (14.6.1).
const ASIC: [(u8, u16); 2] = [(ee::A_MPR1, 0xFF80), (ee::A_MPR98, 0xFF82)];

/// How many whole cycles a time is.
fn cycles(time: Span) -> u32 {
    u32::try_from(time.units() / CYCLE.units()).unwrap_or(u32::MAX)
}

/// The program of an ND21 and everything that it commands.
#[derive(Clone, Debug)]
pub struct Program {
    cells: Cells,
    properties: Nd21Properties,
    world: World,
    plant: Plant,
    motion: Motion,
    source: Source,
    positioning: Positioning,
    referencing: Referencing,
    s_ramp: SRampRun,
    scope: Scope,
    pub(super) cycle_control: CycleControl,
    eeprom_controller: EepromController,
    clock: Clock,
    encoder: Encoder,
    /// Half the motor's poles, as of the last reset (14.6.7).
    pole_pairs: u16,
    /// Aeff of one unit of `msoll`.
    amperes: f64,
    /// Times of the properties in cycles.
    i2t_cycles: u32,
    calculation_cycles: u32,
    now: Instant,
    /// Before this nothing is to be done.
    due: Instant,
    next_cycle: Instant,
    next_scan: Instant,
    self_test_until: Instant,
    mode: Mode,
    quiet: bool,
    /// Something has come from outside since the last cycle: what is watched is to be looked at.
    stirred: bool,
    pub(crate) invariants: InvariantWatch,
    /// The last values of the input ports.
    shown_inputs: Option<(Inputs, Option<ErrorCode>)>,
}

impl Program {
    pub(super) fn new(cells: Cells, properties: Nd21Properties) -> Self {
        let plant = Plant::new(properties.plant);
        let mut program = Self {
            cells,
            properties,
            world: World::default(),
            plant,
            motion: Motion::default(),
            source: Source::default(),
            positioning: Positioning::default(),
            referencing: Referencing::default(),
            s_ramp: SRampRun::default(),
            scope: Scope::default(),
            cycle_control: CycleControl::default(),
            eeprom_controller: EepromController::default(),
            clock: Clock::default(),
            encoder: Encoder::default(),
            pole_pairs: 0,
            amperes: torque_from_raw(1_000, properties.device).to_f64() / 1_000.0,
            i2t_cycles: cycles(properties.i2t_time),
            calculation_cycles: cycles(properties.ps_calculation_time),
            now: Instant::START,
            due: Instant::START,
            next_cycle: Instant::START + CYCLE,
            next_scan: Instant::START,
            self_test_until: Instant::START,
            mode: Mode::Reset,
            quiet: false,
            stirred: true,
            invariants: InvariantWatch::default(),
            shown_inputs: None,
        };
        program.start();
        // At the beginning the drives have been switched on long before.
        program.end_self_test();
        program.mode = program.work_out_mode();
        program.show_flags(EndSwitches::new(&program.world, &program.cells), 0);
        program
    }

    /// Whether it tests itself and does not receive bytes meanwhile (property `self-test-bus`, 11.8).
    pub(crate) fn is_deaf(&self) -> bool {
        self.mode == Mode::Reset && self.properties.self_test_bus == SelfTestBus::Silent
    }

    /// Whether the program does nothing that the bus shows, and sees nothing of bytes that are only passed on, until a byte is for the
    /// drive: no self-test, no time-out monitoring, no scan, which could be of `busAddr`.
    pub(super) fn leaves_the_bus_alone(&self) -> bool {
        self.mode != Mode::Reset
            && !self.cells.monitors_time_out()
            && !self.scope.running(&self.cells)
    }

    /// The cells, past all rules of access.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// The cells, past all rules of access.
    pub fn cells_mut(&mut self) -> &mut Cells {
        self.stir();
        self.shown_inputs = None;
        &mut self.cells
    }

    /// Lets something happen from outside the bus.
    pub(super) fn stimulate(&mut self, stimulus: Stimulus) {
        self.stir();
        if let Some(error) = self.world.change(stimulus) {
            error_state::raise(error.code(), &mut self.cells);
        }
        monitor::show_temperatures(&self.world, &mut self.cells);
        self.show_inputs();
    }

    /// `SK_WritePS` beside the bus, whose form for it the manual does not give (13.5.4); false during a run.
    pub(super) fn load_s_ramp(&mut self, ramp: &SRamp) -> bool {
        self.s_ramp.load(ramp.points().to_vec())
    }

    /// `SK_StartPS` beside the bus (13.5.4).
    pub(super) fn start_s_ramp(&mut self, direction: Direction) {
        self.s_ramp.start(direction, self.mode);
        self.stir();
    }

    /// `SK_StatusPS` beside the bus (13.5.4).
    pub(super) fn s_ramp_status(&self) -> Status {
        self.s_ramp.status()
    }

    /// What can be seen from outside the bus.
    pub(super) fn shown(&self) -> OutputLevels {
        let high = self.cells.byte(OUTPUTS);
        OutputLevels {
            gpo1: high & GPO1 != 0,
            gpo2: high & GPO2 != 0,
            ready: outputs::ready(self.mode),
            analogue: outputs::analogue(&self.cells),
            encoder: self.encoder.impulses(self.plant.increments()),
            display: error_state::display(&self.cells),
            mode: self.mode,
        }
    }

    /// Does what the drive does by itself up to `now`.
    #[inline]
    pub(super) fn advance(&mut self, now: Instant) {
        self.now = now;
        if self.due <= now {
            self.catch_up(now);
        }
    }

    fn catch_up(&mut self, now: Instant) {
        loop {
            let scanning = self.scope.running(&self.cells);
            let scan_first = scanning && self.next_scan < self.next_cycle;
            self.due = if scan_first {
                self.next_scan
            } else {
                self.next_cycle
            };
            if self.due > now {
                break;
            }
            if scan_first {
                self.scope.scan(&mut self.cells);
                self.next_scan += SCAN;
                continue;
            }
            let mut cycles = 1;
            if self.quiet {
                if !scanning {
                    cycles += now.since(self.next_cycle).units() / CYCLE.units();
                }
                self.clock.pass(cycles, self.released(), &mut self.cells);
            } else {
                self.eeprom_controller
                    .advance(self.next_cycle, &mut self.cells);
                self.cycle(self.next_cycle);
            }
            self.next_scan = self.next_cycle;
            self.next_cycle += CYCLE * cycles;
        }
        self.eeprom_controller.advance(now, &mut self.cells);
        if let Some(until) = self.eeprom_controller.busy_until() {
            self.due = self.due.min(until);
        }
    }

    /// The oscilloscope is started or stopped: its next scan is at the next quarter of a cycle.
    fn align_scan(&mut self) {
        let quarters = self.next_cycle.since(self.now).units() / SCAN.units();
        self.due = Instant::START;
        self.next_scan = Instant::START
            + self
                .next_cycle
                .since_start()
                .saturating_sub(SCAN * quarters);
    }

    /// Something comes from outside.
    fn stir(&mut self) {
        self.quiet = false;
        self.stirred = true;
    }

    fn released(&self) -> bool {
        matches!(self.mode, Mode::Stop | Mode::Go)
    }

    /// What the drive's program does at power-up and reset: RAM is lost; the cells with a place in the
    /// EEPROM are loaded from there (14.2.2, 13.1.4); the self-test begins.
    fn start(&mut self) {
        let cells = &mut self.cells;
        cells.start();
        for link in LINKS {
            for i in 0..link.size {
                let byte = cells.eeprom()[usize::from(link.eeprom + i)];
                cells.put(link.ram + u16::from(i), byte);
            }
        }
        for (eeprom, asic) in ASIC {
            cells.put(asic, cells.eeprom()[usize::from(eeprom)]);
        }
        let first = usize::from(ee::IMPULSZAHL);
        let impulses = u16::from_be_bytes([cells.eeprom()[first], cells.eeprom()[first + 1]]);
        self.encoder.start(self.plant.increments(), impulses);
        self.pole_pairs = u16::from(cells.eeprom()[usize::from(ee::POLE)] / 2);
        let hardware = cells.byte(ram::HW_VERSION);
        self.source = Source::new(hardware & hw_version::ANALOGUE != 0);
        // 13.1.4: this speed is initialised with the maximum speed.
        cells.put_word(ram::PS_V0, cells.word(ram::N_MAX));
        let blocked = cells.byte(ram::SW_VERSION) & sw_version::BLOCK_AFTER_RESET != 0;
        cells.set_bits(ram::STATUS, status::BLOCK, blocked);
        cells.set_bits(ram::STATUS, status::RESET, true);
        cells.put(OUTPUTS, 0);
        self.motion.start(&self.plant, cells);
        self.referencing.start();
        self.s_ramp = SRampRun::default();
        self.scope.start(cells);
        self.cycle_control.start();
        self.eeprom_controller.start(cells);
        self.positioning = Positioning::default();
        monitor::show_temperatures(&self.world, cells);
        if !parity_is_right(self.cells.eeprom()) {
            error_state::raise(ErrorCode::EepromParity.code(), &mut self.cells);
        }
        self.self_test_until = self.now + self.properties.self_test_time;
        self.mode = Mode::Reset;
        self.stir();
        self.shown_inputs = None;
        self.show_inputs();
        self.show_flags(EndSwitches::new(&self.world, &self.cells), 0);
    }

    /// The power has come back. What was being written to the EEPROM when it failed is damaged, which the
    /// self-test finds (14.11.2).
    pub(super) fn power_on(&mut self, now: Instant) {
        self.eeprom_controller
            .damage(self.now, &self.properties, &mut self.cells);
        // Meanwhile the motor has run out.
        let load = f64::from(self.world.load) / 1_000.0;
        while self.next_cycle <= now && (self.plant.speed != 0.0 || load != 0.0) {
            self.plant.step(0.0, load, self.world.jammed);
            self.next_cycle += CYCLE;
        }
        self.now = now;
        self.next_cycle = now + CYCLE;
        self.due = Instant::START;
        self.encoder.power_on(self.plant.increments());
        self.start();
    }

    /// One cycle, at `now`.
    fn cycle(&mut self, now: Instant) {
        if self.world.has_cams() {
            self.stirred |= self.world.turn_to(self.plant.increments());
        }
        let switches = EndSwitches::new(&self.world, &self.cells);
        if self.mode == Mode::Reset && now >= self.self_test_until {
            self.end_self_test();
        }
        if self.stirred
            && !error_state::is_set(&self.cells)
            && self.mode != Mode::Reset
            && let Some(error) = monitor::error(&self.world, switches, &self.cells)
        {
            error_state::raise(error.code(), &mut self.cells);
        }
        if self.stirred
            && let Some(warning) = monitor::warning(&self.world, &self.cells)
            && self.cells.word(ram::ERRORCODE) == 0
        {
            error_state::note(warning.code(), &mut self.cells);
        }
        self.stirred = self.mode == Mode::Reset;
        self.mode = self.work_out_mode();
        let orders = self.plc(now);
        let demand = self.demand(switches, orders);
        let torque_share = if orders.analogue_torque {
            // 10 V leave the whole limit (13.1.4).
            (self.world.analogue.unsigned_abs() * 256 / 10_000).min(256)
        } else {
            256
        };
        let moved = self.motion.cycle(
            demand,
            Outside {
                most: limit_maximum_raw(self.properties.device),
                amperes: self.amperes,
                load: f64::from(self.world.load) / 1_000.0,
                jammed: self.world.jammed,
                pole_pairs: self.pole_pairs,
                i2t_cycles: self.i2t_cycles,
                torque_share: u16::try_from(torque_share).unwrap_or(256),
            },
            &mut self.plant,
            &mut self.cells,
        );
        if moved.slipped {
            error_state::raise(ErrorCode::Schleppfehler.code(), &mut self.cells);
            self.mode = self.work_out_mode();
        }
        self.show_inputs();
        self.show_flags(switches, moved.flags);
        if error_state::is_set(&self.cells) {
            // 14.7.1: the code of an error that this cycle has found.
            self.show_inputs();
        }
        outputs::show_gpo2(&self.positioning, &mut self.cells);
        self.clock.pass(1, self.released(), &mut self.cells);
        self.quiet = moved.at_rest
            && !moved.slipped
            && self.mode != Mode::Reset
            && self.positioning.at_rest(&self.cells)
            && self.referencing.at_rest(&self.cells)
            && self.s_ramp.status() != Status::Doing
            && self.cycle_control.at_rest(&self.cells)
            && self.still_demands_nothing();
        self.invariants.look(&CheckedState {
            cells: &self.cells,
            mode: self.mode,
            positioning: &self.positioning,
            speed: self.plant.speed,
            position: self.plant.position,
        });
    }

    /// The nominal value is 0 and stays so.
    fn still_demands_nothing(&self) -> bool {
        let software = self.cells.byte(ram::SW_VERSION);
        let idle = self.mode != Mode::Go || self.cells.word(ram::NSOLL) == 0;
        let impulses = software & sw_version::SOURCE == sw_version::SOURCE_FREQUENCY
            && self.world.frequency > 0;
        idle && !impulses && software & sw_version::REVERSING == 0
    }

    /// The self-test is over (11.8); the positioning controller is activated if so programmed (13.2.1).
    fn end_self_test(&mut self) {
        self.cells.set_bits(ram::STATUS, status::RESET, false);
        self.mode = Mode::Block;
        let automatic = self.cells.byte(ram::HW_VERSION2) & hw_version2::NO_AUTOMATIC_PS == 0;
        self.positioning.start(automatic, &mut self.cells);
    }

    /// The mode: hardware and software must both release and both start (11.8).
    fn work_out_mode(&self) -> Mode {
        let status = self.cells.byte(ram::STATUS);
        if self.mode == Mode::Reset && status & status::RESET != 0 {
            Mode::Reset
        } else if status & status::ERROR != 0 {
            Mode::Error
        } else if status & status::BLOCK != 0 || !self.world.inputs.is_high(Input::Gpin5) {
            Mode::Block
        } else if status & status::STOP != 0 || !self.world.inputs.is_high(Input::Gpin3) {
            Mode::Stop
        } else {
            Mode::Go
        }
    }

    /// The cycle control's part of this cycle (13.1.5).
    fn plc(&mut self, now: Instant) -> Orders {
        let orders = self.cycle_control.cycle(
            self.world.inputs,
            self.mode,
            now,
            &mut self.cells,
            &mut self.eeprom_controller,
            &self.properties,
        );
        if let Some(code) = orders.error {
            error_state::raise(code, &mut self.cells);
        }
        if orders.confirm {
            error_state::confirm(&mut self.cells);
        }
        if orders.error.is_some() || orders.confirm {
            self.mode = self.work_out_mode();
        }
        orders
    }

    /// What the motor is to do in this cycle.
    fn demand(&mut self, switches: EndSwitches, orders: Orders) -> Demand {
        let cells = &mut self.cells;
        let standing = cells.word(ram::NSOLLRAMPE) == 0 && cells.signed(ram::NIST).abs() < 8;
        let range = SpeedRange::from_sw_version2(cells.byte(ram::SW_VERSION2));
        let situation = Situation {
            mode: self.mode,
            standing,
            calculation: self.calculation_cycles,
            whole_words: self.properties.ps_position == PsPosition::WholeWords,
            referencing: self.referencing.on(),
            per_increment: match range {
                SpeedRange::To8000 => 8,
                SpeedRange::To12000 => 4,
            },
        };
        let run = self.referencing.cycle(
            situation,
            self.world.inputs.is_high(Input::Gpin4),
            &self.positioning,
            cells,
        );
        let situation = Situation {
            referencing: self.referencing.on(),
            ..situation
        };
        let s_ramp = cells.byte(ram::SW_VERSION2) & sw_version2::NO_S_RAMP == 0;
        let wired = s_ramp && self.properties.s_ramp_wire == SRampWire::Puffer;
        if wired {
            if self.positioning.running() {
                self.positioning.cancel(cells);
            }
            self.s_ramp.serve(self.mode, cells);
        }
        let mut profile = if wired {
            None
        } else {
            match self.positioning.cycle(situation, cells) {
                Ok(profile) => profile,
                Err(error) => {
                    error_state::raise(error.code(), cells);
                    self.mode = Mode::Error;
                    None
                }
            }
        };
        if self.referencing.ends(cells) {
            // 13.1.1 step 7.
            let point = cells.long(ram::REF_UMDR0);
            self.motion.set_position(point, cells);
            self.positioning.set_target(point);
        }
        if let Some(speed) = self.s_ramp.cycle(self.mode) {
            profile = i16::try_from(speed).ok();
        }
        match self.mode {
            Mode::Reset | Mode::Error | Mode::Block => Demand::Free,
            Mode::Stop => Demand::Speed(0),
            Mode::Go => {
                if let Some(speed) = profile {
                    if switches.restrain(speed) == speed {
                        return Demand::Exact(speed);
                    }
                    // An end switch stops the drive in mid-run (14.3.3).
                    if self.s_ramp.cycle(Mode::Stop).is_none() && !wired {
                        self.positioning.cancel(cells);
                    }
                }
                let most = cells.word(ram::N_MAX).min(0x7FFF).cast_signed();
                let speed = match run {
                    Run::Speed(speed) => speed.clamp(-most, most),
                    Run::Positioning => 0,
                    Run::Off => match orders.jog {
                        Some(speed) => speed.clamp(-most, most),
                        None => self.source.cycle(&self.world, orders.analogue, cells),
                    },
                };
                Demand::Speed(switches.restrain(speed))
            }
        }
    }

    /// The inputs in their ports (14.7.1).
    fn show_inputs(&mut self) {
        let error = if error_state::is_set(&self.cells) {
            ErrorCode::from_code(self.cells.word(ram::ERRORCODE))
        } else {
            None
        };
        if self.shown_inputs == Some((self.world.inputs, error)) {
            return;
        }
        self.shown_inputs = Some((self.world.inputs, error));
        for (address, byte, mask) in self.world.inputs.ports(error) {
            self.cells.put_bits(address, mask, byte);
        }
    }

    /// `Flags` (14.4.2).
    fn show_flags(&mut self, switches: EndSwitches, motion: u8) {
        let cells = &mut self.cells;
        let hardware_stop = !self.world.inputs.is_high(Input::Gpin3);
        let stops = cells.byte(ram::HW_VERSION) & hw_version::END_SWITCH_BLOCKS == 0;
        let stop = hardware_stop
            || cells.byte(ram::STATUS) & status::STOP != 0
            || stops && (switches.positive || switches.negative);
        let block = matches!(self.mode, Mode::Reset | Mode::Error | Mode::Block);
        let bit = |set: bool, bit: u8| if set { bit } else { 0 };
        let byte = motion
            | bit(stop, flags::STOP)
            | bit(hardware_stop, flags::HARDWARE_STOP)
            | bit(block, flags::BLOCK);
        cells.put_bits(ram::FLAGS, !flags::TIMING, byte);
    }

    /// The bus works, again or for the first time (14.4.3).
    #[inline]
    pub(super) fn bus_works(&mut self) {
        let both = flags2::OK | flags2::TIMEOUT;
        if self.cells.byte(ram::FLAGS2) & both != flags2::OK {
            self.cells.put_bits(ram::FLAGS2, both, flags2::OK);
        }
    }
}

impl Memory for Program {
    fn read(&mut self, address: u16) -> u8 {
        self.cells.peek(address)
    }

    /// Read-only cells and bits stay as they are (14.2.1).
    fn write(&mut self, address: u16, data: u8) {
        match (address, data) {
            (ram::BUS_ADDR, _) => self.cells.put(address, data),
            (ram::EEPROM_CONTROL, code) => {
                self.due = Instant::START;
                self.eeprom_controller
                    .control(self.now, code, self.properties, &mut self.cells);
            }
            (ram::ERRORCODE, nd21::CONFIRM_ERROR) => {
                error_state::confirm(&mut self.cells);
                self.stir();
            }
            _ => {
                let Some(byte) = memory_rules::written(address, data, &self.cells) else {
                    return;
                };
                if byte != self.cells.byte(address) {
                    self.cells.put(address, byte);
                    self.stir();
                }
                match address {
                    ram::SCOPE_STATUS => self.align_scan(),
                    ram::PS_STATUS => self.positioning.status_written(byte, &self.cells),
                    _ => {}
                }
            }
        }
    }

    /// With the analogue output active GPO1 is no digital output (14.3.4).
    fn write_output(&mut self, change: OutputChange) {
        let analogue = self.cells.byte(ram::HW_VERSION2) & hw_version2::NO_ANALOGUE_OUTPUT == 0;
        if change.output != Output::Gpo1 || !analogue {
            self.cells.write_output(change);
        }
        self.stir();
    }

    /// Restarts the program and its cycle.
    fn reset(&mut self) {
        self.next_cycle = self.now + CYCLE;
        self.due = Instant::START;
        self.start();
    }

    fn bus_error(&mut self, error: BusError) {
        let cells = &mut self.cells;
        let time_out = error == BusError::TimeOut;
        cells.set_bits(ram::FLAGS2, flags2::OK, false);
        cells.set_bits(ram::FLAGS2, flags2::TIMEOUT, time_out);
        let code = error.error_code().code();
        if time_out || self.properties.bus_errors == BusErrors::Block {
            error_state::raise(code, cells);
        } else {
            error_state::note(code, cells);
        }
        self.stir();
    }

    fn monitors_time_out(&self) -> bool {
        self.cells.monitors_time_out()
    }
}
