//! Hypotheses, judged by what their twins answer.

use crate::language::syntax::Header;
use crate::twin::{Conversation, Exactness, Silences, Twin};
use harness_proto::time::Span;

/// A model with something changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Hypothesis {
    /// The assumption, as text for people.
    pub name: String,
    /// What makes simulated drives behave so.
    pub header: Header,
}

/// How well a hypothesis explains the bytes received.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Fit {
    /// All differences of times together.
    pub apart: Span,
    /// Whether every byte also came at the predicted time.
    pub timely: bool,
    /// How many cells hold what the master wrote, where the hypothesis says that they hold something else.
    pub against: u64,
    /// How many bytes were compared. Behind bytes that drives send unasked (ND21 9.9) none is.
    pub compared: u64,
}

/// The hypotheses that explain every byte of all conversations, with their evidence, in the order given. If one of them also explains the
/// times, those that do not are left out.
///
/// # Errors
/// The error of `twin` for a header that does not describe a ring.
pub(crate) fn explaining<'h, E>(
    hypotheses: &'h [Hypothesis],
    conversations: &[Conversation],
    exactness: Exactness,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Result<Vec<(&'h Hypothesis, Fit)>, E> {
    let mut explaining = Vec::new();
    for hypothesis in hypotheses {
        let twin = twin(&hypothesis.header)?;
        if let Some(evidence) = judge(twin, conversations, exactness) {
            explaining.push((hypothesis, evidence));
        }
    }
    if explaining.iter().any(|(_, evidence)| evidence.timely) {
        explaining.retain(|(_, evidence)| evidence.timely);
    }
    Ok(explaining)
}

/// How well a twin explains conversations; none where a byte differs.
pub(crate) fn judge(
    twin: Twin,
    conversations: &[Conversation],
    exactness: Exactness,
) -> Option<Fit> {
    fit(twin, conversations, exactness).ok()
}

/// The same.
///
/// # Errors
/// How many bytes were compared up to the first that differs.
pub(super) fn fit(
    mut twin: Twin,
    conversations: &[Conversation],
    exactness: Exactness,
) -> Result<Fit, u64> {
    let mut evidence = Fit {
        timely: true,
        ..Fit::default()
    };
    for comparison in twin.follow_while_alike(conversations, exactness, Silences::Noted) {
        evidence.compared += comparison.compared;
        if comparison.divergence.is_some() {
            return Err(evidence.compared);
        }
        evidence.apart = evidence.apart + comparison.apart;
        evidence.timely &= comparison.untimely.is_none();
        evidence.against += comparison.against;
    }
    Ok(evidence)
}
