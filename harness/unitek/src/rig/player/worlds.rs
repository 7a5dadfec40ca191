//! What came in an attempt, judged by right drives: whether one of them could have sent it.

use super::super::Axis;
use super::super::known::KnownDrives;
use super::super::observed::Exchange;
use super::Player;
use super::counted::counted;
use crate::judge::World;
use crate::language::written;
use crate::simulate::DriveSetup;
use harness_bench::qualify::worlds::{
    Dialogue, RightDrive as _, TimedPiece, WorldsVerdict, judge_alive,
};
use harness_bench::rig::playing::observed::LinkTimes;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{READ, STOP};
use harness_proto::unitek::properties::{Dlc4, Properties};
use harness_proto::unitek::words::{ERROR_TIME_OUT, ERRORS_NOT_READY, MODE_EVENT, status};
use harness_proto::unitek::{Access, REGISTERS, Register, Reply, Request};
use harness_sim::segment::Station as _;
use std::collections::BTreeSet;
use std::sync::Arc;

/// How far ahead of its time a frame may leave: an adapter takes frames before the bus is free.
pub(super) const AHEAD: Span = Span::from_millis(3);

/// The most steps of all worlds of a conversation; and of those of a deviation, of which there are many.
const STEPS: usize = 200_000;
const STEPS_OF_A_NAME: usize = 30_000;

/// How late a frame usually is at most.
const USUALLY: Span = Span::from_millis(3);

/// How much later than the slowest one that was measured a frame may be.
const WORSE: u64 = 3;

/// From this time without a reply, or without frames of a cycle, on something has stood still, and the attempt accuses no drive.
pub(super) const STANDSTILL: Span = Span::from_millis(250);

/// The most frames of an attempt that an adapter may lose.
pub(super) const MOST_LOST: usize = 3;

/// FW-VERSION.
const FIRMWARE: u8 = 0x1B;

/// The bits of an identifier (UNITEK 3.1).
const MOST_IDENTIFIER: u32 = 0x7FF;

/// A register that is compared without a position command only where it held at first what a model holds: the tolerance.
const READ_AT_FIRST: u8 = 0xF4;

/// Bits of D8 that show inputs, and the inputs one by one (UNITEK 4).
const INPUT_BITS: u32 = 0x003F;
const INPUTS: std::ops::RangeInclusive<u8> = 0xE4..=0xE8;

/// A frame that came: when it was on the bus by its stamp, and when it was read.
pub(super) type TimedFrame = (Instant, Instant, Frame);

/// The frames of an attempt, and what is known of their times.
#[derive(Clone, Debug)]
pub(super) struct AttemptFrames {
    pub(super) talk: Exchange,
    pub(super) way: LinkTimes,
    /// Registers that read something else at rest than those of the model, by drive.
    pub(super) unlike: Vec<(u8, u8)>,
    /// The registers among `unlike` that a right drive may read so.
    pub(super) explained: Vec<(u8, u8)>,
    pub(super) follows: bool,
}

impl AttemptFrames {
    fn measured(&self) -> Span {
        self.way.late.max(self.way.longest)
    }

    /// Whether an adapter, the computer or a simulated drive has stood still: what came then may be of any time since.
    fn stood_still(&self) -> bool {
        let silent = self.measured().max(self.talk.longest_standstill());
        self.way.tolerance > Span::ZERO && silent >= STANDSTILL
    }

    /// Whether it may have done so for nearly as long as a frame may be late: a plant that goes on meanwhile shows it as well.
    fn may_have_stood_still(&self) -> bool {
        let silent = self.way.late.max(self.talk.longest_standstill());
        self.way.tolerance > Span::ZERO && silent * 2 >= self.slowest()
    }

    /// How late a frame may be, and whether replies may be overtaken: few worlds explain most conversations, and the most are tried last. In
    /// virtual time nothing is late.
    fn lateness(&self) -> Vec<(Span, bool)> {
        match self.way.tolerance {
            Span::ZERO => vec![(Span::ZERO, false)],
            _ => vec![(self.measured() + USUALLY, false), (self.slowest(), true)],
        }
    }

    fn slowest(&self) -> Span {
        match self.way.tolerance {
            Span::ZERO => Span::ZERO,
            tolerance => tolerance.max(self.measured() * WORSE),
        }
    }
}

/// What right drives say of an attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Proof {
    /// Something no right drive would have sent, in a sentence.
    Wrong(String),
    /// An adapter may have lost frames of a register, or something has stood still: where it comes again and again, no right drive has sent it.
    Lost(Option<u8>, String),
    /// Right drives could have sent all of it, and nothing more.
    Complete,
    /// Right drives could have sent all of it.
    Right,
    /// It was not compared, or not to its end, and why.
    Unknown(&'static str),
}

/// Why what no right drive sends accuses none yet.
pub(super) const LOST: &str = "an adapter may have lost it, and all else is what right drives send";
const HELD_UP: &str = "an adapter, the computer or the drive stood still meanwhile";

/// Why what came is not compared to its end.
const OTHER_IDENTIFIERS: &str = "two drives may have sent it";
const NOT_AT_REST: &str = "the drive did not stand, or had the error of a time-out, before it";
const CHANGED_INPUTS: &str = "an input has changed, or what an input is blamed for";
const NOT_FORETOLD: &str = "what a right drive does here does not follow from what is known of it";
pub(super) const BESIDE_THE_BUS: &str =
    "it puts faults on frames, or acts on drives beside the bus";
const TOO_MANY: &str = "it has more worlds than are kept";
pub(super) const STOOD_STILL: &str = "nothing came for a quarter of a second or more: an adapter, the computer or the drive stood still";

impl Proof {
    /// What several drives come to.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Wrong(why), _) | (_, Self::Wrong(why)) => Self::Wrong(why),
            (lost @ Self::Lost(..), _) | (_, lost @ Self::Lost(..)) => lost,
            (Self::Unknown(why), _) | (_, Self::Unknown(why)) => Self::Unknown(why),
            (Self::Complete, Self::Complete) => Self::Complete,
            _ => Self::Right,
        }
    }
}

impl Player {
    /// Whether right drives could have sent what came.
    pub(super) fn shown(&self, told: &AttemptFrames) -> Proof {
        let each = self.known().iter().map(|known| self.shown_by(known, told));
        let shown = each.reduce(Proof::and);
        match shown.unwrap_or(Proof::Unknown(NOT_AT_REST)) {
            Proof::Wrong(_) if told.stood_still() => Proof::Unknown(STOOD_STILL),
            Proof::Wrong(why) if told.may_have_stood_still() => {
                Proof::Lost(None, format!("{why}: {HELD_UP}"))
            }
            shown => shown,
        }
    }

    fn shown_by(&self, known: &KnownDrives, told: &AttemptFrames) -> Proof {
        let unlike = self.unlike(known, told);
        let talk = &told.talk;
        let (came, changed) = match self.came_from(known, talk) {
            Ok(came) => came,
            Err(why) => return Proof::Unknown(why),
        };
        if let Some(shown) = counted(talk, &came, known.axis, told.way.tolerance) {
            return shown;
        }
        let judged = |properties, late: Span, (overtakes, complete), most_lost| {
            let talk = Dialogue {
                overtakes: overtakes && says_by_itself(talk),
                complete,
                most_lost,
                ..conversation(talk, &came, late)
            };
            let world = self.world(known, properties, &unlike, told);
            let world = match changed {
                true => world.disturbed(),
                false => world,
            };
            judge_alive(vec![world], &talk, &|| self.beats.beat())
        };
        for (late, overtakes) in told.lateness() {
            match judged(known.properties, late, (overtakes, true), 0) {
                WorldsVerdict::Right if changed => return Proof::Unknown(CHANGED_INPUTS),
                WorldsVerdict::Right => return Proof::Complete,
                WorldsVerdict::TooMany => return Proof::Unknown(TOO_MANY),
                WorldsVerdict::Unknown => return Proof::Unknown(NOT_FORETOLD),
                WorldsVerdict::Wrong(..) => {}
            }
        }
        let right = self.world(known, known.properties, &unlike, told);
        let others = known.candidates().into_iter();
        let others = others.filter(|properties| {
            self.beats.beat();
            let other = self.world(known, *properties, &unlike, told);
            !say_the_same(&right, &other, told)
        });
        let mut wrong = None;
        for properties in std::iter::once(known.properties).chain(others) {
            match judged(properties, told.slowest(), (true, false), 0) {
                WorldsVerdict::Right if changed => return Proof::Unknown(CHANGED_INPUTS),
                WorldsVerdict::Right => return Proof::Right,
                WorldsVerdict::TooMany => return Proof::Unknown(TOO_MANY),
                WorldsVerdict::Unknown => return Proof::Unknown(NOT_FORETOLD),
                WorldsVerdict::Wrong(place, expected) => wrong = wrong.or(Some((place, expected))),
            }
        }
        let Some((place, expected)) = wrong else {
            return Proof::Unknown(NOT_FORETOLD);
        };
        let mut unclear = false;
        let mut loses = || {
            let mut lateness = told.lateness().into_iter();
            lateness.any(|(late, overtakes)| {
                let lossy = judged(known.properties, late, (overtakes, false), MOST_LOST);
                unclear |= lossy == WorldsVerdict::TooMany;
                lossy == WorldsVerdict::Right
            })
        };
        let missing = expected.filter(|_| told.way.tolerance > Span::ZERO && loses());
        let register = missing.and_then(|frame| frame.data().first().copied());
        let why = words(known, &came, place, expected);
        let asked = expected.and_then(|frame| frame.data().first().copied());
        match register {
            Some(_) => Proof::Lost(register, format!("{why}: {LOST}")),
            // The drives were made ready, and what the scenario sends has too many worlds after a loss.
            None if unclear && asked.is_some_and(|first| talk.asks_before_it_began(first)) => {
                Proof::Unknown(TOO_MANY)
            }
            None => Proof::Wrong(why),
        }
    }

    /// Whether a drive with a deviation could have sent what came from it in an attempt; `None` where that is not compared. Before the attempt
    /// it has answered what the drives were asked at first, and some requests `more`. A drive that says what a right one says could have sent it
    /// unless that is `wrong`.
    pub(super) fn could_deviate(
        &self,
        known: &KnownDrives,
        setup: &DriveSetup,
        more: u8,
        shown: &AttemptFrames,
        wrong: bool,
    ) -> Option<bool> {
        self.beats.beat();
        let came = self.came_from(known, &shown.talk).ok()?;
        let (mut came, _) = Some(came).filter(|came| !came.1)?;
        // A frame that began before the first request had left belongs to what was before; stamps of adapters are not that exact.
        if let (Some((first, _)), Span::ZERO) = (shown.talk.sent.first(), shown.way.tolerance) {
            let least = |frame: &Frame| self.rate.time_of(frame.bits_to_acknowledge());
            let before = came.iter();
            let before = before.take_while(|came| came.0 < *first + least(&came.2));
            let before = before.count();
            came.drain(..before);
        }
        let world = |setup: &DriveSetup| {
            let mut drive = setup.drive(self.rate, Instant::START);
            let more = std::iter::repeat_n(FIRMWARE, more.into());
            for register in known.cells.keys().copied().chain(more) {
                let request = Request::Read { register };
                if let Ok(frame) = request.encode(known.axis.rx) {
                    drive.hear(Instant::START, &frame);
                }
                while drive.wants().is_some() {
                    drive.sent(Instant::START);
                }
            }
            follows(World::new(drive, self.unlike(known, shown), false), shown)
        };
        let deviant = world(setup);
        let right = world(&known.model(known.properties));
        if say_the_same(&deviant, &right, shown) {
            return Some(!wrong);
        }
        for (late, overtakes) in shown.lateness() {
            let talk = Dialogue {
                overtakes: overtakes && says_by_itself(&shown.talk),
                most_steps: STEPS_OF_A_NAME,
                ..conversation(&shown.talk, &came, late)
            };
            match judge_alive(vec![deviant.clone()], &talk, &|| self.beats.beat()) {
                WorldsVerdict::Right => return Some(true),
                WorldsVerdict::Wrong(..) => {}
                WorldsVerdict::TooMany | WorldsVerdict::Unknown => return None,
            }
        }
        Some(false)
    }

    /// The registers of a drive that are not compared: at rest, or when they were first read, they held something else than those of its model,
    /// which a right drive may.
    fn unlike(&self, known: &KnownDrives, told: &AttemptFrames) -> Arc<BTreeSet<u8>> {
        let explained = told.explained.iter();
        let explained = explained.filter(|(node, _)| *node == known.axis.node);
        let model = known.model(known.properties);
        let model = model.drive(self.rate, Instant::START);
        let differs = |register: &u8| {
            let read = known.cells.get(register);
            let mask = Register::of(*register).mask();
            read.is_some_and(|raw| (raw ^ model.drive().register(*register)) & mask != 0)
        };
        let first = Some(READ_AT_FIRST).filter(differs);
        // One that was called may still work.
        let other = |register: &u8| known.cells.get(register) != known.first.get(register);
        let called = REGISTERS.iter().filter(|row| row.access == Access::FN);
        let called = called.map(|row| row.number).filter(other);
        let explained = explained.map(|(_, register)| *register);
        Arc::new(explained.chain(first).chain(called).collect())
    }

    fn world(
        &self,
        known: &KnownDrives,
        properties: Properties,
        unlike: &Arc<BTreeSet<u8>>,
        told: &AttemptFrames,
    ) -> World {
        let drive = known.model(properties).drive(self.rate, Instant::START);
        // The conversations whose moves are followed ask for nothing while homing may end.
        let homing = known.settled.contains("homing-time") || told.follows;
        follows(World::new(drive, Arc::clone(unlike), homing), told)
    }

    /// What came from a drive, and whether something beside the bus has changed it.
    ///
    /// # Errors
    /// Why that is not known.
    fn came_from(
        &self,
        known: &KnownDrives,
        talk: &Exchange,
    ) -> Result<(Vec<TimedFrame>, bool), &'static str> {
        let axis = known.axis;
        let [receives, sends] = identifiers(axis, talk);
        let others = self.axes.iter().filter(|other| **other != axis);
        let shared = others
            .flat_map(|other| identifiers(*other, talk).concat())
            .any(|id| receives.contains(&id) || sends.contains(&id));
        let stands = known.cells.get(&0xF5).is_none_or(|state| state & 1 == 1);
        let timed_out = known.cell(0x8F) & ERROR_TIME_OUT != 0 && !known.has_timed_out();
        if shared {
            return Err(OTHER_IDENTIFIERS);
        }
        if !stands || timed_out || known.cells.is_empty() {
            return Err(NOT_AT_REST);
        }
        let of_drive = |came: &&(Instant, Instant, Frame)| {
            sends.contains(&came.2.id().number()) && !came.2.id().is_extended()
        };
        let came: Vec<_> = talk.came.iter().filter(of_drive).copied().collect();
        let changed = came.iter().any(|(_, _, frame)| {
            let tx = u16::try_from(frame.id().number()).unwrap_or(axis.tx);
            let reply = Reply::decode(frame, tx);
            let differs = |reply: &Reply| reply.data.bits() ^ known.cell(reply.register);
            reply.is_ok_and(|reply| match reply.register {
                0x40 => {
                    differs(&reply)
                        & (status::LIMIT_PLUS | status::LIMIT_MINUS | status::CONTINUOUS)
                        != 0
                }
                0x8F => differs(&reply) & ERRORS_NOT_READY & !ERROR_TIME_OUT != 0,
                0xD8 => differs(&reply) & INPUT_BITS != 0,
                register => INPUTS.contains(&register) && differs(&reply) & 1 != 0,
            })
        });
        Ok((came, changed))
    }
}

/// Whether a drive may send something that no request asks for: a cycle (5.2) or an event (ex 10). Nothing else overtakes a reply.
fn says_by_itself(talk: &Exchange) -> bool {
    let mut sent = talk.sent.iter().map(|sent| sent.1.data());
    sent.any(|data| match *data {
        [READ, _, interval, ..] => !matches!(interval, 0 | STOP),
        [0x51, low, ..] => u16::from(low) & MODE_EVENT != 0,
        _ => false,
    })
}

/// A drive whose moves to positions are followed, where they are.
fn follows(world: World, told: &AttemptFrames) -> World {
    match told.follows {
        true => world.following(),
        false => world,
    }
}

/// The identifiers in which a drive may receive and send in a conversation: those that it had and those that are written to it (UNITEK 3.1).
fn identifiers(axis: Axis, talk: &Exchange) -> [Vec<u32>; 2] {
    let [mut receives, mut sends] = [axis.rx, axis.tx].map(|id| vec![u32::from(id)]);
    for (_, frame) in &talk.sent {
        let id = frame.id().number();
        let rx = u16::try_from(id).unwrap_or(0);
        if let (true, Ok(Request::Write { register, data })) = (
            receives.contains(&id),
            Request::decode(frame, rx, Dlc4::As3),
        ) {
            let given = data.bits() & MOST_IDENTIFIER;
            match register {
                0x68 | 0x88 => receives.push(given),
                0x69 | 0x89 => sends.push(given),
                _ => {}
            }
        }
    }
    [receives, sends]
}

/// A conversation in which each frame may have been this late.
fn conversation(
    talk: &Exchange,
    came: &[(Instant, Instant, Frame)],
    late: Span,
) -> Dialogue<Frame> {
    let sent = talk.sent.iter().map(|(at, piece)| TimedPiece {
        earliest: *at - AHEAD.min(late),
        latest: *at + late,
        piece: *piece,
    });
    let came = came.iter().map(|(at, read, piece)| TimedPiece {
        earliest: *at - late,
        latest: *read,
        piece: *piece,
    });
    Dialogue {
        sent: sent.collect(),
        came: came.collect(),
        end: talk.read,
        lag: late,
        overtakes: false,
        complete: false,
        most_lost: 0,
        loses_sent: false,
        asked: Vec::new(),
        most_steps: STEPS,
    }
}

/// What a drive says, and when, in a conversation in which every frame reaches it this late.
fn said(mut drive: World, talk: &Exchange, late: Span) -> Vec<(Instant, Frame)> {
    let mut said = Vec::new();
    let end = (talk.read, None);
    let sent = talk.sent.iter().map(|(at, frame)| (*at, Some(frame)));
    for (at, frame) in sent.chain([end]) {
        let at = at + late;
        while let Some(due) = drive.due().filter(|due| *due < at) {
            drive.advance(due);
            said.extend(std::iter::from_fn(|| Some((due, drive.say()?))));
        }
        drive.advance(at);
        frame.into_iter().for_each(|frame| drive.hear(at, frame));
        said.extend(std::iter::from_fn(|| Some((at, drive.say()?))));
    }
    said
}

/// Whether two drives say the same in a conversation, with frames as late as they may be and without.
fn say_the_same(one: &World, other: &World, told: &AttemptFrames) -> bool {
    let mut late = [Span::ZERO, told.slowest()].into_iter();
    late.all(|late| {
        let [one, other] = [one, other].map(|world| said(world.clone(), &told.talk, late));
        one == other
    })
}

/// What no right drive would have sent.
fn words(
    known: &KnownDrives,
    came: &[(Instant, Instant, Frame)],
    place: usize,
    expected: Option<Frame>,
) -> String {
    let node = known.axis.node;
    let came = came.get(place).map(|came| written(&came.2));
    let expected = expected.map(|frame| written(&frame));
    match (came, expected) {
        (Some(came), Some(expected)) => {
            format!("no right drive {node} sends {came} here, where {expected} is expected")
        }
        (Some(came), None) => format!("no right drive {node} sends {came} here"),
        (None, Some(expected)) => format!("{expected} of drive {node} has not come"),
        (None, None) => format!("drive {node} does not do what a right one does"),
    }
}
