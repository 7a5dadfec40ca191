//! The positioning controller PC1.0 (ND21 13.1-13.4): from a target to a trapezoid, and along it.
//!
//! What the manual leaves open, as named choices:
//!
//! * A target in `ps_positionH` and `ps_positionL` is in the format of 13.1.9, mode bit and 31 bits;
//!   13.3.2.1 speaks of 32 bits. Property `ps-position`.
//! * The trapezoid is worked out in raw units of speed a cycle, so that it meets the target exactly:
//!   `ps_k0` cycles from the start to the beginning of the braking; then down in steps of `nRampe-`, with
//!   `ps_k1` cycles (0 or 1) at `ps_v1`, the speed that is left over. `ps_delta` is then 0.
//! * The calculation takes `ps-calculation-time`.
//! * Direction bit 1 is negative (E118).
//! * Error 601 is raised when a calculation is started and the controller is not released: not
//!   initialised since reset (13.2.1), position regulator off, or nominal value not from NOVOBUS (13.1.4).
//! * Stop and block in mid-run end the positioning: `ps_status` 00, `Flags2` bit 3 = 0. The target is
//!   reloaded to complete the remaining track (13.1.13).
//! * A run whose phase the bus takes back (`NB_InitPS` in the target braking, 13.2.1.3) ends too; the drive brakes
//!   on its ramp.

use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{flags2, ps_status, sw_version};
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::ram;

/// 26 s in cycles of 432 us, the longest positioning (13.1).
const LONGEST: u64 = 26_000_000 / 432;

/// A trapezoid: how long to drive up and on, and how to brake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Trapezoid {
    /// The acceleration ramp in raw speed a cycle.
    up: u64,
    /// The braking ramp.
    down: u64,
    /// The speed that is reached.
    peak: u64,
    /// Cycles from the start to the end of the constant drive.
    constant: u64,
    /// The speed that is left over, driven for one cycle; 0 for none.
    rest: u64,
    /// Cycles of braking, without that one.
    braking: u64,
}

/// The sum of the speeds of `cycles` cycles of acceleration to `peak`.
fn sum_up(cycles: u64, up: u64, peak: u64) -> u64 {
    let ramp = cycles.min(peak / up);
    up * ramp * (ramp + 1) / 2 + (cycles - ramp) * peak
}

/// How many cycles of braking from `peak` have a speed above 0.
fn cycles_down(peak: u64, down: u64) -> u64 {
    peak.saturating_sub(1) / down
}

/// The sum of their speeds.
fn sum_down(peak: u64, down: u64) -> u64 {
    let cycles = cycles_down(peak, down);
    cycles * peak - down * (cycles * (cycles + 1) / 2)
}

impl Trapezoid {
    /// The fastest one over `way` (in raw speed x cycles) with this speed and these ramps; `None` if it
    /// never gets there.
    pub(super) fn new(way: u64, speed: u16, up: u16, down: u16) -> Option<Self> {
        let (speed, up, down) = (u64::from(speed), u64::from(up), u64::from(down));
        if way == 0 {
            return Some(Self {
                up: 1,
                down: 1,
                ..Self::default()
            });
        }
        if speed == 0 || up == 0 || down == 0 {
            return None;
        }
        let fits = |peak: u64| sum_up(peak.div_ceil(up), up, peak) + sum_down(peak, down) <= way;
        // The highest speed that still leaves room to brake; 1 always does.
        let (mut peak, mut most) = (1, speed);
        while peak < most {
            let middle = peak + (most - peak).div_ceil(2);
            if fits(middle) {
                peak = middle;
            } else {
                most = middle - 1;
            }
        }
        let climb = peak.div_ceil(up);
        let left = way - sum_up(climb, up, peak) - sum_down(peak, down);
        Some(Self {
            up,
            down,
            peak,
            constant: climb + left / peak,
            rest: left % peak,
            braking: cycles_down(peak, down),
        })
    }

    /// How many cycles it takes.
    pub(super) fn cycles(&self) -> u64 {
        self.constant + u64::from(self.rest > 0) + self.braking
    }

    /// The speed of a cycle, the first being 1, and the phase bit of `ps_status`.
    fn speed(&self, cycle: u64) -> (u64, u8) {
        let Some(braking) = cycle.checked_sub(self.constant).filter(|&c| c > 0) else {
            return ((self.up * cycle).min(self.peak), ps_status::CONSTANT);
        };
        let last = cycle >= self.cycles();
        let before = self.peak.saturating_sub(self.down * (braking - 1));
        let due = self.peak.saturating_sub(self.down * braking);
        // The cycle at the speed that is left over comes where the ramp passes that speed.
        let speed = if due >= self.rest && due > 0 {
            due
        } else if self.rest > 0 && before >= self.rest {
            self.rest
        } else {
            before
        };
        let target = last || speed <= self.rest;
        let phase = if target {
            ps_status::TARGET_BRAKING
        } else {
            ps_status::BRAKING
        };
        (speed, phase)
    }
}

/// Where the controller is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Idle,
    /// The calculation is done after this number of cycles.
    Calculating(u32),
    /// Calculated, for a start at this nominal position.
    Ready(Trapezoid, u32),
    /// On the way: the cycle, and whether it goes backwards.
    Running(Trapezoid, u64, bool),
}

/// The positioning controller.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Positioning {
    phase: Phase,
    initialised: bool,
    /// Where the last positioning is to end.
    target: u32,
    /// `Flags2` bit 3 has asked for the present calculation or run.
    asked: bool,
}

/// What the drive tells the controller in each cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    pub(super) mode: Mode,
    /// The motor stands, and so does the nominal value.
    pub(super) standing: bool,
    /// How long a calculation takes, in cycles.
    pub(super) calculation: u32,
    /// Targets have 32 bits and no mode bit (property `ps-position`).
    pub(super) whole_words: bool,
    /// A referencing run drives: it needs no initialisation, it is one.
    pub(super) referencing: bool,
    /// Raw speed units per increment: 8, or 4 in the range to 12000 rpm.
    pub(super) per_increment: u8,
}

impl Positioning {
    /// As after reset; initialised at once if `HwVersion2` says so (13.2.1).
    pub(super) fn start(&mut self, automatic: bool, cells: &mut Cells) {
        *self = Self::default();
        if automatic {
            cells.put(ram::PS_STATUS, ps_status::FINISHED);
            self.initialised = true;
            self.target = cells.long(ram::UMDRSOLL);
        }
    }

    /// Nothing is under way.
    pub(super) fn at_rest(&self, cells: &Cells) -> bool {
        matches!(self.phase, Phase::Idle | Phase::Ready(..))
            && cells.byte(ram::FLAGS2) & flags2::CALCULATE == 0
            && cells.byte(ram::PS_STATUS) & (ps_status::CALCULATE | ps_status::START) == 0
    }

    /// The actual position is less than 4 x `Window` from the target (13.1.4, E57).
    pub(super) fn in_position(&self, cells: &Cells) -> bool {
        let away = self.target.wrapping_sub(cells.long(ram::UMDRIST));
        self.initialised
            && cells.byte(ram::PS_STATUS) & ps_status::FINISHED != 0
            && away.cast_signed().unsigned_abs() < 4 * u32::from(cells.byte(ram::WINDOW))
    }

    /// A run is under way.
    pub(super) fn running(&self) -> bool {
        matches!(self.phase, Phase::Running(..))
    }

    /// The count of the position has been shifted: here the rotor now is.
    pub(super) fn set_target(&mut self, position: u32) {
        self.target = position;
    }

    /// `ps_status` has been written: with 01, where nothing is under way, the present place is the target
    /// (13.2.1.2, 13.2.1.3).
    pub(super) fn status_written(&mut self, byte: u8, cells: &Cells) {
        if byte & ps_status::FINISHED != 0 && !self.running() {
            self.target = cells.long(ram::UMDRSOLL);
        }
    }

    /// What `Flags2` bit 3 asked for is done; a request that has come since is not (13.2.2).
    fn answer(&mut self, cells: &mut Cells) {
        if self.asked {
            cells.set_bits(ram::FLAGS2, flags2::CALCULATE, false);
        }
        self.asked = false;
    }

    /// One cycle: the speed to have, if a run is under way.
    pub(super) fn cycle(
        &mut self,
        situation: Situation,
        cells: &mut Cells,
    ) -> Result<Option<i16>, ErrorCode> {
        let status = cells.byte(ram::PS_STATUS);
        if status & ps_status::FINISHED != 0 && !self.initialised {
            self.initialised = true;
            self.target = cells.long(ram::UMDRSOLL);
        }
        let asked =
            status & ps_status::CALCULATE != 0 || cells.byte(ram::FLAGS2) & flags2::CALCULATE != 0;
        if self.phase == Phase::Idle && status & ps_status::START != 0 && !asked {
            // There is nothing to be started (13.3.2.3): it must not start the next run by itself.
            cells.set_bits(ram::PS_STATUS, ps_status::START, false);
        }
        if self.phase == Phase::Idle && status & ps_status::CALCULATED == 0 && self.at_rest(cells) {
            return Ok(None);
        }
        match situation.mode {
            Mode::Reset | Mode::Error | Mode::Block => {
                self.block(cells);
                return Ok(None);
            }
            Mode::Stop if self.running() => {
                self.cancel(cells);
                return Ok(None);
            }
            Mode::Stop | Mode::Go => {}
        }
        match self.phase {
            Phase::Running(trapezoid, cycle, backwards) => {
                return Ok(self.run(trapezoid, cycle + 1, backwards, cells));
            }
            Phase::Calculating(left) => self.calculate(left, situation, cells)?,
            Phase::Idle | Phase::Ready(..) => self.begin(situation, cells)?,
        }
        let status = cells.byte(ram::PS_STATUS);
        match self.phase {
            // It starts from a standstill only (13.1.2).
            Phase::Ready(trapezoid, from)
                if status & ps_status::START != 0
                    && situation.mode == Mode::Go
                    && situation.standing =>
            {
                if self.asked && from != cells.long(ram::UMDRSOLL) {
                    // "The start position is not correct any more" (13.1.2): the way to the target is another.
                    cells.set_bits(ram::PS_STATUS, ps_status::CALCULATED, false);
                    self.phase = Phase::Idle;
                    return Ok(None);
                }
                let backwards = status & ps_status::NEGATIVE != 0;
                Ok(self.run(trapezoid, 1, backwards, cells))
            }
            _ => Ok(None),
        }
    }

    /// "The drive block cancels all results of the positioning controller" (13.1.2); a calculation that has
    /// not begun waits for the release.
    fn block(&mut self, cells: &mut Cells) {
        if self.phase != Phase::Idle {
            self.cancel(cells);
        } else if cells.byte(ram::PS_STATUS) & ps_status::CALCULATED != 0 {
            cells.set_bits(ram::PS_STATUS, ps_status::CALCULATED, false);
        }
    }

    /// Ends the positioning where it is.
    pub(super) fn cancel(&mut self, cells: &mut Cells) {
        self.phase = Phase::Idle;
        self.target = cells.long(ram::UMDRSOLL);
        cells.put(ram::PS_STATUS, 0);
        cells.set_bits(ram::FLAGS2, flags2::CALCULATE, false);
    }

    /// Starts a calculation that has been asked for, by `Flags2` bit 3 or by `ps_status` bit 6.
    fn begin(&mut self, situation: Situation, cells: &mut Cells) -> Result<(), ErrorCode> {
        let status = cells.byte(ram::PS_STATUS);
        let target = cells.byte(ram::FLAGS2) & flags2::CALCULATE != 0;
        let ready = matches!(self.phase, Phase::Ready(..)) && status & ps_status::CALCULATED != 0;
        if status & ps_status::CALCULATE == 0 && (!target || ready) {
            if !ready {
                // The result was withdrawn by a write (13.2.1.3).
                self.phase = Phase::Idle;
            }
            return Ok(());
        }
        let software = cells.byte(ram::SW_VERSION);
        let released = (self.initialised || situation.referencing)
            && software & sw_version::POSITION_REGULATOR != 0
            && software & sw_version::SOURCE == sw_version::SOURCE_NOVOBUS;
        if !released {
            self.cancel(cells);
            return Err(ErrorCode::DisPs);
        }
        if !situation.standing {
            return Ok(());
        }
        self.asked = status & ps_status::CALCULATE == 0;
        if self.asked {
            self.direction(situation, cells);
        }
        self.phase = Phase::Calculating(situation.calculation);
        self.calculate(situation.calculation, situation, cells)
    }

    /// Direction and amount of the way, from the target (13.3.2.2).
    fn direction(&mut self, situation: Situation, cells: &mut Cells) {
        let word = cells.long(ram::PS_POSITION_H);
        let here = cells.long(ram::UMDRSOLL);
        let position = Position::decode(word);
        let way = if situation.whole_words {
            word.wrapping_sub(here).cast_signed()
        } else {
            match position.mode() {
                PositionMode::Relative => position.increments(),
                PositionMode::Absolute => position.increments().wrapping_sub(here.cast_signed()),
            }
        };
        cells.put_long(ram::PS_UMDREHUNG, way.unsigned_abs());
        let kept = cells.byte(ram::PS_STATUS) & ps_status::START;
        let direction = if way < 0 { ps_status::NEGATIVE } else { 0 };
        cells.put(ram::PS_STATUS, kept | direction | ps_status::CALCULATE);
    }

    /// The calculation of the positioning (13.3.2.2).
    fn calculate(
        &mut self,
        left: u32,
        situation: Situation,
        cells: &mut Cells,
    ) -> Result<(), ErrorCode> {
        let status = cells.byte(ram::PS_STATUS);
        if status & ps_status::CALCULATE == 0 {
            self.phase = Phase::Idle;
            return Ok(());
        }
        if left > 0 {
            self.phase = Phase::Calculating(left - 1);
            return Ok(());
        }
        let way = cells.long(ram::PS_UMDREHUNG);
        let speed = cells
            .word(ram::PS_V0)
            .min(cells.word(ram::N_MAX))
            .min(0x7FFF);
        let trapezoid = Trapezoid::new(
            u64::from(way) * u64::from(situation.per_increment),
            speed,
            cells.word(ram::N_RAMPE_PLUS),
            cells.word(ram::N_RAMPE_MINUS),
        );
        let Some(trapezoid) = trapezoid.filter(|t| t.cycles() <= LONGEST) else {
            self.cancel(cells);
            return Err(ErrorCode::Ps);
        };
        let word = |number: u64| u16::try_from(number).unwrap_or(u16::MAX);
        cells.put_word(ram::PS_K0, word(trapezoid.constant));
        cells.put_word(ram::PS_V1, word(trapezoid.rest));
        cells.put_word(ram::PS_K1, u16::from(trapezoid.rest > 0));
        cells.put(ram::PS_DELTA, 0);
        let kept = status & (ps_status::NEGATIVE | ps_status::START);
        cells.put(ram::PS_STATUS, kept | ps_status::CALCULATED);
        self.phase = Phase::Ready(trapezoid, cells.long(ram::UMDRSOLL));
        Ok(())
    }

    /// A cycle of the run: its speed; the phase stands in `ps_status`. None where the bus has taken the phase
    /// back, as the last step of `NB_InitPS` does in the target braking (13.2.1.3): the drive then brakes on its
    /// ramp.
    fn run(
        &mut self,
        trapezoid: Trapezoid,
        cycle: u64,
        backwards: bool,
        cells: &mut Cells,
    ) -> Option<i16> {
        const PHASES: u8 = ps_status::CONSTANT | ps_status::BRAKING | ps_status::TARGET_BRAKING;
        let status = cells.byte(ram::PS_STATUS);
        if cycle > 1 && status & PHASES == 0 {
            self.phase = Phase::Idle;
            self.answer(cells);
            return None;
        }
        let direction = if backwards { ps_status::NEGATIVE } else { 0 };
        if cycle == 1 {
            let way = cells.long(ram::PS_UMDREHUNG);
            let way = if backwards { way.wrapping_neg() } else { way };
            self.target = cells.long(ram::UMDRSOLL).wrapping_add(way);
        }
        if cycle > trapezoid.cycles() {
            self.phase = Phase::Idle;
            cells.put(ram::PS_STATUS, ps_status::FINISHED);
            self.answer(cells);
            return Some(0);
        }
        self.phase = Phase::Running(trapezoid, cycle, backwards);
        let (speed, phase) = trapezoid.speed(cycle);
        cells.put(ram::PS_STATUS, direction | phase);
        let speed = i16::try_from(speed).unwrap_or(i16::MAX);
        Some(if backwards { -speed } else { speed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of the speeds is the way, no step is steeper than the ramps, and the phases follow each
    /// other (ND21 13.3.2.3).
    #[test]
    fn trapezoids_meet_their_target() {
        let mut seed = 0x9E37_79B9_7F4A_7C15_u64;
        let mut random = |most: u64| {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            seed % most
        };
        for round in 0..4_000 {
            let scale = [50, 3_000, 4_000_000][round % 3];
            let way = 1 + random(scale);
            let (speed, up, down) = (1 + random(9_000), 1 + random(300), 1 + random(300));
            let [speed16, up16, down16] =
                [speed, up, down].map(|number| u16::try_from(number).unwrap());
            let trapezoid = Trapezoid::new(way, speed16, up16, down16).unwrap();
            let case = format!("way {way} speed {speed} up {up} down {down} {trapezoid:?}");
            let (mut covered, mut before, mut phase) = (0, 0, ps_status::CONSTANT);
            if trapezoid.cycles() > 50_000 {
                continue;
            }
            for cycle in 1..=trapezoid.cycles() {
                let (now, bit) = trapezoid.speed(cycle);
                assert!(now > 0 && now <= speed, "{case}: {cycle}");
                assert!(
                    now <= before + up && before <= now + down,
                    "{case}: {cycle}"
                );
                assert!(bit <= phase, "{case}: {cycle}");
                (covered, before, phase) = (covered + now, now, bit);
            }
            assert_eq!(covered, way, "{case}");
            assert!(before <= down, "{case}");
            assert_eq!(
                phase == ps_status::CONSTANT,
                trapezoid.cycles() == trapezoid.constant,
                "{case}"
            );
        }
    }

    /// By hand: 10 turns at 1500 rpm (5662), ramps of 16: 5,242,880 = 5662 x cycles of full speed and two
    /// ramps of 354 cycles; 10/25 s + 0.153 s = 0.553 s.
    #[test]
    fn a_trapezoid_by_hand() {
        let trapezoid = Trapezoid::new(10 * 65_536 * 8, 5_662, 16, 16).unwrap();
        let seconds = f64::from(u32::try_from(trapezoid.cycles()).unwrap()) * 432e-6;
        let by_hand = 10.0 / 25.0 + 5_662.0 / 16.0 * 432e-6;
        assert!(
            (seconds - by_hand).abs() < 2.0 * 432e-6,
            "{seconds} {by_hand}"
        );
    }

    #[test]
    fn nothing_to_do_and_no_way_to_do_it() {
        assert_eq!(Trapezoid::new(0, 0, 0, 0).unwrap().cycles(), 0);
        assert_eq!(Trapezoid::new(1, 0, 1, 1), None);
        assert_eq!(Trapezoid::new(1, 1, 0, 1), None);
        let jump = Trapezoid::new(800, 5_000, 0x7FFF, 0x7FFF).unwrap();
        assert_eq!((jump.cycles(), jump.speed(1).0), (1, 800));
    }
}
