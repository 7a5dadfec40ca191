//! Scenarios on a rig of NORDAC inverters, and their attempts judged again from a record.

use super::player::{Own, Player, capabilities};
use super::{Session, limits, rate, slaves};
use crate::buses::Bus;
use crate::buses::nordac::stream::TOLERANCE;
use crate::link::{Line, Link, LinkEvent, Recording, Sink, Trouble};
use crate::rig::segment::{OnSegment, RepeatedVerdict, SegmentJudge, SegmentRun};
use crate::rig::{Again, Attempt, End, Keeper, Options, Played, Rig, SessionError, attempts_of};
use crate::scenario::parse;
use crate::scenario::run::{Outcome, Skip};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::nordac::guard::{Class, class};
use harness_proto::nordac::{Parameter, Pkw, Task};
use harness_proto::time::Span;

/// A rig in use.
pub(crate) struct InvertersInUse {
    session: Session,
    options: Options,
    player: Player,
    again: Again,
    notes: Vec<String>,
    /// Why nothing more is played.
    over: Option<String>,
}

impl InvertersInUse {
    /// Takes a rig.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub(crate) fn open(rig: &Rig, options: &Options) -> Result<Self, SessionError> {
        if rig.port().is_some_and(|port| port.listen_only) {
            return Err(SessionError::Drives {
                rig: rig.id().to_owned(),
                why: "scenarios send, and its file says `listen_only = true`; set it to false"
                    .to_owned(),
            });
        }
        let session = Session::open(rig, options)?;
        let real = !rig.is_simulated();
        Ok(Self {
            player: player(rig, options.allow_motion),
            session,
            options: options.clone(),
            again: Again::new(real),
            notes: Vec::new(),
            over: None,
        })
    }

    fn attempt(&mut self, own: &Own, sink: &mut dyn Sink) -> Attempt {
        let simulated = self.session.rig().is_simulated();
        if simulated {
            // Each attempt has slaves of its own: no scenario sees what another one has left.
            match Session::open(self.session.rig(), &self.options) {
                Ok(fresh) => {
                    let _simulated = std::mem::replace(&mut self.session, fresh).release();
                }
                Err(error) => self.over = Some(error.to_string()),
            }
        }
        let link = self.session.link();
        link.reset_after_denial();
        let mut recording = Recording::new(link, sink);
        let (outcome, before) = self.player.attempt(own, &mut recording);
        let traces = vec![recording.trace(0)];
        if outcome.verdict != Verdict::Skipped && !simulated {
            self.make_safe();
        }
        Attempt {
            opening: Some(before),
            ..Attempt::on_own_rings(outcome, traces)
        }
    }

    /// Takes the slaves to their safe state, and sets parameters back that a scenario has changed.
    fn make_safe(&mut self) {
        let safe = self.session.make_safe();
        if !safe.confirmed {
            self.over = Some(format!("after the scenario: {safe}"));
            return;
        }
        let mut notes = Vec::new();
        for known in self.player.known() {
            let address = known.slave.address;
            let written = self.player.written().iter();
            for (_, number, ind) in written.filter(|own| own.0 == address) {
                let Some(raw) = known.values.get(&(*number, *ind)) else {
                    continue;
                };
                let Some(parameter) = Parameter::of(*number) else {
                    continue;
                };
                let name = format!("slave {address}: {number} ({})", parameter.name);
                if class(*number) == Class::Everything {
                    notes.push(format!("{name} was written: compare every parameter"));
                    continue;
                }
                let mut talk = self.session.talk();
                talk.restart(address);
                let mut task = |ak, pwe| {
                    let ppo = known.slave.ppo.unwrap_or_default();
                    talk.start(address, ppo, None)?;
                    known.task(&mut talk, Pkw::of(ak, *number, *ind, pwe))
                };
                let reads = match task(Task::read(parameter).ak(), 0) {
                    Ok(Some(reads)) if reads != *raw => reads,
                    Ok(_) => continue,
                    Err(error) => {
                        notes.push(error.to_string());
                        continue;
                    }
                };
                let kept = match task(Task::change(parameter).ak(), *raw) {
                    Ok(Some(_)) => continue,
                    Ok(None) => "the slave does not take it".to_owned(),
                    Err(error) => error.to_string(),
                };
                drop(talk);
                self.session.link().reset_after_denial();
                notes.push(format!(
                    "{name} reads {reads} and is not set back to {raw}: {kept}"
                ));
            }
        }
        self.notes.extend(notes);
    }
}

impl SegmentRun for InvertersInUse {
    fn segment(&self) -> OnSegment {
        segment(self.session.rig(), self.session.limits().motion)
    }

    fn play(
        &mut self,
        source: &Source,
        mut keeper: Option<&mut dyn Keeper>,
    ) -> Result<Played, SessionError> {
        let own = match read(source) {
            Ok(own) => own,
            Err(skip) => return Ok(Played::skipped(skip)),
        };
        if let Some(skip) = self.player.not_begun(&own) {
            return Ok(Played::skipped(skip));
        }
        let real = !self.session.rig().is_simulated();
        let most = attempts_of(self.session.rig(), real, false);
        let mut attempts = Vec::new();
        loop {
            let number = attempts.len() + 1;
            let mut forgotten: Vec<LinkEvent> = Vec::new();
            let attempt = match &mut keeper {
                Some(keeper) => {
                    keeper.begins(number);
                    let attempt = self.attempt(&own, &mut **keeper);
                    keeper.ends(number, &attempt);
                    attempt
                }
                None => self.attempt(&own, &mut forgotten),
            };
            attempts.push(attempt);
            let more = self.again.after(&attempts, most);
            if !more || self.over.is_some() || self.session.link().trouble().is_some() {
                return Ok(Played::of(attempts));
            }
        }
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn over(&self) -> Option<String> {
        let late = self.session.overdue();
        let overdue = late.then(|| "the run reached `max_run` of the rig's file".to_owned());
        self.over.clone().or(overdue)
    }

    fn trouble(&self) -> Option<Trouble> {
        self.session.guarded().trouble().cloned()
    }

    fn close(self: Box<Self>, error: bool) -> End {
        self.session.close(error)
    }
}

/// Judges a record: of simulated slaves by playing it again, of others from what was received.
pub(crate) struct InverterJudge {
    rig: Rig,
    allow_motion: bool,
    /// Made with the first attempt.
    player: Option<Player>,
    /// The simulated rig, from the first attempt on.
    run: Option<InvertersInUse>,
}

impl InverterJudge {
    /// For a run in which motors may have turned, as far as the rig's file permits it, or for one in which they may not.
    pub(crate) fn new(rig: &Rig, allow_motion: bool) -> Self {
        Self {
            allow_motion,
            run: None,
            player: None,
            rig: rig.clone(),
        }
    }

    fn player(&mut self) -> &mut Player {
        let (rig, allow_motion) = (&self.rig, self.allow_motion);
        self.player.get_or_insert_with(|| player(rig, allow_motion))
    }

    /// Plays an attempt on the simulated rig again.
    fn again(&mut self, own: &Own) -> Result<RepeatedVerdict, String> {
        let mut run = match self.run.take() {
            Some(run) => run,
            None => {
                let options = Options {
                    allow_motion: self.allow_motion,
                    ..Options::default()
                };
                // Nothing outside the folder is touched.
                let mut rig = self.rig.clone();
                rig.file.hooks = Default::default();
                rig.file.power.clear();
                rig.file.quarantine = None;
                InvertersInUse::open(&rig, &options).map_err(|error| error.to_string())?
            }
        };
        let mut events: Vec<LinkEvent> = Vec::new();
        let attempt = run.attempt(own, &mut events);
        let trouble = run.trouble().is_some();
        self.run = Some(run);
        Ok(RepeatedVerdict {
            outcome: attempt.outcome,
            before: attempt.opening,
            left: None,
            played: Some((events, attempt.traces)),
            trouble,
        })
    }
}

impl SegmentJudge for InverterJudge {
    fn segments(&self) -> [OnSegment; 2] {
        [true, false].map(|motion| segment(&self.rig, limits(&self.rig, motion).motion))
    }

    fn not_begun(&self, source: &Source) -> Option<Outcome> {
        let skip = match read(source) {
            Err(skip) => Some(skip),
            Ok(own) => player(&self.rig, self.allow_motion).not_begun(&own),
        };
        skip.map(Outcome::skipped)
    }

    fn judge(&mut self, source: &Source, events: &[LinkEvent]) -> Result<RepeatedVerdict, String> {
        let own = Own::read(source).map_err(|problems| problems.to_string())?;
        if self.rig.is_simulated() {
            return self.again(&own);
        }
        let player = self.player();
        let mut replay = player.replay(events, TOLERANCE);
        let (outcome, before) = player.attempt(&own, &mut replay);
        Ok(RepeatedVerdict {
            outcome,
            before: Some(before),
            left: replay.left(),
            played: None,
            trouble: replay.trouble().is_some(),
        })
    }
}

/// A scenario of this bus, or why it is not played here.
fn read(source: &Source) -> Result<Own, Skip> {
    match parse::bus(source) {
        // It was read when it was selected.
        Bus::Nordac => Own::read(source).map_err(|_| Skip::not_on_rig(Bus::Nordac)),
        other => Err(Skip::not_on_rig(other)),
    }
}

fn player(rig: &Rig, allow_motion: bool) -> Player {
    let port = rig.port();
    Player::new(
        port.map(slaves).unwrap_or_default(),
        port.map(rate).unwrap_or_default(),
        port.map_or(Span::ZERO, |port| super::session::patience_of(rig, port)),
        limits(rig, allow_motion),
        rig.is_simulated(),
    )
}

/// What a record says of a rig on which motors may turn or not.
fn segment(rig: &Rig, motion: bool) -> OnSegment {
    let all = limits(rig, motion);
    let simulated = rig.is_simulated();
    let port = rig.port();
    let drives = port.map_or(0, |port| port.drives.len());
    OnSegment {
        rate: port.map_or(0, |port| rate(port).bits_per_second()),
        drives: u8::try_from(drives).unwrap_or(u8::MAX),
        tolerance: match simulated {
            true => Span::ZERO,
            false => TOLERANCE,
        },
        capabilities: capabilities(&all, simulated),
    }
}
