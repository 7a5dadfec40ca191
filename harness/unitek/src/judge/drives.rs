//! Judges the drives of a bus: what differs, and what is in doubt.

use super::follower::Follower;
use super::symptom::FrameSymptom;
use crate::language::identifier;
use harness_bench::capture::gap::{self, Gap};
use harness_bench::counted::counted;
use harness_proto::time::Span;
use harness_sim::record::{LineFrame, Seam, SeamKind};
use std::collections::BTreeSet;

pub(super) const MOST_BREACHES: usize = 50;

/// Something that a drive does, and that no value of what the manual leaves open explains.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Breach {
    pub(crate) what: FrameSymptom,
    /// The number of the frame where it shows, counted from 1.
    pub(crate) frame: usize,
    pub(crate) drive: u8,
    pub(crate) register: u8,
    /// The section, example or appendix item, such as `ex 9`.
    pub(crate) section: &'static str,
    /// What was expected and what has come.
    pub(crate) about: String,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct JudgedDrives {
    /// What differs, in order.
    pub(crate) breaches: Vec<Breach>,
    /// Frames of drives that were compared.
    pub(crate) compared: usize,
    /// Frames that could be compared: `compared`, and those that may be of another station.
    pub(crate) replies: usize,
    /// The drives of which a frame was compared.
    pub(crate) heard: BTreeSet<u8>,
    /// Values that were compared with what had been written.
    pub(crate) values: usize,
    /// What was not compared, in sentences.
    pub(crate) remarks: Vec<String>,
    /// What differs and may have another cause than a wrong drive, in sentences with their places: it accuses no drive, and nothing has passed.
    pub(crate) doubts: Vec<String>,
}

impl JudgedDrives {
    pub(super) fn doubt(&mut self, about: String) {
        if self.doubts.len() < MOST_BREACHES {
            self.doubts.push(about);
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct HeardFrames<'f> {
    /// The frames, in order.
    pub(crate) frames: &'f [LineFrame],
    /// Where their times do not go on.
    pub(crate) seams: &'f [Seam],
    /// How far the time of each may be off.
    pub(crate) tolerance: Span,
}

impl<'f> HeardFrames<'f> {
    /// Frames with the times of the bus.
    #[cfg(test)]
    pub(crate) const fn exact(frames: &'f [LineFrame]) -> Self {
        Self {
            frames,
            seams: &[],
            tolerance: Span::ZERO,
        }
    }

    fn recordings(&self) -> impl Iterator<Item = Recording> {
        let begins = self.seams.iter();
        let begins = begins.filter(|seam| seam.kind == SeamKind::Recording);
        let mut places = vec![0];
        places.extend(begins.map(|seam| seam.piece));
        places.push(self.frames.len());
        let frames = self.frames;
        (1..places.len()).filter_map(move |end| {
            let part = frames.get(places[end - 1]..places[end])?;
            Some(Recording::of(places[end - 1], part))
        })
    }

    /// Whether the clock was set in front of a frame.
    fn clock_set(&self, piece: usize) -> bool {
        let here = self.seams.binary_search_by_key(&piece, |seam| seam.piece);
        here.is_ok_and(|place| self.seams[place].kind == SeamKind::ClockSet)
    }
}

/// A part of a log in which times go on.
struct Recording {
    /// The number of frames in front of it.
    before: usize,
    /// Its frames, at times that do not count the gaps.
    frames: Vec<LineFrame>,
    gaps: Vec<Gap>,
}

impl Recording {
    fn of(before: usize, frames: &[LineFrame]) -> Self {
        let mut gaps = gap::gaps(frames.iter().map(|frame| (frame.start, frame.at)));
        let mut frames = frames.to_vec();
        for gap in &mut gaps {
            for frame in frames.iter_mut().skip(gap.piece) {
                (frame.start, frame.at) = (frame.start - gap.silence, frame.at - gap.silence);
            }
            gap.piece += before;
        }
        Self {
            before,
            frames,
            gaps,
        }
    }
}

/// Judges frames with these drives: number, and the identifiers on which each receives and sends.
#[must_use]
pub(crate) fn judge(heard: HeardFrames<'_>, drives: &[(u8, (u16, u16))]) -> JudgedDrives {
    judge_with(heard, drives, Follower::new)
}

/// Judges drives whose identifiers are guessed from their frames.
#[must_use]
pub(crate) fn judge_guessed(heard: HeardFrames<'_>, drives: &[(u8, (u16, u16))]) -> JudgedDrives {
    judge_with(heard, drives, Follower::guessed)
}

fn judge_with(
    heard: HeardFrames<'_>,
    drives: &[(u8, (u16, u16))],
    of: fn(u8, (u16, u16)) -> Follower,
) -> JudgedDrives {
    let mut all = JudgedDrives::default();
    let (mut used, mut shared_by_two) = (BTreeSet::new(), BTreeSet::new());
    let recordings: Vec<Recording> = heard.recordings().collect();
    for &(drive, identifiers) in drives {
        let shared = |other: &&(u8, (u16, u16))| {
            let (rx, tx) = other.1;
            other.0 != drive && (rx == identifiers.0 || tx == identifiers.1)
        };
        if let Some((other, _)) = drives.iter().find(shared) {
            let remark = format!("drives {drive} and {other} share an identifier: not compared");
            all.remarks.push(remark);
            shared_by_two.insert(u32::from(identifiers.1));
            continue;
        }
        for recording in &recordings {
            let mut follower = of(drive, identifiers).with_tolerance(heard.tolerance);
            follower.others = drives.iter().map(|drive| drive.0).collect();
            if !follower.guessed {
                let others = drives.iter().map(|drive| drive.1.0);
                follower.elsewhere.declared = others.collect();
            }
            let (frames, mut gaps) = (&recording.frames, recording.gaps.iter().peekable());
            for (index, frame) in (recording.before..).zip(frames) {
                if heard.clock_set(index) {
                    follower.clock_set(frame.start);
                }
                if let Some(gap) = gaps.next_if(|gap| gap.piece == index) {
                    follower.gap(index + 1, frame.start, gap.silence);
                }
                follower.hear(index + 1, frame);
            }
            used.extend(follower.identifiers().map(u32::from));
            let judged = follower.end(recording.before + frames.len(), frames);
            all.breaches.extend(judged.breaches);
            all.compared += judged.compared;
            all.replies += judged.replies;
            all.heard.extend((judged.compared > 0).then_some(drive));
            all.values += judged.values;
            all.doubts.extend(judged.doubts);
            let new = judged.remarks.into_iter();
            let known = |remark: &String| all.remarks.contains(remark);
            let new: Vec<_> = new.filter(|remark| !known(remark)).collect();
            all.remarks.extend(new);
        }
    }
    let not_compared = |frame: &&LineFrame| shared_by_two.contains(&frame.frame.id().number());
    all.replies += heard.frames.iter().filter(not_compared).count();
    let numbers: Vec<u8> = drives.iter().map(|drive| drive.0).collect();
    let gaps = recordings.iter().flat_map(|recording| &recording.gaps);
    let gaps: Vec<Gap> = gaps.copied().collect();
    all.remarks.extend(gap::note(&gaps, "frame"));
    all.remarks.extend(others(heard.frames, &numbers, &used));
    all.breaches.sort_by_key(|breach| breach.frame);
    all
}

const MOST_SHOWN: usize = 8;

/// How many frames are neither to nor from one of the drives, and with which identifiers.
fn others(frames: &[LineFrame], drives: &[u8], used: &BTreeSet<u32>) -> Option<String> {
    let other = |frame: &&LineFrame| {
        let id = frame.frame.id();
        let of_drive = frame.from.is_some_and(|drive| drives.contains(&drive));
        !of_drive && (id.is_extended() || !used.contains(&id.number()))
    };
    let frames = frames.iter().filter(other).map(|frame| frame.frame.id());
    let ids: Vec<_> = frames.collect();
    let all: BTreeSet<String> = ids.iter().map(|id| identifier(*id)).collect();
    let shown: Vec<_> = all.iter().take(MOST_SHOWN).map(String::as_str).collect();
    let more = if all.len() > MOST_SHOWN { ", ..." } else { "" };
    (!all.is_empty()).then(|| {
        format!(
            "{} with {} of other devices not judged: {}{more}",
            counted(ids.len(), "frame"),
            counted(all.len(), "identifier"),
            shown.join(", ")
        )
    })
}
