//! The cycle control AS1.0: what a PLC makes the drive do with its mode switches (ND21 13.1.5-13.1.13).
//!
//! A function is taken at the rising edge of GPIN3 while GPO1 is low; GPO1 = high reports that it is done;
//! GPIN3 = low ends it, done or not, and takes GPO1 back (13.1.6). GPIN3 = low is also the hardware stop,
//! so that a motion that is cut short stops by itself.
//!
//! Choices where the manual is silent:
//!
//! * `AS_Command` shows the code of the function while it is selected by GPIN3. Codes without a function
//!   do nothing, GPO1 stays low.
//! * The marker `PZ` goes from 39 to 0 and back; what the bus writes to it counts modulo 40.
//! * A transmission that another function interrupts is forgotten ("must not be interrupted", 13.1.9.2).
//!   `WrPS`, `WrEE` and the functions that use the parameter do nothing without a whole one; they use the last
//!   whole one again (13.1.13). `BZ` counts the bits.
//! * Bits of parameters are sent highest first, as those of positions are; bits of the error code are read
//!   lowest first, as those of the position are. GPO1 shows the bit as long as GPIN3 is high. The position is
//!   latched at the first bit.
//! * `Wr nMax` sets `ps_v0` as well, "the velocity for the positioning procedure".
//! * `Teach In` by `Flags2` bit 4 stores at `PZ` and moves `PZ` on, as the function does; the drive clears the
//!   bit when the position is stored.
//! * In the error mode only `RdError` is taken, in the reset mode nothing.

use super::eeprom_controller::EepromController;
use super::properties::Nd21Properties;
use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{flags2, hw_version, hw_version2, ps_status, sw_version2};
use harness_proto::nd21::errors::LINE_TEST;
use harness_proto::nd21::functions::{self, Function};
use harness_proto::nd21::io::{GPO1, Input, Inputs, OUTPUTS};
use harness_proto::nd21::position::{self, POSITIONS, Position};
use harness_proto::nd21::ram;
use harness_proto::time::Instant;

/// Reads of `RdError` that give bits; the one behind them confirms the error (13.1.7.4).
const ERROR_BITS: u8 = 12;

/// What the cycle control wants of the rest of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Orders {
    /// Stepping with this speed.
    pub(super) jog: Option<i16>,
    /// The nominal value is that of the analogue input (13.1.9.5).
    pub(super) analogue: bool,
    /// The analogue input limits the torque (13.1.4).
    pub(super) analogue_torque: bool,
    /// This error is to be raised.
    pub(super) error: Option<u16>,
    /// The error is confirmed.
    pub(super) confirm: bool,
}

/// A serial transmission under way, bit by bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Serial {
    Position,
    Parameter,
    ReadPosition,
    ReadError,
}

/// What has become of the function that was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FunctionCourse {
    /// It is being done.
    Working,
    /// It is done; GPO1 shows this level.
    Done(bool),
    /// It cannot be done; GPO1 stays low.
    Refused,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CycleControl {
    /// GPIN3 of the cycle before.
    started: bool,
    running: Option<(Function, FunctionCourse)>,
    serial: Option<Serial>,
    /// The position and the parameter that were transmitted, the position that is read.
    position: u32,
    parameter: u16,
    /// A whole position, a whole parameter has been transmitted.
    has_position: bool,
    has_parameter: bool,
    read: u32,
    /// The error code that is being read.
    error: u16,
    /// A position is being stored.
    storing: bool,
    /// Nothing happened in the last cycle.
    at_rest: bool,
}

/// Everything that a function may touch.
struct Reach<'a> {
    now: Instant,
    mode: Mode,
    cells: &'a mut Cells,
    eeprom: &'a mut EepromController,
    properties: &'a Nd21Properties,
}

impl CycleControl {
    /// The function that a PLC has ordered, and its state, for observers.
    pub(super) fn ordered(&self) -> Option<(Function, &'static str)> {
        self.running.map(|(function, course)| match course {
            FunctionCourse::Working => (function, "working"),
            FunctionCourse::Done(true) => (function, "done, GPO1 high"),
            FunctionCourse::Done(false) => (function, "done, GPO1 low"),
            FunctionCourse::Refused => (function, "refused"),
        })
    }

    pub(super) fn start(&mut self) {
        *self = Self::default();
    }

    /// Nothing is under way, and nothing will be with the same inputs.
    pub(super) fn at_rest(&self, cells: &Cells) -> bool {
        self.at_rest && cells.byte(ram::FLAGS2) & flags2::TEACH_IN == 0
    }

    /// One cycle, after the mode is known.
    pub(super) fn cycle(
        &mut self,
        inputs: Inputs,
        mode: Mode,
        now: Instant,
        cells: &mut Cells,
        eeprom: &mut EepromController,
        properties: &Nd21Properties,
    ) -> Orders {
        let mut reach = Reach {
            now,
            mode,
            cells,
            eeprom,
            properties,
        };
        self.teach_in_by_bus(&mut reach);
        let mut orders = Orders::default();
        let active = reach.cells.byte(ram::HW_VERSION) & hw_version::CYCLE_CONTROL != 0;
        if !active || mode == Mode::Reset {
            self.at_rest = !self.storing;
            self.started = inputs.is_high(Input::Gpin3);
            self.running = None;
            return orders;
        }
        let start = inputs.is_high(Input::Gpin3);
        let edge = start && !self.started;
        self.at_rest = start == self.started && self.running.is_none();
        self.started = start;
        if !start {
            if let Some((Function::StartPs, FunctionCourse::Working)) = self.running {
                // The function is ended (13.1.6): a start that has not begun is none.
                reach
                    .cells
                    .set_bits(ram::PS_STATUS, ps_status::START, false);
            }
            self.running = None;
        } else if mode == Mode::Error && self.running.is_some_and(goes_on) {
            // It does not go on when the error is confirmed.
            self.running = self
                .running
                .map(|(function, _)| (function, FunctionCourse::Refused));
        } else if edge {
            let gpin8 = reach.cells.byte(ram::SW_VERSION2) & sw_version2::NO_GPIN8 == 0
                && reach.cells.byte(ram::HW_VERSION) & hw_version::ANALOGUE == 0;
            let code = functions::code(inputs, gpin8);
            reach.cells.put(ram::AS_COMMAND, code);
            let function = Function::from_code(code)
                .filter(|function| mode != Mode::Error || *function == Function::RdError);
            self.running =
                function.map(|function| (function, self.take(function, &mut reach, &mut orders)));
        } else if let Some((function, FunctionCourse::Working)) = self.running {
            let course = self.go_on(function, &mut reach);
            self.running = Some((function, course));
        }
        if let Some((function, course)) = self.running {
            hold(function, course, &mut orders, reach.cells);
            // A function that is done waits for GPIN3, which is an input.
            self.at_rest =
                matches!(course, FunctionCourse::Done(_) | FunctionCourse::Refused) && !edge;
        }
        if reach.cells.byte(ram::HW_VERSION2) & hw_version2::NO_ANALOGUE_OUTPUT != 0 {
            let high = matches!(self.running, Some((_, FunctionCourse::Done(true))));
            reach.cells.set_bits(OUTPUTS, GPO1, high);
        }
        orders
    }

    /// A function begins.
    fn take(
        &mut self,
        function: Function,
        reach: &mut Reach<'_>,
        orders: &mut Orders,
    ) -> FunctionCourse {
        let serial = match function {
            Function::Wr0 | Function::Wr1 => Some(Serial::Position),
            Function::Wr0Param | Function::Wr1Param => Some(Serial::Parameter),
            Function::RdPos => Some(Serial::ReadPosition),
            Function::RdError => Some(Serial::ReadError),
            _ => None,
        };
        if serial.is_none() || serial != self.serial {
            reach.cells.put(ram::BZ, 0);
            self.serial = serial;
        }
        let cells = &mut *reach.cells;
        match function {
            Function::WrNMax | Function::WrVtippen | Function::WrNRampe | Function::WrI
                if !self.has_parameter =>
            {
                return FunctionCourse::Refused;
            }
            Function::ClrPz => cells.put(ram::PZ, 0),
            Function::IncPz => move_marker(1, cells),
            Function::DecPz => move_marker(POSITIONS - 1, cells),
            Function::Wr0 => self.shift_position(0, cells),
            Function::Wr1 => self.shift_position(1, cells),
            Function::Wr0Param => self.shift_parameter(0, cells),
            Function::Wr1Param => self.shift_parameter(1, cells),
            Function::WrNMax => {
                cells.put_word(ram::N_MAX, self.parameter);
                cells.put_word(ram::PS_V0, self.parameter);
            }
            Function::WrVtippen => cells.put_word(ram::VTIPPEN, self.parameter),
            Function::WrNRampe => {
                cells.put_word(ram::N_RAMPE_MINUS, self.parameter);
                cells.put_word(ram::N_RAMPE_PLUS, self.parameter);
            }
            Function::WrI => {
                let [imax, i0] = self.parameter.to_be_bytes();
                cells.put(ram::IMAX, imax);
                cells.put(ram::I0, i0);
            }
            Function::InitPs => {
                cells.set_bits(ram::FLAGS2, flags2::CALCULATE, false);
                cells.put(ram::PS_STATUS, ps_status::FINISHED);
            }
            Function::Leitungstest => orders.error = Some(LINE_TEST),
            Function::RdPos => return self.read_position(cells),
            Function::RdError => return self.read_error(orders, cells),
            Function::WrPs | Function::WrEe if !self.has_position => {
                return FunctionCourse::Refused;
            }
            Function::WrPs => load(self.position, cells),
            Function::RdEeWrPs => {
                let position = stored_position(cells);
                load(position, cells);
                move_marker(1, cells);
            }
            Function::StartPs => {
                if cells.byte(ram::PS_STATUS) & ps_status::CALCULATED == 0 {
                    return FunctionCourse::Refused;
                }
                cells.set_bits(ram::PS_STATUS, ps_status::START, true);
            }
            Function::Referenzfahrt => {
                cells.put(ram::PS_STATUS, 0);
                cells.put_bits(ram::FLAGS2, flags2::REFERENCING, flags2::START_REFERENCING);
            }
            Function::TippenMinus
            | Function::TippenPlus
            | Function::WaitPs
            | Function::TeachIn
            | Function::WrEe => {}
        }
        self.go_on(function, reach)
    }

    /// Whether the function is done.
    fn go_on(&mut self, function: Function, reach: &mut Reach<'_>) -> FunctionCourse {
        let status = reach.cells.byte(ram::PS_STATUS);
        let done = match function {
            Function::WrPs | Function::RdEeWrPs | Function::WaitPs => {
                status & ps_status::CALCULATED != 0
            }
            Function::StartPs => status == ps_status::FINISHED,
            Function::Referenzfahrt => {
                status == ps_status::FINISHED
                    && reach.cells.byte(ram::FLAGS2) & flags2::REFERENCING == 0
            }
            Function::TippenMinus | Function::TippenPlus => reach.mode == Mode::Go,
            Function::TeachIn => {
                let position = actual_position(reach.cells);
                self.store(position, reach)
            }
            Function::WrEe => self.store(self.position.to_be_bytes(), reach),
            _ => true,
        };
        if done {
            FunctionCourse::Done(true)
        } else {
            FunctionCourse::Working
        }
    }

    /// Stores a position at the marker through the EEPROM controller, and moves the marker on when it is
    /// written.
    fn store(&mut self, position: [u8; 4], reach: &mut Reach<'_>) -> bool {
        if !self.storing {
            let address = position::eeprom_address(marker(reach.cells));
            self.storing = address.is_some_and(|address| {
                reach
                    .eeprom
                    .store(reach.now, address, position, reach.properties)
            });
            return false;
        }
        let done = !reach.eeprom.storing();
        if done {
            self.storing = false;
            move_marker(1, reach.cells);
        }
        done
    }

    /// Teach-in by `Flags2` bit 4 (14.4.3).
    fn teach_in_by_bus(&mut self, reach: &mut Reach<'_>) {
        let asked = reach.cells.byte(ram::FLAGS2) & flags2::TEACH_IN != 0;
        let by_plc = matches!(
            self.running,
            Some((Function::TeachIn | Function::WrEe, FunctionCourse::Working))
        );
        if asked && !by_plc {
            let position = actual_position(reach.cells);
            if self.store(position, reach) {
                reach.cells.set_bits(ram::FLAGS2, flags2::TEACH_IN, false);
            }
        } else if self.storing && !by_plc && !reach.eeprom.storing() {
            // The PLC has gone away in mid-write: the position is stored all the same.
            self.storing = false;
            move_marker(1, reach.cells);
        }
    }

    fn shift_position(&mut self, bit: u32, cells: &mut Cells) {
        let bits = count(32, cells);
        if bits == 1 {
            self.position = 0;
        }
        self.position = self.position << 1 | bit;
        self.has_position = bits == 32;
    }

    fn shift_parameter(&mut self, bit: u16, cells: &mut Cells) {
        let bits = count(16, cells);
        if bits == 1 {
            self.parameter = 0;
        }
        self.parameter = self.parameter << 1 | bit;
        self.has_parameter = bits == 16;
    }

    /// Bit 0 first (13.1.9.5).
    fn read_position(&mut self, cells: &mut Cells) -> FunctionCourse {
        if cells.byte(ram::HW_VERSION2) & hw_version2::RD_POS == 0 {
            return FunctionCourse::Done(true);
        }
        let bit = count(32, cells) - 1;
        if bit == 0 {
            self.read = cells.long(ram::UMDRIST);
        }
        FunctionCourse::Done(self.read >> bit & 1 != 0)
    }
}

impl CycleControl {
    /// The 12 bits of the error code as it stood at the first of them, and the 13th read, which confirms that
    /// error (13.1.7.4).
    fn read_error(&mut self, orders: &mut Orders, cells: &mut Cells) -> FunctionCourse {
        let bit = count(ERROR_BITS + 1, cells) - 1;
        if bit == 0 {
            self.error = cells.word(ram::ERRORCODE);
        }
        if bit == ERROR_BITS {
            orders.confirm = cells.word(ram::ERRORCODE) == self.error;
            return FunctionCourse::Done(true);
        }
        FunctionCourse::Done(self.error >> bit & 1 != 0)
    }
}

/// Whether a function does something as long as GPIN3 is high.
fn goes_on((function, course): (Function, FunctionCourse)) -> bool {
    let holds = matches!(
        function,
        Function::TippenMinus | Function::TippenPlus | Function::RdPos
    );
    holds || course == FunctionCourse::Working
}

/// What a function asks for as long as GPIN3 is high.
fn hold(function: Function, course: FunctionCourse, orders: &mut Orders, cells: &Cells) {
    if course == FunctionCourse::Refused {
        return;
    }
    let jog = match function {
        Function::TippenPlus => cells.signed(ram::VTIPPEN),
        Function::TippenMinus => cells.signed(ram::VTIPPEN).saturating_neg(),
        Function::RdPos => {
            orders.analogue = cells.byte(ram::HW_VERSION2) & hw_version2::RD_POS == 0;
            return;
        }
        _ => return,
    };
    orders.jog = Some(jog);
    orders.analogue_torque = cells.byte(ram::SW_VERSION2) & sw_version2::NO_ANALOGUE_TORQUE == 0;
}

/// Counts a bit of a transmission in `BZ`; after the last one the next transmission begins.
fn count(bits: u8, cells: &mut Cells) -> u8 {
    let before = cells.byte(ram::BZ);
    let now = if before >= bits { 1 } else { before + 1 };
    cells.put(ram::BZ, now);
    now
}

fn marker(cells: &Cells) -> u8 {
    cells.byte(ram::PZ) % POSITIONS
}

fn move_marker(by: u8, cells: &mut Cells) {
    cells.put(ram::PZ, (marker(cells) + by) % POSITIONS);
}

/// The position at the marker; its four bytes in the order of their addresses (13.1.9).
fn stored_position(cells: &Cells) -> u32 {
    let first = position::eeprom_address(marker(cells)).map_or(0, usize::from);
    let bytes = cells.eeprom().get(first..first + 4);
    bytes.map_or(0, |bytes| {
        bytes
            .iter()
            .fold(0, |word, byte| word << 8 | u32::from(*byte))
    })
}

/// The actual position as an absolute one: "in the teach-in process only absolute positions are stored"
/// (13.1.9). Beyond 16384 turns its 31 bits have to do.
fn actual_position(cells: &Cells) -> [u8; 4] {
    let word = cells.long(ram::UMDRIST) & 0x7FFF_FFFF;
    Position::decode(word).to_bytes()
}

/// A new target for the positioning controller (13.1.7.4); a result that was not used is taken back.
fn load(position: u32, cells: &mut Cells) {
    cells.put_long(ram::PS_POSITION_H, position);
    cells.set_bits(
        ram::PS_STATUS,
        ps_status::CALCULATED | ps_status::START,
        false,
    );
    cells.set_bits(ram::FLAGS2, flags2::CALCULATE, true);
}
