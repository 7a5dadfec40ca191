//! A plain drive that counts the writes to its cells, which shows which jobs really ran.

use crate::novobus::cells::Cells;
use crate::novobus::device::Device;
use crate::novobus::plain::PlainDrive;
use crate::novobus::transitions::{Event, Reached, Transition, classify, state};
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Reaction};
use harness_proto::novobus::command::Kind;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Instant;
use std::collections::BTreeMap;

/// A plain drive's cells, with a count of the writes to each.
#[derive(Clone, Debug)]
pub struct CountedCells {
    cells: Cells,
    written: BTreeMap<u16, u32>,
    /// How often the drive was reset over the bus.
    pub resets: u32,
    refused: Option<u16>,
}

impl CountedCells {
    /// How often this cell was written over the bus.
    #[must_use]
    pub fn written(&self, address: u16) -> u32 {
        self.written.get(&address).copied().unwrap_or(0)
    }

    /// From now on the drive takes no command for this address.
    pub fn refuse(&mut self, address: u16) {
        self.refused = Some(address);
    }

    /// The cells that were written over the bus.
    pub fn all_written(&self) -> impl Iterator<Item = u16> + '_ {
        self.written.keys().copied()
    }

    /// The contents of a cell.
    #[must_use]
    pub fn peek(&self, address: u16) -> u8 {
        self.cells.peek(address)
    }

    /// Sets a cell from outside the bus; false where the drive has none there.
    pub fn poke(&mut self, address: u16, byte: u8) -> bool {
        self.cells.poke(address, byte)
    }
}

impl Memory for CountedCells {
    fn read(&mut self, address: u16) -> u8 {
        self.cells.read(address)
    }

    fn write(&mut self, address: u16, data: u8) {
        *self.written.entry(address).or_default() += 1;
        self.cells.write(address, data);
    }

    fn permits(&self, kind: Kind, address: u16) -> bool {
        self.refused != Some(address) && self.cells.permits(kind, address)
    }

    fn write_output(&mut self, change: OutputChange) {
        self.cells.write_output(change);
    }

    fn reset(&mut self) {
        self.resets += 1;
        self.cells.reset();
    }

    fn bus_error(&mut self, error: BusError) {
        self.cells.bus_error(error);
    }

    fn monitors_time_out(&self) -> bool {
        self.cells.monitors_time_out()
    }
}

/// A plain drive with counted cells.
#[derive(Clone, Debug)]
pub struct Counted {
    bus_end: BusEnd,
    /// Its cells.
    pub memory: CountedCells,
    /// How often the power came back.
    pub starts: u32,
    /// The protocol transitions that it went through, if they are watched.
    reached: Option<Box<Reached>>,
}

impl Counted {
    /// After power-up, with time-out monitoring or without (EESelftest bit 7, ND21 14.3.6).
    #[must_use]
    pub fn new(monitoring: bool) -> Self {
        let mut eeprom = [0; 256];
        eeprom[0x47] = if monitoring { 0x80 } else { 0 };
        let drive = PlainDrive::new(Properties::default(), eeprom);
        Self {
            bus_end: BusEnd::new(Properties::default()),
            memory: CountedCells {
                cells: drive.memory().clone(),
                written: BTreeMap::new(),
                resets: 0,
                refused: None,
            },
            starts: 0,
            reached: None,
        }
    }

    /// From now on its protocol transitions are noted.
    pub fn watch(&mut self) {
        self.reached = Some(Box::default());
    }

    /// The transitions that it went through; `None` if they are not watched.
    #[must_use]
    pub fn reached(&self) -> Option<&Reached> {
        self.reached.as_deref()
    }
}

impl Device for Counted {
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        if let Some(reached) = &mut self.reached {
            reached.add(classify(&self.bus_end, &self.memory.cells, received));
        }
        self.bus_end.receive(now, received, &mut self.memory)
    }

    fn deadline(&self) -> Option<Deadline> {
        self.bus_end.deadline(&self.memory)
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        if let Some(reached) = &mut self.reached {
            reached.add(Transition {
                state: state(&self.bus_end, &self.memory.cells),
                event: Event::Silence,
            });
        }
        self.bus_end.handle_deadline(now, &mut self.memory)
    }

    fn power_on(&mut self, _now: Instant) {
        self.starts += 1;
        self.memory.cells.reset();
        self.bus_end = BusEnd::new(Properties::default());
    }

    fn in_error(&self) -> bool {
        self.bus_end.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.bus_end.cause()
    }
}
