//! Many cycles at once, counted: with each more there are more worlds than are kept, and how many frames of a register come does not depend
//! on when its cycle began.
//!
//! A cycle runs at least from the reply to a request after its own until the request that stops it is sent, and at most from when its
//! own was sent until the reply to one after the stop was read.

use super::super::Axis;
use super::super::observed::Exchange;
use super::worlds::{AHEAD, LOST, MOST_LOST, Proof, TimedFrame};
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK};
use harness_proto::unitek::{Data, Register, Request};
use std::collections::BTreeMap;

/// From how many cycles at once on they are counted, and how many places the table has (App 8).
const MANY: usize = 5;
const PLACES: usize = 8;

/// How far the mean of many intervals may be off: this part of it (UNITEK 5.2).
const DRIFT: u64 = 50;

/// MODE, and the commands of speed and torque.
const MODE: u8 = 0x51;
const COMMANDS: [u8; 2] = [0x31, 0x90];

struct CountedCycle {
    every: u8,
    /// Where in what was sent its request stands, and the one that stops it.
    begun: usize,
    ended: Option<usize>,
}

/// A conversation of cycles and single requests alone.
struct Conversation<'t> {
    sent: Vec<(Instant, Option<Request>)>,
    came: &'t [TimedFrame],
    read: Instant,
    cycles: BTreeMap<u8, CountedCycle>,
}

impl<'t> Conversation<'t> {
    /// `None` where it is more than that, or where there are not many cycles at once.
    fn of(talk: &Exchange, came: &'t [TimedFrame], axis: Axis) -> Option<Self> {
        let decode =
            |(at, frame): &(Instant, Frame)| (*at, Request::decode(frame, axis.rx, Dlc4::As3).ok());
        let mut all = Self {
            sent: talk.sent.iter().map(decode).collect(),
            came,
            read: talk.read,
            cycles: BTreeMap::new(),
        };
        let (mut running, mut most) = (0, 0);
        for (place, (_, request)) in all.sent.iter().enumerate() {
            match *request {
                Some(Request::Cycle { register, every }) => {
                    running += 1;
                    most = most.max(running);
                    let begun = CountedCycle {
                        every,
                        begun: place,
                        ended: None,
                    };
                    // Each register has one cycle, once.
                    if all.cycles.insert(register, begun).is_some() {
                        return None;
                    }
                }
                Some(Request::Stop { register }) => {
                    running -= 1;
                    all.cycles.get_mut(&register)?.ended.replace(place);
                }
                Some(Request::Read { .. }) | None => {}
                Some(Request::Write {
                    register: MODE,
                    data,
                }) => {
                    let other = data.bits() & !u32::from(MODE_LOCK);
                    if other & u32::from(MODE_EVENT) != 0 || other != 0 {
                        return None;
                    }
                }
                Some(Request::Write {
                    register,
                    data: Data::Short(0),
                }) if COMMANDS.contains(&register) => {}
                Some(Request::Write { .. }) => return None,
            }
        }
        let asked = |came: &TimedFrame| {
            let first = came.2.data().first();
            first.is_some_and(|first| all.cycles.contains_key(first) || all.asks(*first) > 0)
        };
        let answered = came.iter().all(asked);
        ((MANY..=PLACES).contains(&most) && answered).then_some(all)
    }

    /// How many single requests ask for a register.
    fn asks(&self, number: u8) -> usize {
        let reads = |sent: &&(Instant, Option<Request>)| matches!(sent.1, Some(Request::Read { register }) if register == number);
        self.sent.iter().filter(reads).count()
    }

    /// When the reply was read to the first request after a place whose register is asked for once.
    fn confirmed(&self, place: usize) -> Option<Instant> {
        let mut behind = self.sent.iter().skip(place + 1);
        behind.find_map(|(_, request)| {
            let Some(Request::Read { register }) = *request else {
                return None;
            };
            let alone = self.asks(register) == 1 && !self.cycles.contains_key(&register);
            let reply = |came: &&TimedFrame| came.2.data().first() == Some(&register);
            let mut replies = self.came.iter().filter(reply);
            replies.next().filter(|_| alone).map(|came| came.1)
        })
    }

    /// The fewest and the most frames of a cycle that a right drive sends.
    fn bounds(&self, cycle: &CountedCycle) -> Option<(u64, u64)> {
        let every = Span::from_millis(cycle.every.into()).units();
        let ended = cycle.ended?;
        let surely = (self.sent[ended].0 - AHEAD).since(self.confirmed(cycle.begun)?);
        let begun = self.sent[cycle.begun].0 - AHEAD;
        let at_most = self.confirmed(ended).unwrap_or(self.read).since(begun);
        let fewest = (surely.units() - surely.units() / DRIFT) / every;
        let most = (at_most.units() + at_most.units() / DRIFT) / every + 2;
        Some((fewest.saturating_sub(1), most))
    }
}

/// What the number of frames of each register shows where many cycles run at once; `None` where they are not counted.
pub(super) fn counted(
    talk: &Exchange,
    came: &[TimedFrame],
    axis: Axis,
    tolerance: Span,
) -> Option<Proof> {
    let all = Conversation::of(talk, came, axis)?;
    let lossy = tolerance > Span::ZERO;
    let mut shown = Proof::Right;
    for (register, cycle) in &all.cycles {
        let of_register = |came: &&TimedFrame| came.2.data().first() == Some(register);
        let frames = came.iter().filter(of_register).count() as u64;
        let (fewest, most) = all.bounds(cycle)?;
        let name = Register::of(*register).name;
        let node = axis.node;
        if frames > most {
            return Some(Proof::Wrong(format!(
                "drive {node} sends register {register:02X} ({name}) {frames} times by its cycle of {} ms, and {most} times at most are right",
                cycle.every
            )));
        }
        let lost = if lossy { MOST_LOST as u64 } else { 0 };
        if frames + lost < fewest {
            let why = format!(
                "drive {node} sends register {register:02X} ({name}) {frames} times by its cycle of {} ms, and {fewest} times at least are right",
                cycle.every
            );
            shown = match lossy {
                true => Proof::Lost(Some(*register), format!("{why}: {LOST}")),
                false => return Some(Proof::Wrong(why)),
            };
        }
    }
    Some(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: Axis = Axis {
        node: 1,
        rx: 0x201,
        tx: 0x181,
    };
    const REGISTERS: [u8; 8] = [0x1B, 0x59, 0xC8, 0x73, 0xC6, 0x76, 0x77, 0x79];

    fn at(millis: u64) -> Instant {
        Instant::START + Span::from_millis(millis)
    }

    fn exchange(sent: Vec<(Instant, Frame)>) -> Exchange {
        let mut talk = Exchange::default();
        (talk.sent, talk.read) = (sent, at(700));
        talk
    }

    fn frame(text: String) -> Frame {
        text.parse().expect("a frame")
    }

    /// Eight cycles of 50 ms for 600 ms, of which each register has sent this many; the reply after the requests was read this late.
    fn judged(sends: impl Fn(usize) -> u64, late: u64, tolerance: u64) -> Option<Proof> {
        let request = |millis: u64, register: u8, every: u8| {
            (
                at(millis),
                frame(format!("201#3D{register:02X}{every:02X}")),
            )
        };
        let begin = REGISTERS.map(|register| request(10, register, 0x32));
        let end = REGISTERS.map(|register| request(620, register, 0xFF));
        let sent = begin.into_iter().chain([request(20, 0xD9, 0)]).chain(end);
        let talk = exchange(sent.chain([request(630, 0x67, 0)]).collect());
        let reply = |millis: u64, register: u8| {
            (
                at(millis),
                at(millis),
                frame(format!("181#{register:02X}000000")),
            )
        };
        let cycles = REGISTERS.iter().enumerate().flat_map(|(place, register)| {
            (1..=sends(place)).map(move |number| reply(12 + 50 * number, *register))
        });
        let came: Vec<_> = cycles
            .chain([reply(21 + late, 0xD9), reply(631, 0x67)])
            .collect();
        counted(&talk, &came, AXIS, Span::from_millis(tolerance))
    }

    /// App 8: the table has eight places. A frame or two may be lost by an adapter.
    #[test]
    fn a_register_without_a_place_is_missed() {
        assert_eq!(judged(|_| 12, 0, 0), Some(Proof::Right));
        assert_eq!(judged(|_| 10, 0, 20), Some(Proof::Right));
        let six = |place: usize| if place < 6 { 12 } else { 0 };
        assert!(matches!(judged(six, 0, 0), Some(Proof::Wrong(_))));
        assert!(matches!(
            judged(six, 0, 20),
            Some(Proof::Lost(Some(0x79), _))
        ));
        assert!(matches!(judged(|_| 24, 0, 20), Some(Proof::Wrong(_))));
        // It may have begun only when the reply after its request came.
        assert_eq!(judged(six, 590, 20), Some(Proof::Right));
    }

    /// Fewer cycles at once are followed.
    #[test]
    fn a_single_cycle_is_not_counted() {
        let request = |millis: u64, every: &str| (at(millis), frame(format!("201#3D1B{every}")));
        let talk = exchange(vec![request(10, "32"), request(500, "FF")]);
        assert_eq!(counted(&talk, &[], AXIS, Span::ZERO), None);
    }
}
