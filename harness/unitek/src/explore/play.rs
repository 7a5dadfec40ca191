//! Plays a case on a simulated segment.

use super::act::{FrameActKind, FrameTalk};
use crate::simulate::{Bench, Setup};
use harness_bench::explore::line::LineSeen;
use harness_bench::link::{AnyStimulus, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::medium::Out;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineFrame;
use harness_sim::unitek;

/// How long a case goes on after its last act, for replies.
const TAIL: Span = Span::from_millis(20);

/// What a case has shown: frames of the drives, and when each act began.
pub(crate) type FramesSeen = LineSeen<LineFrame, Instant>;

/// Plays a case on fresh drives.
#[must_use]
pub(crate) fn play(setup: &Setup, case: &FrameTalk) -> FramesSeen {
    let mut bench = Bench::new(setup);
    let bench = &mut bench;
    let begin = bench.now();
    let mut done = Vec::with_capacity(case.acts.len());
    for act in &case.acts {
        done.push(bench.now());
        match &act.what {
            FrameActKind::Send(frame) => {
                bench.send(0, Out::Frames(&[*frame]));
            }
            FrameActKind::Restart { drive } => {
                for fault in [DriveFault::Off, DriveFault::On] {
                    bench.inject(0, PlacedFault::Drive(*drive, fault), Moment::Now);
                }
            }
            input => {
                if let Some((drive, stimulus)) = stimulus(input) {
                    let fault = PlacedFault::Stimulus(drive, AnyStimulus::Unitek(stimulus));
                    bench.inject(0, fault, Moment::Now);
                }
            }
        }
        pass(bench, act.wait());
    }
    pass(bench, TAIL);
    let trace = bench.trace(0);
    let all = trace.channels.iter().flat_map(|channel| channel.frames());
    FramesSeen {
        said: all.filter(|frame| frame.from.is_some()).copied().collect(),
        done,
        took: bench.now().since(begin),
    }
}

/// What an act does to a drive from outside.
fn stimulus(what: &FrameActKind) -> Option<(u8, unitek::Stimulus)> {
    let name = what.name()?;
    match what {
        FrameActKind::Input { drive, on, .. } => Some((*drive, unitek::Stimulus::Input(name, *on))),
        FrameActKind::Force { drive, raw, .. } => {
            Some((*drive, unitek::Stimulus::Force(name, *raw)))
        }
        FrameActKind::Send(_) | FrameActKind::Restart { .. } => None,
    }
}

/// Lets `wait` pass after the present time, whatever happens.
fn pass(bench: &mut Bench, wait: Span) {
    let until = bench.now() + wait;
    while bench.now() < until {
        bench.wait(until);
        while bench.receive(0).is_some() {}
    }
}
