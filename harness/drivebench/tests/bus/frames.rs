//! A link of frames: a bus on CAN needs no ring to be sent to, recorded and played back.

use harness::evidence::RecordLine as Written;
use harness::link::{Capability, Line, Link, LinkEvent, Moment, PlacedFault, Recording, Replay};
use harness::medium::{HeardPiece, Medium, Out};
use harness_proto::can::{self, BitRate, CanError, Frame};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, FrameEnd, LineFrame, Trace};
use std::collections::VecDeque;

const MEDIUM: Medium = Medium::Frames(BitRate::K500);

/// How long the station of the bus below takes for an answer.
const ANSWER: Span = Span::from_millis(1);

/// A bus with one station: it answers each frame to 201 with one from 181, and acknowledges no other frame.
#[derive(Default)]
struct Memory {
    now: Instant,
    free: Instant,
    answers: VecDeque<(Instant, can::CanEvent)>,
    carried: Vec<LineFrame>,
}

impl Line for Memory {
    fn medium(&self, _port: usize) -> Medium {
        MEDIUM
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, _port: usize, what: Out<'_>) -> Instant {
        for frame in what.frames() {
            self.free =
                self.free.max(self.now) + MEDIUM.time_of(Out::Frames(std::slice::from_ref(frame)));
            let answer = match frame.id().number() {
                0x201 => can::CanEvent::Frame(
                    Frame::base(0x181, frame.data()).expect("as long as the question"),
                ),
                _ => can::CanEvent::Error(CanError::NoAcknowledge),
            };
            self.answers.push_back((self.free + ANSWER, answer));
            self.carried.push(LineFrame {
                from: None,
                start: self.free - MEDIUM.time_of(Out::Frames(std::slice::from_ref(frame))),
                at: self.free,
                frame: *frame,
                ended: match answer {
                    can::CanEvent::Frame(_) => FrameEnd::Good,
                    can::CanEvent::Error(error) => FrameEnd::Error(error),
                },
            });
        }
        self.free
    }

    fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
        let (at, heard) = *self.answers.front().filter(|(at, _)| *at <= self.now)?;
        self.answers.pop_front();
        Some((at, HeardPiece::Frame(heard)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let next = self.answers.iter().map(|(at, _)| *at);
        let next = next.filter(|at| *at > self.now).min();
        self.now = next.map_or(until, |at| at.min(until)).max(self.now);
        next.is_some()
    }
}

impl Link for Memory {
    fn capabilities(&self) -> &[Capability] {
        &[]
    }

    fn begin(&mut self) {
        *self = Self::default();
    }

    fn busy(&self) -> bool {
        !self.answers.is_empty()
    }

    fn inject(&mut self, _port: usize, _fault: PlacedFault, _moment: Moment) {}

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn carried(&self) -> u64 {
        self.carried.len() as u64
    }

    fn drives(&self, _port: usize) -> u8 {
        1
    }

    fn trace(&self, port: usize) -> Trace {
        Trace {
            channels: vec![Channel::of_frames(self.carried.clone())],
            ..Trace::empty(self.drives(port))
        }
    }
}

fn frames() -> [Frame; 3] {
    ["201#3D4000", "201#51040000", "7FF#"].map(|text| text.parse().expect("a frame"))
}

/// Sends the frames, and waits for what comes.
fn talk(link: &mut dyn Link) -> Vec<(Instant, HeardPiece)> {
    link.begin();
    let left = link.send(0, Out::Frames(&frames()));
    let mut came = Vec::new();
    let end = left + ANSWER;
    while link.now() < end && link.wait(end) {
        came.extend(std::iter::from_fn(|| link.receive(0)));
    }
    came
}

/// Each frame takes its exact time (77 bits the first one), and each answer comes ANSWER behind its question.
#[test]
fn frames_are_carried_recorded_and_played_back() {
    let mut link = Memory::default();
    let mut events = Vec::new();
    let came = talk(&mut Recording::new(&mut link, &mut events));
    let trace = link.trace(0);
    let carried: Vec<_> = trace.channels[0]
        .frames()
        .iter()
        .map(|frame| frame.frame)
        .collect();
    assert_eq!((trace.stations, carried), (1, frames().to_vec()));
    let [question, other, _] = frames();
    let first = Instant::START + BitRate::K500.time_of(77);
    assert_eq!(question.wire_bits(), 77);
    let answer = |data: &[u8]| can::CanEvent::Frame(Frame::base(0x181, data).expect("short"));
    let second = first + BitRate::K500.time_of(other.wire_bits());
    assert_eq!(
        came[..2],
        [
            (first + ANSWER, HeardPiece::Frame(answer(question.data()))),
            (second + ANSWER, HeardPiece::Frame(answer(other.data()))),
        ]
    );
    let no_one = can::CanEvent::Error(CanError::NoAcknowledge);
    assert_eq!(
        came[2..]
            .iter()
            .map(|(_, heard)| *heard)
            .collect::<Vec<_>>(),
        [HeardPiece::Frame(no_one)]
    );

    let written: Vec<_> = events.iter().filter_map(Written::of).collect();
    let text: Vec<_> = written
        .iter()
        .map(|line| serde_json::to_string(line).expect("JSON"))
        .collect();
    assert_eq!(
        text[1],
        r#"{"kind":"sent-frames","ring":1,"t":1266000,"frames":["201#3D4000","201#51040000","7FF#"]}"#
    );
    assert_eq!(
        text[2],
        r#"{"kind":"frame","ring":1,"t":3462000,"frame":"181#3D4000"}"#
    );
    assert!(
        text[4].ends_with(r#""error":"no-acknowledge"}"#),
        "{text:?}"
    );
    let read: Vec<_> = text
        .iter()
        .filter_map(|line| {
            serde_json::from_str::<Written>(line)
                .expect("a line")
                .event()
        })
        .collect();
    assert_eq!(read, events);

    let mut replay = Replay::new(read, MEDIUM, Span::ZERO, vec![1], Vec::new());
    assert_eq!(talk(&mut replay), came);
    assert_eq!((replay.trouble(), replay.left()), (None, None));
}

/// Other frames than the recorded ones are trouble.
#[test]
fn other_frames_are_not_played_back() {
    let mut link = Memory::default();
    let mut events = Vec::new();
    talk(&mut Recording::new(&mut link, &mut events));
    let mut replay = Replay::new(events, MEDIUM, Span::ZERO, vec![1], Vec::new());
    replay.begin();
    replay.send(0, Out::Frames(&frames()[..1]));
    assert!(replay.trouble().is_some());
}

/// A line of an event that cannot be is none.
#[test]
fn a_frame_and_an_error_at_once_is_no_event() {
    for text in [
        r#"{"kind":"frame","ring":1,"t":0}"#,
        r#"{"kind":"frame","ring":1,"t":0,"frame":"181#","error":"bus-off"}"#,
        r#"{"kind":"frame","ring":1,"t":0,"frame":"18#"}"#,
        r#"{"kind":"frame","ring":1,"t":0,"error":"parity"}"#,
        r#"{"kind":"sent-frames","ring":1,"t":0,"frames":["201#3"]}"#,
    ] {
        let line: Written = serde_json::from_str(text).expect("a line");
        assert_eq!(line.event(), None::<LinkEvent>, "{text}");
    }
}
