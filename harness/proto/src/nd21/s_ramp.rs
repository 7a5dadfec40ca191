//! Positioning with the sine-squared ramp, the S-ramp: its pre-calculation in the PC (ND21 13.5).
//!
//! The speed follows V sin²(pi t / 2T) in the acceleration time T, is constant, and follows the mirror
//! image in braking. The drive gets "several points of support", and "between the points of support a
//! constant acceleration proceeds" (13.5.3, E75).
//!
//! What the manual leaves open, and what is chosen here:
//!
//! * *A point* is a number of cycles of 432 us and the speed at their end. A point without cycles is a step
//!   of speed. The speed in a cycle is that in the middle of it, rounded ([`SupportPoint::speed_in`]).
//! * *16 points a flank* ([`POINTS_PER_FLANK`]), or one a cycle where the acceleration time has fewer cycles.
//!   The acceleration time is rounded to whole cycles.
//! * *The distance is met exactly* to the part of an increment that the raw speed counts. First the peak
//!   speed is chosen, never above the one that was asked for, then single points are raised by one raw unit,
//!   and the rest goes as one raw unit into cycles in the middle of the constant phase. Each point stays within
//!   one raw unit of the curve.
//! * *A distance too short for the full speed* gets a lower peak in the same acceleration time, held for a
//!   quarter of it, 4 cycles at least: as long as that rest may need.
//! * *Distance 0* has no points.

use super::units::{CYCLE_US, SpeedRange};
use alloc::vec::Vec;
use core::fmt;

/// How many points of support a flank has; the manual says "several" (ND21 13.5.3).
pub const POINTS_PER_FLANK: usize = 16;
/// The longest run in cycles: 120 minutes (ND21 13.5.3).
pub const MAX_CYCLES: u32 = 120 * 60 * (1_000_000 / 16) / (CYCLE_US / 16);
/// The greatest raw speed (ND21 14.5.3.2).
pub const MAX_SPEED: u16 = 0x7FFF;

/// 1 as a share of the peak speed.
const ONE: u64 = 1 << 30;
/// pi² in the same unit.
const PI_SQUARED: u64 = 10_597_407_032;
/// The peak speed is looked for in parts of this many bits of a raw unit.
const PEAK_BITS: u32 = 16;

/// A point of support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SupportPoint {
    /// The cycles of 432 us from the point before; 0 is a step of speed.
    pub cycles: u32,
    /// The speed at their end, without direction; raw (ND21 14.5.3.1).
    pub speed: u16,
}

impl SupportPoint {
    /// The bytes of a point on the wire `puffer`, drivebench's invention.
    pub const SIZE: usize = 6;

    /// The speed in a cycle before this point, 1 the first, with a constant acceleration from the speed
    /// `from` of the point before: that in the middle of the cycle, a half rounded up.
    ///
    /// Between these two speeds for every `cycle`.
    #[must_use]
    pub fn speed_in(self, from: u16, cycle: u32) -> u16 {
        let whole = 2 * u64::from(self.cycles);
        let done = (2 * u64::from(cycle)).saturating_sub(1).min(whole);
        let sum = u64::from(from) * (whole - done) + u64::from(self.speed) * done;
        let speed = (sum + whole / 2).checked_div(whole);
        speed.map_or(self.speed, |speed| u16::try_from(speed).unwrap_or(u16::MAX))
    }

    /// What the cycles before this point cover: the sum of their speeds.
    fn path(self, from: u16) -> u64 {
        (1..=self.cycles)
            .map(|cycle| u64::from(self.speed_in(from, cycle)))
            .sum()
    }

    /// The bytes on the wire `puffer`: the cycles as a double word, the speed as a word.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; Self::SIZE] {
        let [a, b, c, d] = self.cycles.to_be_bytes();
        let [high, low] = self.speed.to_be_bytes();
        [a, b, c, d, high, low]
    }

    /// The point of these bytes on the wire `puffer`.
    #[must_use]
    pub const fn from_bytes([a, b, c, d, high, low]: [u8; Self::SIZE]) -> Self {
        Self {
            cycles: u32::from_be_bytes([a, b, c, d]),
            speed: u16::from_be_bytes([high, low]),
        }
    }
}

/// What `SK_StatusPS` gives (ND21 13.5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// 0: the transmission has finished.
    Ready,
    /// 1: there is a stop; the drive waits for a start by hardware or software.
    Wait,
    /// 2: the positioning is in operation.
    Doing,
    /// 3: the positioning has finished.
    Done,
    /// FF: the drive was stopped or blocked.
    Stopped,
}

impl Status {
    /// The byte that `SK_StatusPS` gives.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Ready => 0,
            Self::Wait => 1,
            Self::Doing => 2,
            Self::Done => 3,
            Self::Stopped => 0xFF,
        }
    }
}

/// `Richtung` of `SK_StartPS` (ND21 13.5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// `+`.
    Positive,
    /// `-`.
    Negative,
}

/// Why there is no S-ramp for these figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SRampError {
    /// The speed is 0, or more than [`MAX_SPEED`].
    Speed(u16),
    /// The acceleration time is 0.
    NoAccelerationTime,
    /// The run would last this many cycles, more than [`MAX_CYCLES`].
    TooLong(u64),
}

impl fmt::Display for SRampError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Speed(speed) => write!(
                f,
                "a speed of {speed} is no speed of an S-ramp: 1 to {MAX_SPEED} expected (ND21 14.5.3)"
            ),
            Self::NoAccelerationTime => {
                f.write_str("an S-ramp needs an acceleration time of 1 to 255 ms (ND21 13.5.4)")
            }
            Self::TooLong(cycles) => {
                let seconds = cycles.saturating_mul(u64::from(CYCLE_US)) / 1_000_000;
                write!(
                    f,
                    "the S-ramp would last {seconds} s: at most 120 minutes expected (ND21 13.5.3)"
                )
            }
        }
    }
}

impl core::error::Error for SRampError {}

/// A run: the points of support from rest to rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SRamp {
    points: Vec<SupportPoint>,
}

impl SRamp {
    /// The most points that a run has: two flanks, and five of the constant phase.
    pub const MAX_POINTS: usize = 2 * POINTS_PER_FLANK + 5;

    /// The pre-calculation of `SK_WritePS` (ND21 13.5.4): the distance `Weg` in increments, 65536 a turn;
    /// the speed as a raw value of 14.5.3.1 (`Upm` is in rpm, E76); the acceleration time `Rampe` in ms.
    ///
    /// # Errors
    /// The speed or the acceleration time is none, or the run lasts longer than 120 minutes (ND21 13.5.3).
    pub fn new(
        distance: u32,
        speed: u16,
        range: SpeedRange,
        acceleration_ms: u8,
    ) -> Result<Self, SRampError> {
        if !(1..=MAX_SPEED).contains(&speed) {
            return Err(SRampError::Speed(speed));
        }
        if acceleration_ms == 0 {
            return Err(SRampError::NoAccelerationTime);
        }
        if distance == 0 {
            return Ok(Self { points: Vec::new() });
        }
        let flank = Flank::new((u32::from(acceleration_ms) * 1_000 + CYCLE_US / 2) / CYCLE_US);
        let path = u64::from(distance) * u64::from(range.parts());
        let speed = u64::from(speed);
        // One cycle more than the full speed needs, if it does not fit: the peak is then lower.
        let full = 2 * flank.path(&flank.speeds(speed << PEAK_BITS));
        let constant = path.saturating_sub(full).div_ceil(speed);
        let constant = constant.max(u64::from(flank.least_constant()));
        let cycles = 2 * u64::from(flank.cycles()) + constant;
        let too_long = SRampError::TooLong(cycles);
        if cycles > u64::from(MAX_CYCLES) {
            return Err(too_long);
        }
        let constant = u32::try_from(constant).map_err(|_| too_long)?;
        Ok(flank.run(path, speed << PEAK_BITS, constant))
    }

    /// The points of support, in their order in time; the last one has the speed 0.
    #[must_use]
    pub fn points(&self) -> &[SupportPoint] {
        &self.points
    }

    /// How long the run lasts, in cycles of 432 us.
    #[must_use]
    pub fn cycles(&self) -> u32 {
        self.points.iter().map(|point| point.cycles).sum()
    }
}

/// The acceleration: at which cycle each point stands, and its share of the peak speed. The points have the
/// numbers 1 to `count`; number 0 is rest.
struct Flank {
    count: usize,
    cycles: [u32; POINTS_PER_FLANK + 1],
    shares: [u64; POINTS_PER_FLANK + 1],
}

/// The speeds of the points of a flank.
type Speeds = [u16; POINTS_PER_FLANK + 1];

impl Flank {
    /// A flank of `cycles` cycles, at least 1.
    fn new(cycles: u32) -> Self {
        let mut flank = Self {
            count: 0,
            cycles: [0; POINTS_PER_FLANK + 1],
            shares: [0; POINTS_PER_FLANK + 1],
        };
        let count = cycles.min(POINTS_PER_FLANK as u32);
        let places = flank.cycles.iter_mut().zip(&mut flank.shares);
        for (i, (cycle, share)) in (0..=count).zip(places) {
            *cycle = i * cycles / count;
            *share = sine_squared(*cycle, cycles);
            flank.count = i as usize;
        }
        flank
    }

    fn cycles(&self) -> u32 {
        self.cycles[self.count]
    }

    /// How many cycles the constant phase has at least. To raise a point by one raises the speed of the
    /// cycles on both sides of it by one at most, on both flanks: four times the distance of two points.
    fn least_constant(&self) -> u32 {
        4 * self.cycles().div_ceil(self.count as u32)
    }

    /// The speeds with this peak, in parts of a raw unit, cut off.
    fn speeds(&self, peak: u64) -> Speeds {
        self.shares
            .map(|share| u16::try_from((peak * share / ONE) >> PEAK_BITS).unwrap_or(MAX_SPEED))
    }

    /// Point `i` with its cycles and speed in the acceleration.
    fn point(&self, speeds: &Speeds, i: usize) -> SupportPoint {
        SupportPoint {
            cycles: self.cycles[i] - self.cycles[i - 1],
            speed: speeds[i],
        }
    }

    /// What the flank covers with these speeds.
    fn path(&self, speeds: &Speeds) -> u64 {
        (1..=self.count)
            .map(|i| self.point(speeds, i).path(speeds[i - 1]))
            .sum()
    }

    /// The run that covers exactly `path` with a constant phase of `constant` cycles. With the peak `most` it
    /// covers `path` or more.
    fn run(&self, path: u64, most: u64, constant: u32) -> SRamp {
        let covered = |speeds: &Speeds| {
            2 * self.path(speeds) + u64::from(constant) * u64::from(speeds[self.count])
        };
        // The greatest peak that does not cover more.
        let (mut peak, mut above) = (0, most + 1);
        while above - peak > 1 {
            let middle = peak.midpoint(above);
            if covered(&self.speeds(middle)) <= path {
                peak = middle;
            } else {
                above = middle;
            }
        }
        let low = self.speeds(peak);
        let high = self.speeds(above.min(most));
        let base = low[self.count];
        let mut speeds = low;
        let mut rest = path - covered(&low);
        // The next peak raises some points and covers more; so some of them stay.
        for i in 1..=self.count {
            let mut raised = speeds;
            raised[i] = high[i];
            let more = 2 * (self.path(&raised) - self.path(&speeds));
            if more <= rest {
                speeds = raised;
                rest -= more;
            }
        }
        // Now the rest is less than the cycles of the constant phase: either a point stayed, which needs
        // more (`least_constant`), or all are raised and `constant` cycles at the next peak cover more.
        debug_assert!(rest < u64::from(constant), "{rest} of {constant}");
        let rest = u32::try_from(rest).map_or(constant, |rest| rest.min(constant));
        let (base, next) = ((constant - rest, base), (rest, base + 1));
        let phases = if speeds[self.count] == base.1 {
            [base, next]
        } else {
            [next, base]
        };
        self.assemble(&speeds, phases)
    }

    /// The points: acceleration, the constant phase at the peak with its middle at another speed, braking.
    fn assemble(&self, speeds: &Speeds, [outer, middle]: [(u32, u16); 2]) -> SRamp {
        let mut points = Vec::with_capacity(SRamp::MAX_POINTS);
        points.extend((1..=self.count).map(|i| self.point(speeds, i)));
        let mut constant = |(cycles, speed): (u32, u16), step: bool| {
            if step {
                points.push(SupportPoint { cycles: 0, speed });
            }
            if cycles != 0 {
                points.push(SupportPoint { cycles, speed });
            }
        };
        let (cycles, peak) = outer;
        if middle.0 == 0 {
            constant(outer, false);
        } else {
            constant((cycles / 2, peak), false);
            constant(middle, true);
            constant((cycles - cycles / 2, peak), true);
        }
        points.extend((1..=self.count).rev().map(|i| SupportPoint {
            speed: speeds[i - 1],
            ..self.point(speeds, i)
        }));
        SRamp { points }
    }
}

/// sin²(pi/2 x `part` / `whole`) in parts of [`ONE`], for a part from 0 to the whole, of at most 1024. In
/// integers, so that every machine makes the same points.
fn sine_squared(part: u32, whole: u32) -> u64 {
    let half = |part: u32| {
        let (part, whole) = (u64::from(part), u64::from(whole));
        let square = PI_SQUARED * part * part / (whole * whole);
        // (1 - cos y) / 2 = y²/4 (1 - y²/12 (1 - y²/30 ...)), up to y^16.
        let series = [240, 182, 132, 90, 56, 30, 12].iter();
        let sum = series.fold(ONE, |sum, factor| ONE - square * sum / ONE / factor);
        square * sum / ONE / 4
    };
    if 2 * part <= whole {
        half(part)
    } else {
        ONE - half(whole - part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    const RANGES: [SpeedRange; 2] = [SpeedRange::To8000, SpeedRange::To12000];

    /// The speeds, cycle by cycle.
    fn speeds(ramp: &SRamp) -> Vec<u16> {
        let mut from = 0;
        let mut speeds = Vec::new();
        for point in ramp.points() {
            speeds.extend((1..=point.cycles).map(|cycle| point.speed_in(from, cycle)));
            from = point.speed;
        }
        assert_eq!(from, 0);
        speeds
    }

    /// Runs short and long, slow and fast, with everything that 13.5 asks of each.
    fn check(distance: u32, speed: u16, range: SpeedRange, ms: u8) {
        let what = (distance, speed, range, ms);
        let ramp = SRamp::new(distance, speed, range, ms).unwrap();
        assert!(ramp.points().len() <= SRamp::MAX_POINTS, "{what:?}");
        let speeds = speeds(&ramp);
        assert_eq!(speeds.len(), ramp.cycles() as usize, "{what:?}");

        let covered: u64 = speeds.iter().map(|&speed| u64::from(speed)).sum();
        let parts = u64::from(range.parts());
        assert_eq!(covered, u64::from(distance) * parts, "{what:?}");
        assert!(speeds.iter().all(|&s| s <= speed), "{what:?}");

        // Braking mirrors the acceleration; the middle of the constant phase may lie a cycle beside.
        let mirrored = speeds.iter().rev();
        let apart = speeds.iter().zip(mirrored).map(|(&a, &b)| a.abs_diff(b));
        assert!(apart.clone().all(|apart| apart <= 1), "{what:?}");
        assert!(apart.map(u32::from).sum::<u32>() <= 4, "{what:?}");

        // Nothing jumps: from cycle to cycle no more than the steepest part of the curve, and rounding.
        let flank = Flank::new((u32::from(ms) * 1_000 + 216) / 432);
        let cycles = f64::from(flank.cycles());
        let peak = ramp.points()[flank.count - 1].speed;
        let steepest = core::f64::consts::FRAC_PI_2 * f64::from(peak) / cycles;
        let steps = speeds.windows(2).map(|pair| pair[0].abs_diff(pair[1]));
        assert!(
            steps.map(f64::from).all(|step| step <= steepest + 2.0),
            "{what:?}"
        );

        // Every point of the acceleration lies on the curve.
        let mut cycle = 0;
        for point in &ramp.points()[..flank.count] {
            cycle += point.cycles;
            let sine = (core::f64::consts::FRAC_PI_2 * f64::from(cycle) / cycles).sin();
            let curve = f64::from(peak) * sine * sine;
            let apart = (f64::from(point.speed) - curve).abs();
            assert!(apart < 1.0 + 1e-4, "{what:?}: {apart} in cycle {cycle}");
        }
        assert_eq!(cycle, flank.cycles());
    }

    /// 13.5.3: the distance is covered to the last increment, however short, with every ramp.
    #[test]
    fn distances_are_met() {
        for range in RANGES {
            for ms in [1, 2, 3, 6, 7, 8, 50, 254, 255] {
                for speed in [1, 2, 3, 100, 3_775, 30_199, MAX_SPEED] {
                    for distance in (1..40).chain([100, 1_000, 65_536, 100_003]) {
                        check(distance, speed, range, ms);
                    }
                }
            }
        }
        check(50_000_001, 30_199, SpeedRange::To8000, 255);
        check(50_000_001, MAX_SPEED, SpeedRange::To12000, 1);
    }

    /// The same of figures at random.
    #[test]
    fn distances_are_met_at_random() {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut random = |bits: u32| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state >> (64 - bits)
        };
        for _ in 0..3_000 {
            let speed = 1 + (random(15) % u64::from(MAX_SPEED)) as u16;
            // Up to some 30000 cycles at this speed.
            let bits = random(12) as u32;
            let distance = 1 + bits * u32::from(speed) + random(13) as u32;
            let ms = 1 + (random(8) % 255) as u8;
            check(
                if bits.is_multiple_of(2) {
                    distance
                } else {
                    distance % 50_000 + 1
                },
                speed,
                RANGES[random(1) as usize],
                ms,
            );
        }
    }

    /// A worked run: 10 turns at 3000 rpm with 100 ms. Exact figures, the same on every machine.
    #[test]
    fn a_run_of_ten_turns() {
        let ramp = SRamp::new(655_360, 11_325, SpeedRange::To8000, 100).unwrap();
        assert_eq!(ramp.points().len(), 37);
        // 100 ms are 231 cycles; 5242880 / 11325 are 463 of full speed, of which both flanks take half.
        assert_eq!(ramp.cycles(), 231 + 463);
        let flank: Vec<_> = ramp.points()[..16].iter().map(|p| p.speed).collect();
        let expected = [
            102, 405, 940, 1617, 2504, 3451, 4552, 5623, 6696, 7802, 8755, 9652, 10340, 10890,
            11207, 11324,
        ];
        assert_eq!(flank, expected);
    }

    /// 13.5.1: the peak acceleration of the sine-squared ramp is pi/2 times the mean one.
    #[test]
    fn peak_acceleration() {
        let ramp = SRamp::new(10_000_000, 30_000, SpeedRange::To8000, 255).unwrap();
        let (mut from, mut steepest) = (0, 0.0_f64);
        for point in &ramp.points()[..POINTS_PER_FLANK] {
            let slope = f64::from(point.speed - from) / f64::from(point.cycles);
            (from, steepest) = (point.speed, steepest.max(slope));
        }
        let mean = f64::from(from) / 590.0;
        let ratio = steepest / mean / core::f64::consts::FRAC_PI_2;
        // The chord of a sixteenth of the flank is a little flatter than the curve.
        assert!((0.985..=1.0).contains(&ratio), "{ratio}");
    }

    /// The series against the library's sine, to some units of its last bit.
    #[test]
    fn sine_squared_is_exact() {
        for whole in 1..=600 {
            for part in 0..=whole {
                let angle = core::f64::consts::FRAC_PI_2 * f64::from(part) / f64::from(whole);
                let share = sine_squared(part, whole) as f64 / ONE as f64;
                let apart = (share - angle.sin() * angle.sin()).abs();
                assert!(apart < 5e-9, "{part}/{whole}: {apart:e}");
            }
            assert_eq!(sine_squared(0, whole), 0);
            assert_eq!(sine_squared(whole, whole), ONE);
        }
    }

    /// 13.5.3: 120 minutes and no cycle more.
    #[test]
    fn the_longest_run() {
        assert_eq!(MAX_CYCLES, 16_666_666);
        // 8 raw units are an increment a cycle: each increment more lasts one cycle more.
        let run = |distance| SRamp::new(distance, 8, SpeedRange::To8000, 100);
        // The flanks of 231 cycles cover 203 increments: half of the speed, and what is cut off.
        let longest = MAX_CYCLES - 2 * 231 + 203;
        let cycles = run(longest).map(|ramp| ramp.cycles());
        assert_eq!(cycles, Ok(MAX_CYCLES));
        let too_long = SRampError::TooLong(u64::from(MAX_CYCLES) + 1);
        assert_eq!(run(longest + 1), Err(too_long));
        assert_eq!(
            run(u32::MAX).unwrap_err().to_string(),
            "the S-ramp would last 1855425 s: at most 120 minutes expected (ND21 13.5.3)"
        );
        assert!(SRamp::new(u32::MAX, 1, SpeedRange::To8000, 255).is_err());
        assert!(SRamp::new(u32::MAX, MAX_SPEED, SpeedRange::To12000, 1).is_ok());
    }

    #[test]
    fn no_speed_and_no_time() {
        let new = |speed, ms| SRamp::new(1, speed, SpeedRange::To8000, ms);
        for speed in [0, MAX_SPEED + 1, u16::MAX] {
            assert_eq!(new(speed, 1), Err(SRampError::Speed(speed)));
        }
        assert_eq!(new(1, 0), Err(SRampError::NoAccelerationTime));
        let nowhere = SRamp::new(0, 1, SpeedRange::To8000, 1).unwrap();
        assert_eq!((nowhere.points(), nowhere.cycles()), ([].as_slice(), 0));
    }

    /// No point of any content makes a panic or a speed that is not between its ends.
    #[test]
    fn speeds_of_any_point() {
        for cycles in [0, 1, 2, 7, u32::MAX] {
            for (from, speed) in [(0, u16::MAX), (u16::MAX, 0), (7, 7)] {
                let point = SupportPoint { cycles, speed };
                for cycle in [0, 1, 2, cycles, u32::MAX] {
                    let reached = point.speed_in(from, cycle);
                    assert!((from.min(speed)..=from.max(speed)).contains(&reached));
                }
                assert_eq!(SupportPoint::from_bytes(point.to_bytes()), point);
            }
        }
    }

    /// The five results of 13.5.4.
    #[test]
    fn codes_of_13_5_4() {
        use Status::*;
        let codes = [Ready, Wait, Doing, Done, Stopped].map(Status::code);
        assert_eq!(codes, [0, 1, 2, 3, 0xFF]);
    }
}
