//! Hypotheses, judged by what their twins answer.

use crate::twin::{Conversation, Exactness, Twin};
use harness_proto::time::Span;
use std::collections::BTreeMap;

/// A model with something changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hypothesis {
    /// What is supposed, for people.
    pub name: String,
    /// The header lines of the scenario language that make it so.
    pub lines: Vec<String>,
}

/// How well a hypothesis explains what came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evidence {
    /// All differences of times together.
    pub apart: Span,
    /// Whether every byte also came when it says.
    pub timely: bool,
}

/// The hypotheses under which every byte of all conversations is as it was, with how well; in the order given. Where
/// one of them also explains the times, those that do not are left out.
///
/// # Errors
/// What `twin` says of lines that make no ring.
pub fn explaining<'h, E>(
    hypotheses: &'h [Hypothesis],
    conversations: &[Conversation],
    exactness: Exactness,
    twin: &dyn Fn(&[String]) -> Result<Twin, E>,
) -> Result<Vec<(&'h Hypothesis, Evidence)>, E> {
    let mut explaining = Vec::new();
    for hypothesis in hypotheses {
        let twin = twin(&hypothesis.lines)?;
        if let Some(evidence) = judge(twin, conversations, exactness) {
            explaining.push((hypothesis, evidence));
        }
    }
    if explaining.iter().any(|(_, evidence)| evidence.timely) {
        explaining.retain(|(_, evidence)| evidence.timely);
    }
    Ok(explaining)
}

/// How many attempts every hypothesis is asked for.
const ASKED_OF_ALL: usize = 3;

/// The hypotheses that explain the most of several attempts, in the order given: a drive that a deviation has left in another
/// state explains what comes behind in its own way. Where one has explained every attempt so far, those that have explained none
/// are asked no more. What the right drive explains as well is explained by no deviation.
pub fn explaining_most<E>(
    mut hypotheses: Vec<Hypothesis>,
    attempts: &[Vec<Conversation>],
    exactness: Exactness,
    twin: &dyn Fn(&[String]) -> Result<Twin, E>,
) -> Vec<Hypothesis> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let most = |counts: &BTreeMap<String, usize>| counts.values().max().copied();
    for (number, attempt) in attempts.iter().enumerate() {
        let right = twin(&[]).ok();
        let right = right.and_then(|twin| judge(twin, attempt, exactness));
        let better = |own: Evidence| right.is_none_or(|right| own.timely && !right.timely);
        let found = explaining(&hypotheses, attempt, exactness, twin).unwrap_or_default();
        for (hypothesis, _) in found.into_iter().filter(|(_, own)| better(*own)) {
            *counts.entry(hypothesis.name.clone()).or_default() += 1;
        }
        if number + 1 >= ASKED_OF_ALL && most(&counts) == Some(number + 1) {
            hypotheses.retain(|hypothesis| counts.contains_key(&hypothesis.name));
        }
    }
    let most = most(&counts);
    hypotheses.retain(|hypothesis| most.is_some() && counts.get(&hypothesis.name).copied() == most);
    hypotheses
}

fn judge(mut twin: Twin, conversations: &[Conversation], exactness: Exactness) -> Option<Evidence> {
    let mut evidence = Evidence {
        timely: true,
        ..Evidence::default()
    };
    for comparison in twin.follow_while_alike(conversations, exactness) {
        if comparison.divergence.is_some() {
            return None;
        }
        evidence.apart = evidence.apart + comparison.apart;
        evidence.timely &= comparison.untimely.is_none();
    }
    Some(evidence)
}
