//! Scenarios on a rig: healthy before, beside the twin while they run, again where they did not pass, and every attempt
//! kept.

use super::file::Deviation;
use super::session::{Session, SessionError, examine};
use crate::link::{Event, Line, Link, Recording};
use crate::scenario::plan::Plan;
use crate::scenario::problem::Problems;
use crate::scenario::run::{AtFinding, Outcome, lacks, play_over_bus, start_anew};
use crate::scenario::simulate;
use crate::scenario::verdict::Verdict;
use crate::twin::{Comparison, Conversation, Exactness, Twin};
use harness_proto::time::Span;
use harness_sim::deviation;
use harness_sim::trace::Trace;

/// One attempt at a scenario.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// What came of it, the twin's word heard.
    pub outcome: Outcome,
    /// Everything that happened at the master's end of the rings, from the health check on.
    pub events: Vec<Event>,
    /// How the conversations compare with the twin's, in order; those of the health check and of what is set up before are
    /// among them.
    pub comparisons: Vec<Comparison>,
    /// What the links carried in the scenario itself, ring by ring.
    pub traces: Vec<Trace>,
}

/// A scenario that was played as often as the rig's file says.
#[derive(Clone, Debug)]
pub struct Played {
    /// What came of all attempts together.
    pub outcome: Outcome,
    /// The attempts, in order; none where it was skipped.
    pub attempts: Vec<Attempt>,
}

/// A rig that scenarios are played on, and its twin.
pub struct Run<'s> {
    session: &'s mut Session,
    twin: Twin,
    exactness: Exactness,
    byte_time: Span,
}

impl<'s> Run<'s> {
    /// Scenarios on a rig in use.
    ///
    /// # Errors
    /// Known deviations of the rig's file that make no ring.
    pub fn new(session: &'s mut Session) -> Result<Self, Problems> {
        let twin = twin(session, &known(session))?;
        let tolerance = session.link().time_tolerance();
        let simulated = session.rig().is_simulated();
        let abilities = session.link().capabilities();
        let line_errors = abilities.contains(&crate::link::Capability::LineErrors);
        let byte_time = session.link().byte_time();
        Ok(Self {
            exactness: Exactness {
                tolerance,
                line_errors,
                knows_cells: simulated,
            },
            session,
            twin,
            byte_time,
        })
    }

    /// How exactly the twin is compared.
    #[must_use]
    pub fn exactness(&self) -> Exactness {
        self.exactness
    }

    /// The rig.
    pub fn session(&mut self) -> &mut Session {
        self.session
    }

    /// A twin that nobody has spoken to, its drives with what `lines` of a header say beside the rig's file.
    ///
    /// # Errors
    /// The lines have mistakes.
    pub fn twin_with(&self, lines: &[String]) -> Result<Twin, Problems> {
        twin(self.session, lines)
    }

    /// Plays a scenario, and again where it did not pass, as often as the rig's file says.
    ///
    /// # Errors
    /// The rig is ill, so that nothing more can be played.
    pub fn play(&mut self, plan: &Plan) -> Result<Played, SessionError> {
        let mut forgotten: Vec<Event> = Vec::new();
        let rings = plan.rings == self.session.rings();
        let recording = Recording::new(self.session.link(), &mut forgotten);
        if let Some(lacks) = lacks(plan, &recording) {
            return Ok(Played::skipped(lacks));
        }
        if !rings {
            return Ok(Played::skipped(format!(
                "it is for {}, the rig has {}",
                sizes(&plan.rings),
                sizes(self.session.rings())
            )));
        }
        let mut attempts = Vec::new();
        let most = self.session.rig().file.retry.attempts.max(1);
        while attempts.len() < usize::from(most) {
            let attempt = self.attempt(plan)?;
            let done = matches!(
                attempt.outcome.verdict,
                Verdict::Passed | Verdict::Skipped | Verdict::RigError
            );
            attempts.push(attempt);
            if done || self.session.link().trouble().is_some() {
                break;
            }
        }
        Ok(Played::of(attempts))
    }

    fn attempt(&mut self, plan: &Plan) -> Result<Attempt, SessionError> {
        let limits = &self.session.rig().file.limits;
        let anew = limits.allow_reset && limits.allow_motion;
        let between = self.session.rig().file.health.between;
        let attempts = self.session.rig().file.health.attempts;
        let simulated = self.session.rig().is_simulated();
        let rings = self.session.rings().to_vec();
        self.session.link().reset_after_denial();
        let mut events = Vec::new();
        let mut recording = Recording::new(self.session.link(), &mut events);
        let healthy = if between {
            examine(&mut recording, &rings, attempts).map(|_| ())
        } else {
            Ok(())
        };
        if let Err((ring, ill)) = healthy {
            return Err(self.session.ill(ring, ill));
        }
        let ready = match anew {
            true => start_anew(&mut recording, &rings),
            false => Ok(()),
        };
        let mut outcome = match (ready, recording.trouble()) {
            (Ok(()), _) => {
                recording.begin();
                play_over_bus(plan, &mut recording, AtFinding::Stop)
            }
            (Err(why), None) => Outcome::skipped(why),
            (Err(_), Some(trouble)) => Outcome::rig_error(trouble.to_string()),
        };
        let traces = (0..rings.len()).map(|ring| recording.trace(ring)).collect();
        let conversations = Conversation::all(&events, self.byte_time, simulated);
        let mut comparisons = Vec::new();
        for conversation in &conversations {
            comparisons.push(self.twin.follow(conversation, self.exactness));
        }
        let ports = self.session.link().inner_mut().ports_mut();
        let unplaced = ports.map_or(0, crate::link::StreamLink::take_unplaced);
        judge(
            &mut outcome,
            &comparisons,
            unplaced,
            self.session.rig().file.deviation.as_slice(),
        );
        if comparisons.iter().any(|c| c.divergence.is_some()) {
            // It has heard something else than the drives; another one begins like them.
            if let Ok(twin) = twin(self.session, &known(self.session)) {
                self.twin = twin;
            }
        }
        Ok(Attempt {
            outcome,
            events,
            comparisons,
            traces,
        })
    }
}

impl Played {
    fn skipped(why: String) -> Self {
        Self {
            outcome: Outcome::skipped(why),
            attempts: Vec::new(),
        }
    }

    /// The last attempt speaks for all; one that passed behind one that did not is flaky.
    fn of(attempts: Vec<Attempt>) -> Self {
        let mut outcome = match attempts.last() {
            Some(last) => last.outcome.clone(),
            None => Outcome::skipped("it was not played".to_owned()),
        };
        if attempts.len() > 1 {
            let verdicts: Vec<_> = attempts
                .iter()
                .map(|attempt| attempt.outcome.verdict.name())
                .collect();
            let remark = format!("{} attempts: {}", attempts.len(), verdicts.join(", "));
            outcome.remarks.push(remark);
            if outcome.verdict == Verdict::Passed {
                outcome.verdict = Verdict::Flaky;
            }
        }
        Self { outcome, attempts }
    }
}

/// Hears the twin: a difference is the drive's fault, what a known deviation explains is none, and what the transport
/// could not have shown settles nothing.
fn judge(outcome: &mut Outcome, comparisons: &[Comparison], unplaced: u64, known: &[Deviation]) {
    let divergence = comparisons.iter().find_map(|c| c.divergence.as_ref());
    let untimely = comparisons.iter().find_map(|c| c.untimely.as_ref());
    for adopted in comparisons.iter().flat_map(|c| &c.adopted).take(8) {
        outcome.remarks.push(format!(
            "cell {:04X} of drive {} holds {:02X}, which the model did not know",
            adopted.address, adopted.drive, adopted.value
        ));
    }
    match (outcome.verdict, divergence) {
        (Verdict::Passed | Verdict::Failed, Some(divergence)) => {
            let rule = format!("nd21 {}", divergence.role.rule().0);
            match known
                .iter()
                .find(|entry| entry.rule == rule && by_hand(entry))
            {
                Some(entry) => {
                    outcome.verdict = Verdict::Passed;
                    outcome.remarks.push(told(entry));
                }
                None => outcome.verdict = Verdict::Failed,
            }
            outcome.remarks.push(format!("the model: {divergence}"));
        }
        (Verdict::Failed, None) if !known.is_empty() => {
            // The twin has the deviations too, and gave every byte that the drives gave.
            outcome.verdict = Verdict::Passed;
            outcome.remarks.extend(known.iter().map(told));
        }
        (Verdict::Failed, None) => {
            outcome.verdict = Verdict::Inconclusive;
            outcome.remarks.push(
                "the model does what the drives do: the scenario expects a rig in another state"
                    .to_owned(),
            );
        }
        (Verdict::Passed, None) => {
            if let Some(untimely) = untimely {
                outcome.verdict = Verdict::Marginal;
                outcome.remarks.push(format!("the model: {untimely}"));
            }
        }
        _ => {}
    }
    if unplaced > 0
        && matches!(
            outcome.verdict,
            Verdict::Passed | Verdict::Failed | Verdict::Marginal
        )
    {
        outcome.verdict = Verdict::Inconclusive;
        outcome.remarks.push(format!(
            "{unplaced} line errors were told of without their bytes: the transport could not have shown them"
        ));
    }
}

/// Whether a known deviation is none that the simulator has.
fn by_hand(entry: &Deviation) -> bool {
    deviation::deviation(&entry.name).is_none()
}

fn told(entry: &Deviation) -> String {
    format!(
        "known deviation {} ({}): {}",
        entry.name, entry.rule, entry.reason
    )
}

/// The known deviations of a rig that the simulator has, as lines of a header.
fn known(session: &Session) -> Vec<String> {
    let mut lines = Vec::new();
    for entry in session
        .rig()
        .file
        .deviation
        .iter()
        .filter(|entry| !by_hand(entry))
    {
        let ring = if entry.ring == 2 { "2:" } else { "" };
        if entry.drives.is_empty() {
            lines.push(format!("drive {ring}0..last deviates {}", entry.name));
        }
        for drive in &entry.drives {
            lines.push(format!("drive {ring}{drive} deviates {}", entry.name));
        }
    }
    lines
}

fn twin(session: &Session, lines: &[String]) -> Result<Twin, Problems> {
    let plan = session.rig().plan_with(lines)?;
    let mut twin = Twin::new(simulate::bench(&plan), session.rings());
    // The self-tests are over (11.8).
    twin.rest(Span::from_millis(200));
    Ok(twin)
}

fn sizes(rings: &[harness_proto::novobus::address::RingSize]) -> String {
    let sizes: Vec<_> = rings.iter().map(|ring| ring.drives().to_string()).collect();
    match sizes.len() {
        1 => format!("a ring of {}", sizes[0]),
        _ => format!("rings of {}", sizes.join(" and ")),
    }
}
