//! The drive: its end of the bus over its memory.

use super::program::Program;
use super::properties::Nd21Properties;
use super::world::{OutputLevels, Stimulus};
use crate::novobus::cells::Cells;
use crate::novobus::device::Device;
use harness_proto::line::Received;
use harness_proto::nd21::functions::Function;
use harness_proto::nd21::ram;
use harness_proto::nd21::s_ramp::{Direction, SRamp, Status};
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Reaction, Relay};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Instant;

/// An ND21.
#[derive(Clone, Debug)]
pub struct Nd21Drive {
    bus_end: BusEnd,
    program: Program,
    properties: Properties,
}

impl Nd21Drive {
    /// A drive with an EEPROM as given, after power-up.
    #[must_use]
    pub fn new(properties: Properties, choices: Nd21Properties, eeprom: [u8; 256]) -> Self {
        Self {
            bus_end: BusEnd::new(properties),
            program: Program::new(Cells::with_eeprom(eeprom), choices),
            properties,
        }
    }

    /// Its program.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Lets something happen to it from outside the bus.
    pub fn stimulate(&mut self, stimulus: Stimulus) {
        self.program.stimulate(stimulus);
    }

    /// Gives it the points of support of an S-ramp beside the bus, whose form for them the manual does not
    /// give (13.5.4); false, and nothing taken, during a run.
    pub fn load_s_ramp(&mut self, ramp: &SRamp) -> bool {
        self.program.load_s_ramp(ramp)
    }

    /// Starts the run along the S-ramp.
    pub fn start_s_ramp(&mut self, direction: Direction) {
        self.program.start_s_ramp(direction);
    }

    /// The status of the run.
    #[must_use]
    pub fn s_ramp_status(&self) -> Status {
        self.program.s_ramp_status()
    }

    /// The PLC function that was ordered, and what has become of it (ND21 13.1.7).
    pub(crate) fn ordered(&self) -> Option<(Function, &'static str)> {
        self.program.cycle_control.ordered()
    }

    /// What it shows outside the bus.
    #[must_use]
    pub fn shown(&self) -> OutputLevels {
        self.program.shown()
    }

    /// Its program.
    pub fn program_mut(&mut self) -> &mut Program {
        &mut self.program
    }

    /// Its end of the bus, and the memory on which that works.
    pub(crate) fn inside(&self) -> (&BusEnd, &dyn Memory) {
        (&self.bus_end, &self.program)
    }

    /// The same, to work with.
    pub(crate) fn parts(&mut self) -> (&mut BusEnd, &mut dyn Memory) {
        (&mut self.bus_end, &mut self.program)
    }

    /// The bus end has taken a byte: "NOVOBUS OK!" (14.4.3).
    pub(crate) fn bus_has_worked(&mut self) {
        if !self.bus_end.in_error() {
            self.program.bus_works();
        }
    }
}

impl Device for Nd21Drive {
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        if self.program.is_deaf() {
            return Reaction::SILENCE;
        }
        let step = self.bus_end.receive(now, received, &mut self.program);
        self.bus_has_worked();
        step
    }

    fn deadline(&self) -> Option<Deadline> {
        self.bus_end.deadline(&self.program)
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        self.bus_end.handle_deadline(now, &mut self.program)
    }

    fn advance(&mut self, now: Instant) {
        self.program.advance(now);
    }

    fn power_on(&mut self, now: Instant) {
        self.program.power_on(now);
        self.bus_end = BusEnd::new(self.properties);
    }

    fn in_error(&self) -> bool {
        self.bus_end.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.bus_end.cause()
    }

    fn relay(&self) -> Option<Relay> {
        if !self.program.leaves_the_bus_alone() {
            return None;
        }
        self.bus_end.relay(self.program.cells().byte(ram::BUS_ADDR))
    }

    fn answer(&mut self, now: Instant, byte: u8) -> Reaction {
        let step = self.bus_end.answer(now, byte, &mut self.program);
        self.bus_has_worked();
        step
    }

    fn has_relayed(&mut self, at: Instant, relay: Relay) {
        self.bus_end.has_relayed(at, relay);
        if let Relay::Passing(passing) = relay
            && let Some(sum) = passing.sum()
        {
            self.program.write(ram::BUS_ADDR, sum);
        }
        self.bus_has_worked();
    }
}
