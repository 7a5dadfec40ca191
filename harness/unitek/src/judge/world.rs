//! A drive, right or with a known deviation, as one of the worlds of a conversation: which of what it says is compared, and how.
//!
//! What plant, sensors and inputs decide is not compared, or only within a band; nor is a register that reads something else at rest than
//! the model of the drive.

use super::held::{is_live, takes_writes};
use harness_bench::qualify::worlds::RightDrive;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::words::{ERRORS_NOT_READY, MODE_EVENT, MODE_LOCK, status};
use harness_proto::unitek::{Register, Reply, Request};
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

/// Whether the position is in tolerance (ex 12).
const IN_TOLERANCE: u8 = 0xF4;

/// The scale of the speed, which is what C8 holds (App 7).
const SCALE: u8 = 0xCE;

/// Inputs, in conversations in which none of them changes (UNITEK 4).
const INPUT: std::ops::RangeInclusive<u8> = 0xE4..=0xE8;

/// The oscilloscope, which may write its own registers.
const CAPTURE: std::ops::RangeInclusive<u8> = 0x10..=0x18;

/// What a cell without a meaning reads (dump).
const UNASSIGNED: u32 = 0xFACE;

/// Bits of STATUS that say what the drive does (ex 8, ex 10); the others say what its inputs are, or are not printed.
const PRINTED: u32 =
    status::ENABLED | status::POSITION | status::SPEED | status::CALIBRATED | status::TOLERANCE;

/// The bits of STATUS that show inputs (ex 10-1).
const INPUTS: u32 = status::LIMIT_PLUS | status::LIMIT_MINUS | status::CONTINUOUS;

/// How a register is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compared {
    /// These bits.
    Bits(u32),
    /// Within a band.
    Near(i64),
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
        known || is_parameter(number)
    }

    /// A drive that stands, of which these registers are not compared. Its clock begins at the start.
    #[must_use]
    pub(crate) fn new(drive: Deviant, unlike: Arc<BTreeSet<u8>>, homing_is_known: bool) -> Self {
        Self {
            drive,
            unlike,
            astray: false,
            placed: false,
            homing: (homing_is_known, false),
            said: VecDeque::new(),
            asked: false,
            held: 0,
        }
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
            let cause = self.drive().wants().map(|own| own.cause);
            self.said.push_back((frame, cause == Some(Cause::Asked)));
            self.drive.sent(now);
        }
        // At its end the axis stands where 72 says (ex 12).
        let homed = self.homing.1 && !self.drive().is_homing() && self.drive().is_enabled();
        self.placed |= homed;
        self.homing.1 = self.drive().is_homing();
        self.astray = self.speed() != 0 || self.astray && !homed;
    }

    /// How a register is compared; `None` if it is not.
    fn compared(&self, number: u8) -> Option<Compared> {
        if self.unlike.contains(&number) {
            return None;
        }
        let moves = self.drive().control() == Control::Position && !self.drive().is_homing();
        match number {
            own if CONSTANT.contains(&own) || LOGIC.contains(&own) || INPUT.contains(&own) => {
                Some(Compared::Bits(!0))
            }
            own if SPEEDS.contains(&own) && !moves => Some(Compared::Near(SPEED_BAND)),
            own if CURRENTS.contains(&own) && self.drive().control() == Control::Torque => {
                Some(Compared::Near(CURRENT_BAND))
            }
            SCALE => Some(Compared::Bits(!0)),
            POSITION if self.placed && !self.astray => Some(Compared::Near(POSITION_BAND)),
            IN_TOLERANCE if !self.astray && !moves => Some(Compared::Bits(!0)),
            // The speed alone decides it.
            0xF5 if (self.speed().abs() - 328).abs() > SPEED_BAND => Some(Compared::Bits(!0)),
            0x40 => Some(Compared::Bits(match self.astray {
                true => PRINTED & !status::TOLERANCE,
                false => PRINTED,
            })),
            0x8F => Some(Compared::Bits(ERRORS_NOT_READY)),
            own if is_parameter(own) => Some(Compared::Bits(!0)),
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
        let waits = self.drive.wants().map(|own| own.0);
        let scan = self.drive.next_action();
        [waits, scan].into_iter().flatten().min()
    }

    fn advance(&mut self, to: Instant) {
        self.drive.advance(to);
        self.speak(to);
    }

    fn hear(&mut self, at: Instant, piece: &Frame) {
        let rx = self.drive().identifiers().0;
        let request = Request::decode(piece, rx, Dlc4::As3);
        self.placed |= matches!(request, Ok(Request::Write { register, .. }) if register == PRESET);
        self.drive.hear(at, piece);
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
        let head = |own: &Frame| {
            (
                own.id(),
                own.is_remote(),
                own.dlc(),
                own.data().first().copied(),
            )
        };
        if head(said) != head(came) {
            return false;
        }
        let reply = |own: &Frame| Reply::decode(own, u16::try_from(own.id().number()).unwrap_or(0));
        let (Ok(said), Ok(came)) = (reply(said), reply(came)) else {
            return false;
        };
        let known = Register::of(said.register).mask();
        match self.compared(said.register) {
            None => true,
            Some(Compared::Bits(mask)) => (said.data.bits() ^ came.data.bits()) & mask & known == 0,
            Some(Compared::Near(band)) => (said.number() - came.number()).abs() <= band,
        }
    }

    /// One whose events or whose way to a position depend on what is not known.
    fn knows(&self) -> bool {
        let mode = self.cell(0x51);
        let events = mode & u32::from(MODE_EVENT) != 0;
        let chosen = self.cell(0x52);
        let shown = PRINTED | INPUTS;
        let unknown = chosen & !shown != 0 || self.astray && chosen & status::TOLERANCE != 0;
        let locked = mode & u32::from(MODE_LOCK) != 0;
        let homes = self.drive().is_homing();
        let travels = self.drive().control() == Control::Position && self.astray && !locked;
        !(events && unknown || travels && !homes || homes && !self.homing.0)
    }

    fn state(&self) -> u64 {
        let place = (!self.astray).then(|| self.drive().register(0x6D));
        let place = place.map_or(1, |own| u64::from(own) << 1);
        // The destination alone changes without a frame, at the end of homing.
        let place = place ^ u64::from(self.cell(0x6E)) << 31;
        self.drive.state()
            ^ self.held
            ^ u64::from(self.placed)
            ^ place.wrapping_mul(0x9E37_79B9_7F4A_7C15)
    }
}
