//! The referencing run (ND21 13.1.1): eight steps from `Flags2` bits 7 to 5 = 100 to 000.
//!
//! Choices where the manual is silent: while the run is on, bits 7 to 5 show the step (1: 101, 2: 110,
//! 3: 111, 4: 001, 5: 010, 6: 011). "Slow drive in the first direction" is the second speed with the sign
//! of the first. For step 6 the drive brakes and then positions with `ps_v0` = the second speed, which
//! is why `NB_Referenzfahrt` keeps `ps_v0` (13.2.1.1 steps 1 and 9). The rotor angle is that of the
//! resolver, without `dLage`. Stop, block and errors end the run: the bits are 000 and `ps_status` is not 01.

use super::positioning::{Positioning, Situation};
use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{flags2, ps_status};
use harness_proto::nd21::ram;

/// The steps of 13.1.1 that take time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// 1: in the programmed direction as long as GPIN4 is low.
    Search,
    /// 2: braking.
    BrakeOn,
    /// 3: slower in the opposite direction as long as GPIN4 is high.
    Leave,
    /// 4: braking.
    BrakeOff,
    /// 5: slow in the first direction until GPIN4 is high.
    Return,
    /// 6: to the next position with the reference angle; first to a standstill.
    BrakeLast,
    Position,
}

impl Step {
    const fn bits(self) -> u8 {
        let code = match self {
            Self::Search => 0b101,
            Self::BrakeOn => 0b110,
            Self::Leave => 0b111,
            Self::BrakeOff => 0b001,
            Self::Return => 0b010,
            Self::BrakeLast | Self::Position => 0b011,
        };
        code << 5
    }
}

/// The referencing run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Referencing {
    step: Option<Step>,
}

/// What a cycle of the run asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Run {
    /// No run is on.
    Off,
    /// This speed, on the ramps.
    Speed(i16),
    /// The positioning controller drives.
    Positioning,
}

impl Referencing {
    pub(super) fn start(&mut self) {
        self.step = None;
    }

    /// No run is on.
    pub(super) fn at_rest(&self, cells: &Cells) -> bool {
        self.step.is_none() && cells.byte(ram::FLAGS2) & flags2::REFERENCING == 0
    }

    /// One cycle, before that of the positioning controller. `switch` is the reference switch at GPIN4.
    pub(super) fn cycle(
        &mut self,
        situation: Situation,
        switch: bool,
        positioning: &Positioning,
        cells: &mut Cells,
    ) -> Run {
        let bits = cells.byte(ram::FLAGS2) & flags2::REFERENCING;
        if bits == 0 {
            self.step = None;
            return Run::Off;
        }
        if situation.mode != Mode::Go {
            self.end(cells);
            cells.put(ram::PS_STATUS, 0);
            return Run::Off;
        }
        if bits == flags2::START_REFERENCING {
            cells.put(ram::PS_STATUS, 0);
            self.go_to(Step::Search, cells);
        }
        let (first, second) = (cells.signed(ram::REF_V1), cells.signed(ram::REF_V2));
        let back = second.unsigned_abs().min(0x7FFF).cast_signed();
        let back = if first < 0 { -back } else { back };
        // A step that is over gives way to the next in the same cycle.
        match self.step {
            Some(Step::Search) if switch => self.go_to(Step::BrakeOn, cells),
            Some(Step::BrakeOn) if situation.standing => self.go_to(Step::Leave, cells),
            Some(Step::Leave) if !switch => self.go_to(Step::BrakeOff, cells),
            Some(Step::BrakeOff) if situation.standing => self.go_to(Step::Return, cells),
            Some(Step::Return) if switch => self.go_to(Step::BrakeLast, cells),
            Some(Step::BrakeLast) if situation.standing => {
                Self::order(first < 0, back, cells);
                self.go_to(Step::Position, cells);
                return Run::Positioning;
            }
            _ => {}
        }
        match self.step {
            None => {
                // Other bits than 100 start nothing (13.2.1.1 step 6).
                cells.set_bits(ram::FLAGS2, flags2::REFERENCING, false);
                Run::Off
            }
            Some(Step::Search) => Run::Speed(first),
            Some(Step::Leave) => Run::Speed(second),
            Some(Step::Return) => Run::Speed(back),
            Some(Step::BrakeOn | Step::BrakeOff | Step::BrakeLast) => Run::Speed(0),
            Some(Step::Position) => {
                if !positioning.running() && positioning.at_rest(cells) {
                    // The bus has taken the positioning back.
                    self.end(cells);
                }
                Run::Positioning
            }
        }
    }

    /// After the positioning controller's cycle: true where the run has come to its end, and 13.1.1 step 7 is
    /// due.
    pub(super) fn ends(&mut self, cells: &mut Cells) -> bool {
        let ends =
            self.step == Some(Step::Position) && cells.byte(ram::PS_STATUS) == ps_status::FINISHED;
        if ends {
            self.end(cells);
        }
        ends
    }

    /// A run is on.
    pub(super) fn on(&self) -> bool {
        self.step.is_some()
    }

    fn go_to(&mut self, step: Step, cells: &mut Cells) {
        self.step = Some(step);
        cells.put_bits(ram::FLAGS2, flags2::REFERENCING, step.bits());
    }

    fn end(&mut self, cells: &mut Cells) {
        self.step = None;
        cells.set_bits(ram::FLAGS2, flags2::REFERENCING, false);
    }

    /// Step 6: the way to the next place where the rotor angle is H'8000, shifted by `RefLage`.
    fn order(negative: bool, speed: i16, cells: &mut Cells) {
        // Where the rotor angle is to be, which is what the position shows less its shift.
        let angle = cells
            .word(ram::LAGESOLL)
            .wrapping_sub(cells.word(ram::D_LAGE));
        let goal = 0x8000_u16.wrapping_add(cells.word(ram::REF_LAGE));
        let way = if negative {
            angle.wrapping_sub(goal)
        } else {
            goal.wrapping_sub(angle)
        };
        cells.put_word(ram::PS_V0, speed.unsigned_abs());
        cells.put_long(ram::PS_UMDREHUNG, u32::from(way));
        let direction = if negative { ps_status::NEGATIVE } else { 0 };
        cells.put(
            ram::PS_STATUS,
            direction | ps_status::CALCULATE | ps_status::START,
        );
    }
}
