//! A drive, right or with a known deviation, as one of the worlds of a conversation: which of what it says is compared, and how.
//!
//! What plant, sensors and inputs decide is not compared, or only within a band; nor is a register that reads something else at rest than
//! the model of the drive.

use super::held::{is_live, takes_writes};
use super::way::Way;
use harness_bench::qualify::worlds::RightDrive;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::words::{
    ERROR_TIME_OUT, ERRORS_NOT_READY, MODE_EVENT, MODE_LOCK, status,
};
use harness_proto::unitek::{Access, Register, Reply, Request};
use harness_sim::segment::Station as _;
use harness_sim::unitek::deviation::Deviant;
use harness_sim::unitek::{Cause, Control, Drive};
use std::collections::{BTreeSet, VecDeque};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

/// How far a speed may be off that of the model, which has no load: 2 % (our choice).
const SPEED_BAND: i64 = 655;

/// Registers of the speed, and of what decides whether it counts as standing.
const SPEEDS: [u8; 3] = [0x30, 0x32, 0xA8];

/// STATUS and ERROR_WARNING_MAP, of which the bits that are printed or field facts are compared (ex 10, dump).
const STATUS: u8 = 0x40;
const ERRORS: u8 = 0x8F;

/// Registers of the current, and how far one may be off that of the model: 2 % of 100 % (App 7; our choice).
const CURRENTS: [u8; 3] = [0x20, 0x27, 0x5F];
const CURRENT_BAND: i64 = 8;

/// Registers that never change but by a write, although they cannot be written over the bus: the firmware (1B) and the scale of the
/// current (App 7).
const CONSTANT: [u8; 2] = [0x1B, 0xD9];

/// What the drive makes of its inputs, its errors and its commands: ready, running, no fault, brake (ex 11, dump).
const LOGIC: [u8; 4] = [0xE2, 0xE3, 0xEF, 0xF2];

/// The position, and how far one may be off that of the model while the axis has not moved: 1 % of a turn (App 6; our choice).
const POSITION: u8 = 0x6D;
const PRESET: u8 = 0x7A;
const POSITION_BAND: i64 = 655;

/// Whether the position is in tolerance, the destination, and how far it may be off (ex 12).
const IN_TOLERANCE: u8 = 0xF4;
const DESTINATION: u8 = 0x6E;

/// The commands of speed, torque and position, and the start of homing (App 5).
const COMMANDS: [u8; 4] = [0x31, 0x90, DESTINATION, 0x78];
const WINDOW: u8 = 0x79;

/// What decides how fast an axis moves: rpm at 100 %, the limit, and the ramps in their lower halves (6.1, ex 11).
const FULL_SPEED: u8 = 0xC8;
const LIMIT: u8 = 0x34;
const RAMPS: [u8; 2] = [0x35, 0xED];

/// The scale of the speed, which is what C8 holds (App 7).
const SCALE: u8 = 0xCE;

/// Inputs and outputs in one register, and its bits for ready and running (App 7, UNITEK 4).
const IO: u8 = 0xD8;
const IO_LOGIC: u32 = 1 << 10 | 1 << 11;

/// The position error, which has the sign of the way that is left (dump).
const POSITION_ERROR: u8 = 0x70;

/// Inputs, in conversations in which none of them changes (UNITEK 4).
const INPUT: std::ops::RangeInclusive<u8> = 0xE4..=0xE8;

/// The oscilloscope, which may write its own registers.
const CAPTURE: std::ops::RangeInclusive<u8> = 0x10..=0x18;

/// Functions: what they read changes by their calls only (5.2, dump). READ and those of the oscilloscope are called by others.
const FUNCTIONS: [u8; 7] = [0x78, 0x83, 0x84, 0x85, 0x8E, 0xF9, 0xFA];

/// What a cell without a meaning reads (dump).
const UNASSIGNED: u32 = 0xFACE;

/// Bits of STATUS that say what the drive does (ex 8, ex 10); the others say what its inputs are, or are not printed.
const PRINTED: u32 =
    status::ENABLED | status::POSITION | status::SPEED | status::CALIBRATED | status::TOLERANCE;

/// The bits of STATUS that show inputs (ex 10-1).
const INPUTS: u32 = status::LIMIT_PLUS | status::LIMIT_MINUS | status::CONTINUOUS;

/// How a register is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tolerance {
    Bits(u32),
    Near(i64),
    Between(i64, i64),
}

/// A drive, right or with a known deviation.
#[derive(Clone, Debug)]
pub(crate) struct World {
    drive: Deviant,
    /// Registers that are not compared: they read something else at rest.
    unlike: Arc<BTreeSet<u8>>,
    /// Its axis has moved, and where it stands now depends on when it was told to.
    astray: bool,
    /// Whether its position is known: it was set in this conversation, by POS_PRESET (App 6) or by homing.
    placed: bool,
    /// Whether an input has changed at a time that is not known.
    disturbed: bool,
    /// Whether it was given a command while it was homing: what comes of that is open (ex 12).
    interrupted: bool,
    /// Whether a function was called in this conversation.
    called: bool,
    /// Whether its moves to positions are followed, and the one that it makes.
    follows: bool,
    way: Option<Way>,
    now: Instant,
    /// Whether it is known how long homing takes, and whether homing ran before the last step.
    homing: (bool, bool),
    /// What it sends now, and whether a request asked for it.
    said: VecDeque<(Frame, bool)>,
    /// Whether a request asked for what was taken last.
    asked: bool,
    /// A checksum of what its registers hold.
    held: u64,
}

impl World {
    /// Whether a register is compared in every state of a drive, and all of it.
    #[must_use]
    pub(crate) fn compares(number: u8) -> bool {
        let known =
            CONSTANT.contains(&number) || LOGIC.contains(&number) || SPEEDS.contains(&number);
        known || number == SCALE || is_parameter(number)
    }

    /// Whether a register is compared in some states at least, or some of it.
    #[must_use]
    pub(crate) fn compares_partly(number: u8) -> bool {
        [STATUS, ERRORS].contains(&number) || CURRENTS.contains(&number) || Self::compares(number)
    }

    /// A drive that stands, of which these registers are not compared. Its clock begins at the start.
    #[must_use]
    pub(crate) fn new(drive: Deviant, unlike: Arc<BTreeSet<u8>>, homing_is_known: bool) -> Self {
        Self {
            drive,
            unlike,
            astray: false,
            placed: false,
            disturbed: false,
            interrupted: false,
            called: false,
            follows: false,
            way: None,
            now: Instant::START,
            homing: (homing_is_known, false),
            said: VecDeque::new(),
            asked: false,
            held: 0,
        }
    }

    /// The same drive, of which an input changes at a time that is not known: what no input decides is compared.
    #[must_use]
    pub(crate) const fn disturbed(mut self) -> Self {
        self.disturbed = true;
        self
    }

    /// The same drive, whose moves to positions are followed.
    #[must_use]
    pub(crate) fn following(mut self) -> Self {
        let inputs = self.drive().inputs();
        self.follows = !(inputs.limit1 || inputs.limit2);
        self
    }

    /// The drive that is right but for its deviation.
    const fn drive(&self) -> &Drive {
        self.drive.drive()
    }

    fn speed(&self) -> i64 {
        Register::of(0x30).number_of(self.drive().register(0x30))
    }

    fn cell(&self, number: u8) -> u32 {
        self.drive().held()[usize::from(number)]
    }

    /// Takes what it wants to send by now.
    fn speak(&mut self, now: Instant) {
        while let Some((ready, frame)) = self.drive.wants()
            && ready <= now
        {
            let cause = self.drive().wants().map(|wish| wish.cause);
            self.said.push_back((frame, cause == Some(Cause::Asked)));
            self.drive.sent(now);
        }
        // At its end the axis stands where 72 says (ex 12).
        let homed = self.homing.1 && !self.drive().is_homing() && self.drive().is_enabled();
        self.placed |= homed;
        self.homing.1 = self.drive().is_homing();
        let travels = self.follow();
        self.astray = self.speed() != 0 && !travels || self.astray && !homed;
    }

    /// Where its axis stands, and where it is to go.
    fn places(&self) -> [i64; 2] {
        [self.drive().register(POSITION), self.cell(DESTINATION)]
            .map(|raw| i64::from(raw.cast_signed()))
    }

    /// Follows a move to a position. Returns whether all that moves is followed.
    fn follow(&mut self) -> bool {
        let [place, destination] = self.places();
        let drive = self.drive();
        let positions = drive.control() == Control::Position && drive.is_enabled();
        let travels = positions && !drive.is_homing() && self.follows && self.placed;
        match self.way {
            // It was given another destination, or none, on its way.
            Some(way) if !travels || way.destination() != destination => {
                self.way = None;
                self.astray = true;
            }
            Some(_) => {}
            None if travels && !self.astray && place != destination => {
                let scale = self.cell(FULL_SPEED);
                let limit = Register::of(LIMIT).number_of(self.cell(LIMIT)).abs();
                let ramps = RAMPS.map(|register| self.cell(register) & 0xFFFF);
                self.way = Some(Way::new([place, destination], scale, limit, ramps));
            }
            None => {}
        }
        travels && !self.astray
    }

    /// Between which positions its axis is.
    fn whereabouts(&self) -> (i64, i64) {
        let [place, _] = self.places();
        let slowest = self.way.map_or(place, |way| way.place());
        let between = (place.min(slowest), place.max(slowest));
        (between.0 - POSITION_BAND, between.1 + POSITION_BAND)
    }

    /// Whether it is certain that the position is in tolerance, or that it is not (79, ex 12).
    fn tolerance_is_certain(&self) -> bool {
        let [place, destination] = self.places();
        let positions = self.drive().control() == Control::Position;
        let (least, most) = self.whereabouts();
        let window = i64::from(self.cell(WINDOW) & 0xFFFF);
        let inside = destination - window <= least && most <= destination + window;
        let outside = most < destination - window || destination + window < least;
        let arrived = self.way.is_none() && place == destination;
        !self.astray && (!positions || arrived || inside || outside)
    }

    /// Between which numbers the position error is on the way: what commands the axis is at its destination or lags behind.
    fn error_on_its_way(&self) -> Option<Tolerance> {
        self.way?;
        let [_, destination] = self.places();
        let (least, most) = self.whereabouts();
        let (below, above) = (destination - most, destination - least);
        Some(Tolerance::Between(
            below.min(0) - POSITION_BAND,
            above.max(0) + POSITION_BAND,
        ))
    }

    /// How a register is compared; `None` if it is not.
    fn compared(&self, number: u8) -> Option<Tolerance> {
        let positions = self.drive().control() == Control::Position;
        // Whether a position is in tolerance where nothing asks for one is our choice.
        let unlike = self.unlike.contains(&number);
        if unlike && !(number == IN_TOLERANCE && positions) {
            return None;
        }
        if self.disturbed {
            return match number {
                ERRORS => Some(Tolerance::Bits(ERROR_TIME_OUT)),
                _ if CONSTANT.contains(&number) || number == SCALE || is_parameter(number) => {
                    Some(Tolerance::Bits(!0))
                }
                _ => None,
            };
        }
        let followed = self.follows && self.placed && !self.astray;
        let moves = positions && !self.drive().is_homing() && !followed;
        let speed = |way: Way| {
            let (least, most) = way.speeds();
            Tolerance::Between(least - SPEED_BAND, most + SPEED_BAND)
        };
        match number {
            _ if CONSTANT.contains(&number)
                || LOGIC.contains(&number)
                || INPUT.contains(&number) =>
            {
                Some(Tolerance::Bits(!0))
            }
            _ if SPEEDS.contains(&number) && !moves => {
                let near = Tolerance::Near(SPEED_BAND);
                Some(self.way.map_or(near, speed))
            }
            _ if CURRENTS.contains(&number) && self.drive().control() == Control::Torque => {
                Some(Tolerance::Near(CURRENT_BAND))
            }
            SCALE => Some(Tolerance::Bits(!0)),
            _ if FUNCTIONS.contains(&number) && !self.called => Some(Tolerance::Bits(!0)),
            IO => Some(Tolerance::Bits(IO_LOGIC)),
            POSITION if self.placed && !self.astray => {
                let (least, most) = self.whereabouts();
                Some(Tolerance::Between(least, most))
            }
            POSITION_ERROR => self.error_on_its_way(),
            IN_TOLERANCE if self.tolerance_is_certain() => Some(Tolerance::Bits(!0)),
            // The speed alone decides it.
            0xF5 if self.way.is_none() && (self.speed().abs() - 328).abs() > SPEED_BAND => {
                Some(Tolerance::Bits(!0))
            }
            STATUS => Some(Tolerance::Bits(match self.tolerance_is_certain() {
                true => PRINTED,
                false => PRINTED & !status::TOLERANCE,
            })),
            ERRORS => Some(Tolerance::Bits(ERRORS_NOT_READY)),
            _ if is_parameter(number) => Some(Tolerance::Bits(!0)),
            _ => None,
        }
    }
}

/// Whether a register holds what was written to it, and nothing else changes it.
fn is_parameter(number: u8) -> bool {
    let register = Register::of(number);
    let other = CAPTURE.contains(&number) || is_live(number) || register.dump == UNASSIGNED;
    takes_writes(register) && !other
}

impl RightDrive for World {
    type Piece = Frame;
    const SCAN: Span = Span::from_millis(1);

    fn due(&self) -> Option<Instant> {
        let waits = self.drive.wants().map(|wish| wish.0);
        let scan = self.drive.next_action();
        let way = self.way.map(|_| self.now + Self::SCAN);
        [waits, scan, way].into_iter().flatten().min()
    }

    fn advance(&mut self, to: Instant) {
        self.drive.advance(to);
        let scans = to.since(self.now).units() / Self::SCAN.units();
        self.now += Self::SCAN * scans;
        if let Some(way) = &mut self.way {
            (0..scans).for_each(|_| way.step());
        }
        self.speak(to);
        // The slowest drive has arrived, too.
        self.way = self.way.filter(|way| way.place() != way.destination());
    }

    fn hear(&mut self, at: Instant, piece: &Frame) {
        let rx = self.drive().identifiers().0;
        let request = Request::decode(piece, rx, Dlc4::As3);
        let homed = self.drive().is_homing();
        self.drive.hear(at, piece);
        if let Ok(Request::Write { register, .. }) = request {
            self.interrupted |= homed && COMMANDS.contains(&register);
            self.called |= Register::of(register).access == Access::FN;
            if register == PRESET {
                self.placed = true;
                self.astray = self.speed() != 0;
            }
        }
        self.speak(at);
        let mut held = DefaultHasher::new();
        self.drive().held().hash(&mut held);
        self.held = held.finish();
    }

    fn say(&mut self) -> Option<Frame> {
        let (frame, asked) = self.said.pop_front()?;
        self.asked = asked;
        Some(frame)
    }

    fn may_wait(&self) -> bool {
        self.asked
    }

    fn is(&self, said: &Frame, came: &Frame) -> bool {
        let head = |frame: &Frame| {
            (
                frame.id(),
                frame.is_remote(),
                frame.dlc(),
                frame.data().first().copied(),
            )
        };
        if head(said) != head(came) {
            return false;
        }
        let id = |frame: &Frame| u16::try_from(frame.id().number()).unwrap_or(0);
        let reply = |frame: &Frame| Reply::decode(frame, id(frame));
        let (Ok(said), Ok(came)) = (reply(said), reply(came)) else {
            return false;
        };
        let known = Register::of(said.register).mask();
        match self.compared(said.register) {
            None => true,
            Some(Tolerance::Bits(mask)) => {
                (said.data.bits() ^ came.data.bits()) & mask & known == 0
            }
            Some(Tolerance::Near(band)) => (said.number() - came.number()).abs() <= band,
            Some(Tolerance::Between(least, most)) => (least..=most).contains(&came.number()),
        }
    }

    /// False where events or the way to a position depend on what is not known.
    fn knows(&self) -> bool {
        let mode = self.cell(0x51);
        let events = mode & u32::from(MODE_EVENT) != 0;
        let chosen = self.cell(0x52);
        let shown = PRINTED | INPUTS;
        let moves = self.astray || self.way.is_some();
        let unknown = chosen & !shown != 0
            || moves && chosen & status::TOLERANCE != 0
            || self.disturbed && chosen != 0;
        let locked = mode & u32::from(MODE_LOCK) != 0;
        let homes = self.drive().is_homing();
        let travels = self.drive().control() == Control::Position && self.astray && !locked;
        let homing = homes && !self.homing.0 || self.interrupted;
        !(events && unknown || travels && !homes || homing)
    }

    fn state(&self) -> u64 {
        let place = (!self.astray).then(|| self.drive().register(0x6D));
        let place = place.map_or(1, |position| u64::from(position) << 1);
        // The destination alone changes without a frame, at the end of homing.
        let place = place ^ u64::from(self.cell(0x6E)) << 31;
        self.drive.state()
            ^ self.held
            ^ u64::from(self.placed)
            ^ u64::from(self.interrupted) << 1
            ^ place.wrapping_mul(0x9E37_79B9_7F4A_7C15)
            ^ self.way.map_or(0, |way| way.state())
    }
}
