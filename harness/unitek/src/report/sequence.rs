//! A sequence diagram of frames: time goes down, a line for the master and one for each drive, an arrow a frame (5.2, ex 8 to 12).
//!
//! Frames of a cycle are folded: the first two have arrows of their own, and the second one says how many came after it.

use super::meaning;
use crate::language::identifier;
use harness_bench::html::Html;
use harness_bench::report::html::sequence::{Arrow, SequenceWords};
use harness_bench::report::html::{self};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{FrameEnd, LineFrame, Trace};
use std::collections::{BTreeMap, BTreeSet};

/// How much the gaps of a cycle may differ (2: cyclic frames of a drive).
const JITTER: Span = Span::from_millis(2);

/// Room for what the frames mean.
const WORDS: usize = 640;

/// The first frame of an arrow, and the frames of the same cycle that are folded into it.
struct Fold<'t> {
    first: &'t LineFrame,
    last: &'t LineFrame,
    times: usize,
}

/// The last two frames of a drive with one register, since the master's last frame.
struct Recurrence {
    arrow: usize,
    at: Instant,
    gap: Option<Span>,
}

/// Writes the picture; false where there is nothing to draw.
pub(crate) fn sequence(html: &mut Html, id: &str, title: &str, trace: &Trace) -> bool {
    let folded = folded(trace);
    let arrows = folded.iter().map(drawn);
    let words = SequenceWords {
        drive: "drive",
        carried: "frames",
        room: WORDS,
    };
    html::sequence::sequence(html, id, title, &drives(trace), arrows, words)
}

fn frames(trace: &Trace) -> impl Iterator<Item = &LineFrame> {
    trace.channels.iter().flat_map(|channel| channel.frames())
}

/// The drives of a trace by their numbers: those that have sent something, or were sent something by the identifier of 3.1.
fn drives(trace: &Trace) -> Vec<u8> {
    let mut drives: BTreeSet<u8> = frames(trace).filter_map(|frame| frame.from).collect();
    if drives.len() < usize::from(trace.stations) {
        drives.extend(frames(trace).filter_map(receiver));
    }
    drives.into_iter().collect()
}

/// The drive with the identifier of 3.1 to which the master sends: 200 + n.
fn receiver(frame: &LineFrame) -> Option<u8> {
    let number = frame.frame.id().number();
    let to_drive = (0x201..=0x27F).contains(&number) && !frame.frame.id().is_extended();
    u8::try_from(number & 0x7F)
        .ok()
        .filter(|_| to_drive && frame.from.is_none())
}

/// The arrows. A frame is folded into the one before it of the same drive and register where the gaps are those of a cycle, and the
/// master has sent nothing since.
fn folded(trace: &Trace) -> Vec<Fold<'_>> {
    let mut arrows: Vec<Fold<'_>> = Vec::new();
    let mut begun: BTreeMap<(u8, Option<u8>), Recurrence> = BTreeMap::new();
    for frame in frames(trace) {
        let key = frame
            .from
            .map(|drive| (drive, frame.frame.data().first().copied()));
        let Some(key) = key else {
            begun.clear();
            arrows.push(one(frame));
            continue;
        };
        let before = begun.get_mut(&key);
        let gap = before.as_ref().map(|last| frame.at.since(last.at));
        match (before, gap) {
            (Some(series), Some(gap)) if series.gap.is_some_and(|last| alike(last, gap)) => {
                series.at = frame.at;
                arrows[series.arrow].last = frame;
                arrows[series.arrow].times += 1;
            }
            _ => {
                let arrow = arrows.len();
                begun.insert(
                    key,
                    Recurrence {
                        arrow,
                        at: frame.at,
                        gap,
                    },
                );
                arrows.push(one(frame));
            }
        }
    }
    arrows
}

fn one(frame: &LineFrame) -> Fold<'_> {
    Fold {
        first: frame,
        last: frame,
        times: 1,
    }
}

fn alike(one: Span, other: Span) -> bool {
    one.max(other) <= one.min(other) + JITTER
}

fn drawn(folded: &Fold<'_>) -> Arrow {
    let LineFrame {
        at,
        from,
        frame,
        ended,
        ..
    } = *folded.first;
    let mut words = format!(
        "{}  {}",
        identifier(frame.id()),
        meaning(&frame, from.is_some())
    );
    match ended {
        FrameEnd::Good => {}
        FrameEnd::Lost => words.push_str("  [lost]"),
        FrameEnd::Error(error) => words.push_str(&format!("  [{error}]")),
    }
    if folded.times > 1 {
        let more = folded.times - 1;
        let end = meaning(&folded.last.frame, true);
        words.push_str(&format!(
            "  and {more} more up to {}: {end}",
            folded.last.at
        ));
    }
    Arrow {
        at,
        from,
        to: receiver(folded.first),
        good: matches!(ended, FrameEnd::Good),
        words,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::record::Channel;

    fn trace(frames: &[(u64, Option<u8>, &str)]) -> Trace {
        let frames = frames.iter().map(|&(at, from, text)| LineFrame {
            start: Instant::START + Span::from_millis(at),
            at: Instant::START + Span::from_millis(at),
            from,
            frame: text.parse().expect("a frame"),
            ended: FrameEnd::Good,
        });
        Trace {
            channels: vec![Channel::of_frames(frames.collect())],
            ..Trace::empty(1)
        }
    }

    fn times(trace: &Trace) -> Vec<usize> {
        folded(trace).iter().map(|arrow| arrow.times).collect()
    }

    /// Ex 9: a cycle of 100 ms, with one of 10 ms beside it, and what ends it.
    #[test]
    fn cycles_are_folded() {
        let mut frames = vec![(0, None, "201#3D3064")];
        for k in 1..=30 {
            frames.push((10 * k, Some(1), "181#A8000000"));
            if k % 10 == 0 {
                frames.push((10 * k, Some(1), "181#30FF7F00"));
            }
        }
        frames.push((305, None, "201#3D30FF"));
        assert_eq!(times(&trace(&frames)), [1, 1, 29, 1, 2, 1]);
    }

    /// Frames that come at irregular times are events: each has its arrow.
    #[test]
    fn events_are_not_folded() {
        let event = "181#408131000000";
        let frames = [
            (0, Some(1), event),
            (7, Some(1), event),
            (50, Some(1), event),
        ];
        assert_eq!(times(&trace(&frames)), [1, 1, 1]);
    }

    #[test]
    fn each_drive_has_a_line() {
        let trace = trace(&[(0, None, "202#310000"), (1, Some(4), "184#30000000")]);
        assert_eq!(drives(&trace), [4]);
        let mut html = Html::new();
        assert!(sequence(&mut html, "a", "A title", &trace));
        assert!(!sequence(
            &mut Html::new(),
            "a",
            "A title",
            &Trace::empty(1)
        ));
    }
}
