//! The level of a line over time, as logic analysers record it.

use super::numbers::SignedTime;

/// The level of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineLevel {
    /// 0.
    Low,
    /// 1.
    High,
    /// Nothing was recorded.
    Unknown,
}

impl LineLevel {
    /// The level of a character: `0`, `1`, or `X` and `Z`, which are unknown. `None` for others.
    pub(super) const fn of(character: u8) -> Option<Self> {
        match character {
            b'0' => Some(Self::Low),
            b'1' => Some(Self::High),
            b'x' | b'X' | b'z' | b'Z' => Some(Self::Unknown),
            _ => None,
        }
    }
}

/// A change: from this time on the line has this level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LevelChange {
    pub(super) at: SignedTime,
    pub(super) level: LineLevel,
}

/// What a line did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Levels {
    pub(super) changes: Vec<LevelChange>,
    /// The time between two samples, where the file says it.
    pub(super) sample: Option<SignedTime>,
    /// The end of the last level, if the file says it.
    pub(super) end: Option<SignedTime>,
}

/// The time between samples at a rate.
pub(super) fn sample_time(samples_per_second: u64) -> Option<SignedTime> {
    SignedTime::try_from(3_000_000_000_u64.checked_div(samples_per_second)?).ok()
}

impl Levels {
    /// The changes, each later than the one before it and to another level.
    pub(super) fn changes(&self) -> &[LevelChange] {
        &self.changes
    }

    /// The line has this level from `at` on. Of several levels at one time the last counts; `false` where the time goes back.
    pub(super) fn push(&mut self, at: SignedTime, level: LineLevel) -> bool {
        if let Some(last) = self.changes.last() {
            if at < last.at {
                return false;
            }
            if at == last.at {
                self.changes.pop();
            }
        }
        if self.changes.last().is_none_or(|last| last.level != level) {
            self.changes.push(LevelChange { at, level });
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changes_are_kept() {
        let mut levels = Levels::default();
        for (at, level) in [
            (0, LineLevel::High),
            (1, LineLevel::High),
            (2, LineLevel::Low),
            (2, LineLevel::High),
            (3, LineLevel::Low),
        ] {
            assert!(levels.push(at, level));
        }
        assert!(!levels.push(2, LineLevel::High));
        let at: Vec<_> = levels.changes().iter().map(|change| change.at).collect();
        assert_eq!(at, [0, 3]);
    }
}
