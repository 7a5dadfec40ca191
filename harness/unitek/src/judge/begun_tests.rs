//! What may have been set before the first frame of a log or in a gap of it: each of it explains frames of a right drive, and excuses no wrong
//! one. Times that go back or leap forward, and times that are off.

use super::drives::JudgedDrives;
use super::{FrameSymptom, HeardFrames, judge, judge_guessed};
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::sender_of;
use harness_sim::record::{FrameEnd, LineFrame, Seam, SeamKind};

/// Frames with their times in tenths of a millisecond.
fn log(frames: &[(u64, &str)]) -> Vec<LineFrame> {
    let frame = |&(at, text): &(u64, &str)| {
        let frame: Frame = text.parse().expect("a frame");
        let start = Instant::START + Span::from_micros(at * 100);
        LineFrame {
            from: sender_of(&frame),
            start,
            at: start + Span::from_micros(90),
            frame,
            ended: FrameEnd::Good,
        }
    };
    let mut all: Vec<_> = frames.iter().map(frame).collect();
    all.sort_by_key(|frame| frame.start);
    all
}

const DRIVE: [(u8, (u16, u16)); 1] = [(1, (0x201, 0x181))];

fn judged(frames: &[(u64, &str)]) -> JudgedDrives {
    let frames = log(frames);
    let heard = HeardFrames::exact(&frames);
    let [sure, guessed] = [judge(heard, &DRIVE), judge_guessed(heard, &DRIVE)];
    assert_eq!(sure.breaches, guessed.breaches);
    sure
}

#[track_caller]
fn right(frames: &[(u64, &str)]) {
    let judged = judged(frames);
    assert_eq!((judged.breaches, judged.doubts), (Vec::new(), Vec::new()));
}

#[track_caller]
fn wrong(frames: &[(u64, &str)], what: FrameSymptom, section: &str) {
    let judged = judged(frames);
    let first = judged.breaches.first().expect("a difference");
    assert_eq!((first.what, first.section), (what, section), "{judged:#?}");
}

/// A read with its reply: the bus and the drive are known to be at work.
const READ: [(u64, &str); 2] = [(100, "201#3DE200"), (104, "181#E2010000")];

/// This number of frames, one each `every` tenths of a millisecond.
fn cycle(text: &'static str, every: u64, count: u64) -> Vec<(u64, &'static str)> {
    (0..count).map(|place| (place * every, text)).collect()
}

/// UNITEK 5.2: a cycle of any register, also where MODE is written meanwhile, which ends events and no cycle.
#[test]
fn a_cycle() {
    for text in [
        "181#30010200",
        "181#40010100",
        "181#8F0000000000",
        "181#FA4D4400",
        "181#81CEFA00",
        "181#D10000000000",
    ] {
        for write in ["201#510400", "201#511400", "201#3D5100"] {
            let mut frames = cycle(text, 1_000, 12);
            frames.extend(READ);
            frames.push((3_500, write));
            if write == "201#3D5100" {
                frames.push((3_504, "181#51000000"));
            }
            right(&frames);
        }
    }
}

/// UNITEK 5.2, ex 10: sending by event, with any mask, until MODE switches it off.
#[test]
fn events() {
    let events = [(0, "181#400101000000"), (9_000, "181#400001000000")];
    right(&[&READ[..], &events].concat());
    let read = [(200, "201#3D5100"), (204, "181#51100000")];
    right(&[&READ[..], &events, &read].concat());
    // A cycle would have shown itself after the write.
    let off = (10_000, "201#510400");
    let late = (15_500, "181#400101000000");
    let asks = [
        cycle("201#3DE200", 1_000, 20),
        cycle("181#E2010000", 1_000, 20),
    ]
    .concat();
    let asks = asks
        .into_iter()
        .zip(0..)
        .map(|((at, text), place)| (at + 200 + place / 20 * 4, text));
    let asks: Vec<_> = asks.collect();
    right(&[&asks[..], &events, &[off]].concat());
    wrong(
        &[&asks[..], &events, &[off, late]].concat(),
        FrameSymptom::Unasked,
        "5.2",
    );
}

/// A request in front of the first frame.
#[test]
fn a_request() {
    right(&[&[(50, "181#30010200")], &READ[..]].concat());
    let other = (9_000, "181#30010200");
    let asks = [(8_000, "201#3DE200"), (8_004, "181#E2010000")];
    wrong(
        &[&READ[..], &asks, &[other]].concat(),
        FrameSymptom::Unasked,
        "5.2",
    );
}

/// UNITEK App 8: a table of eight cycles that is full, so that a ninth is refused.
#[test]
fn a_full_table() {
    const OLD: [&str; 8] = [
        "181#30010200",
        "181#31010200",
        "181#35000000000",
        "181#40010100",
        "181#49010200",
        "181#4A010200",
        "181#4B010200",
        "181#EB010200",
    ];
    let mut frames: Vec<_> = READ.to_vec();
    for (place, text) in OLD.into_iter().enumerate() {
        let text = if place == 2 { "181#350000000000" } else { text };
        let frame = |(at, text): (u64, &'static str)| (at + place as u64 * 3, text);
        frames.extend(cycle(text, 1_000, 20).into_iter().map(frame));
    }
    let ninth = (8_000, "201#3DA00A");
    frames.push(ninth);
    right(&frames);
    let asks = |at: u64| [(at, "201#3DE200"), (at + 4, "181#E2010000")];
    let alone = [
        &READ[..],
        &asks(2_000),
        &asks(5_000),
        &[ninth],
        &asks(9_000),
        &asks(10_000),
    ];
    wrong(&alone.concat(), FrameSymptom::Missing, "ex 9");
}

/// UNITEK App 3: all replies with 6 bytes, by bit 8 of DC.
#[test]
fn long_replies() {
    let long = |at: u64| [(at, "201#3DE200"), (at + 4, "181#E20100000000")];
    right(&[long(1_000), long(2_000)].concat());
    wrong(
        &[long(800), READ.map(|(at, text)| (at + 900, text))].concat(),
        FrameSymptom::Length,
        "App 2",
    );
}

/// A lock, errors that are latched and a bus time-out that expires: no frame asks for what STATUS and the errors show (UNITEK ex 2, App 7).
#[test]
fn a_lock_and_errors() {
    let asks = |at: u64, status, errors| {
        [
            (at, "201#3D4000"),
            (at + 4, status),
            (at + 8, "201#3D8F00"),
            (at + 12, errors),
        ]
    };
    let locked = asks(100, "181#40000000", "181#8F080000");
    let enabled = asks(900, "181#40010100", "181#8F000000");
    right(&[locked, enabled].concat());
    let lock = [(700, "201#510400")];
    wrong(
        &[&locked[..], &lock, &enabled].concat(),
        FrameSymptom::Value,
        "ex 2",
    );
}

/// UNITEK 4.3, ex 1: identifiers that are not those of 3.1 accuse no drive where they are guessed.
#[test]
fn identifiers() {
    let asks = |at: u64| [(at, "201#3DE200"), (at + 4, "185#E2010000")];
    let frames = log(&[asks(100), asks(9_000)].concat());
    let drives = [(1, (0x201, 0x181)), (5, (0x205, 0x185))];
    let judged = judge_guessed(HeardFrames::exact(&frames), &drives);
    assert_eq!(judged.breaches, []);
    assert!(!judged.doubts.is_empty(), "{judged:#?}");
    let set_up = judge(HeardFrames::exact(&frames), &[(1, (0x201, 0x185))]);
    assert_eq!((set_up.breaches, set_up.doubts), (Vec::new(), Vec::new()));
}

/// How many differences and how many doubts there are.
fn counts(frames: &[(u64, &str)]) -> (usize, usize) {
    let judged = judged(frames);
    (judged.breaches.len(), judged.doubts.len())
}

/// These frames at a later time, in tenths of a millisecond.
fn at<'t>(later: u64, frames: &[(u64, &'t str)]) -> Vec<(u64, &'t str)> {
    let frames = frames.iter();
    frames.map(|(at, text)| (at + later, *text)).collect()
}

/// UNITEK ex 12: homing that was asked for before sets the destination at its end; a lock ends it.
#[test]
fn homing() {
    let reads = |at: u64, reply| [(at, "201#3D6E00"), (at + 4, reply)];
    let moves = reads(1_000, "181#6E0010000000");
    let home = reads(2_000, "181#6E0000000000");
    assert_eq!(counts(&[moves, home].concat()), (0, 1));
    let lock = [(500, "201#510400")];
    assert_eq!(counts(&[&lock[..], &moves, &home].concat()), (1, 0));
}

/// A second pair of identifiers (88, 89): what a host sends there may be for the drive, unless another one receives it (`second-identifiers`).
#[test]
fn second_identifiers() {
    let asks = [(9_000, "207#3D3000"), (9_003, "181#30010200")];
    let writes = [
        (9_100, "201#D101000000"),
        (9_200, "207#D102000000"),
        (9_300, "201#3DD100"),
        (9_304, "181#D10200000000"),
    ];
    let other = (7, (0x207, 0x187));
    let lock = [(9_400, "201#510400"), (9_500, "207#510000")];
    let enabled = [(9_600, "201#3D4000"), (9_604, "181#40010100")];
    for frames in [&asks[..], &writes, &[lock, enabled].concat()] {
        let polls = at(8_700, &READ);
        let frames = [&READ[..], &polls, frames].concat();
        assert_eq!(counts(&frames), (0, 1), "{frames:?}");
        let frames = log(&frames);
        let judged = judge(HeardFrames::exact(&frames), &[DRIVE[0], other]);
        assert_eq!(judged.breaches.len(), 1, "{judged:#?}");
    }
}

/// UNITEK ex 9: a cycle that goes on after a gap of an hour, and one that does not.
#[test]
fn a_gap_in_a_cycle() {
    const HOUR: u64 = 36_000_000;
    let asks = at(4_000, &[(0, "201#3D3064")]);
    let polls = cycle("201#3DE200", 1_000, 10);
    let polls: Vec<_> = polls
        .iter()
        .flat_map(|poll| [*poll, (poll.0 + 4, "181#E2010000")])
        .collect();
    let frames = at(5_000, &cycle("181#30010200", 1_000, 10));
    let before = [&polls[..], &asks, &at(4_000, &READ), &frames].concat();
    let gap = |remark: &String| remark.starts_with("the log has a gap of 3600");
    for gone_on in [true, false] {
        let goes_on = cycle("181#30010200", 1_000, if gone_on { 10 } else { 0 });
        let behind = at(HOUR, &[goes_on, at(400, &polls)].concat());
        let all = [before.clone(), at(16_000, &behind)].concat();
        let judged = judged(&all);
        let found = (judged.breaches.len(), judged.doubts.len());
        assert_eq!(found, (0, usize::from(!gone_on)), "{judged:#?}");
        assert!(judged.remarks.iter().any(gap), "{judged:#?}");
    }
    // It was stopped after the gap, before a frame was due.
    let stop = [(HOUR + 15_000, "201#3D30FF")];
    assert_eq!(counts(&[&before[..], &stop].concat()), (0, 1));
    // The host goes on, however slowly.
    for every in [1_000, 20_000, 100_000] {
        let on = at(16_000, &cycle("201#3DE200", every, 8));
        let replies = at(4, &on).into_iter();
        let replies = replies.map(|(at, _)| (at, "181#E2010000"));
        let replies: Vec<_> = replies.collect();
        wrong(
            &[&before[..], &on, &replies].concat(),
            FrameSymptom::Missing,
            "ex 9",
        );
    }
}

/// Requests, and what was written: a gap may hide a reply and another write, and accuses no drive of it.
#[test]
fn a_gap_hides_a_reply_and_a_write() {
    const HOUR: u64 = 36_000_000;
    let polls = [READ.to_vec(), at(500, &READ), at(1_000, &READ)].concat();
    let request = [(2_000, "201#3DE200")];
    let late = [(HOUR, "181#E2010000")];
    let again = at(HOUR + 500, &polls);
    assert_eq!(
        counts(&[&polls[..], &request, &late, &again].concat()),
        (0, 0)
    );
    assert_eq!(counts(&[&polls[..], &request, &again].concat()), (0, 1));
    let write = [(2_000, "201#D101000000")];
    let reads = |later: u64| [(later, "201#3DD100"), (later + 4, "181#D10000000000")];
    let across = [&polls[..], &write, &again, &reads(HOUR + 3_000)].concat();
    assert_eq!(counts(&across), (0, 1));
    let behind = [&polls[..], &again, &at(HOUR, &write), &reads(HOUR + 3_000)].concat();
    wrong(&behind, FrameSymptom::Value, "App 6");
    // A cycle that began in the gap, or ended in it.
    let starts = at(HOUR, &cycle("181#30010200", 1_000, 8));
    let off = [(1_500, "201#3D30FF")];
    assert_eq!(counts(&[&polls[..], &off, &starts].concat()), (0, 0));
    // Half the requests are not answered, with an hour between: that is no gap of the log.
    let unanswered =
        (0..12).flat_map(|place| at(HOUR * place, &[&READ[..], &at(200, &READ[..1])].concat()));
    let unanswered: Vec<_> = unanswered.collect();
    wrong(&unanswered, FrameSymptom::Missing, "5.2");
}

/// A clock that was set back hides no difference, and makes none of times.
#[test]
fn a_clock_that_was_set() {
    let judged = |frames: &[(u64, &str)], piece, kind| {
        let frames = log(frames);
        let seams = [Seam { piece, kind }];
        judge(
            HeardFrames {
                seams: &seams,
                ..HeardFrames::exact(&frames)
            },
            &DRIVE,
        )
    };
    // The drive sends nothing for half a second in front of the write, which is too late to be lost without supply.
    let reads = |at: u64| [(at, "201#3DD100"), (at + 4, "181#D10000000000")];
    let write = [(6_000, "201#D101000000")];
    let frames = [&reads(100)[..], &write, &reads(6_005)].concat();
    let found = judged(&frames, 3, SeamKind::ClockSet).breaches;
    assert_eq!((found.len(), found[0].what), (1, FrameSymptom::Value));
    // Behind another recording's begin it is not known what was written between.
    assert_eq!(judged(&frames, 3, SeamKind::Recording).breaches, []);
    // A cycle of 100 ms goes on 20 ms after its last frame.
    let asks = [(0, "201#3D3064")];
    let mut frames = [&asks[..], &cycle("181#30010200", 1_000, 5)[1..]].concat();
    frames.extend([(4_200, "181#30010200"), (5_200, "181#30010200")]);
    assert_eq!(judged(&frames, 5, SeamKind::ClockSet).breaches, []);
    assert_eq!(
        judge(HeardFrames::exact(&log(&frames)), &DRIVE)
            .breaches
            .len(),
        1
    );
}

/// UNITEK 5.2, ex 9: times that may be off by a tolerance differ beyond it only.
#[test]
fn a_tolerance() {
    let ends = [1_120, 2_080, 3_040, 4_160, 5_120, 6_080];
    let mut frames = vec![(0, "201#3D3064")];
    frames.extend(ends.map(|at| (at, "181#30010200")));
    let frames = log(&frames);
    let count = |tolerance| {
        let heard = HeardFrames {
            tolerance: Span::from_millis(tolerance),
            ..HeardFrames::exact(&frames)
        };
        judge(heard, &DRIVE).breaches.len()
    };
    assert_eq!([count(0), count(9), count(16)], [5, 1, 0]);
}

/// Identifiers of other devices are counted in one line.
#[test]
fn other_devices() {
    let others = [
        (120, "700#05"),
        (130, "00000201#3DE200"),
        (140, "080#"),
        (150, "700#05"),
    ];
    let judged = judged(&[&READ[..], &others].concat());
    assert_eq!(judged.breaches, []);
    let line = "4 frames with 3 identifiers of other devices not judged: 080, 700, x00000201";
    assert_eq!(judged.remarks, [line]);
}

/// A log that ends after a request says nothing of its reply.
#[test]
fn a_log_ends_before_the_reply() {
    let remarks = |frames: &[(u64, &str)]| judged(frames).remarks.len();
    assert_eq!(remarks(&[(0, "201#3DE200")]), 0);
    assert_eq!(remarks(&[(0, "201#3DE200"), (1_000, "201#3DE200")]), 1);
}

/// Ex 10: a frame of STATUS by event comes in front of the reply to an earlier request, which a slow drive has read while MODE released it.
#[test]
fn an_event_is_not_taken_for_the_reply_to_a_request() {
    let released = [(10, "201#510000"), (20, "201#3D4000")];
    let locked = [
        (30, "201#511400"),
        (34, "181#408031000000"),
        (40, "201#3D4000"),
        (60, "181#40813100"),
        (80, "181#40803100"),
    ];
    right(&[&READ, &released[..], &locked].concat());
    wrong(&[&READ[..], &locked].concat(), FrameSymptom::Value, "ex 2");
}

/// A drive reads a register at any time between a request and its reply.
#[test]
fn what_was_written_in_between_may_be_read() {
    let asked = |reply: &'static str| {
        let frames = [
            (10, "201#D411110000"),
            (20, "201#3DD400"),
            (22, "201#D422220000"),
            (24, "201#D433330000"),
            (28, reply),
        ];
        [&READ[..], &frames].concat()
    };
    for text in ["181#D41111000000", "181#D42222000000", "181#D43333000000"] {
        right(&asked(text));
    }
    wrong(&asked("181#D44444000000"), FrameSymptom::Value, "App 6");
}
