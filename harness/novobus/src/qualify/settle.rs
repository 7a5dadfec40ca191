//! Settles a property from the answers to its probe.

use super::hypothesis::{Fit, Hypothesis, explaining};
use super::probes::{Probe, ProbeTarget, hypotheses};
use crate::language::syntax::{DriveRange, Header, Setup, SetupKind};
use crate::twin::{Conversation, Exactness, Silences, Twin};
use harness_bench::scenario::times::Duration;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::time::Span;
use harness_sim::nd21::PROPERTIES;

/// Maximum number of settings in a hypothesis about the bus.
const MOST_SETTINGS: usize = 3;

/// How many hypotheses are named at most.
const MOST_TOLD: usize = 3;

/// How late or early the bench sees the first unasked byte of a drive (ND21 9.9) in real time: its clock and the drive's differ, the
/// computer may be busy, and a ring behind a socket is not bound to the times of a line.
const LATENESS: Span = Span::from_millis(2);

/// The result of a probe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ProbeAnswer {
    /// A value explains every byte.
    Settled {
        /// It, for people.
        value: String,
        /// What makes a simulated drive behave so.
        header: Header,
        /// Of a time: the shortest and the longest that explain every byte, in tenths of a millisecond.
        span: Option<(u64, u64)>,
    },
    /// Every value explains every byte.
    NoDifference,
    /// Several values explain every byte, one drive being different from the others in each: these, for people.
    Several(String),
    /// The drive was not done at its last poll, after this time.
    NotDone(String),
    /// No value does.
    Unexplained,
}

/// What the conversations of a probe in a ring of `drives` say, those of each of its entries by themselves. `twin` gives a ring
/// with this header behind its own.
///
/// # Errors
/// What `twin` says of a header that makes no ring.
pub(crate) fn answer<E>(
    probe: &Probe,
    drives: u8,
    conversations: &[Vec<Conversation>],
    exactness: Exactness,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Result<ProbeAnswer, E> {
    let ProbeTarget::Drive(drive, looks) = probe.asked else {
        let all = hypotheses(probe.property, drives);
        let lateness = match exactness.tolerance {
            Span::ZERO => Span::ZERO,
            _ => LATENESS * probe.entries.len() as u64,
        };
        // The simplest ones first.
        for settings in 1..=MOST_SETTINGS {
            let simple = |h: &&Hypothesis| h.header.setups.len() == settings;
            let simplest = all.iter().filter(simple).cloned();
            let simplest: Vec<_> = simplest.collect();
            let found = explaining_all(simplest, conversations, exactness, twin)?;
            // A time is the one that fits best. No byte tells one drive from another one.
            if settings > 1 && found.len() > 1 && all.iter().all(is_of_words) {
                return Ok(ProbeAnswer::Several(one_of(&found)));
            }
            if let Some(hypothesis) = best(&found, lateness) {
                return Ok(ProbeAnswer::Settled {
                    value: hypothesis.name.clone(),
                    header: hypothesis.header.clone(),
                    span: None,
                });
            }
        }
        return Ok(ProbeAnswer::Unexplained);
    };
    let exactness = Exactness {
        looks: Some((drive, looks)),
        ..exactness
    };
    let asked = |assumed: &Header| {
        let twin = |header: &Header| twin(&assumed.and(header));
        of_the_drive(
            probe.property,
            drive,
            &conversations.concat(),
            exactness,
            &twin,
        )
    };
    match asked(&probe.assumed)? {
        ProbeAnswer::Unexplained if !probe.assumed.is_empty() => asked(&Header::default()),
        answer => Ok(answer),
    }
}

/// Whether its settings are words.
fn is_of_words(hypothesis: &Hypothesis) -> bool {
    let mut setups = hypothesis.header.setups.iter();
    setups.all(|setup| matches!(setup.what, SetupKind::Word(..)))
}

/// The hypotheses, for people.
fn one_of(found: &[(Hypothesis, Fit)]) -> String {
    let names = found
        .iter()
        .take(MOST_TOLD)
        .map(|(hypothesis, _)| hypothesis.name.as_str());
    let names: Vec<_> = names.collect();
    let more = match found.len().saturating_sub(MOST_TOLD) {
        0 => String::new(),
        more => format!(", or one of {more} more"),
    };
    format!("{}{more}", names.join(", or "))
}

/// What the conversations show of a property of one drive.
fn of_the_drive<E>(
    property: &str,
    drive: u8,
    conversations: &[Conversation],
    exactness: Exactness,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Result<ProbeAnswer, E> {
    let header = |what: SetupKind| Header::from(Setup::new(DriveRange::one(0, drive), what));
    let known = PROPERTIES.iter().find(|known| known.name == property);
    let explained = |what: SetupKind| -> Result<ExplainedPart, E> {
        Ok(explained(twin(&header(what))?, conversations, exactness))
    };
    if let Some(longest) = known.and_then(|property| property.longest()) {
        let time = |tenths: u64| SetupKind::time(property, written(tenths));
        let explained = |tenths: u64| explained(time(tenths));
        return Ok(match bracket(tenths(longest), &explained)? {
            Bracket::Between(from, to) if to == tenths(longest) => {
                ProbeAnswer::NotDone(written(from).to_string())
            }
            Bracket::Between(from, to) => between(property, drive, from, to),
            Bracket::Anything => ProbeAnswer::NoDifference,
            Bracket::Nothing => ProbeAnswer::Unexplained,
        });
    }
    let mut explaining = Vec::new();
    for word in known.into_iter().flat_map(|property| property.words()) {
        let what = SetupKind::word(property, word);
        if explained(what.clone())? == ExplainedPart::Whole {
            explaining.push(what);
        }
    }
    Ok(match explaining.as_slice() {
        [] => ProbeAnswer::Unexplained,
        [what] => ProbeAnswer::Settled {
            value: what.value(),
            header: header(what.clone()),
            span: None,
        },
        _ => ProbeAnswer::NoDifference,
    })
}

/// A time of a drive, in tenths of a millisecond. A simulated drive gets the middle.
pub(super) fn between(property: &str, drive: u8, from: u64, to: u64) -> ProbeAnswer {
    let time = SetupKind::time(property, written(from.midpoint(to)));
    ProbeAnswer::Settled {
        value: format!("{} to {}", written(from), written(to)),
        header: Setup::new(DriveRange::one(0, drive), time).into(),
        span: Some((from, to)),
    }
}

/// How long a drive of a ring of `drives` was silent behind its reset (ND21 11.8): between the last SYNCO that was lost and the first that came
/// back. Bytes that a drive does not pass on are lost in one piece.
pub(super) fn silence(
    property: &str,
    (drives, drive): (u8, u8),
    conversation: &Conversation,
    byte_time: Span,
) -> ProbeAnswer {
    let (sent, times) = (conversation.sent_in(0), conversation.sent_at(0));
    let lost = sent.len().saturating_sub(conversation.received_in(0).len());
    let Ok(size) = RingSize::new(u64::from(drives)) else {
        return ProbeAnswer::Unexplained;
    };
    let roles = roles(size, &sent);
    let is_check = |role: &Role| matches!(role, Role::Check { drive: Some(addressed), .. } if *addressed == drive);
    let Some(reset) = roles.iter().position(is_check).filter(|_| lost > 0) else {
        return ProbeAnswer::Unexplained;
    };
    let began = times[reset] + byte_time * u64::from(drives - drive);
    let since = |place: usize| tenths(times[place].since(began));
    let last = reset + lost;
    match roles.get(last + 1) {
        Some(Role::Idle) => between(property, drive, since(last), since(last + 1)),
        _ => ProbeAnswer::NotDone(written(since(last.min(roles.len() - 1))).to_string()),
    }
}

/// The hypotheses that explain each of several sets of conversations.
fn explaining_all<E>(
    hypotheses: Vec<Hypothesis>,
    sets: &[Vec<Conversation>],
    exactness: Exactness,
    twin: &dyn Fn(&Header) -> Result<Twin, E>,
) -> Result<Vec<(Hypothesis, Fit)>, E> {
    let mut found: Vec<_> = hypotheses
        .into_iter()
        .map(|hypothesis| (hypothesis, Fit::default()))
        .collect();
    for set in sets {
        let all: Vec<_> = found.iter().map(|(h, _)| h.clone()).collect();
        let here = explaining(&all, set, exactness, twin)?;
        found.retain_mut(|(hypothesis, evidence)| {
            let explained = here.iter().find(|(h, _)| *h == hypothesis);
            explained
                .inspect(|(_, here)| evidence.apart = evidence.apart + here.apart)
                .is_some()
        });
    }
    Ok(found)
}

/// The hypothesis whose times fit best. The first one, which has the manual's value, is preferred if it fits equally well within a sixth
/// and `lateness`, because in real time the bench sees bytes a little late.
fn best(found: &[(Hypothesis, Fit)], lateness: Span) -> Option<&Hypothesis> {
    let (first, evidence) = found.first()?;
    let (best, better) = found.iter().min_by_key(|(_, evidence)| evidence.apart)?;
    match better.apart * 6 + lateness * 6 < evidence.apart * 5 {
        true => Some(best),
        false => Some(first),
    }
}

/// A time in tenths of a millisecond: a cycle of a drive's program is 432 us (ND21 4.1).
fn tenths(time: Span) -> u64 {
    time.as_nanos() / 100_000
}

/// A time in tenths of a millisecond, without a zero behind the point.
fn written(tenths: u64) -> Duration {
    match tenths % 10 {
        0 => Duration::millis(tenths / 10),
        _ => Duration::millis(tenths).tenth(),
    }
}

/// How well a model explains the bytes received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ExplainedPart {
    Whole,
    /// The bits in the cell by which the drive reports that it is done differ; these are the model's.
    Cell(u8),
    /// It does not explain a byte that the question is not about.
    Not,
}

fn explained(
    mut twin: Twin,
    conversations: &[Conversation],
    exactness: Exactness,
) -> ExplainedPart {
    let comparisons = twin.follow_while_alike(conversations, exactness, Silences::Noted);
    let Some(found) = comparisons.into_iter().find_map(|c| c.divergence) else {
        return ExplainedPart::Whole;
    };
    let (Some((asked, looks)), Some((_, wanted))) = (exactness.looks, found.expected) else {
        return ExplainedPart::Not;
    };
    let look = match found.role {
        Role::Data {
            drive: Some(drive),
            address,
        } if drive == asked => looks.iter().find(|look| look.address == address),
        _ => None,
    };
    look.map_or(ExplainedPart::Not, |look| {
        ExplainedPart::Cell(wanted.byte & look.mask)
    })
}

/// The times that explain the bytes received, in tenths of a millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bracket {
    /// From the first to the last of these.
    Between(u64, u64),
    Anything,
    Nothing,
}

/// Finds the times up to `longest` that explain everything, if a drive is polled until it is done. If the model answers as with the
/// longest time, its time is too long, else too short.
fn bracket<E>(
    longest: u64,
    explained: &dyn Fn(u64) -> Result<ExplainedPart, E>,
) -> Result<Bracket, E> {
    let not_yet = explained(longest)?;
    if not_yet == ExplainedPart::Whole && explained(0)? == ExplainedPart::Whole {
        return Ok(Bracket::Anything);
    }
    // The shortest time that is not too short.
    let (mut low, mut high) = (0, longest);
    while low < high {
        let middle = low.midpoint(high);
        let here = explained(middle)?;
        match here == ExplainedPart::Whole || here == not_yet {
            true => high = middle,
            false => low = middle + 1,
        }
    }
    let shortest = low;
    if explained(shortest)? != ExplainedPart::Whole {
        return Ok(Bracket::Nothing);
    }
    let mut high = longest;
    while low < high {
        let middle = low.midpoint(high + 1);
        match explained(middle)? == ExplainedPart::Whole {
            true => low = middle,
            false => high = middle - 1,
        }
    }
    Ok(Bracket::Between(shortest, low))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that needs `time`, asked at these times whether it is done.
    fn asked(time: u64, questions: &[u64]) -> Bracket {
        let explained = |model: u64| -> Result<ExplainedPart, ()> {
            let done = questions.iter().map(|at| (*at >= time, *at >= model));
            let wrong = done.into_iter().find(|(real, model)| real != model);
            Ok(wrong.map_or(ExplainedPart::Whole, |(_, model)| {
                ExplainedPart::Cell(model.into())
            }))
        };
        bracket(1_000, &explained).expect("a bracket")
    }

    #[test]
    fn a_time_lies_between_the_last_no_and_the_first_yes() {
        let questions: Vec<u64> = (1..=20).map(|at| at * 50).collect();
        assert_eq!(asked(120, &questions), Bracket::Between(101, 150));
        // Done before the first question, and never done.
        assert_eq!(asked(10, &questions), Bracket::Between(0, 50));
        assert_eq!(asked(600, &questions[..10]), Bracket::Between(501, 1_000));
        assert_eq!(asked(600, &[]), Bracket::Anything);
        // Asked late in the first place, and then from the beginning.
        assert_eq!(asked(120, &[300, 50, 100, 150]), Bracket::Between(101, 150));
        // What the question is not about.
        let other = bracket(1_000, &|_| Ok::<_, ()>(ExplainedPart::Not));
        assert_eq!(other, Ok(Bracket::Nothing));
    }

    #[test]
    fn times_are_written_as_a_header_reads_them() {
        let written = |tenths| written(tenths).to_string();
        assert_eq!(written(tenths(Span::from_millis(12))), "12ms");
        assert_eq!(written(17), "1.7ms");
        assert_eq!(written(0), "0ms");
    }
}
