//! What comes of playing: outcome, finding, and why playing stops.

use super::record::Record;
use crate::link::Trouble;
use crate::scenario::pattern::Expected;
use crate::scenario::problem::Span;
use crate::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::time;

/// What came of a scenario.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// The first thing that was otherwise; playing stops there.
    pub finding: Option<Finding>,
    /// What is worth saying although nothing failed.
    pub remarks: Vec<String>,
    /// How long it took, on the line's clock.
    pub took: time::Span,
    /// The cells that it recorded.
    pub records: Vec<Record>,
}

impl Outcome {
    /// A scenario that is not played, and why.
    #[must_use]
    pub fn skipped(remark: String) -> Self {
        Self::not_played(Verdict::Skipped, remark)
    }

    /// A scenario that the bench could not play, and why.
    #[must_use]
    pub fn rig_error(remark: String) -> Self {
        Self::not_played(Verdict::RigError, remark)
    }

    fn not_played(verdict: Verdict, remark: String) -> Self {
        Self {
            verdict,
            finding: None,
            remarks: vec![remark],
            took: time::Span::ZERO,
            records: Vec::new(),
        }
    }
}

/// Something that was otherwise than a step says.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The step.
    pub span: Span,
    /// What is wrong, in a sentence.
    pub message: String,
    /// Where the bytes differ, if bytes are what differs.
    pub difference: Option<Difference>,
    /// The drives that were in the error mode then, in words; empty where none was or where this cannot
    /// be seen.
    pub in_error: String,
}

/// Bytes that differ.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Which ring, counted from 0.
    pub ring: usize,
    /// Which byte that the master received, counted from 1.
    pub byte: usize,
    /// When it was received; none where it never came.
    pub at: Option<time::Instant>,
    /// Which byte of the line, counted from 0.
    pub index: usize,
    /// What the line says.
    pub expected: Vec<Expected>,
    /// What was received, as far as it came.
    pub received: Vec<Received>,
}

/// Why playing stops.
pub(super) struct Stop {
    pub(super) verdict: Verdict,
    pub(super) finding: Box<Finding>,
}

impl Stop {
    pub(super) fn failed(span: Span, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Failed,
            finding: Box::new(Finding {
                span,
                message: message.into(),
                difference: None,
                in_error: String::new(),
            }),
        }
    }

    /// What is wrong, in a sentence.
    pub(super) fn into_message(self) -> String {
        self.finding.message
    }

    pub(super) fn inconclusive(span: Span, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Inconclusive,
            ..Self::failed(span, message)
        }
    }

    /// All bytes are right, and some were late.
    pub(super) fn marginal(span: Span, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Marginal,
            ..Self::failed(span, message)
        }
    }

    /// The bench's fault; a denied command and an interruption are nobody's.
    pub(super) fn trouble(span: Span, trouble: &Trouble) -> Self {
        let verdict = match trouble {
            Trouble::Lost(_) | Trouble::Garbled(_) | Trouble::Interlock(_) => Verdict::RigError,
            Trouble::Denied(_) | Trouble::Interrupted => Verdict::Aborted,
        };
        Self {
            verdict,
            ..Self::failed(span, trouble.to_string())
        }
    }

    pub(super) fn aborted(span: Span, message: impl Into<String>) -> Self {
        Self {
            verdict: Verdict::Aborted,
            ..Self::failed(span, message)
        }
    }

    pub(super) fn differs(mut self, difference: Difference) -> Self {
        self.finding.difference = Some(difference);
        self
    }
}
