//! What comes of playing: outcome, finding, and why playing stops.

use super::record::CellRecord;
use crate::counted::counted;
use crate::link::Trouble;
use crate::scenario::language::Language;
use crate::scenario::pattern::Expected;
use crate::scenario::plan::Plan;
use crate::scenario::problem::TextSpan;
use crate::scenario::run::skip::Skip;
use crate::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::time::{self, Span};

/// Why what plays to its end has not passed.
const NOTHING_JUDGED: &str =
    "nothing was judged: no step says what must come back; add a line such as `<`";

/// The outcome of a scenario.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub verdict: Verdict,
    /// The first thing that was not as a step says; playing stops there.
    pub finding: Option<Mismatch>,
    /// Where the unmet steps begin, if playing continued after the first one.
    pub unmet: Vec<usize>,
    /// Notes, also when nothing failed.
    pub remarks: Vec<String>,
    /// How long it took, on the line's clock.
    pub took: Span,
    /// The cells that it recorded.
    pub records: Vec<CellRecord>,
    /// Why no step was played although the rig has all that the scenario needs: a drive could not be made ready.
    pub unready: Option<Unready>,
    /// The computer or the adapter may have caused all that was not as a step says: another attempt speaks for this one.
    pub shows_nothing: bool,
    /// Why it was skipped; `None` where it was not, and where this is read from a record.
    pub skip: Option<Skip>,
}

/// How a drive could not be made ready for a scenario: reset, or set to hold what the header says. The first remark of the
/// [outcome](Outcome) says which drive and which cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unready {
    /// It gave no right answer. Where time is real, a computer that stalled may be the cause.
    NoAnswer,
    /// A cell does not hold what was written to it.
    Differs,
}

impl Outcome {
    /// A scenario that is not played, and why.
    #[must_use]
    pub fn skipped(skip: Skip) -> Self {
        Self {
            skip: Some(skip.clone()),
            ..Self::not_played(Verdict::Skipped, skip.why.to_string())
        }
    }

    /// A scenario that the bench could not play, and why.
    #[must_use]
    pub fn rig_error(remark: String) -> Self {
        Self::not_played(Verdict::RigError, remark)
    }

    /// A scenario that trouble of the link has ended before its first step.
    #[must_use]
    pub fn trouble(trouble: &Trouble) -> Self {
        Self::not_played(trouble.verdict(), trouble.to_string())
    }

    /// The outcome with the trouble of the link after its last step: the earlier judgement becomes a remark.
    #[must_use]
    pub fn ended_by(self, trouble: &Trouble) -> Self {
        let before = format!("before that: {}", self.verdict);
        let found = self.finding.map(|finding| finding.message);
        let remarks = [trouble.to_string(), before].into_iter();
        Self {
            verdict: trouble.verdict(),
            finding: None,
            remarks: remarks.chain(found).chain(self.remarks).collect(),
            ..self
        }
    }

    /// The same, which has not passed where no step of the scenario judges anything.
    pub fn judged_by<L: Language>(mut self, plan: &Plan<L>) -> Self {
        if !plan.judges() {
            self.judged_nothing();
        }
        self
    }

    /// The same where nothing was judged: it has not passed.
    pub fn judged_nothing(&mut self) {
        if self.verdict == Verdict::Passed {
            self.verdict = Verdict::Inconclusive;
            self.remarks.push(NOTHING_JUDGED.to_owned());
        }
    }

    /// The same where the transport reported this number of line errors or losses without their place: neither a pass nor a failure is proven.
    pub fn unplaced(&mut self, count: u64) {
        let verdict = self.verdict;
        if count > 0
            && matches!(
                verdict,
                Verdict::Passed | Verdict::Failed | Verdict::Marginal
            )
        {
            self.verdict = Verdict::Inconclusive;
            self.remarks.push(format!(
                "{} reported without a place: the transport cannot show what was damaged or lost, or another program uses the port",
                counted(count, "line error")
            ));
        }
    }

    /// A scenario that a drive could not be prepared for, and what was wrong with the drive.
    #[must_use]
    pub fn not_ready(verdict: Verdict, unready: Unready, remark: String) -> Self {
        Self {
            unready: Some(unready),
            ..Self::not_played(verdict, remark)
        }
    }

    fn not_played(verdict: Verdict, remark: String) -> Self {
        Self {
            verdict,
            finding: None,
            unmet: Vec::new(),
            remarks: vec![remark],
            took: Span::ZERO,
            records: Vec::new(),
            unready: None,
            shows_nothing: false,
            skip: None,
        }
    }
}

impl Trouble {
    /// The verdict of an attempt that this trouble ends. Trouble is the bench's fault, except for a denied command and an
    /// interruption.
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Lost(_) | Self::Garbled(_) | Self::Interlock(_) => Verdict::RigError,
            Self::Denied(_) | Self::Interrupted => Verdict::Aborted,
        }
    }
}

/// Something that was not as a step says.
#[derive(Clone, Debug)]
pub struct Mismatch {
    pub span: TextSpan,
    /// What is wrong, in a sentence.
    pub message: String,
    /// Where the bytes differ, if bytes are what differs.
    pub difference: Option<ByteDifference>,
    /// The drives that were in the error mode then, in words; empty where none was or where this cannot
    /// be seen.
    pub in_error: String,
}

/// Bytes that differ.
#[derive(Clone, Debug)]
pub struct ByteDifference {
    /// Which ring, counted from 0.
    pub ring: usize,
    /// Which byte that the master received, counted from 1.
    pub byte: usize,
    /// When it was received; `None` if it never was.
    pub at: Option<time::Instant>,
    /// Which byte of the line, counted from 0.
    pub index: usize,
    /// What the line says.
    pub expected: Vec<Expected>,
    /// What was received, as far as anything was.
    pub received: Vec<Received>,
}

impl ByteDifference {
    /// Whether a byte differs only by not having come yet.
    pub fn is_absence(&self) -> bool {
        self.at.is_none() && !self.expected.is_empty()
    }
}

/// Why playing stops.
pub struct Stop {
    pub verdict: Verdict,
    pub finding: Box<Mismatch>,
}

impl Stop {
    pub fn failed(span: TextSpan, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Failed,
            finding: Box::new(Mismatch {
                span,
                message: message.into(),
                difference: None,
                in_error: String::new(),
            }),
        }
    }

    /// What is wrong, in a sentence.
    pub fn into_message(self) -> String {
        self.finding.message
    }

    pub fn inconclusive(span: TextSpan, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Inconclusive,
            ..Self::failed(span, message)
        }
    }

    /// All bytes are right, and some were late.
    pub fn marginal(span: TextSpan, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Marginal,
            ..Self::failed(span, message)
        }
    }

    /// Trouble of the link.
    pub fn trouble(span: TextSpan, trouble: &Trouble) -> Self {
        Self {
            verdict: trouble.verdict(),
            ..Self::failed(span, trouble.to_string())
        }
    }

    pub fn aborted(span: TextSpan, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Aborted,
            ..Self::failed(span, message)
        }
    }

    /// The same with the pieces that differ, where they are shown.
    pub fn with(mut self, difference: Option<ByteDifference>) -> Self {
        self.finding.difference = difference;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was damaged or lost without a place may be a reply, or what a reply differed by.
    #[test]
    fn losses_without_a_place_prove_nothing() {
        for verdict in [Verdict::Passed, Verdict::Failed, Verdict::Marginal] {
            let played = || Outcome {
                verdict,
                ..Outcome::rig_error(String::new())
            };
            let mut none = played();
            none.unplaced(0);
            assert_eq!(none.verdict, verdict);
            let mut some = played();
            some.unplaced(1);
            assert_eq!(some.verdict, Verdict::Inconclusive);
            let remark = some.remarks.last().expect("a remark");
            assert!(
                remark.starts_with("1 line error reported without a place"),
                "{remark}"
            );
        }
        let mut rig = Outcome::rig_error(String::new());
        rig.unplaced(1);
        assert_eq!(rig.verdict, Verdict::RigError);
    }
}
