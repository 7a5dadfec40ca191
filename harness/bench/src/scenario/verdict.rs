//! Verdicts, the most serious last.

use std::fmt;

/// The verdict on a scenario. A later one is more serious.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Verdict {
    /// Not played: the rig lacks something.
    Skipped,
    /// Everything was as the scenario says.
    Passed,
    /// As the scenario says, but only just.
    Marginal,
    /// One attempt of several was as the scenario says.
    Flaky,
    /// The transport could not have shown a failure.
    Inconclusive,
    /// A drive did not behave as the scenario says.
    Failed,
    /// It could not be played to its end.
    Aborted,
    /// The bench failed, not the drive.
    RigError,
}

impl Verdict {
    /// All, in order of gravity.
    pub const ALL: [Self; 8] = [
        Self::Skipped,
        Self::Passed,
        Self::Marginal,
        Self::Flaky,
        Self::Inconclusive,
        Self::Failed,
        Self::Aborted,
        Self::RigError,
    ];

    /// All but passed and failed, in order of gravity.
    pub const REST: [Self; 6] = [
        Self::Skipped,
        Self::Marginal,
        Self::Flaky,
        Self::Inconclusive,
        Self::Aborted,
        Self::RigError,
    ];

    /// The word in records and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Skipped => "skipped",
            Self::Passed => "passed",
            Self::Marginal => "marginal",
            Self::Flaky => "flaky",
            Self::Inconclusive => "inconclusive",
            Self::Failed => "failed",
            Self::Aborted => "aborted",
            Self::RigError => "rig-error",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
