//! The steps of a finding's scenario: it passes if every frame is as the model predicts, and fails if one is not.

use super::act::{FrameActKind, FrameTalk};
use super::play::FramesSeen;
use crate::language::written;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineFrame;
use std::fmt::Write as _;

/// How far a frame may be off that no request directly before it asks for.
const TOLERANCE: Span = Span::from_micros(300);

/// The same for a frame that is known to come at another time.
const EXACT: Span = Span::from_micros(1);

/// Frames up to this time after a request need no time in a scenario.
const AT_ONCE: Span = Span::from_micros(1_500);

/// The steps; the frame `timed`, counted from 1, must come exactly at its time.
pub(super) fn steps(case: &FrameTalk, seen: &FramesSeen, timed: Option<usize>, text: &mut String) {
    let mut frames = (1..).zip(&seen.said).peekable();
    let mut last = Instant::START;
    for (act, at) in case.acts.iter().zip(&seen.done) {
        while let Some((number, frame)) = frames.next_if(|(_, frame)| frame.at <= *at) {
            expect(frame, last, timed == Some(number), text);
        }
        let time = time(*at);
        let _infallible = match &act.what {
            FrameActKind::Send(frame) => {
                last = *at;
                writeln!(text, "@{time} > {}", written(frame))
            }
            FrameActKind::Input { drive, name, on } => {
                let level = if *on { "high" } else { "low" };
                writeln!(text, "@{time} drive {drive} input {name} {level}")
            }
            FrameActKind::Force { drive, name, raw } => {
                let value = raw.map_or("off".to_owned(), |raw| format!("= {raw:X}"));
                writeln!(text, "@{time} drive {drive} force {name} {value}")
            }
            FrameActKind::Restart { drive } => writeln!(text, "@{time} drive {drive} restart"),
        };
    }
    for (number, frame) in frames {
        expect(frame, last, timed == Some(number), text);
    }
    // As long as the case, and no longer: cycles may still run.
    let last = seen.said.last().map(|frame| &frame.at);
    let ends = seen.done.iter().chain(last);
    let spoken = ends.max().copied().unwrap_or(Instant::START);
    let rest = (Instant::START + seen.took).since(spoken);
    let _infallible = writeln!(text, "wait {}", time(Instant::START + rest));
}

/// A frame of a drive, its stuff byte left open (UNITEK 4.1).
fn expect(frame: &LineFrame, last: Instant, timed: bool, text: &mut String) {
    let mut shown = written(&frame.frame);
    if !frame.frame.is_remote() && matches!(frame.frame.dlc(), 4 | 6) {
        shown.truncate(shown.len() - 2);
        shown.push_str("xx");
    }
    let tolerance = if timed { EXACT } else { TOLERANCE };
    let _infallible = match frame.at.since(last) <= AT_ONCE && !timed {
        true => writeln!(text, "< {shown}"),
        false => {
            let from = Instant::START + frame.at.since(Instant::START + tolerance);
            writeln!(
                text,
                "@{}..{} < {shown}",
                time(from),
                time(frame.at + tolerance)
            )
        }
    };
}

/// A time in milliseconds.
fn time(at: Instant) -> String {
    let micros = at.since_start().as_nanos() / 1_000;
    match micros % 1_000 {
        0 => format!("{}ms", micros / 1_000),
        rest => format!("{}.{rest:03}ms", micros / 1_000),
    }
}
