//! The ND21's memory as the bus reaches it: read-only cells and bits, errors and their confirmation, the
//! EEPROM controller.

use super::eeprom_controller::{CONTROL, EepromController};
use super::properties::Nd21Properties;
use super::world::{Mode, Shown, Stimulus, World};
use crate::cells::Cells;
use harness_proto::nd21;
use harness_proto::nd21::cells::{Access, cell_at};
use harness_proto::nd21::eeprom::LINKS;
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::{Memory, RAM};
use harness_proto::novobus::output::OutputChange;
use harness_proto::time::Instant;

/// Bit 5 of `Status`: the drive is in error mode (ND21 14.10.1).
const STATUS_ERROR: u8 = 1 << 5;

/// The memory of an ND21.
#[derive(Clone, Debug)]
pub struct Nd21Memory {
    cells: Cells,
    eeprom_controller: EepromController,
    properties: Nd21Properties,
    now: Instant,
    world: World,
}

impl Nd21Memory {
    pub(super) fn new(cells: Cells, properties: Nd21Properties) -> Self {
        let mut memory = Self {
            cells,
            eeprom_controller: EepromController::default(),
            properties,
            now: Instant::START,
            world: World::default(),
        };
        memory.start();
        memory
    }

    /// The cells, past all rules of access.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// The cells, past all rules of access.
    pub fn cells_mut(&mut self) -> &mut Cells {
        &mut self.cells
    }

    pub(super) fn stimulate(&mut self, stimulus: Stimulus) {
        if let Some(error) = self.world.change(stimulus) {
            self.error(error);
        }
    }

    pub(super) fn shown(&self) -> Shown {
        let outputs = self.cells.peek(nd21::io::OUTPUTS);
        Shown {
            gpo1: outputs & nd21::io::GPO1 != 0,
            gpo2: outputs & nd21::io::GPO2 != 0,
            ready: false,
            analogue: 0,
            encoder: 0,
            display: None,
            mode: Mode::Reset,
        }
    }

    /// Does what the drive does by itself up to `now`.
    pub(super) fn advance(&mut self, now: Instant) {
        self.now = now;
        self.eeprom_controller.advance(now, &mut self.cells);
    }

    /// What the drive's program does at power-up and reset: RAM is lost; the cells with a place in the
    /// EEPROM are loaded from there (ND21 14.2.2, 13.1.4).
    fn start(&mut self) {
        self.cells.start();
        for link in LINKS {
            for i in 0..link.size {
                let byte = self.cells.eeprom()[usize::from(link.eeprom + i)];
                self.put(link.ram + u16::from(i), byte);
            }
        }
        self.eeprom_controller.start(&mut self.cells);
    }

    /// The power has come back. What was being written to the EEPROM when it failed is damaged, which the
    /// self-test finds (14.11.2).
    pub(super) fn power_on(&mut self) {
        let damaged = self.eeprom_controller.damage(&mut self.cells);
        self.start();
        if damaged {
            self.error(ErrorCode::EepromParity);
        }
    }

    /// The drive goes into error mode (ND21 14.10.1).
    fn error(&mut self, error: ErrorCode) {
        let [high, low] = error.code().to_be_bytes();
        self.put(nd21::ram::ERRORCODE, high);
        self.put(nd21::ram::ERRORCODE + 1, low);
        self.put(
            nd21::ram::STATUS,
            self.cells.peek(nd21::ram::STATUS) | STATUS_ERROR,
        );
    }

    /// "Write H'AF in RAM cell error code" (ND21 14.10.1).
    fn confirm_error(&mut self) {
        self.put(nd21::ram::ERRORCODE, 0);
        self.put(nd21::ram::ERRORCODE + 1, 0);
        self.put(
            nd21::ram::STATUS,
            self.cells.peek(nd21::ram::STATUS) & !STATUS_ERROR,
        );
    }

    fn put(&mut self, address: u16, byte: u8) {
        let known = self.cells.poke(address, byte);
        debug_assert!(known, "{address:04X} is RAM");
    }
}

impl Memory for Nd21Memory {
    fn read(&mut self, address: u16) -> u8 {
        self.cells.peek(address)
    }

    /// Read-only cells and bits stay as they are (ND21 14.2.1).
    fn write(&mut self, address: u16, data: u8) {
        if address == nd21::ram::BUS_ADDR || !RAM.contains(&address) {
            self.cells.write(address, data);
            return;
        }
        match (address, data) {
            (CONTROL, code) => {
                self.eeprom_controller
                    .control(self.now, code, self.properties, &mut self.cells);
                return;
            }
            (nd21::ram::ERRORCODE, nd21::CONFIRM_ERROR) => {
                self.confirm_error();
                return;
            }
            _ => {}
        }
        let Some(cell) = cell_at(address) else { return };
        if cell.access == Access::Read {
            return;
        }
        let kept = self.cells.peek(address) & cell.read_only_bits;
        self.put(address, kept | data & !cell.read_only_bits);
    }

    fn write_output(&mut self, change: OutputChange) {
        self.cells.write_output(change);
    }

    fn reset(&mut self) {
        self.start();
    }

    fn bus_error(&mut self, error: BusError) {
        self.error(error.error_code());
    }

    fn monitors_time_out(&self) -> bool {
        self.cells.monitors_time_out()
    }
}
