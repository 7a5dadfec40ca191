//! Scenarios on a rig: healthy before, beside the twin while they run, again where they did not pass, and every attempt
//! kept.

use super::beside::judged;
use super::health::{LATEST, Unhealthy, examine, outlast_standstill};
use super::judge::{AttemptFacts, known};
use super::put_back::{begin, remember, within};
use super::session::{self, OfRings as _, Session};
use super::sim;
use crate::gate::{GuardsRings as _, guard_rings};
use crate::language::plan::Plan;
use crate::language::run::over_bus::{come_home, play_over_bus, start_anew};
use crate::language::syntax::Header;
use crate::link::SimulatedLink;
use crate::rig::sim::RigOfRings;
use crate::simulate;
use crate::twin::{Conversation, Exactness, Twin, answered};
use harness_bench::counted::counted;
use harness_bench::guard::Guarded;
use harness_bench::link::{
    Capability, Line, Link, LinkEvent, Octets, Recording, Sink, Trouble, wait_keeping,
};
use harness_bench::rig::{Attempt, Keeper, PlayedScenario, RetryRule, Rig, SessionError};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::{
    AtMismatch, ByteDifference, Mismatch, Outcome, Skip, Unlock, Why, lacks, lacks_as_well,
};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::limit::LimitSetting;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::{Limits, Touched};
use harness_proto::time::Span;
use harness_sim::novobus::deviation::MasterDeviation;
use std::collections::BTreeSet;
use std::ops::DerefMut;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A rig that scenarios are played on, and its twin.
pub(crate) struct Run<'s> {
    /// A rig in use, for as long as it is or for a while.
    session: Box<dyn DerefMut<Target = Session> + 's>,
    twin: Twin,
    exactness: Exactness,
    byte_time: Span,
    /// Sign of life for the session's watchdog while the program only computes.
    beats: Option<Arc<AtomicU64>>,
    /// When a scenario is played once more.
    again: RetryRule,
    /// Drives are not reset before a scenario, whatever is allowed.
    as_they_are: bool,
    /// A scenario that the rig's limits do not permit to its end is skipped, and nothing of it is sent.
    rehearses: bool,
    /// Whether a scenario was played.
    played: bool,
    /// How the bench's own master breaks the manual on this rig, on purpose.
    master: Option<&'static MasterDeviation>,
}

pub(super) struct RigModel {
    twin: Twin,
    master: Option<&'static MasterDeviation>,
}

impl RigModel {
    /// # Errors
    /// Known deviations of the rig's file that make no ring.
    pub(super) fn of(rig: &Rig) -> Result<Self, Problems> {
        Ok(Self {
            twin: twin(rig, &known(rig))?,
            master: rig.plan()?.master,
        })
    }
}

impl<'s> Run<'s> {
    /// Scenarios on a rig in use.
    ///
    /// # Errors
    /// Known deviations of the rig's file that make no ring.
    pub(crate) fn new(session: &'s mut Session) -> Result<Self, Problems> {
        let model = RigModel::of(session.rig())?;
        Ok(Self::on(Box::new(session), model))
    }

    /// The same, for as long as the rig is in use.
    pub(super) fn of(session: Session, model: RigModel) -> Run<'static> {
        Run::on(Box::new(Box::new(session)), model)
    }

    fn on(
        mut session: Box<dyn DerefMut<Target = Session> + 's>,
        RigModel { twin, master }: RigModel,
    ) -> Self {
        begin(&mut session);
        let tolerance = session.link().time_tolerance();
        let simulated = session.rig().is_simulated();
        let abilities = session.link().capabilities();
        let line_errors = abilities.contains(&harness_bench::link::Capability::LineErrors);
        let byte_time = session.link().byte_time();
        Self {
            master,
            exactness: Exactness {
                tolerance,
                line_errors,
                knows_cells: simulated,
                looks: None,
            },
            beats: session.ports().map(|ports| ports.beats()),
            again: RetryRule::of(session.rig(), tolerance, false),
            session,
            twin,
            byte_time,
            played: false,
            as_they_are: false,
            rehearses: true,
        }
    }

    /// What the rig can be asked, with what only a simulated one shows left out.
    #[must_use]
    pub(crate) fn capabilities(&mut self) -> Vec<Capability> {
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let recording = Recording::new(self.session.link(), &mut forgotten);
        recording.capabilities().to_vec()
    }

    /// How exactly the twin is compared.
    #[must_use]
    pub(crate) fn exactness(&self) -> Exactness {
        self.exactness
    }

    /// The rig.
    pub(crate) fn session(&mut self) -> &mut Session {
        &mut self.session
    }

    /// A fresh twin. Its drives are set up as the rig's file and this header say.
    ///
    /// # Errors
    /// The header has mistakes.
    pub(crate) fn twin_with(&self, header: &Header) -> Result<Twin, Problems> {
        self.alive();
        twin(self.session.rig(), header)
    }

    /// Tells the session's watchdog that the program works.
    fn alive(&self) {
        beat(self.beats.as_deref());
    }

    /// Plays a scenario, and again where it did not pass, as often as the rig's file says.
    ///
    /// # Errors
    /// The rig fails its health check, so nothing more can be played.
    pub(crate) fn play(
        &mut self,
        plan: &Plan,
        keeper: Option<&mut dyn Keeper>,
    ) -> Result<PlayedScenario, SessionError> {
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let way = self.way();
        let recording = Recording::new(self.session.link(), &mut forgotten);
        let lacks = not_played(plan, &recording, &way.rings);
        if let Some(skip) = self.denied(plan, lacks) {
            return Ok(PlayedScenario::skipped(skip));
        }
        self.remember(plan);
        let attempt = |run: &mut Self, sink: &mut dyn Sink| run.attempt(plan, sink);
        PlayedScenario::play(self, keeper, attempt, |run, attempts| {
            run.again.after(attempts) && run.session.link().trouble().is_none()
        })
    }

    fn attempt(&mut self, plan: &Plan, sink: &mut dyn Sink) -> Result<Attempt, SessionError> {
        let mut plan = plan.clone();
        plan.master = self.master.or(plan.master);
        let plan = &plan;
        let mut way = self.way();
        let capabilities = self.capabilities();
        let simulated = self.session.rig().is_simulated();
        if matches!(self.session.link().trouble(), Some(Trouble::Denied(_))) {
            self.session.link().reset_after_denial();
            way.examine_after_denial(self.session.rig());
        }
        let mut both = KeepingSink {
            events: Vec::new(),
            sink,
        };
        // What the scenario before has left may answer no interlock.
        let examined = way.examine(&mut Recording::new(self.session.link(), &mut both));
        if examined.is_ok() {
            self.session.look_at_interlocks();
        }
        let is_trouble = |event: &LinkEvent| matches!(event, LinkEvent::Trouble(_));
        let told = both.events.iter().any(is_trouble);
        let mut recording = Recording::new(self.session.link(), &mut both);
        if told {
            recording.trouble_is_told();
        }
        let outcome = examined.map(|()| play_examined(&mut recording, plan, &way));
        let rings = way.rings.len();
        let traces = (0..rings).map(|ring| recording.trace(ring)).collect();
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err((ring, ill)) if self.session.drives().ill_as_well => {
                Outcome::rig_error(session::unhealthy(self.session.rig(), ring, ill).to_string())
            }
            Err((ring, ill)) => return Err(session::unhealthy(self.session.rig(), ring, ill)),
        };
        let said = Conversation::all(&both.events, self.byte_time, simulated);
        if let (false, Some(last)) = (simulated, said.last()) {
            drop_late(self.session.link(), &way.rings, last);
        }
        // Bytes that do not come may be those of another program.
        let unplaced = self.session.take_unplaced();
        let beats = self.beats.clone();
        let facts = AttemptFacts {
            rig: self.session.rig(),
            plan,
            way: &way,
            exactness: self.exactness,
            conversations: &[],
            comparisons: &[],
            unplaced,
            alive: &|| beat(beats.as_deref()),
        };
        let recorded = (both.events.as_slice(), capabilities.as_slice());
        let attempt = judged(facts, said, recorded, outcome, &mut self.twin);
        Ok(Attempt { traces, ..attempt })
    }

    /// How attempts go on this rig.
    #[must_use]
    pub(crate) fn way(&self) -> Way {
        Way {
            rings: self.session.rings().to_vec(),
            attempts: self.session.rig().examinations(),
            anew: self.resets(self.session.limits()),
        }
    }

    /// Whether every drive is reset before a scenario.
    fn resets(&self, limits: Limits) -> bool {
        limits.reset && limits.motion && !self.as_they_are
    }

    /// Whether a scenario is played on the model first, and skipped where the guard denies a byte of it there. By default it is.
    pub(crate) fn rehearse(&mut self, rehearses: bool) {
        self.rehearses = rehearses;
    }

    /// Plays from now on what does not pass once more at least, where time is real: what a busy computer has caused does not come
    /// again.
    pub(crate) fn repeat(&mut self) {
        self.again = RetryRule::of(self.session.rig(), self.exactness.tolerance, true);
    }

    /// Why a plan is skipped that `lacks` something, or that the guard denies on the model; with all that would let it be played.
    fn denied(&self, plan: &Plan, lacks: Option<Skip>) -> Option<Skip> {
        let elsewhere = |unlock: &Unlock| {
            matches!(
                unlock,
                Unlock::Simulated | Unlock::Rings(_) | Unlock::SecondRing
            )
        };
        let within_reach = |skip: &Skip| !skip.unlocks.iter().any(elsewhere);
        if !self.rehearses || !lacks.as_ref().is_none_or(within_reach) {
            return lacks;
        }
        let mut limits = self.session.limits();
        let mut skip = lacks;
        // Each turn changes a setting.
        for _ in LimitSetting::ALL {
            let Some((why, denying)) = self.denied_within(plan, limits) else {
                break;
            };
            let denied = skip.unwrap_or_else(|| Why::Denied(why).into());
            skip = Some(denied.and(denying.iter().copied().map(Unlock::Limit)));
            let denying = denying.iter();
            let allowed = denying.fold(limits, |all, limit| all.without(*limit));
            if allowed == limits {
                break;
            }
            limits = allowed;
        }
        skip
    }

    /// What the guard refuses of a plan on the model, and by which settings.
    fn denied_within(&self, plan: &Plan, limits: Limits) -> Option<(String, Vec<LimitSetting>)> {
        if limits.allow_everything() && limits.bytes_per_second.is_none() {
            return None;
        }
        let way = Way {
            anew: self.resets(limits),
            ..self.way()
        };
        let guarded = self.rehearsed(limits, |link| {
            let _outcome = play_one(link, plan, &way);
        })?;
        match guarded.trouble() {
            Some(Trouble::Denied(why)) => Some((why.clone(), guarded.denying().to_vec())),
            _ => None,
        }
    }

    /// Lets the session read what a plan may change of the drives, by what it changes on the model.
    fn remember(&mut self, plan: &Plan) {
        if self.session.rig().is_simulated() {
            return;
        }
        self.alive();
        let mut plan = plan.clone();
        plan.master = self.master.or(plan.master);
        let limits = self.session.limits();
        let resets = self.resets(limits);
        // The model's drives are as new.
        let way = Way {
            attempts: self.way().attempts.filter(|_| !resets),
            ..self.way()
        };
        let rehearsed = self.rehearsed(limits, |link| {
            let _examined = way.examine(link);
            // Drives that differ from the model may be sent the rest too.
            let _outcome = play_over_bus(&plan, link, AtMismatch::GoOn);
        });
        let mut touched = rehearsed.map_or_else(BTreeSet::new, |mut link| link.take_touched());
        for axis in self.session.axes() {
            match resets {
                true => touched.extend([(axis, Touched::Reset)]),
                // Later, drives may be in the middle of something.
                false if !self.played => touched.extend(within(&limits).map(|part| (axis, part))),
                false => {}
            }
        }
        // Drives that are reset, or have just been opened, and the twin know of no recovery before.
        remember(&mut self.session, &touched, resets || !self.played);
        self.played = true;
    }

    /// A guarded model on which something was played.
    fn rehearsed(
        &self,
        limits: Limits,
        play: impl FnOnce(&mut dyn Link),
    ) -> Option<Guarded<SimulatedLink>> {
        let rig = self.session.rig();
        // A simulated drive that is wrong on purpose is rehearsed as a right one too.
        let model = twin(rig, &known(rig)).ok()?.into_link();
        let mut guarded = guard_rings(model, limits);
        // The model's drives have just been made.
        guarded.assume_fresh();
        guarded.know_as(self.session.guarded());
        let mut beating = LifeSign(self.beats.clone());
        play(&mut Recording::new(&mut guarded, &mut beating));
        Some(guarded)
    }

    /// Resets no drive any more before a scenario: for a ring with a drive that does not answer `ResetH8` as it should.
    pub(crate) fn leave_as_they_are(&mut self) {
        self.as_they_are = true;
    }
}

/// How an attempt goes.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    pub rings: Vec<RingSize>,
    /// How often a ring is examined before it counts as ill; `None` where it is not examined.
    pub attempts: Option<u8>,
    /// Whether every drive is reset before.
    pub anew: bool,
}

impl Way {
    /// Examines the rings before an attempt that follows a denial, whatever the rig's file says: the drives may be in the middle of a
    /// telegram. The attempt's record holds the recovery, so that the twin follows it.
    pub(crate) fn examine_after_denial(&mut self, rig: &Rig) {
        self.attempts = Some(rig.file.health.attempts);
    }

    /// Examines the rings, where they are examined before an attempt. An interlock that ends the examination is trouble of the link.
    ///
    /// # Errors
    /// Returns the ring that fails the health check.
    fn examine(&self, link: &mut dyn Link) -> Result<(), (usize, Unhealthy)> {
        let Some(attempts) = self.attempts else {
            return Ok(());
        };
        match examine(link, &self.rings, attempts) {
            // It ends the attempt as it does at a step.
            Ok(_) | Err((_, Unhealthy::Trouble(Trouble::Interlock(_)))) => Ok(()),
            Err(ill) => Err(ill),
        }
    }

    /// How exactly an attempt is compared. Only a reset puts the programs of the drives and of the twin at the same place in their cycle.
    #[must_use]
    pub(crate) fn exactness(&self, rig: Exactness) -> Exactness {
        Exactness {
            knows_cells: rig.knows_cells && self.anew,
            ..rig
        }
    }

    /// The conversations to compare, and whether to compare them with a fresh twin. If drives are reset, what real ones did
    /// before does not matter, and how a ring leaves the error mode in real time is a race (9.9).
    #[must_use]
    pub(crate) fn compared(
        &self,
        mut all: Vec<Conversation>,
        exactness: Exactness,
    ) -> (Vec<Conversation>, bool) {
        let before = self.before_the_reset(&all, exactness);
        all.drain(..before);
        (all, self.anew && exactness.tolerance > Span::ZERO)
    }

    /// How many conversations come before the reset of the drives: what was before the first one, and the health check. 0 if these are
    /// compared too.
    fn before_the_reset(&self, all: &[Conversation], exactness: Exactness) -> usize {
        let fresh = self.anew && exactness.tolerance > Span::ZERO;
        let before = if self.attempts.is_some() { 3 } else { 1 };
        if fresh && all.len() > before {
            before
        } else {
            0
        }
    }
}

/// How the bytes received before the reset of the drives compare with those of a ring at rest; `None` where these are judged with the
/// rest. No verdict depends on it: it makes the record of an attempt complete.
pub(crate) fn opening(
    rig: &Rig,
    way: &Way,
    all: &[Conversation],
    exactness: Exactness,
) -> Option<String> {
    let before = &all[..way.before_the_reset(all, exactness)];
    if before.is_empty() {
        return None;
    }
    let mut twin = twin(rig, &known(rig)).ok()?;
    let follow = |conversation| twin.follow(conversation, exactness).divergence;
    let divergence = before.iter().find_map(follow);
    let received = before
        .iter()
        .map(|conversation| conversation.received.len());
    let received: usize = received.sum();
    Some(match divergence {
        None => format!("{} as of a ring at rest", counted(received, "byte")),
        Some(divergence) => format!("{}; {divergence}", counted(received, "byte")),
    })
}

/// Why a scenario is not played on rings of these sizes; `None` where it is, unless the rig's limits deny it.
pub(crate) fn not_played(plan: &Plan, link: &dyn Link, rings: &[RingSize]) -> Option<Skip> {
    // The size first: a link of another ring may have the number of one that there is.
    match plan.rings == rings {
        true => lacks(plan, link),
        false => {
            let is_inner = |ring: usize, place: usize| {
                let drives = plan.rings.get(ring).map_or(0, |size| size.drives());
                (1..usize::from(drives)).contains(&place)
            };
            let rig = rings.iter().map(|ring| ring.drives()).collect();
            let skip = Skip::other_size(plan.sizes.clone(), rig);
            let skip = skip.and(lacks_as_well(plan, link, is_inner));
            match skip.unlocks.contains(&Unlock::Simulated) {
                // No ring behind a port would do, of whatever size.
                true => lacks(plan, link),
                false => Some(skip),
            }
        }
    }
}

/// Plays a scenario once on any link, with what comes before it.
///
/// # Errors
/// Returns the ring that fails the health check.
pub(crate) fn play_one(
    link: &mut dyn Link,
    plan: &Plan,
    way: &Way,
) -> Result<Outcome, (usize, Unhealthy)> {
    way.examine(link)?;
    Ok(play_examined(link, plan, way))
}

/// The same after the examination.
fn play_examined(link: &mut dyn Link, plan: &Plan, way: &Way) -> Outcome {
    let ready = match way.anew {
        true => start_anew(link, &way.rings),
        false => Ok(()),
    };
    let outcome = match ready {
        Ok(()) => {
            link.begin();
            let outcome = play_over_bus(plan, link, AtMismatch::Stop);
            if link.time_tolerance() > Span::ZERO && ends_in_silence(&outcome) {
                outlast_standstill(link, way.rings.len());
            }
            outcome
        }
        Err(not_ready) => not_ready.judged(link),
    };
    if matches!(link.trouble(), Some(Trouble::Denied(_))) {
        come_home(link);
    }
    outcome
}

/// Whether a scenario has failed because nothing more came.
fn ends_in_silence(outcome: &Outcome) -> bool {
    let finding = outcome.finding.as_ref();
    let silent = |mismatch: &Mismatch| {
        mismatch
            .difference
            .as_ref()
            .is_none_or(ByteDifference::is_absence)
    };
    outcome.verdict == Verdict::Failed && finding.is_some_and(silent)
}

/// Drops the bytes that come back after the end of a conversation, from rings that owe some.
fn drop_late(link: &mut dyn Link, rings: &[RingSize], last: &Conversation) {
    let owed = |(ring, size): (usize, &RingSize)| {
        let answered = answered(*size, &last.sent_in(ring)).0.len();
        answered.saturating_sub(last.received_in(ring).len())
    };
    let mut owed: Vec<usize> = rings.iter().enumerate().map(owed).collect();
    let end = link.now() + LATEST;
    while owed.iter().any(|owed| *owed > 0) && link.now() < end && link.trouble().is_none() {
        if !wait_keeping(link, end) {
            break;
        }
        for (ring, owed) in owed.iter_mut().enumerate() {
            while link.receive(ring).is_some() {
                *owed = owed.saturating_sub(1);
            }
        }
    }
}

fn beat(beats: Option<&AtomicU64>) {
    if let Some(beats) = beats {
        beats.fetch_add(1, Ordering::Relaxed);
    }
}

/// Tells a session's watchdog that the program works while it plays on a model, which takes a busy computer longer than the watchdog waits.
struct LifeSign(Option<Arc<AtomicU64>>);

impl Sink for LifeSign {
    fn take(&mut self, _: &LinkEvent) {
        beat(self.0.as_deref());
    }

    fn waits(&mut self) {
        beat(self.0.as_deref());
    }
}

/// Keeps events and hands them on.
struct KeepingSink<'s> {
    events: Vec<LinkEvent>,
    sink: &'s mut dyn Sink,
}

impl Sink for KeepingSink<'_> {
    fn take(&mut self, event: &LinkEvent) {
        self.events.push(event.clone());
        self.sink.take(event);
    }
}

/// A fresh twin of a rig's drives, set up as its file and this header say.
pub(crate) fn twin(rig: &Rig, header: &Header) -> Result<Twin, Problems> {
    let mut model = rig.clone();
    // A simulated drive that is wrong on purpose is compared with one that is not.
    sim::set_up(&mut model, &sim::setup(rig).without_deviations());
    let plan = model.plan_with(header)?;
    let mut twin = Twin::new(simulate::bench(&plan), &plan.rings);
    twin.rest_through_self_tests();
    Ok(twin)
}

#[cfg(test)]
mod tests;
