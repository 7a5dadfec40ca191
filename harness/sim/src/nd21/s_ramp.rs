//! Positioning with the sine-squared ramp in the drive (ND21 13.5): it follows points of support that the PC
//! has calculated ([`harness_proto::nd21::s_ramp`]).
//!
//! What the manual leaves open, and what is chosen here:
//!
//! * *Before the first transmission* the status is done (3): nothing is to be positioned, and none of the five
//!   results (13.5.4) says that nothing has come. A start is then not taken.
//! * *A block or an error before the start* gives stopped (FF) and the start is forgotten; only a stop makes
//!   it wait (1). So an error that is confirmed never sets a motor in motion.
//! * *Stop, block or error during the run* give stopped (FF), and the rest of the distance is dropped: "the
//!   following distances are done from this position" (13.5.3). The next start covers the whole distance.
//! * *While a run is going on* neither a start nor a transmission is taken. A transmission while the drive
//!   waits takes the place of what waits, and needs a start of its own.
//! * *The speed after the last cycle* is not the run's business: it ends with the speed 0.
//!
//! # How the points come to the drive: `s-ramp-wire`
//!
//! 13.5.3 says that the driver NOVOBUS.LIB sends the points, and not to which cells. This is the open property
//! `s-ramp-wire` ([`SRampWire`]):
//!
//! * `none`, the default: the drive offers no cells for it. A run is loaded and started beside the bus
//!   ([`SRampRun::load`], [`SRampRun::start`]).
//! * `puffer`: *an invention for testing drivebench, which no ND21 knows.* It borrows cells that exist, with
//!   the meaning of 13.3.1 for the bits of `ps_status`, and only where bit 2 of `SwVersion2` is 0 (13.5.2,
//!   E74):
//!
//!   1. The PC writes the points to `scope_puffer`, 6 bytes each from FDA0 on: the cycles as a double word,
//!      the speed at their end as a word ([`SupportPoint::to_bytes`]); at most 42.
//!   2. It writes their number to `ps_umdrehung` (FF48), as a word.
//!   3. It sets bit 6 of `ps_status` (FF43). In its next cycle the drive takes the points over and clears
//!      bit 6; bit 5 is then 1 if they were good, and the oscilloscope can have its buffer back. The
//!      status is ready (0), or FF where they were not. While a run is going on bit 6 stays 1 until its end.
//!   4. It sets bit 4, with the direction in bit 7 (1 is negative). The drive clears bit 4 and starts; again
//!      for the same distance.
//!   5. `ps_impuls` (FF4A) has the status as a word, 0000 to 0003 or 00FF. Bit 0 of `ps_status` is 1 in done.
//!
//! # How it is wired into the drive
//!
//! Every 432 us, after the mode is known: with the wire `puffer` and bit 2 of `SwVersion2` = 0 first
//! [`SRampRun::serve`]; then, with both wires, [`SRampRun::cycle`], whose speed takes the place of every other
//! nominal value and is not led through the ramp generator. At reset and power-up the run is a new one.

use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::ps_status::{CALCULATE, CALCULATED, FINISHED, NEGATIVE, START};
use harness_proto::nd21::ram;
use harness_proto::nd21::s_ramp::{Direction, MAX_CYCLES, MAX_SPEED, Status, SupportPoint};

/// The property `s-ramp-wire` (ND21 13.5.3): how the points come to the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SRampWire {
    /// The drive offers no cells for it.
    #[default]
    None,
    /// Through `scope_puffer`: an invention for testing drivebench.
    Puffer,
}

/// Why points from the wire `puffer` are rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BadPoints {
    /// More points than `scope_puffer` holds.
    Count(u16),
    /// A speed is more than H'7FFF (ND21 14.5.3.2).
    Speed(u16),
    /// The last speed is not 0.
    NotAtRest(u16),
    /// They last longer than 120 minutes (ND21 13.5.3).
    TooLong(u64),
}

/// The size of `scope_puffer` (ND21 14.2.1).
const PUFFER_SIZE: usize = 256;
/// How many points it holds.
const PUFFER_POINTS: usize = PUFFER_SIZE / SupportPoint::SIZE;

/// The points on the wire `puffer`.
pub(super) fn read_points(cells: &Cells) -> Result<Vec<SupportPoint>, BadPoints> {
    let count = cells.word(ram::PS_UMDREHUNG);
    if usize::from(count) > PUFFER_POINTS {
        return Err(BadPoints::Count(count));
    }
    let points: Vec<_> = (0..count)
        .map(|i| ram::SCOPE_PUFFER + i * SupportPoint::SIZE as u16)
        .map(|first| {
            let bytes = std::array::from_fn(|offset| cells.byte(first + offset as u16));
            SupportPoint::from_bytes(bytes)
        })
        .collect();
    if let Some(fast) = points.iter().find(|point| point.speed > MAX_SPEED) {
        return Err(BadPoints::Speed(fast.speed));
    }
    if let Some(last) = points.last().filter(|last| last.speed != 0) {
        return Err(BadPoints::NotAtRest(last.speed));
    }
    let cycles = points.iter().map(|point| u64::from(point.cycles)).sum();
    if cycles > u64::from(MAX_CYCLES) {
        return Err(BadPoints::TooLong(cycles));
    }
    Ok(points)
}

/// The S-ramp in the drive.
#[derive(Clone, Debug)]
pub(super) struct SRampRun {
    /// The points of the last transmission; they stay for further starts.
    points: Option<Vec<SupportPoint>>,
    status: Status,
    direction: Direction,
    /// The speed at the point before, which point comes next, and how many of its cycles are done.
    from: u16,
    next: usize,
    done: u32,
}

impl Default for SRampRun {
    /// As after power-up and reset.
    fn default() -> Self {
        Self {
            points: None,
            status: Status::Done,
            direction: Direction::Positive,
            from: 0,
            next: 0,
            done: 0,
        }
    }
}

impl SRampRun {
    /// What `SK_StatusPS` gives (ND21 13.5.4).
    pub(super) fn status(&self) -> Status {
        self.status
    }

    /// The end of a transmission (`SK_WritePS`, ND21 13.5.4); false, and nothing taken, during a run.
    pub(super) fn load(&mut self, points: Vec<SupportPoint>) -> bool {
        if self.status == Status::Doing {
            return false;
        }
        self.points = Some(points);
        self.status = Status::Ready;
        true
    }

    /// `SK_StartPS` (ND21 13.5.3). "With same distances the points of support are not to be calculated
    /// again": they are followed from the first one.
    pub(super) fn start(&mut self, direction: Direction, mode: Mode) {
        if self.status == Status::Doing || self.points.is_none() {
            return;
        }
        self.direction = direction;
        (self.from, self.next, self.done) = (0, 0, 0);
        self.status = match mode {
            Mode::Go => Status::Doing,
            Mode::Stop => Status::Wait,
            Mode::Reset | Mode::Error | Mode::Block => Status::Stopped,
        };
    }

    /// 432 us: the speed to follow in this cycle, with its sign, as a raw value (ND21 14.5.3.1); `None` where
    /// there is no run.
    pub(super) fn cycle(&mut self, mode: Mode) -> Option<i32> {
        match (self.status, mode) {
            (Status::Doing, Mode::Go) => {}
            (Status::Wait, Mode::Go) => self.status = Status::Doing,
            (Status::Wait, Mode::Stop) => return None,
            (Status::Doing | Status::Wait, _) => {
                self.status = Status::Stopped;
                return None;
            }
            _ => return None,
        }
        let speed = self.advance();
        if speed.is_none() {
            self.status = Status::Done;
        }
        speed
    }

    fn advance(&mut self) -> Option<i32> {
        loop {
            let point = *self.points.as_ref()?.get(self.next)?;
            if self.done < point.cycles {
                self.done += 1;
                let speed = i32::from(point.speed_in(self.from, self.done));
                return Some(match self.direction {
                    Direction::Positive => speed,
                    Direction::Negative => -speed,
                });
            }
            (self.from, self.done) = (point.speed, 0);
            self.next += 1;
        }
    }

    /// 432 us of the wire `puffer`: does what the bits of `ps_status` ask for, and shows the status.
    pub(super) fn serve(&mut self, mode: Mode, cells: &mut Cells) {
        let asked = cells.byte(ram::PS_STATUS);
        if asked & CALCULATE != 0 && self.status != Status::Doing {
            let good = match read_points(cells) {
                Ok(points) => self.load(points),
                Err(_) => {
                    self.points = None;
                    self.status = Status::Stopped;
                    false
                }
            };
            cells.set_bits(ram::PS_STATUS, CALCULATE, false);
            cells.set_bits(ram::PS_STATUS, CALCULATED, good);
        }
        if asked & START != 0 {
            let direction = if asked & NEGATIVE != 0 {
                Direction::Negative
            } else {
                Direction::Positive
            };
            self.start(direction, mode);
            cells.set_bits(ram::PS_STATUS, START, false);
        }
        cells.set_bits(ram::PS_STATUS, FINISHED, self.status == Status::Done);
        cells.put_word(ram::PS_IMPULS, u16::from(self.status.code()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::nd21::s_ramp::SRamp;
    use harness_proto::nd21::units::SpeedRange;

    fn points(distance: u32) -> Vec<SupportPoint> {
        let ramp = SRamp::new(distance, 3_775, SpeedRange::To8000, 20).unwrap();
        ramp.points().to_vec()
    }

    fn loaded(distance: u32) -> SRampRun {
        let mut run = SRampRun::default();
        assert!(run.load(points(distance)));
        run
    }

    /// Lets it run to its end; the sum of the speeds.
    fn finish(run: &mut SRampRun) -> i32 {
        let path = std::iter::from_fn(|| run.cycle(Mode::Go)).sum();
        assert_eq!(run.status(), Status::Done);
        path
    }

    /// 13.5.3: ready, doing, done; and the same distance again without another transmission, in the
    /// direction of each start.
    #[test]
    fn a_run_and_the_same_again() {
        let mut run = loaded(100_003);
        assert_eq!((run.status(), run.cycle(Mode::Go)), (Status::Ready, None));
        for direction in [
            Direction::Positive,
            Direction::Negative,
            Direction::Positive,
        ] {
            run.start(direction, Mode::Go);
            assert_eq!(run.status(), Status::Doing);
            let sign = if direction == Direction::Positive {
                1
            } else {
                -1
            };
            assert_eq!(finish(&mut run), sign * 8 * 100_003);
            assert_eq!(run.cycle(Mode::Go), None);
        }
    }

    /// The last cycle is still doing; done comes when the target is reached (13.5.3). Every cycle of the
    /// points is one of the run.
    #[test]
    fn cycles_of_a_run() {
        let ramp = SRamp::new(1, 1, SpeedRange::To8000, 1).unwrap();
        let mut run = SRampRun::default();
        assert!(run.load(ramp.points().to_vec()));
        run.start(Direction::Positive, Mode::Go);
        for _ in 0..ramp.cycles() {
            assert!(run.cycle(Mode::Go).is_some());
            assert_eq!(run.status(), Status::Doing);
        }
        assert_eq!(run.cycle(Mode::Go), None);
        assert_eq!(run.status(), Status::Done);
    }

    /// 13.5.3: a stop before the start makes it wait.
    #[test]
    fn wait() {
        let mut run = loaded(1_000);
        run.start(Direction::Positive, Mode::Stop);
        for _ in 0..3 {
            assert_eq!(run.status(), Status::Wait);
            assert_eq!(run.cycle(Mode::Stop), None);
        }
        assert_eq!(finish(&mut run), 8_000);
    }

    /// 13.5.3: stop and block end a run; the next start covers the whole distance from there.
    #[test]
    fn stopped() {
        for mode in [Mode::Stop, Mode::Block, Mode::Error, Mode::Reset] {
            let mut run = loaded(1_000);
            run.start(Direction::Positive, Mode::Go);
            assert!(run.cycle(Mode::Go).is_some());
            assert_eq!(run.cycle(mode), None);
            assert_eq!((run.status(), run.status().code()), (Status::Stopped, 0xFF));
            assert_eq!(run.cycle(Mode::Go), None);
            run.start(Direction::Negative, Mode::Go);
            assert_eq!(finish(&mut run), -8_000);
        }
    }

    /// The choices: block and error forget a start; a run is not disturbed; nothing is done before the first
    /// transmission.
    #[test]
    fn choices() {
        for mode in [Mode::Block, Mode::Error, Mode::Reset] {
            let mut run = loaded(1_000);
            run.start(Direction::Positive, mode);
            assert_eq!(run.status(), Status::Stopped);
            run.start(Direction::Positive, Mode::Stop);
            assert_eq!(run.cycle(mode), None);
            assert_eq!(run.cycle(Mode::Go), None);
            assert_eq!(run.status(), Status::Stopped);
        }
        let mut run = loaded(1_000);
        run.start(Direction::Positive, Mode::Go);
        let first = run.cycle(Mode::Go).unwrap();
        run.start(Direction::Negative, Mode::Go);
        assert!(!run.load(points(1)));
        assert_eq!(first + finish(&mut run), 8_000);

        let mut run = SRampRun::default();
        run.start(Direction::Positive, Mode::Go);
        assert_eq!((run.status(), run.cycle(Mode::Go)), (Status::Done, None));
        assert!(run.load(Vec::new()));
        run.start(Direction::Positive, Mode::Go);
        assert_eq!(finish(&mut run), 0);
    }

    /// The points in the cells, as the PC writes them.
    fn write_points(cells: &mut Cells, points: &[SupportPoint]) {
        let bytes = points.iter().flat_map(|point| point.to_bytes());
        (ram::SCOPE_PUFFER..)
            .zip(bytes)
            .for_each(|(address, byte)| cells.put(address, byte));
        cells.put_word(ram::PS_UMDREHUNG, points.len() as u16);
    }

    /// The wire `puffer`, step by step as the head of this file says.
    #[test]
    fn wire_puffer() {
        const { assert!(PUFFER_POINTS >= SRamp::MAX_POINTS) };
        let mut cells = Cells::with_eeprom([0; 256]);
        let mut run = SRampRun::default();
        let shown = |cells: &Cells| (cells.byte(ram::PS_STATUS), cells.word(ram::PS_IMPULS));
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x01, 3));

        write_points(&mut cells, &points(100_003));
        cells.put(ram::PS_STATUS, 0x40);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x20, 0));

        // The oscilloscope may have its buffer back.
        (0xFDA0..=0xFE9F).for_each(|address| cells.put(address, 0xFF));
        cells.put(ram::PS_STATUS, 0x90);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x80, 2));
        let first = run.cycle(Mode::Go).unwrap();
        // Not taken before the end of the run.
        write_points(&mut cells, &points(500));
        cells.put(ram::PS_STATUS, 0x40);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x40, 2));
        assert_eq!(first + finish(&mut run), -8 * 100_003);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x20, 0));

        cells.put(ram::PS_STATUS, 0x10);
        run.serve(Mode::Stop, &mut cells);
        assert_eq!(shown(&cells), (0x00, 1));
        assert_eq!(finish(&mut run), 4_000);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x01, 3));

        // Points that are not good.
        cells.put_word(ram::PS_UMDREHUNG, 43);
        cells.put(ram::PS_STATUS, 0x50);
        run.serve(Mode::Go, &mut cells);
        assert_eq!(shown(&cells), (0x00, 0xFF));
        assert_eq!(run.cycle(Mode::Go), None);
    }

    #[test]
    fn points_that_are_not_good() {
        let mut cells = Cells::with_eeprom([0; 256]);
        let point = |cycles, speed| SupportPoint { cycles, speed };
        let rest = point(1, 0);
        for (points, expected) in [
            ([point(1, 0x8000), rest], BadPoints::Speed(0x8000)),
            ([rest, point(1, 1)], BadPoints::NotAtRest(1)),
            (
                [point(MAX_CYCLES, 1), rest],
                BadPoints::TooLong(u64::from(MAX_CYCLES) + 1),
            ),
            (
                [point(u32::MAX, 1), point(u32::MAX, 0)],
                BadPoints::TooLong(2 * u64::from(u32::MAX)),
            ),
        ] {
            write_points(&mut cells, &points);
            assert_eq!(read_points(&cells), Err(expected));
        }
        let good = [point(0, MAX_SPEED), point(MAX_CYCLES, 0)];
        write_points(&mut cells, &good);
        assert_eq!(read_points(&cells), Ok(good.to_vec()));
        for count in [43, 0x100, 0xFFFF] {
            cells.put_word(ram::PS_UMDREHUNG, count);
            assert_eq!(read_points(&cells), Err(BadPoints::Count(count)));
        }
        cells.put_word(ram::PS_UMDREHUNG, 0);
        assert_eq!(read_points(&cells), Ok(Vec::new()));
    }

    /// Whatever the cells hold, no panic, and no other cells are touched than `ps_status` and `ps_impuls`.
    #[test]
    fn any_cells() {
        let mut state = 0x2545_F491_4F6C_DD1D_u64;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let modes = Mode::NAMES.map(|(_, mode)| mode);
        let mut cells = Cells::with_eeprom([0; 256]);
        let mut run = SRampRun::default();
        let mut driven = 0;
        for n in 0..100_000 {
            let word = random();
            // Short points in most of the cells, so that many are good; any byte at times.
            let offset = (word % 252) as u16;
            let low = [3, 5].contains(&(offset % SupportPoint::SIZE as u16)) && word >> 62 != 0;
            let byte = (word >> 8) as u8;
            let byte = if low || n % 50 == 0 { byte } else { 0 };
            cells.put(ram::SCOPE_PUFFER + offset, byte);
            cells.put(ram::PS_STATUS, (word >> 16) as u8);
            cells.put_word(ram::PS_UMDREHUNG, (word >> 24) as u16 % 45);
            let mode = modes[((word >> 40) as usize % 32).min(modes.len() - 1)];
            let before = cells.clone();
            run.serve(mode, &mut cells);
            let speed = run.cycle(mode).unwrap_or_default().unsigned_abs();
            assert!(speed <= u32::from(MAX_SPEED));
            driven += u32::from(speed != 0);
            let mut allowed = before;
            for cell in [ram::PS_STATUS, ram::PS_IMPULS, ram::PS_IMPULS + 1] {
                allowed.put(cell, cells.byte(cell));
            }
            assert_eq!(cells, allowed);
        }
        assert!(driven > 100, "{driven}");
    }
}
