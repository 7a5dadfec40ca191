//! Right drives are never accused by a set of worlds, however late their frames are; wrong ones are.

use super::World;
use super::tests::{of_all, scenarios};
use crate::language::Unitek;
use harness_bench::qualify::worlds::{Dialogue, TimedPiece, WorldsVerdict, judge};
use harness_bench::scenario::run::AtMismatch;
use harness_bench::scenario::settled::{BenchSize, settle};
use harness_bench::scenario::source::Source;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::{Accepts, PROPERTIES};
use harness_sim::record::FrameEnd;
use harness_sim::unitek::deviation::DEVIATIONS;
use std::sync::Arc;

/// What happens to a drive beside the bus in a scenario, which no frame shows.
fn is_disturbed(source: &Source) -> bool {
    let fault = source.text.lines().any(|line| line.contains("! "));
    let mut steps = source.text.split("\n\n").skip(1).flat_map(str::lines);
    // A time stands in front of some.
    fault || steps.any(|line| line.split(' ').find(|word| !word.starts_with('+')) == Some("drive"))
}

/// A scenario of one drive played on a simulated one with this line in its header, and judged where each frame may have been this late.
fn judged(source: &Source, right: &str, wrong: &str, late: Span) -> Option<WorldsVerdict<Frame>> {
    let with = |line: &str| {
        let text = source
            .text
            .replace("bus     unitek\n", &format!("bus     unitek\n{line}"));
        Source::from_bytes(source.name.clone(), text.into_bytes()).expect("a text")
    };
    let (right, wrong) = (with(right), with(&format!("{right}{wrong}")));
    let setup = crate::serve::bench(None, Some(&right))
        .expect("a header")
        .setup;
    let [drive] = &setup.drives[..] else {
        return None;
    };
    let (_, plan) = settle::<Unitek>(&wrong, BenchSize::Own).expect("a scenario");
    let mut link = plan.simulate();
    plan.play(&mut *link, AtMismatch::GoOn);
    let frames = link.trace(0).channels[0].frames().to_vec();
    let good = frames.iter().filter(|frame| frame.ended == FrameEnd::Good);
    let timed = |drives: bool| {
        let good = good.clone();
        let frames = good.filter(move |frame| frame.from.is_some() == drives);
        let frames = frames.enumerate().map(|(place, frame)| {
            // Its true time is anywhere in between.
            let part = place as u64 * 7 % 11;
            let before = Span::from_units(late.units() / 10 * part);
            TimedPiece {
                earliest: frame.at - before,
                latest: frame.at + late.saturating_sub(before),
                piece: frame.frame,
            }
        });
        frames.collect()
    };
    let talk = Dialogue {
        sent: timed(false),
        came: timed(true),
        end: link.now(),
        lag: late + Span::from_millis(1),
        complete: false,
        most_lost: 0,
        loses_sent: false,
        asked: Vec::new(),
        most_steps: 50_000,
        overtakes: late > Span::from_millis(5),
    };
    let drive = drive.drive(setup.rate, Instant::START);
    let world = World::new(drive, Arc::default(), true).following();
    Some(judge(vec![world], &talk))
}

fn undisturbed() -> Vec<Source> {
    let all = scenarios().into_iter();
    all.filter(|source| !is_disturbed(source)).collect()
}

/// UNITEK 7: with every value of an open point, and frames that are up to 10 ms late.
#[test]
fn no_right_drive_is_accused_however_late_its_frames_are() {
    let words =
        |property: &'static harness_proto::unitek::properties::UnitekProperty| match property
            .accepts
        {
            Accepts::Words(words) => words.to_vec(),
            Accepts::Byte | Accepts::TimeUpTo(_) => Vec::new(),
        };
    let lines = PROPERTIES.iter().flat_map(|property| {
        let words = words(property).into_iter();
        words.map(move |word| format!("property {} = {word}", property.name))
    });
    let lines: Vec<_> = lines.collect();
    let mut right = 0;
    for (place, source) in undisturbed().iter().enumerate() {
        let line = of_all(source, &lines[place % lines.len()]);
        for (line, late) in [("", 0), ("", 2), (&line[..], 10)] {
            let judged = judged(source, line, "", Span::from_millis(late));
            assert!(
                !matches!(judged, Some(WorldsVerdict::Wrong(..))),
                "{}, {line}{late} ms late: {judged:?}",
                source.name
            );
            right += usize::from(judged == Some(WorldsVerdict::Right));
        }
    }
    assert!(right > 100, "{right} judged");
}

/// Deviations that lie in inputs, in a register without a meaning, or in what these scenarios do not ask for.
const NOT_FOUND: [&str; 7] = [
    "writes-without-sign",
    "interval-one-more",
    "lock-ends-cycles",
    "mask-is-fixed",
    "homing-by-any-value",
    "limit-switches-swapped",
    "unassigned-reads-zero",
];

/// Whether a set of worlds finds a wrong drive, without any line of the scenarios.
fn is_found(deviation: &str, all: &[Source]) -> bool {
    all.iter().any(|source| {
        let wrong = of_all(source, &format!("deviates {deviation}"));
        let judged = judged(source, "", &wrong, Span::from_millis(2));
        matches!(judged, Some(WorldsVerdict::Wrong(..)))
    })
}

#[test]
fn wrong_drives_are_found_by_what_they_send() {
    let all = undisturbed();
    let names = DEVIATIONS.all().map(|deviation| deviation.name);
    let names = names.filter(|name| !NOT_FOUND.contains(name)).step_by(4);
    let missed: Vec<_> = names.filter(|name| !is_found(name, &all)).collect();
    assert_eq!(missed, [""; 0]);
}

#[test]
#[ignore = "every wrong drive; .ci/nightly runs it"]
fn which_wrong_drives_are_found_by_what_they_send() {
    let all = undisturbed();
    let names = DEVIATIONS.all().map(|deviation| deviation.name);
    let missed: Vec<_> = names.filter(|name| !is_found(name, &all)).collect();
    assert_eq!(missed, NOT_FOUND);
}

/// Ex 10: an event that does not come is missed.
#[test]
fn an_event_that_never_comes_is_missed() {
    let setup = crate::simulate::Setup::of(1);
    let at = |ms: u64| Instant::START + Span::from_millis(ms);
    let timed = |ms: u64, text: &str| TimedPiece {
        earliest: at(ms),
        latest: at(ms + 3),
        piece: text.parse::<Frame>().expect("a frame"),
    };
    let judged = |came: &[(u64, &str)]| {
        let talk = Dialogue {
            sent: vec![
                timed(10, "201#5200000001000000"),
                timed(20, "201#5201000000"),
                timed(20, "201#511400"),
            ],
            came: came.iter().map(|(ms, text)| timed(*ms, text)).collect(),
            end: at(1_000),
            lag: Span::from_millis(30),
            overtakes: false,
            complete: false,
            most_lost: 0,
            loses_sent: false,
            asked: Vec::new(),
            most_steps: 50_000,
        };
        let drive = setup.drives[0].drive(setup.rate, Instant::START);
        judge(vec![World::new(drive, Arc::default(), true)], &talk)
    };
    assert_eq!(judged(&[(22, "181#400001000000")]), WorldsVerdict::Right);
    assert_ne!(judged(&[]), WorldsVerdict::Right);
    assert_ne!(judged(&[(300, "181#400001000000")]), WorldsVerdict::Right);
}
