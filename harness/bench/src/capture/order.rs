//! The order and the times of the frames of a file. Programs write frames as they come, so the order of a file is that of the bus, whatever its
//! clock says: it may have been set in the middle.

use super::frames::FrameRead;
use crate::counted::counted;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Seam, SeamKind};
use std::collections::BTreeMap;

/// The longest time, in nanoseconds, that is one since the start, and not one since 1970: a day.
const DAY: u64 = 86_400_000_000_000;

/// So far, in nanoseconds, may times go back without a clock that was set: frames are stamped by several parts of a computer.
const JITTER: i128 = 1_000_000;

/// Later than any clock, with room for sums.
const LATEST: u64 = u64::MAX / 8;

/// The place of a frame in its file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    /// Its line, row or packet, counted from 1.
    pub(super) number: usize,
    /// Its section of the file; sections are in any order.
    pub(super) section: usize,
    /// The recording of which it is part: the file does not have what was on the bus between two of them.
    pub(super) recording: usize,
}

impl Place {
    pub(super) fn of(number: usize) -> Self {
        Self {
            number,
            ..Self::default()
        }
    }
}

/// What [`Place::number`] counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counts {
    Lines,
    Frames,
    /// Packets of a capture: their times count from the start of a recording, or are those of a computer.
    Packets,
}

impl Counts {
    const fn noun(self) -> &'static str {
        match self {
            Self::Lines => "line",
            Self::Frames => "frame",
            Self::Packets => "packet",
        }
    }
}

/// The frames of a file in the order of the bus, and when each had ended.
#[derive(Debug, Default)]
pub(super) struct Ordered {
    pub(super) frames: Vec<(Instant, FrameRead)>,
    pub(super) seams: Vec<Seam>,
    pub(super) notes: Vec<String>,
}

/// Puts the frames of a file in order; `length` is the time that a frame takes.
pub(super) fn ordered(
    frames: Vec<FrameRead>,
    counts: Counts,
    length: impl Fn(&FrameRead) -> Span,
) -> Ordered {
    let mut all = Ordered::default();
    let Some(first) = frames.first() else {
        return all;
    };
    let frames = sections(frames.clone(), *first);
    let mut clock = FileClock::default();
    for (index, frame) in frames.into_iter().enumerate() {
        if let Some(kind) = clock.next(&frame, counts, length(&frame).as_nanos()) {
            all.seams.push(Seam { piece: index, kind });
        }
        let at = u64::try_from(clock.now).unwrap_or(0).min(LATEST);
        all.frames
            .push((Instant::START + Span::from_nanos(at), frame));
    }
    all.notes = clock.notes(&all.seams, counts);
    all
}

/// Sections that follow each other in time, in order of time; others in that of the file.
fn sections(mut frames: Vec<FrameRead>, first: FrameRead) -> Vec<FrameRead> {
    if frames
        .iter()
        .all(|frame| frame.place.section == first.place.section)
    {
        return frames;
    }
    let mut spans: BTreeMap<usize, (u64, u64)> = BTreeMap::new();
    for frame in &frames {
        let span = spans
            .entry(frame.place.section)
            .or_insert((frame.nanos, frame.nanos));
        *span = (span.0.min(frame.nanos), span.1.max(frame.nanos));
    }
    let spans = spans.into_iter();
    let mut ranks: Vec<_> = spans.map(|(section, span)| (span, section)).collect();
    ranks.sort_unstable();
    let overlap = ranks.windows(2).any(|two| two[1].0.0 < two[0].0.1);
    if !overlap {
        let rank = |frame: &FrameRead| ranks.iter().position(|rank| rank.1 == frame.place.section);
        frames.sort_by_key(rank);
    }
    frames
}

/// The clock of a file.
#[derive(Debug, Default)]
struct FileClock {
    before: Option<Place>,
    /// The time of the first frame since the clock was last set.
    first: u64,
    /// What is subtracted from times.
    base: i128,
    /// When the last frame had ended, in nanoseconds since the start.
    now: i128,
    /// Where the clock was set, and how far it went back.
    set: Vec<(Place, i128)>,
    /// Where times first went back by less, and how far at most.
    jitter: Option<(Place, i128)>,
    /// Where further recordings begin.
    recordings: Vec<Place>,
}

impl FileClock {
    /// Advances to a frame. Returns what separates it from the one before, where times are not continuous.
    fn next(&mut self, frame: &FrameRead, counts: Counts, length: u64) -> Option<SeamKind> {
        let nanos = i128::from(frame.nanos);
        let Some(before) = self.before.replace(frame.place) else {
            self.first = frame.nanos;
            self.base = if frame.nanos > DAY {
                nanos - i128::from(length)
            } else {
                0
            };
            self.now = nanos - self.base;
            return None;
        };
        let at = nanos - self.base;
        let back = self.now - at;
        let since_start = frame.nanos < DAY && self.first < DAY;
        let begins_again = since_start
            && (frame.nanos <= self.first
                || counts == Counts::Packets
                || before.section != frame.place.section);
        let kind = if before.recording != frame.place.recording || back > JITTER && begins_again {
            self.recordings.push(frame.place);
            SeamKind::Recording
        } else if back > JITTER {
            self.set.push((frame.place, back));
            SeamKind::ClockSet
        } else {
            if back > 0 {
                let most = self.jitter.get_or_insert((frame.place, back));
                most.1 = most.1.max(back);
            }
            self.now = self.now.max(at);
            return None;
        };
        if back > 0 {
            self.now += i128::from(length);
            self.base = nanos - self.now;
        } else {
            self.now = at;
        }
        self.first = frame.nanos;
        Some(kind)
    }

    fn notes(&self, seams: &[Seam], counts: Counts) -> Vec<String> {
        let noun = counts.noun();
        let time = |nanos: i128| Span::from_nanos(u64::try_from(nanos).unwrap_or(0).min(LATEST));
        let mut notes = Vec::new();
        if let Some((place, back)) = self.set.first() {
            let more = match self.set.len() {
                1 => String::new(),
                all => format!(", and at {}", counted(all - 1, "other place")),
            };
            notes.push(format!(
                "the clock was set during the log, at {noun} {}: times go back by {} there{more}. The order of the {noun}s is kept, and no time is judged across such a place",
                place.number,
                time(*back)
            ));
        }
        if let Some(place) = self.recordings.first() {
            notes.push(format!(
                "a new recording begins at {noun} {}: the log has {}, each of which is judged for itself",
                place.number,
                counted(self.recordings.len() + 1, "recording")
            ));
        }
        if let Some((place, most)) = self.jitter.filter(|_| seams.is_empty()) {
            notes.push(format!(
                "times go back by up to {}, first at {noun} {}: the order of the {noun}s is kept",
                time(most),
                place.number
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::Sender;
    use super::*;
    use harness_sim::record::FrameEnd;

    const EPOCH: u64 = 1_700_000_000_000_000_000;
    const MS: u64 = 1_000_000;

    fn read(nanos: u64, place: Place) -> FrameRead {
        FrameRead {
            nanos,
            sender: Sender::ByIdentifier,
            frame: "201#3D4000".parse().expect("a frame"),
            ended: FrameEnd::Good,
            place,
        }
    }

    /// The ends of frames in microseconds, the seams and the notes; a frame lasts 100 us.
    fn times(nanos: &[u64], counts: Counts) -> (Vec<u64>, Vec<Seam>, Vec<String>) {
        let frames = nanos.iter().zip(1..);
        let frames = frames.map(|(nanos, number)| read(*nanos, Place::of(number)));
        let all = ordered(frames.collect(), counts, |_| Span::from_micros(100));
        let ends = all
            .frames
            .iter()
            .map(|(at, _)| at.since_start().as_nanos() / 1_000);
        (ends.collect(), all.seams, all.notes)
    }

    #[test]
    fn a_clock_that_was_set_reorders_nothing() {
        let stamps = [600, 0, 300].map(|ms| EPOCH + ms * MS);
        let (ends, seams, notes) = times(&stamps, Counts::Lines);
        assert_eq!(ends, [100, 200, 300_200]);
        let seam = |piece, kind| Seam { piece, kind };
        assert_eq!(seams, [seam(1, SeamKind::ClockSet)]);
        assert!(
            notes[0].starts_with("the clock was set during the log, at line 2"),
            "{notes:?}"
        );
        // To a time after the first one, also where times count from the start.
        let (_, seams, _) = times(&[100 * MS, 600 * MS, 200 * MS], Counts::Lines);
        assert_eq!(seams, [seam(2, SeamKind::ClockSet)]);
    }

    #[test]
    fn times_that_begin_again_begin_a_recording() {
        let (ends, seams, notes) = times(&[MS, 9 * MS, MS, 3 * MS], Counts::Lines);
        assert_eq!(ends, [1_000, 9_000, 9_100, 11_100]);
        let recording = |piece| Seam {
            piece,
            kind: SeamKind::Recording,
        };
        assert_eq!(seams, [recording(2)]);
        assert!(
            notes[0].contains("at line 3: the log has 2 recordings"),
            "{notes:?}"
        );
        // Packets of two captures, one after the other.
        let (_, seams, _) = times(&[MS, 900 * MS, 300 * MS], Counts::Packets);
        assert_eq!(seams, [recording(2)]);
    }

    #[test]
    fn stamps_that_differ_a_little_set_no_clock() {
        let (ends, seams, notes) = times(&[MS, 2 * MS, 2 * MS - 300_000, 3 * MS], Counts::Lines);
        assert_eq!(ends, [1_000, 2_000, 2_000, 3_000]);
        assert_eq!(seams, []);
        assert!(
            notes[0].contains("up to 0.300 ms, first at line 3"),
            "{notes:?}"
        );
    }

    #[test]
    fn sections_are_in_any_order_unless_they_overlap() {
        let order = |stamps: &[(usize, u64)]| {
            let frames = stamps.iter().zip(1..).map(|((section, ms), number)| {
                let place = Place {
                    section: *section,
                    ..Place::of(number)
                };
                read(EPOCH + ms * MS, place)
            });
            let all = ordered(frames.collect(), Counts::Packets, |_| {
                Span::from_micros(100)
            });
            let frames = all.frames.iter();
            let order: Vec<_> = frames.map(|(_, frame)| frame.place.number).collect();
            (order, all.seams.len())
        };
        assert_eq!(
            order(&[(1, 50), (1, 60), (2, 10), (2, 20)]),
            (vec![3, 4, 1, 2], 0)
        );
        assert_eq!(
            order(&[(1, 50), (1, 60), (2, 55), (2, 90)]),
            (vec![1, 2, 3, 4], 1)
        );
    }
}
