//! Scenarios on a rig with a port, and their attempts judged again from a record, whatever the bus.

use super::observed::Beats;
use super::{
    QualificationKeeper, QualificationRecord, QualificationStopped, Qualified, QualifyingScenario,
    RecordJudge, RecordedAttempt, RecordedBench, RepeatedVerdict, RigRun, of_bus,
};
use crate::bus_name::BusName;
use crate::guard::Safe;
use crate::link::{Line, Link, LinkEvent, Recording, Replay, Sink, Trouble};
use crate::rig::left::NotPutBack;
use crate::rig::session::{RigDrives, RigSession, failed};
use crate::rig::{Attempt, End, Keeper, PlayedScenario, RetryRule, Rig, SessionError, UseOptions};
use crate::scenario::problem::Problems;
use crate::scenario::run::{Outcome, Skip};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::sync::Arc;

/// What playing scenarios on a rig asks of the bus of its drives: a player of attempts, on a rig or on a record.
pub trait PortPlayer: Sized {
    /// The bus of its scenarios.
    const BUS: BusName;

    /// Whether simulated drives are restarted for each attempt: no scenario sees what another one has left.
    const ANEW: bool;

    /// The drives of a rig.
    type Drives: RigDrives;

    /// A scenario, read for a rig.
    type Scenario;

    /// For a run in which motors may turn, as far as the rig's file permits it, or for one in which they may not; of a qualification or not.
    fn new(rig: &Rig, allow_motion: bool, qualifies: bool) -> Self;

    /// Judging may take long: the count that shows that the program works meanwhile.
    fn shows_life(&mut self, beats: Beats);

    /// Where it says what a scenario changes, before it does: for a program that ends before that is put back.
    fn tells(&mut self, left: NotPutBack);

    /// What a record says of a rig on which motors may turn or not.
    fn segment(rig: &Rig, allow_motion: bool) -> RecordedBench;

    /// Reads a scenario.
    ///
    /// # Errors
    /// Its mistakes.
    fn read(source: &Source) -> Result<Self::Scenario, Box<Problems>>;

    /// Why a scenario is not begun, whatever the drives are; `None` if it is.
    fn not_begun(&self, scenario: &Self::Scenario) -> Option<Skip>;

    /// Whether a scenario does something to the drives beside the bus.
    fn disturbs(_scenario: &Self::Scenario) -> bool {
        false
    }

    /// Whether drives that are restarted for each attempt are set up to be wrong.
    fn deviates(_rig: &Rig) -> bool {
        false
    }

    /// What was recorded of the rig, as a link.
    fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay;

    /// Waits until an attempt may begin.
    fn wait(&mut self, _scenario: &Self::Scenario, _link: &mut dyn Link) {}

    /// Something was lost in the last attempt: what probes have settled by a silence in it is not known.
    fn doubt(&mut self) {}

    /// One attempt over a link, with what was received before the scenario, in words.
    fn attempt(&mut self, scenario: &Arc<Self::Scenario>, link: &mut dyn Link)
    -> (Outcome, String);

    /// Sets back what the last attempt has changed, on drives in their safe state. Returns what is left to say.
    fn set_back(
        &mut self,
        scenario: &Self::Scenario,
        session: &mut RigSession<Self::Drives>,
    ) -> Vec<String>;

    /// The scenarios that a qualification plays after the selected ones.
    fn conversations(rig: &Rig) -> Vec<Source>;

    /// What the attempts of these players come to, one for each part of a qualification that began at this date and time of day in UTC;
    /// `whole` if everything was played.
    fn qualified(parts: &[&Self], rig: &Rig, began: &str, whole: bool) -> Qualified;
}

/// A rig in use.
pub struct PortRun<P: PortPlayer> {
    session: RigSession<P::Drives>,
    options: UseOptions,
    player: P,
    again: RetryRule,
    notes: Vec<String>,
    /// Why nothing more is played.
    over: Option<String>,
    /// A scenario after which the drives were not seen in their safe state, as after a signal: what it has changed is set back at the end.
    unfinished: Option<Arc<P::Scenario>>,
    /// How simulated drives that were restarted since were not brought to their safe state.
    not_safe: Option<Safe>,
}

impl<P: PortPlayer> PortRun<P> {
    /// Takes a rig.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        if rig.port().is_some_and(|port| port.listen_only) {
            let why = "scenarios send, and its file says `listen_only = true`; set it to false";
            return Err(failed(rig, why));
        }
        Ok(Self::on(RigSession::open(rig, options)?, options))
    }

    /// Takes a rig that is open, of whose drives nothing is known.
    pub fn on(mut session: RigSession<P::Drives>, options: &UseOptions) -> Self {
        let mut player = P::new(session.rig(), options.allow_motion, options.ill_as_well);
        player.shows_life(session.beats());
        player.tells(session.left().clone());
        Self {
            again: retries::<P>(session.rig(), options),
            notes: session.left().take_before().into_iter().collect(),
            session,
            player,
            options: options.clone(),
            over: None,
            unfinished: None,
            not_safe: None,
        }
    }

    /// The rig.
    pub const fn session(&self) -> &RigSession<P::Drives> {
        &self.session
    }

    /// The same, to be used between scenarios.
    pub const fn session_mut(&mut self) -> &mut RigSession<P::Drives> {
        &mut self.session
    }

    /// Sets back what a scenario has changed.
    fn set_back(&mut self, scenario: &P::Scenario) {
        let player = &mut self.player;
        let set_back = |session: &mut _| player.set_back(scenario, session);
        let notes = self.session.without_deadline(set_back);
        self.session.left().keep(&notes);
        self.notes.extend(notes);
    }

    /// Takes the drives to their safe state after a scenario that was broken off, and sets back what it has changed.
    ///
    /// # Errors
    /// The safe state is not confirmed.
    pub fn clear_up(&mut self) -> Result<(), Safe> {
        let Some(scenario) = self.unfinished.take() else {
            return Ok(());
        };
        let safe = self.session.make_safe();
        if !safe.confirmed {
            self.unfinished = Some(scenario);
            return Err(safe);
        }
        self.set_back(&scenario);
        Ok(())
    }

    /// Forgets what is known of the drives: others have used them.
    pub(crate) fn forget_drives(&mut self) {
        let (rig, options) = (self.session.rig(), &self.options);
        self.again = retries::<P>(rig, options);
        self.player = P::new(rig, options.allow_motion, options.ill_as_well);
        self.player.shows_life(self.session.beats());
        self.player.tells(self.session.left().clone());
        self.over = None;
    }

    /// Takes simulated drives that were just switched on.
    fn restart(&mut self) {
        match RigSession::open(self.session.rig(), &self.options) {
            Ok(fresh) => {
                let _simulated = std::mem::replace(&mut self.session, fresh).release();
            }
            Err(error) => self.over = Some(error.to_string()),
        }
    }

    fn attempt(&mut self, scenario: &Arc<P::Scenario>, sink: &mut dyn Sink) -> Attempt {
        let anew = P::ANEW && self.session.rig().is_simulated();
        if anew {
            self.restart();
        }
        self.player.wait(scenario, self.session.link());
        self.session.link().reset_after_denial();
        self.session.look_at_interlocks();
        // A look takes drives where no scenario expects them that were just switched on.
        let looked = !self.session.rig().file.interlock.is_empty();
        if anew && looked && self.session.sound().is_ok() {
            self.restart();
        }
        let _before = self.session.take_doubtful();
        let mut recording = Recording::new(self.session.link(), sink);
        let (mut outcome, before) = self.player.attempt(scenario, &mut recording);
        let traces = vec![recording.trace(0)];
        // A link that is lost may be back at the end of the run.
        let tripped = matches!(
            self.session.guarded().trouble(),
            Some(Trouble::Interlock(_) | Trouble::Lost(_))
        );
        let played = outcome.verdict != Verdict::Skipped && !anew;
        if played && tripped {
            // The drives go to their safe state at the end of the run, and what the scenario has changed is set back then.
            self.unfinished = Some(Arc::clone(scenario));
        } else if played {
            let mut safe = self.session.make_safe();
            if !safe.confirmed && self.session.link().trouble().is_none() {
                // A computer that stood still has not heard the drives.
                safe = self.session.make_safe();
            }
            match safe.confirmed {
                true => self.set_back(scenario),
                false => {
                    self.unfinished = Some(Arc::clone(scenario));
                    self.over = Some(format!("after the scenario: {safe}"));
                }
            }
        }
        if outcome.verdict == Verdict::Failed && self.over.is_none() {
            self.session.hear_of_losses();
        }
        // A pass needs every reply; what differs may be a reply that is lost.
        let unplaced = match outcome.verdict {
            Verdict::Passed => self.session.take_unplaced(),
            _ => self.session.take_doubtful(),
        };
        outcome.unplaced(unplaced);
        if unplaced > 0 {
            self.player.doubt();
        }
        // What a fault of the scenario has switched off is no drive that disobeys.
        let may_disobey = match outcome.verdict {
            Verdict::Failed => true,
            Verdict::Skipped => false,
            _ => P::deviates(self.session.rig()),
        };
        if anew && may_disobey && !P::disturbs(scenario) {
            let safe = self.session.make_safe();
            self.not_safe = self.not_safe.take().or((!safe.confirmed).then_some(safe));
        }
        Attempt {
            opening: Some(before),
            unplaced,
            ..Attempt::new(outcome, traces)
        }
    }
}

impl<P: PortPlayer> RigRun for PortRun<P> {
    fn segment(&mut self) -> RecordedBench {
        P::segment(self.session.rig(), self.options.allow_motion)
    }

    fn play(
        &mut self,
        source: &Source,
        keeper: Option<&mut dyn Keeper>,
    ) -> Result<PlayedScenario, SessionError> {
        let scenario = match of_bus(P::BUS, source, P::read) {
            Ok(scenario) => Arc::new(scenario),
            Err(skip) => return Ok(PlayedScenario::skipped(skip)),
        };
        if let Some(skip) = self.player.not_begun(&scenario) {
            return Ok(PlayedScenario::skipped(skip.on_port()));
        }
        let attempt = |run: &mut Self, sink: &mut dyn Sink| Ok(run.attempt(&scenario, sink));
        PlayedScenario::play(self, keeper, attempt, |run, attempts| {
            let more = run.again.after(attempts) && run.over.is_none();
            more && run.session.link().trouble().is_none()
        })
    }

    fn qualify(
        &mut self,
        _thorough: bool,
        keeper: &mut dyn QualificationKeeper,
    ) -> Result<Qualified, QualificationStopped> {
        let mut whole = true;
        for source in P::conversations(self.session.rig()) {
            whole &= !self.is_over(&mut |why| keeper.complain(why));
            if !whole {
                break;
            }
            let played = keeper.play(&source, &mut |keeper| self.play(&source, keeper))?;
            keeper.show(&source, &played)?;
            for note in self.notes() {
                keeper.say(&format!("  note: {note}\n"));
            }
        }
        let (player, rig) = (&self.player, self.session.rig());
        Ok(P::qualified(&[player], rig, &keeper.began(), whole))
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn over(&mut self) -> Option<String> {
        // The link is in trouble then, which ends the run.
        self.session.end_if_overdue();
        self.over.clone()
    }

    fn trouble(&mut self) -> Option<Trouble> {
        self.session.guarded().trouble().cloned()
    }

    fn close(mut self: Box<Self>, error: bool) -> End {
        let mut not_safe = self.not_safe.take();
        if self.unfinished.is_some() {
            self.session.resume();
            if let Err(safe) = self.clear_up() {
                not_safe = Some(safe);
                self.notes.extend(self.session.left().foretold());
            }
        }
        let notes = self.notes();
        let mut end = self.session.close(error);
        // Simulated drives are taken to their safe state after scenarios only.
        end.safe = end.safe.or(not_safe);
        end.remarks.extend(notes);
        end
    }
}

/// Judges a record: of simulated drives by playing it again, of others from what was received.
pub struct PortJudge<P: PortPlayer> {
    rig: Rig,
    allow_motion: bool,
    qualifies: bool,
    player: P,
    /// The simulated rig, from the first attempt on.
    run: Option<PortRun<P>>,
    /// What has played the parts before.
    before: Vec<P>,
}

impl<P: PortPlayer> PortJudge<P> {
    /// Of a qualification or of a run in which motors may turn, as far as the rig's file permits it; see [`RecordJudge::adopt`].
    pub fn new(rig: &Rig, qualifies: bool) -> Self {
        Self {
            allow_motion: true,
            qualifies,
            run: None,
            player: P::new(rig, true, qualifies),
            rig: rig.clone(),
            before: Vec::new(),
        }
    }

    /// Plays an attempt on the simulated rig again, after those before it.
    fn again(&mut self, scenario: &Arc<P::Scenario>) -> Result<RepeatedVerdict, String> {
        let mut run = match self.run.take() {
            Some(run) => run,
            None => {
                let options = UseOptions {
                    allow_motion: self.allow_motion,
                    ill_as_well: self.qualifies,
                    ..UseOptions::default()
                };
                PortRun::open(&self.rig.for_replay(), &options)
                    .map_err(|error| error.to_string())?
            }
        };
        let mut events: Vec<LinkEvent> = Vec::new();
        let attempt = run.attempt(scenario, &mut events);
        let trouble = run.trouble().is_some();
        self.run = Some(run);
        let traces = attempt.traces.clone();
        Ok(RepeatedVerdict {
            attempt: Attempt {
                traces: Vec::new(),
                ..attempt
            },
            left: None,
            played: Some((events, traces)),
            trouble,
            exact: true,
        })
    }

    fn repeated(
        &mut self,
        scenario: &Arc<P::Scenario>,
        events: &[LinkEvent],
    ) -> Result<RepeatedVerdict, String> {
        if self.rig.is_simulated() {
            return self.again(scenario);
        }
        let tolerance = P::segment(&self.rig, self.allow_motion).tolerance;
        let mut replay = self.player.replay(events, tolerance);
        let (outcome, before) = self.player.attempt(scenario, &mut replay);
        let attempt = Attempt {
            opening: Some(before),
            ..Attempt::new(outcome, Vec::new())
        };
        Ok(RepeatedVerdict::of(attempt, &replay, true))
    }
}

impl<P: PortPlayer> RecordJudge for PortJudge<P> {
    fn adopt(&mut self, capabilities: &[String]) -> RecordedBench {
        let [moving, still] = [true, false].map(|motion| P::segment(&self.rig, motion));
        let named = |bench: &RecordedBench| {
            let names = bench.capabilities.iter().map(|ability| ability.name());
            names.eq(capabilities.iter().map(String::as_str))
        };
        let segment = match named(&still) {
            true => (still, false),
            false => (moving, true),
        };
        self.allow_motion = segment.1;
        self.player = P::new(&self.rig, self.allow_motion, self.qualifies);
        segment.0
    }

    fn not_begun(&self, source: &Source, _remarks: &[String]) -> Option<Outcome> {
        let skip = match of_bus(P::BUS, source, P::read) {
            Err(skip) => Some(skip),
            Ok(scenario) => self.player.not_begun(&scenario),
        };
        skip.map(Outcome::skipped)
    }

    fn conversations(&self) -> Vec<QualifyingScenario> {
        let all = P::conversations(&self.rig).into_iter();
        let listed = all.map(|source| QualifyingScenario {
            source,
            always: true,
        });
        listed.collect()
    }

    fn begin_part(&mut self) {
        let fresh = P::new(&self.rig, self.allow_motion, self.qualifies);
        let player = std::mem::replace(&mut self.player, fresh);
        let player = self.run.take().map_or(player, |run| run.player);
        self.before.push(player);
    }

    fn qualified(
        &mut self,
        began: &str,
        record: QualificationRecord<'_>,
    ) -> Result<Vec<Qualified>, String> {
        let whole = match record {
            QualificationRecord::Run { whole, .. } => whole,
            QualificationRecord::Parts { missing, .. } => missing.is_empty(),
        };
        let last = self.run.as_ref().map_or(&self.player, |run| &run.player);
        let parts: Vec<&P> = self.before.iter().chain([last]).collect();
        Ok(vec![P::qualified(&parts, &self.rig, began, whole)])
    }

    fn judge(
        &mut self,
        source: &Source,
        recorded: RecordedAttempt<'_>,
    ) -> Result<RepeatedVerdict, String> {
        let scenario = P::read(source).map_err(|problems| problems.to_string())?;
        let mut repeated = self.repeated(&Arc::new(scenario), recorded.events)?;
        repeated.attempt.unplaced = recorded.unplaced;
        repeated.attempt.outcome.unplaced(recorded.unplaced);
        if recorded.unplaced > 0 {
            self.player.doubt();
        }
        Ok(repeated)
    }
}

/// When scenarios are played once more.
fn retries<P: PortPlayer>(rig: &Rig, options: &UseOptions) -> RetryRule {
    let segment = P::segment(rig, options.allow_motion);
    RetryRule::of(rig, segment.tolerance, options.ill_as_well)
}
