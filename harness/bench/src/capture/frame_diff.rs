//! Two runs of frames side by side: what one has and the other has not, and how far the times are apart.

use super::Capture;
use crate::counted::counted;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{FrameEnd, LineFrame};
use std::fmt::Write as _;

/// How many frames to look ahead for the next common one.
const AHEAD: usize = 256;

/// Differences that are listed; more are counted.
const LISTED: usize = 20;

/// The result of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameSummary {
    /// How many frames both have, in the same order.
    pub common: usize,
    /// Frames that one side alone has, with the side (0 or 1), in order.
    pub alone: Vec<(usize, Instant, String)>,
    /// How many of the common frames are further apart in time than permitted, counted from the first frame of each side.
    pub late: usize,
    /// The largest distance of times.
    pub apart: Span,
    /// Whether times are not compared, because those of one side are not continuous.
    pub untimed: bool,
}

impl FrameSummary {
    /// Whether nothing differs.
    #[must_use]
    pub const fn same(&self) -> bool {
        self.alone.is_empty() && self.late == 0
    }

    /// For people.
    #[must_use]
    pub fn show(&self, names: [&str; 2]) -> String {
        let mut text = String::new();
        for (side, at, frame) in self.alone.iter().take(LISTED) {
            // Writing to a String cannot fail.
            let _infallible = writeln!(text, "only in {}: {at}  {frame}", names[*side]);
        }
        if self.alone.len() > LISTED {
            let _infallible = writeln!(text, "... and {} more", self.alone.len() - LISTED);
        }
        if self.untimed {
            text.push_str(
                "times not compared: one of them has none, its clock was set, or recordings are joined\n",
            );
        }
        let same = if self.same() { "same: " } else { "differ: " };
        let _infallible = writeln!(
            text,
            "{same}{} in both, {} in one alone, times up to {} apart{}",
            counted(self.common, "frame"),
            self.alone.len(),
            self.apart,
            match self.late {
                0 => String::new(),
                late => format!(", {late} of them further than permitted"),
            }
        );
        text
    }
}

/// Compares frames and how they ended, in their order; times count from the first frame of each side.
#[must_use]
pub fn frame_diff(left: &Capture, right: &Capture, tolerance: Span) -> FrameSummary {
    let sides = [frames(left), frames(right)];
    let seams = |capture: &Capture| capture.traces.iter().any(|trace| !trace.seams.is_empty());
    let mut summary = FrameSummary {
        untimed: seams(left) || seams(right) || !left.timed || !right.timed,
        ..FrameSummary::default()
    };
    let mut at = [0, 0];
    while at[0] < sides[0].len() || at[1] < sides[1].len() {
        let (left, right) = (sides[0].get(at[0]), sides[1].get(at[1]));
        if let (Some(left), Some(right)) = (left, right)
            && key(left) == key(right)
        {
            summary.meet(
                since_first(&sides[0], left),
                since_first(&sides[1], right),
                tolerance,
            );
            at = [at[0] + 1, at[1] + 1];
            continue;
        }
        let skip = next_common(&sides[0][at[0]..], &sides[1][at[1]..]);
        for side in [0, 1] {
            let end = skip.map_or(sides[side].len(), |skip| at[side] + skip[side]);
            let skipped = sides[side][at[side]..end].iter();
            summary
                .alone
                .extend(skipped.map(|frame| (side, frame.at, shown(frame))));
            at[side] = end;
        }
    }
    summary
}

impl FrameSummary {
    fn meet(&mut self, left: Span, right: Span, tolerance: Span) {
        self.common += 1;
        if self.untimed {
            return;
        }
        let apart = left.max(right).saturating_sub(left.min(right));
        self.apart = self.apart.max(apart);
        self.late += usize::from(apart > tolerance);
    }
}

fn frames(capture: &Capture) -> Vec<&LineFrame> {
    let channels = capture.traces.iter().flat_map(|trace| &trace.channels);
    channels.flat_map(|channel| channel.frames()).collect()
}

fn since_first(side: &[&LineFrame], frame: &LineFrame) -> Span {
    side.first()
        .map_or(Span::ZERO, |first| frame.at.since(first.at))
}

fn key(frame: &LineFrame) -> (harness_proto::can::Frame, FrameEnd) {
    (frame.frame, frame.ended)
}

fn shown(frame: &LineFrame) -> String {
    match frame.ended {
        FrameEnd::Good => frame.frame.to_string(),
        FrameEnd::Lost => format!("{} (lost)", frame.frame),
        FrameEnd::Error(error) => format!("{} ({error})", frame.frame),
    }
}

/// How many frames each side skips to the nearest common one.
fn next_common(left: &[&LineFrame], right: &[&LineFrame]) -> Option<[usize; 2]> {
    let most = (left.len() + right.len()).min(AHEAD);
    (1..=most).find_map(|sum| {
        let splits = (0..=sum).map(|skip| [skip, sum - skip]);
        splits
            .filter(|[skip, other]| *skip < left.len() && *other < right.len())
            .find(|[skip, other]| key(left[*skip]) == key(right[*other]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(lines: &[(&str, &str)]) -> Capture {
        let lines = lines
            .iter()
            .map(|(time, frame)| format!("({time}) can0 {frame}\n"));
        super::super::read(lines.collect::<String>().as_bytes(), None).expect("a log")
    }

    #[test]
    fn equal_frames_at_other_times() {
        let left = log(&[("1.0", "201#3D4000"), ("1.001", "181#40810100")]);
        let right = log(&[("9.0", "201#3D4000"), ("9.003", "181#40810100")]);
        let ms = Span::from_millis;
        let summary = frame_diff(&left, &right, ms(2));
        assert!(summary.same());
        assert_eq!((summary.common, summary.apart), (2, ms(2)));
        assert!(!frame_diff(&left, &right, ms(1)).same());
        let text = summary.show(["a", "b"]);
        assert_eq!(
            text,
            "same: 2 frames in both, 0 in one alone, times up to 2.000 ms apart\n"
        );
    }

    #[test]
    fn a_frame_of_one_side_alone() {
        let left = log(&[("1.0", "201#"), ("1.1", "181#AA"), ("1.2", "202#")]);
        let right = log(&[("1.0", "201#"), ("1.2", "202#"), ("1.3", "203#")]);
        let summary = frame_diff(&left, &right, Span::from_millis(500));
        assert_eq!(summary.common, 2);
        let alone: Vec<_> = summary
            .alone
            .iter()
            .map(|(side, _, text)| (*side, text.as_str()))
            .collect();
        assert_eq!(alone, [(0, "181#AA"), (1, "203#")]);
        let text = summary.show(["a", "b"]);
        assert!(
            text.starts_with("only in a: ") && text.contains("only in b: "),
            "{text}"
        );
    }
}
