//! What a bus says and what its device does. A real bus has the first in `harness-proto` and the second in `harness-sim`.
//!
//! The bench asks valve 1 on identifier 101 and hears it on 201. `00` asks where it stands; `01` and a percentage move it. It answers
//! with the same command and its place.

use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_sim::segment::Station;

/// The identifiers of valve 0.
const REQUESTS: u16 = 0x100;
const ANSWERS: u16 = 0x200;
const MOVE: u8 = 1;
const FULL: u8 = 100;
/// From a request to the answer.
const DELAY: Span = Span::from_micros(100);

/// What a frame says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Telegram {
    /// The bench asks where a valve stands.
    Ask(u8),
    /// The bench moves a valve to a percentage.
    Move(u8, u8),
    /// A valve stands at a percentage.
    At(u8, u8),
}

impl Telegram {
    /// Reads a frame; `None` for one that says nothing on this bus.
    pub(crate) fn decode(frame: &Frame) -> Option<Self> {
        let number = u16::try_from(frame.id().number()).ok()?;
        let valve = |base| u8::try_from(number.checked_sub(base)?).ok();
        match (valve(REQUESTS), valve(ANSWERS), frame.data()) {
            (Some(valve), None, [0]) => Some(Self::Ask(valve)),
            (Some(valve), None, [MOVE, place @ 0..=FULL]) => Some(Self::Move(valve, *place)),
            (_, Some(valve), [_, place]) => Some(Self::At(valve, *place)),
            _ => None,
        }
    }

    /// The identifier and the bytes.
    pub(crate) fn encode(self) -> (u16, Vec<u8>) {
        match self {
            Self::Ask(valve) => (REQUESTS + u16::from(valve), vec![0]),
            Self::Move(valve, place) => (REQUESTS + u16::from(valve), vec![MOVE, place]),
            Self::At(valve, place) => (ANSWERS + u16::from(valve), vec![MOVE, place]),
        }
    }
}

/// A valve.
#[derive(Debug)]
pub(crate) struct Valve {
    pub(crate) number: u8,
    /// How far it is open, in percent.
    pub(crate) place: u8,
    /// A deviation: it answers, and does not move.
    pub(crate) sticks: bool,
    answer: Option<(Instant, Frame)>,
}

impl Valve {
    pub(crate) fn new(number: u8, sticks: bool) -> Self {
        Self {
            number,
            place: 0,
            sticks,
            answer: None,
        }
    }
}

impl Station for Valve {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        match Telegram::decode(frame) {
            Some(Telegram::Ask(number)) if number == self.number => {}
            Some(Telegram::Move(number, place)) if number == self.number => {
                if !self.sticks {
                    self.place = place;
                }
            }
            _ => return,
        }
        let command = frame.data().first().copied().unwrap_or(0);
        let id = ANSWERS + u16::from(self.number);
        let answer = Frame::base(id, &[command, self.place]).ok();
        self.answer = answer.map(|frame| (at + DELAY, frame));
    }

    fn wants(&self) -> Option<(Instant, Frame)> {
        self.answer
    }

    fn sent(&mut self, _at: Instant) {
        self.answer = None;
    }

    fn next_action(&self) -> Option<Instant> {
        None
    }

    fn advance(&mut self, _to: Instant) {}
}
