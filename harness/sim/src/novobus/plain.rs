//! A plain drive: the ND21's memory and bus, and nothing that turns.

use crate::novobus::cells::Cells;
use crate::novobus::device::Device;
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Reaction, Relay};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Instant;

/// A plain drive.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct PlainDrive {
    bus_end: BusEnd,
    memory: Cells,
    properties: Properties,
}

impl PlainDrive {
    /// A drive with an EEPROM as given, after power-up.
    #[must_use]
    pub fn new(properties: Properties, eeprom: [u8; 256]) -> Self {
        let mut memory = Cells::with_eeprom(eeprom);
        memory.start();
        Self {
            bus_end: BusEnd::new(properties),
            memory,
            properties,
        }
    }

    /// Is as new again, with the EEPROM that it has.
    pub(crate) fn restart(&mut self) {
        self.memory.restart();
        self.bus_end = BusEnd::new(self.properties);
    }

    /// Its memory.
    #[must_use]
    pub fn memory(&self) -> &Cells {
        &self.memory
    }

    /// Its memory.
    pub fn memory_mut(&mut self) -> &mut Cells {
        &mut self.memory
    }

    /// Its end of the bus.
    #[must_use]
    pub fn bus_end(&self) -> &BusEnd {
        &self.bus_end
    }

    /// Its end of the bus, and the memory on which that works.
    pub(crate) fn inside(&self) -> (&BusEnd, &dyn Memory) {
        (&self.bus_end, &self.memory)
    }

    /// The same, to work with.
    pub(crate) fn parts(&mut self) -> (&mut BusEnd, &mut dyn Memory) {
        (&mut self.bus_end, &mut self.memory)
    }
}

impl Default for PlainDrive {
    fn default() -> Self {
        Self::new(Properties::default(), [0; 256])
    }
}

impl Device for PlainDrive {
    #[inline]
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        self.bus_end.receive(now, received, &mut self.memory)
    }

    #[inline]
    fn deadline(&self) -> Option<Deadline> {
        self.bus_end.deadline(&self.memory)
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        self.bus_end.handle_deadline(now, &mut self.memory)
    }

    fn power_on(&mut self, _now: Instant) {
        self.memory.start();
        self.bus_end = BusEnd::new(self.properties);
    }

    fn in_error(&self) -> bool {
        self.bus_end.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.bus_end.cause()
    }

    fn relay(&self) -> Option<Relay> {
        if self.memory.monitors_time_out() {
            return None;
        }
        self.bus_end.relay(self.memory.peek(ram::BUS_ADDR))
    }

    fn answer(&mut self, now: Instant, byte: u8) -> Reaction {
        self.bus_end.answer(now, byte, &mut self.memory)
    }

    fn has_relayed(&mut self, at: Instant, relay: Relay) {
        self.bus_end.has_relayed(at, relay);
        if let Relay::Passing(passing) = relay
            && let Some(sum) = passing.sum()
        {
            self.memory.write(ram::BUS_ADDR, sum);
        }
    }
}
