//! Judges the drives of a bus: what differs, and what is in doubt.

use super::follower::Follower;
use super::symptom::FrameSymptom;
use harness_sim::record::LineFrame;

/// Differences and doubts that are kept at most.
pub(super) const MOST_BREACHES: usize = 50;

/// Something that a drive does, and that no value of what the manual leaves open explains.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// How it differs.
    pub what: FrameSymptom,
    /// The number of the frame where it shows, counted from 1.
    pub frame: usize,
    /// The drive.
    pub drive: u8,
    /// The register.
    pub register: u8,
    /// The section, example or appendix item, such as `ex 9`.
    pub section: &'static str,
    /// What was expected and what has come.
    pub about: String,
}

/// What came of judging frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JudgedDrives {
    /// What differs, in order.
    pub breaches: Vec<Breach>,
    /// Frames of drives that were compared.
    pub compared: usize,
    /// Values that were compared with what had been written.
    pub values: usize,
    /// What was not compared, in sentences.
    pub remarks: Vec<String>,
    /// What differs and may have another cause than a wrong drive, in sentences with their places: it accuses no drive, and nothing has passed.
    pub doubts: Vec<String>,
}

impl JudgedDrives {
    /// Notes what accuses no drive.
    pub(super) fn doubt(&mut self, about: String) {
        if self.doubts.len() < MOST_BREACHES {
            self.doubts.push(about);
        }
    }
}

/// Judges frames with these drives: number, and the identifiers on which each receives and sends.
#[must_use]
pub fn judge(frames: &[LineFrame], drives: &[(u8, (u16, u16))]) -> JudgedDrives {
    judge_with(frames, drives, Follower::new)
}

/// The same of drives whose identifiers are guessed from their frames.
#[must_use]
pub fn judge_guessed(frames: &[LineFrame], drives: &[(u8, (u16, u16))]) -> JudgedDrives {
    judge_with(frames, drives, Follower::guessed)
}

fn judge_with(
    frames: &[LineFrame],
    drives: &[(u8, (u16, u16))],
    of: fn(u8, (u16, u16)) -> Follower,
) -> JudgedDrives {
    let mut all = JudgedDrives::default();
    for &(drive, identifiers) in drives {
        let shared = |other: &&(u8, (u16, u16))| {
            let (rx, tx) = other.1;
            other.0 != drive && (rx == identifiers.0 || tx == identifiers.1)
        };
        if let Some((other, _)) = drives.iter().find(shared) {
            let remark = format!("drives {drive} and {other} share an identifier: not compared");
            all.remarks.push(remark);
            continue;
        }
        let mut follower = of(drive, identifiers);
        follower.others = drives.iter().map(|own| own.0).collect();
        for (index, frame) in frames.iter().enumerate() {
            follower.hear(index + 1, frame);
        }
        let own = follower.end(frames);
        all.breaches.extend(own.breaches);
        all.compared += own.compared;
        all.values += own.values;
        all.remarks.extend(own.remarks);
        all.doubts.extend(own.doubts);
    }
    all.breaches.sort_by_key(|own| own.frame);
    all
}
