//! Exit codes.

use crate::evidence::EvidenceError;
use crate::regular::is_wrong_path;
use crate::scenario::verdict::Verdict;
use std::process::ExitCode;

/// The program's exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Everything passed.
    Passed = 0,
    /// A drive did not behave as the scenario or the command says, or differs from a file; or a campaign's pinned figure was not
    /// met.
    Failed = 1,
    /// Wrong usage, a file with mistakes, or something that needs `--move` or `--yes`.
    Usage = 2,
    /// The bench itself failed.
    RigError = 3,
    /// Nothing was selected.
    NothingSelected = 4,
    /// Nothing failed, but not everything could be shown.
    Incomplete = 5,
    /// An interlock tripped, or the longest run was over; the safe state was reached.
    Interlock = 6,
    /// The safe state could not be confirmed.
    NotSafe = 7,
    /// Another process or user holds the bench.
    Busy = 75,
    /// Interrupted (Ctrl-C, SIGTERM, SIGHUP, SIGQUIT); the safe state was reached.
    Interrupted = 130,
}

impl Exit {
    /// Every code with its meaning, for `--help`.
    pub const HELP: &str = "\
Exit codes:
  0  everything passed
  1  a drive failed a scenario or a command, or differs from a file; a figure of a campaign differs
     from the pinned one
  2  wrong usage, a file with mistakes, a scenario that could not be played to its end (aborted) or that was
     named and is denied by the rig's [limits], or something that needs --move or --yes
  3  the rig failed
  4  nothing was selected
  5  passed but incomplete: nothing was judged (every scenario was skipped), the run ended early, a scenario
     was inconclusive or flaky, or one was skipped under --require-all
  6  an interlock of the rig tripped, or its max_run was over; the safe state was reached
  7  the safe state could not be confirmed: look at the machine
  75 another user or process holds the rig
  130 interrupted; the safe state was reached";

    /// The code where a file could not be used: wrong usage where its path or the rights to it are wrong, a bench that failed where the disk
    /// is full or broken.
    #[must_use]
    pub fn of_file(error: &std::io::Error) -> Self {
        match is_wrong_path(error) {
            true => Self::Usage,
            false => Self::RigError,
        }
    }

    /// The code where a folder of evidence could not be used.
    #[must_use]
    pub fn of_evidence(error: &EvidenceError) -> Self {
        match error {
            EvidenceError::File { error, .. } => Self::of_file(error),
            _ => Self::Usage,
        }
    }

    /// The code where, beside what it stands for, the bench itself failed: a rig error is graver than a verdict, and not graver than a
    /// tripped interlock, an interruption or a safe state that is not confirmed.
    #[must_use]
    pub const fn with_rig_error(self) -> Self {
        match self {
            Self::Interlock | Self::NotSafe | Self::Busy | Self::Interrupted => self,
            _ => Self::RigError,
        }
    }

    /// The code for the verdicts of a run; `require_all` counts skipped scenarios as missing. A run that has judged nothing has shown
    /// nothing: it is incomplete.
    #[must_use]
    pub fn of(verdicts: &[Verdict], require_all: bool) -> Self {
        let any = |verdict| verdicts.contains(&verdict);
        if verdicts.is_empty() {
            Self::NothingSelected
        } else if any(Verdict::RigError) {
            Self::RigError
        } else if any(Verdict::Aborted) {
            Self::Usage
        } else if any(Verdict::Failed) {
            Self::Failed
        } else if any(Verdict::Inconclusive)
            || any(Verdict::Flaky)
            || require_all && any(Verdict::Skipped)
            || verdicts.iter().all(|verdict| *verdict == Verdict::Skipped)
        {
            Self::Incomplete
        } else {
            Self::Passed
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The most serious verdict decides, and what was only skipped has shown nothing.
    #[test]
    fn verdicts_and_their_exit_codes() {
        let code = |gravest| match gravest {
            Verdict::RigError => Exit::RigError,
            Verdict::Aborted => Exit::Usage,
            Verdict::Failed => Exit::Failed,
            Verdict::Inconclusive | Verdict::Flaky | Verdict::Skipped => Exit::Incomplete,
            Verdict::Marginal | Verdict::Passed => Exit::Passed,
        };
        for some in 0..1_u32 << Verdict::ALL.len() {
            let numbered = (0..).zip(Verdict::ALL);
            let chosen = numbered.filter(|(place, _)| some >> place & 1 == 1);
            let verdicts: Vec<_> = chosen.map(|(_, verdict)| verdict).collect();
            let expected = verdicts
                .last()
                .map_or(Exit::NothingSelected, |verdict| code(*verdict));
            assert_eq!(Exit::of(&verdicts, false), expected, "{verdicts:?}");
            let required = match expected {
                Exit::Passed if verdicts.contains(&Verdict::Skipped) => Exit::Incomplete,
                other => other,
            };
            assert_eq!(Exit::of(&verdicts, true), required, "{verdicts:?}");
        }
    }
}
