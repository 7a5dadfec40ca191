//! The verdict of an attempt, compared with its twin.

use super::explanation::{self, Explanation};
use super::sim;
use crate::language::plan::Plan;
use crate::language::syntax::{DriveRange, Header, Setup};
use crate::rig::run::{Way, play_one, twin};
use crate::twin::{
    Comparison, Conversation, Divergence, Exactness, OwnByte, SILENCED, TOO_MANY, UnaskedByte,
};
use harness_bench::link::{LinkEvent, Recording};
use harness_bench::rig::check::Rig;
use harness_bench::rig::file::Deviation;
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::run::{ByteDifference, Mismatch, Outcome};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::novobus::deviation;

/// Maximum number of listed cells that the twin took over.
const MOST_ADOPTED: usize = 8;

/// The facts of an attempt besides its outcome.
pub(crate) struct AttemptFacts<'h> {
    pub rig: &'h Rig,
    pub plan: &'h Plan,
    pub way: &'h Way,
    /// How exactly the twin was compared.
    pub exactness: Exactness,
    /// The conversations that were compared.
    pub conversations: &'h [Conversation],
    /// Their comparisons with the twin; fewer if the rest could not be compared.
    pub comparisons: &'h [Comparison],
    /// Line errors that the transport reported without their bytes.
    pub unplaced: u64,
    /// Called again and again while a difference is explained, which takes time.
    pub alive: &'h dyn Fn(),
}

/// Settles the verdict of an attempt. A byte that differs from the twin's is the drive's fault, unless the rig's file says that the
/// deviation is known. Where no byte differs, what the scenario found stands, unless the drive's own state, a known deviation or the
/// computer's time explains it. Returns the choices of the manual with which the drives were compared instead of the model's defaults, if
/// they show before the scenario begins.
pub(crate) fn judge(outcome: &mut Outcome, facts: &AttemptFacts<'_>) -> Option<Explanation> {
    let mut assumed = None;
    let comparisons = || facts.comparisons.iter();
    for adopted in comparisons().flat_map(|c| &c.adopted).take(MOST_ADOPTED) {
        outcome.remarks.push(format!(
            "cell {:04X} of drive {} holds {:02X}, which the model did not know",
            adopted.address, adopted.drive, adopted.value
        ));
    }
    let divergence = comparisons().find_map(|c| c.divergence.as_ref());
    let untimely = comparisons().find_map(|c| c.untimely.as_ref());
    match (outcome.verdict, divergence, untimely) {
        _ if outcome.unready.is_some() => {
            not_ready(outcome, divergence, facts);
        }
        (
            Verdict::Passed | Verdict::Failed | Verdict::Marginal | Verdict::Inconclusive,
            Some(divergence),
            _,
        ) => assumed = diverged(outcome, divergence, facts),
        (Verdict::Failed, None, untimely) => {
            let held_up = comparisons().find_map(|c| c.held_up.as_ref());
            failed_alike(outcome, untimely.or(held_up), facts);
        }
        (Verdict::Passed, None, Some(untimely)) => {
            outcome.verdict = Verdict::Marginal;
            outcome.remarks.push(format!("the model: {untimely}"));
        }
        // A drive in which a silence has ended a telegram does not answer, and shows nothing of a cell.
        (Verdict::Inconclusive, None, _) if may_be_late(facts) => outcome.shows_nothing = true,
        _ => {}
    }
    // Where its steps send something, each byte that comes back was compared with the twin's.
    let sends = |conversation: &Conversation| conversation.has_steps() && conversation.sends();
    if !facts.plan.judges() && !facts.conversations.iter().any(sends) {
        outcome.judged_nothing();
    }
    outcome.unplaced(facts.unplaced);
    assumed
}

/// Judges an attempt whose drives could not be made ready. No step was played, so it cannot pass: neither with a known deviation, nor
/// with a twin that could not be made ready either.
fn not_ready(outcome: &mut Outcome, divergence: Option<&Divergence>, facts: &AttemptFacts<'_>) {
    match divergence {
        Some(divergence) => {
            diverged(outcome, divergence, facts);
        }
        None if outcome.verdict == Verdict::Failed => {
            outcome.verdict = Verdict::Inconclusive;
            let known = facts.rig.file.deviation.iter();
            outcome.remarks.extend(known.map(told));
            let why = "the model of the manual could not be made ready either";
            outcome.remarks.push(why.to_owned());
        }
        None => {}
    }
    if outcome.verdict == Verdict::Passed {
        outcome.verdict = Verdict::Inconclusive;
    }
}

/// Judges an attempt with a byte that differs from the twin's. Returns the choices of the manual that explain it, if the scenario does not depend on them.
fn diverged(
    outcome: &mut Outcome,
    divergence: &Divergence,
    facts: &AttemptFacts<'_>,
) -> Option<Explanation> {
    let rule = format!("nd21 {}", divergence.rule.0);
    let mut known = facts.rig.file.deviation.iter();
    let may_be = divergence.drive.or(divergence.role.drive());
    let silenced = |all: &[Comparison]| all.iter().any(|result| result.silenced);
    match known.find(|entry| by_hand(entry) && entry.explains(&rule, divergence.ring, may_be)) {
        Some(entry) => {
            if outcome.verdict != Verdict::Inconclusive {
                outcome.verdict = Verdict::Passed;
            }
            outcome.remarks.push(told(entry));
        }
        None => match explanation::of(facts) {
            Some(found) if silenced(&found.comparisons) => {
                late(outcome);
                outcome.remarks.push(format!(
                    "{} explains every byte up to a silence of the bench: {SILENCED}",
                    found.words
                ));
            }
            Some(found) => {
                let passed = matches!(outcome.verdict, Verdict::Passed | Verdict::Marginal);
                if passed && found.before_steps && outcome.unready.is_none() {
                    compared_with(&found, outcome);
                    return Some(found);
                }
                outcome.verdict = Verdict::Inconclusive;
                outcome.shows_nothing = found.time_outs && may_be_late(facts);
                outcome.remarks.push(format!(
                    "the manual leaves open what differs: {} explains every byte; `qualify` settles such properties",
                    found.words
                ));
            }
            None if silenced(facts.comparisons) => {
                late(outcome);
                let too_many = facts.comparisons.iter().any(|result| result.too_many);
                let why = if too_many { TOO_MANY } else { SILENCED };
                outcome.remarks.push(why.to_owned());
            }
            None => outcome.verdict = Verdict::Failed,
        },
    }
    let whose = match divergence.drive {
        Some(_) => "",
        None => "; not known which drive",
    };
    outcome
        .remarks
        .push(format!("the model: {divergence}{whose}"));
    None
}

/// What differs comes before the scenario, and a choice that the manual leaves open explains it: the scenario is judged beside drives with
/// this choice.
fn compared_with(found: &Explanation, outcome: &mut Outcome) {
    outcome.remarks.push(format!(
        "compared with drives of {}: the manual leaves it open, and it shows before the scenario begins",
        found.words
    ));
    let untimely = found.comparisons.iter().find_map(|c| c.untimely.as_ref());
    if let Some(untimely) = untimely {
        outcome.verdict = Verdict::Marginal;
        outcome.remarks.push(format!("the model: {untimely}"));
    }
}

/// Judges a scenario that failed although every byte is the twin's.
fn failed_alike(outcome: &mut Outcome, untimely: Option<&Divergence>, facts: &AttemptFacts<'_>) {
    let Some(finding) = &outcome.finding else {
        return;
    };
    if explained_by_known(finding, facts) {
        outcome.verdict = Verdict::Passed;
        let known = facts.rig.file.deviation.iter();
        outcome.remarks.extend(known.map(told));
    } else if let Some(byte) = of_the_drive(finding, facts)
        && !facts.exactness.knows_cells
    {
        outcome.verdict = Verdict::Inconclusive;
        let what = match byte.address {
            Some(address) => format!("cell {address:04X}"),
            None => "an answer".to_owned(),
        };
        outcome.remarks.push(format!(
            "{what} of drive {} depends on the drive's own state, which the scenario does not set; set it in the header, or write it first",
            byte.drive
        ));
    } else if in_a_race(finding, facts) {
        outcome.verdict = Verdict::Inconclusive;
        outcome.remarks.push(
            "drives sent bytes unasked (ND21 9.9); their order depends on the drives' clocks, and the model cannot tell it"
                .to_owned(),
        );
    } else if may_be_late(facts) && passes(facts.rig, facts) {
        late(outcome);
        outcome.remarks.push(
            "every byte is as the model says for these times, and the scenario passes on the model: the drives monitor time-outs (ND21 9.9), and the computer left the line silent"
                .to_owned(),
        );
    } else if passes_with_defaults(facts) {
        outcome.verdict = Verdict::Inconclusive;
        outcome.remarks.push(
            "it passes on drives with the model's defaults: the rig's drives differ where the manual leaves the choice open"
                .to_owned(),
        );
    } else if facts.exactness.knows_cells && passes(facts.rig, facts) {
        outcome.remarks.push(
            "it passes on drives that have just been switched on: what was played before left these in another state; set the cell in the header, or permit resets in the rig's [limits]"
                .to_owned(),
        );
    } else if let Some(byte) = untimely
        && (finding.difference.as_ref()).is_none_or(ByteDifference::is_absence)
        && facts.exactness.tolerance > Span::ZERO
    {
        late(outcome);
        outcome.remarks.push(format!(
            "every byte is as the model says, but the computer or the drive was late: {byte}"
        ));
    } else {
        outcome.remarks.push(
            "the model of the manual gives the same bytes: either the scenario asks for something else than the manual says, or the model is wrong"
                .to_owned(),
        );
    }
}

/// Whether drives monitor time-outs, and the line may have been silent for longer than the computer has measured (ND21 9.9).
fn may_be_late(facts: &AttemptFacts<'_>) -> bool {
    facts.exactness.tolerance > Span::ZERO
        && facts.comparisons.iter().any(|result| result.monitored)
}

/// Makes the attempt inconclusive, because the computer was late: that accuses no drive and clears none.
const fn late(outcome: &mut Outcome) {
    outcome.verdict = Verdict::Inconclusive;
    outcome.shows_nothing = true;
}

/// The outcome of the scenario on a rig's model with drives that have just been switched on and have these known deviations.
fn switched_on(rig: &Rig, header: &Header, facts: &AttemptFacts<'_>) -> Option<Outcome> {
    let mut link = twin(rig, header).ok()?.into_link();
    let mut forgotten: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(&mut link, &mut forgotten);
    play_one(&mut recording, facts.plan, facts.way).ok()
}

fn passes(rig: &Rig, facts: &AttemptFacts<'_>) -> bool {
    let outcome = switched_on(rig, &known(rig), facts);
    outcome.is_some_and(|outcome| outcome.verdict == Verdict::Passed)
}

/// Whether the rig's file or its profile settles properties that the manual leaves open, and the scenario passes without them but not with
/// them, on drives that have just been switched on: what was played before explains nothing here.
fn passes_with_defaults(facts: &AttemptFacts<'_>) -> bool {
    let settles = |setup: &Setup| setup.sets().is_some();
    let mut rig = facts.rig.clone();
    let header = sim::setup(&rig);
    let settled = rig.profile.take().is_some() | header.setups.iter().any(settles);
    sim::set_up(&mut rig, &header.only(|setup| !settles(setup)));
    settled && !passes(facts.rig, facts) && passes(&rig, facts)
}

/// Whether the scenario passes on the model of the manual and fails at the same line on the model with the known deviations.
fn explained_by_known(finding: &Mismatch, facts: &AttemptFacts<'_>) -> bool {
    let deviations = known(facts.rig);
    let fails_alike = |outcome: Outcome| {
        let found = outcome.finding;
        found.is_some_and(|found| found.span == finding.span)
    };
    !deviations.is_empty()
        && switched_on(facts.rig, &Header::default(), facts)
            .is_some_and(|right| right.verdict == Verdict::Passed)
        && switched_on(facts.rig, &deviations, facts).is_some_and(fails_alike)
}

/// Whether a finding may be about bytes of the scenario's own conversation, after the first one of that ring that a drive sent unasked.
fn in_a_race(finding: &Mismatch, facts: &AttemptFacts<'_>) -> bool {
    let compared = facts.conversations.iter().zip(facts.comparisons);
    let of_scenario = compared.filter(|(conversation, _)| conversation.has_steps());
    let compared = of_scenario.clone().next();
    if compared.is_none_or(|(_, comparison)| comparison.left_out) {
        // A race before the scenario: its ring has not been compared since.
        let mut before = facts.comparisons.iter().flat_map(|result| &result.unasked);
        let ring = finding.difference.as_ref().map(|found| found.ring);
        return before.any(|race| ring.is_none_or(|ring| race.ring == ring));
    }
    let mut races = of_scenario.flat_map(|(_, comparison)| &comparison.unasked);
    match &finding.difference {
        Some(found) => {
            let within =
                |race: &UnaskedByte, at| at >= race.at && race.until.is_none_or(|end| at < end);
            races.any(|race| race.ring == found.ring && found.at.is_none_or(|at| within(race, at)))
        }
        None => races.next().is_some(),
    }
}

/// The answer of a drive that a finding is about, if its value depends on the drive's own state: the byte that differs, or else one
/// that the line of the finding asked for. The cells of the scenario's header are not the drive's own.
fn of_the_drive<'h>(finding: &Mismatch, facts: &AttemptFacts<'h>) -> Option<&'h OwnByte> {
    let set = |answer: &OwnByte| {
        let mut setups = facts.plan.memory_setups();
        setups.any(|(ring, drives, from, bytes)| {
            let offset = answer.address.and_then(|address| address.checked_sub(from));
            let within = offset.is_some_and(|offset| usize::from(offset) < bytes.len());
            ring == answer.ring && drives.contains(&answer.drive) && within
        })
    };
    let about = |conversation: &Conversation, answer: &OwnByte| match &finding.difference {
        Some(difference) => {
            let asked_for = difference.index < difference.expected.len();
            let differs = match difference.expected.get(difference.index) {
                Some(Expected::Byte(byte)) => byte ^ answer.value,
                _ => 0,
            };
            asked_for
                && differs & answer.known == 0
                && difference.ring == answer.ring
                && difference.at == Some(answer.at)
        }
        None => conversation.step_at(answer.ring, answer.place) == Some(finding.span.start),
    };
    let compared = facts.conversations.iter().zip(facts.comparisons);
    let of_scenario = compared.filter(|(conversation, _)| conversation.has_steps());
    let mut all = of_scenario.flat_map(|(conversation, comparison)| {
        let answers = comparison.own.iter();
        answers.map(move |answer| (conversation, answer))
    });
    let found = all.find(|(conversation, answer)| about(conversation, answer) && !set(answer));
    found.map(|(_, answer)| answer)
}

/// The known deviations of a rig that the simulator has.
pub(crate) fn known(rig: &Rig) -> Header {
    let of_entry = |entry: &Deviation| -> Vec<Setup> {
        let Some(deviation) = deviation::deviation(&entry.name) else {
            return Vec::new();
        };
        let ring = usize::from(entry.ring - 1);
        let whom = match entry.drives.as_slice() {
            [] => vec![DriveRange::all(ring)],
            some => some
                .iter()
                .map(|drive| DriveRange::one(ring, *drive))
                .collect(),
        };
        let deviates = |whom| Setup::deviates(whom, deviation);
        whom.into_iter().map(deviates).collect()
    };
    rig.file.deviation.iter().flat_map(of_entry).collect()
}

/// Whether the simulator does not have a known deviation.
pub(crate) fn by_hand(entry: &Deviation) -> bool {
    deviation::deviation(&entry.name).is_none()
}

fn told(entry: &Deviation) -> String {
    format!(
        "known deviation {} ({}): {}",
        entry.name, entry.rule, entry.reason
    )
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "judge_late_tests.rs"]
mod late_tests;
