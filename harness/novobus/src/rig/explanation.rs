//! Which values of what the manual leaves open explain every byte that came.
//!
//! A drive may have any value of an open property: right drives with these values have sent just this.

use super::judge::{AttemptFacts, known};
use super::sim;
use crate::choice::{Choice, SELF_TEST_TIME, of_drives, of_self_tests, of_the_bus};
use crate::language::syntax::{DriveRange, Header};
use crate::language::write::ring_prefix;
use crate::rig::run::twin;
use crate::twin::{Comparison, Conversation, Divergence, Done, Silences};
use harness_bench::scenario::times::Duration;
use harness_proto::time::Span;

/// The largest ring in which choices of single drives are tried.
const SMALL: u8 = 16;

/// The property of the time after which drives that monitor the line report a silence (ND21 9.9).
const TIME_OUT: &str = "time-out";

/// Choices that explain every byte of an attempt.
pub(crate) struct Explanation {
    pub(crate) words: String,
    /// The header that makes simulated drives behave so.
    pub(crate) header: Header,
    /// The comparisons of the conversations with these drives.
    pub(crate) comparisons: Vec<Comparison>,
    /// Whether the bytes that they explain come before the steps of the scenario: nothing that it asks for depends on the choices.
    pub(crate) before_steps: bool,
    /// Whether they are time-outs alone: a line that was silent for longer than the computer has measured explains the same bytes (ND21 9.9).
    pub(crate) time_outs: bool,
}

/// The choices that explain every byte of an attempt; `None` where the model's defaults explain them as well, or where no choice does.
pub(crate) fn of(facts: &AttemptFacts<'_>) -> Option<Explanation> {
    let real = facts.exactness.tolerance > Span::ZERO && !facts.exactness.knows_cells;
    if !real {
        return None;
    }
    let mut ways = [Silences::Noted, Silences::Longer].into_iter();
    ways.find_map(|silences| explained(facts, silences))
}

fn explained(facts: &AttemptFacts<'_>, silences: Silences) -> Option<Explanation> {
    let compare = |header: &Header| compare(header, facts, silences);
    let (mut first, monitored) = compare(&Header::default()).err()?;
    let mut open = choices(facts);
    open.retain(|choice| choice.property != TIME_OUT || monitored);
    let (mut header, mut chosen, mut time_outs) = (Header::default(), Vec::new(), true);
    // Each choice explains more bytes than those before it.
    loop {
        let mut further = None;
        for (choice, whose, more) in candidates(&open, &first, &header, facts, &compare) {
            let all = header.and(&more);
            match compare(&all) {
                // It moves the model's bytes so that they seem to be late, and explains nothing.
                Ok(comparisons)
                    if silence(&comparisons).is_some_and(|silence| !silence.is_after(&first))
                        || compared(&comparisons) < first.compared => {}
                Ok(comparisons) => {
                    chosen.push(format!("{choice}{whose}"));
                    let has_steps = |conversation: &Conversation| conversation.has_steps();
                    let last = first.conversation.min(facts.conversations.len());
                    return Some(Explanation {
                        words: chosen.join(" and "),
                        header: all,
                        comparisons,
                        before_steps: !facts.conversations[..last].iter().any(has_steps),
                        time_outs: time_outs && choice.property == TIME_OUT,
                    });
                }
                Err((place, _)) if further.is_none() && place.is_after(&first) => {
                    further = Some((place, format!("{choice}{whose}"), all, choice.property));
                }
                Err(_) => {}
            }
        }
        let (place, words, all, property) = further?;
        open.retain(|choice| choice.property != property);
        chosen.push(words);
        time_outs &= property == TIME_OUT;
        (first, header) = (place, all);
    }
}

/// Where an attempt first differs from a model.
#[derive(Clone, Debug, PartialEq, Eq)]
struct FirstDifference {
    /// The conversation, counted from 1; 0 if the choice makes no ring.
    conversation: usize,
    /// The difference; `None` if the choice makes no ring.
    divergence: Option<Box<Divergence>>,
    /// Number of bytes compared before it. A choice that ends the comparison earlier explains nothing (ND21 9.9).
    compared: u64,
}

impl FirstDifference {
    fn is_after(&self, other: &Self) -> bool {
        let byte = |place: &Self| place.divergence.as_ref().map(|found| found.byte);
        let place = |place: &Self| (place.conversation, byte(place));
        place(self) > place(other)
    }
}

/// Comparisons, or where they first differ and whether a drive monitors.
type Compared = Result<Vec<Comparison>, (FirstDifference, bool)>;

fn compared(comparisons: &[Comparison]) -> u64 {
    comparisons.iter().map(|result| result.compared).sum()
}

/// The place at which a silence of the bench has ended the comparison.
fn silence(comparisons: &[Comparison]) -> Option<FirstDifference> {
    let last = comparisons.last().filter(|result| result.silenced)?;
    Some(FirstDifference {
        conversation: comparisons.len(),
        divergence: last.divergence.clone().map(Box::new),
        compared: compared(comparisons),
    })
}

/// What is tried after `header`: each choice in every drive, and in single drives those that change where or how the attempt differs.
fn candidates<'c>(
    open: &'c [Choice],
    first: &FirstDifference,
    header: &Header,
    facts: &AttemptFacts<'_>,
    compare: &dyn Fn(&Header) -> Compared,
) -> Vec<(&'c Choice, String, Header)> {
    let rings = || facts.way.rings.iter().enumerate();
    let every = |choice: &Choice| choice.in_all(facts.way.rings.len());
    let mut all: Vec<_> = open
        .iter()
        .map(|choice| (choice, String::new(), every(choice)))
        .collect();
    for choice in open {
        let whole = header.and(&every(choice));
        let tells = match compare(&whole) {
            Ok(comparisons) => silence(&comparisons).is_some(),
            Err((place, _)) => place != *first,
        };
        if !tells {
            continue;
        }
        for (ring, size) in rings().filter(|(_, size)| (2..=SMALL).contains(&size.drives())) {
            let single = (0..size.drives()).map(|drive| {
                let setup = choice.in_some(DriveRange::one(ring, drive));
                let words = format!(" in drive {}{drive}", ring_prefix(ring));
                (choice, words, setup.into_iter().collect())
            });
            all.extend(single);
        }
    }
    all
}

/// The choices that the rig's file and its profile do not settle.
fn choices(facts: &AttemptFacts<'_>) -> Vec<Choice> {
    let profile = facts.rig.profile.iter().flat_map(|profile| &profile.lines);
    let sim = facts.rig.file.sim.iter().flat_map(|sim| &sim.setup);
    let settings = sim::read(profile.chain(sim)).setups;
    let is_settled = |property| settings.iter().any(|setup| setup.sets() == Some(property));
    let settled = |choice: &Choice| {
        is_settled(choice.property) || choice.with.is_some() && is_settled(SELF_TEST_TIME)
    };
    let self_tests = silent_for(facts.conversations).map(of_self_tests);
    of_the_bus()
        .chain(of_drives())
        .chain(self_tests.into_iter().flatten())
        .filter(|choice| !settled(choice))
        .collect()
}

/// A pause longer than any between two received bytes while drives answer.
const PAUSE: Span = Span::from_millis(50);

/// How long drives may have been silent after their reset (ND21 10.5, 11.8), where the bench has sent bytes to which none came back: the
/// middle between the longest time for which they certainly were and the shortest for which they can have been.
fn silent_for(conversations: &[Conversation]) -> Option<Duration> {
    let (mut least, mut most) = (Span::ZERO, None::<Span>);
    for conversation in conversations {
        for pair in conversation.received.windows(2) {
            let [(ring, last, _), (next_ring, next, _)] = pair else {
                continue;
            };
            if ring != next_ring || next.since(*last) < PAUSE {
                continue;
            }
            let done = conversation.done.iter();
            let unanswered = done.filter_map(|(to, done)| match done {
                Done::Sent(at, _) if to == ring && at > last && *at + PAUSE < *next => Some(*at),
                _ => None,
            });
            if let Some(unanswered) = unanswered.max() {
                let most_here = next.since(*last);
                least = least.max(unanswered.since(*last));
                most = Some(most.map_or(most_here, |most| most.min(most_here)));
            }
        }
    }
    let most = most.filter(|most| *most > least)?;
    let middle = (least.as_nanos() + most.as_nanos()) / 2;
    let whole = middle / 1_000_000;
    Some(match Span::from_millis(whole) > least {
        true => Duration::millis(whole),
        false => Duration::micros(middle / 1_000),
    })
}

/// How an attempt compares with drives with this header that have just been switched on, up to a silence of the bench that may be the
/// cause of a difference.
///
/// # Errors
/// Where it first differs, and whether one of the drives monitors time-outs.
fn compare(header: &Header, facts: &AttemptFacts<'_>, silences: Silences) -> Compared {
    (facts.alive)();
    let Ok(mut twin) = twin(facts.rig, &known(facts.rig).and(header)) else {
        let nowhere = FirstDifference {
            conversation: 0,
            divergence: None,
            compared: 0,
        };
        return Err((nowhere, false));
    };
    let comparisons = twin.follow_while_alike(facts.conversations, facts.exactness, silences);
    let conversation = comparisons.len();
    // What differs after a silence of the bench says nothing about a choice.
    let last = comparisons.last().filter(|result| !result.silenced);
    let divergence = last.and_then(|result| result.divergence.clone());
    match divergence.map(Box::new) {
        None => Ok(comparisons),
        divergence => Err((
            FirstDifference {
                conversation,
                divergence,
                compared: compared(&comparisons),
            },
            twin.monitors(),
        )),
    }
}
