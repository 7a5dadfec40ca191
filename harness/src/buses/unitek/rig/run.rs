//! Scenarios on a rig of UNITEK drives, and their attempts judged again from a record.

use super::player::{Own, Player, stores};
use super::qualify::{conversations, qualify};
use super::{Axis, Session, axes, limits, rate};
use crate::buses::Bus;
use crate::buses::unitek::driver::{Driver, Error};
use crate::buses::unitek::simulate::Bench;
use crate::link::{Capability, Line, Link, LinkEvent, Recording, Sink, Trouble};
use crate::rig::port_file::Port;
use crate::rig::segment::{OnSegment, Qualified, RepeatedVerdict, SegmentJudge, SegmentRun};
use crate::rig::{Again, Attempt, End, Keeper, Options, Played, Rig, SessionError, attempts_of};
use crate::scenario::parse;
use crate::scenario::run::{Outcome, Skip};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::guard::Limits;
use harness_proto::unitek::{Access, Register};
use std::sync::Arc;

/// The shortest time between two writes of 84 (UNITEK ex 7: our choice).
const EEPROM_REST: Span = Span::from_millis(60_000);

/// How long one wait lasts at most: a request to end is looked for between them.
const NAP: Span = Span::from_millis(50);

/// Registers that commands and functions change, which the safe state sets.
const COMMANDS: [u8; 4] = [0x31, 0x51, 0x6E, 0x90];

/// A rig in use.
pub(crate) struct DrivesInUse {
    session: Session,
    player: Player,
    again: Again,
    notes: Vec<String>,
    /// Why nothing more is played.
    over: Option<String>,
    /// Whether something that was played may have stored parameters.
    stored: bool,
}

impl DrivesInUse {
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
        let mut session = Session::open(rig, options)?;
        let real = session.link().time_tolerance() > Span::ZERO;
        let mut player = player(rig, limits(rig, options.allow_motion));
        if options.ill_as_well {
            player.qualify();
        }
        Ok(Self {
            player,
            session,
            again: Again::new(real),
            notes: Vec::new(),
            over: None,
            stored: false,
        })
    }

    /// Waits until 84 may be written again.
    fn rest(&mut self) {
        let end = self.session.link().now() + EEPROM_REST;
        let link = self.session.link();
        while link.now() < end && link.trouble().is_none() {
            let now = link.now();
            link.wait(end.min(now + NAP));
            while link.receive(0).is_some() {}
        }
    }

    fn attempt(&mut self, own: &Arc<Own>, sink: &mut dyn Sink) -> Attempt {
        let stores = own.frames().any(stores);
        if stores && self.stored {
            self.rest();
        }
        let link = self.session.link();
        link.reset_after_denial();
        let mut recording = Recording::new(link, sink);
        let (outcome, before) = self.player.attempt(own, &mut recording);
        let traces = vec![recording.trace(0)];
        if outcome.verdict != Verdict::Skipped {
            self.stored |= stores;
            self.make_safe(stores);
        }
        Attempt {
            opening: Some(before),
            ..Attempt::on_own_rings(outcome, traces)
        }
    }

    /// Takes the drives to their safe state, and sets registers back that a scenario has changed.
    fn make_safe(&mut self, stored: bool) {
        let safe = self.session.make_safe();
        if !safe.confirmed {
            self.over = Some(format!("after the scenario: {safe}"));
            return;
        }
        let mut notes = Vec::new();
        for known in self.player.known() {
            let axis = known.axis;
            let all = self.player.written().contains(&(axis.rx, 0x83));
            let changed = |register: &u8| {
                let access = Register::of(*register).access;
                let written = self.player.written().contains(&(axis.rx, *register));
                (all || written)
                    && matches!(access, Access::RW | Access::SP)
                    && !COMMANDS.contains(register)
            };
            let before = known.cells.iter().filter(|(register, _)| changed(register));
            let mut driver = self.session.driver();
            for (register, raw) in before {
                notes.extend(set_back(&mut driver, axis, (*register, *raw)));
            }
            if stored && !all {
                notes.push(format!(
                    "drive {}: its EEPROM keeps what the scenario stored; `params save` and `params load` compare and set it",
                    axis.node
                ));
            }
        }
        self.notes.extend(notes);
    }
}

/// Sets a register back to what it was. Returns what is left to say.
fn set_back(driver: &mut Driver<'_>, axis: Axis, (register, raw): (u8, u32)) -> Option<String> {
    let name = Register::of(register).name;
    let reads = match driver.read(axis, register) {
        Ok(reply) => reply.data.bits() & Register::of(register).mask(),
        Err(error) => return Some(error.to_string()),
    };
    if reads == raw {
        return None;
    }
    let data = Data::of(Register::of(register), raw);
    let job = harness_proto::unitek::master::Job::Write { register, data };
    let kept = |why: &str| {
        format!(
            "drive {}: register {register:02X} ({name}) reads {reads:X} and is not set back to {raw:X}: {why}",
            axis.node
        )
    };
    if let Some(why) = driver.denied(&[(axis, job)]) {
        return Some(kept(&why));
    }
    match driver.write(axis, register, data) {
        Ok(_) => None,
        Err(Error::Differs { .. }) => Some(kept("the drive does not take it")),
        Err(error) => Some(kept(&error.to_string())),
    }
}

impl SegmentRun for DrivesInUse {
    fn segment(&self) -> OnSegment {
        let rig = self.session.rig();
        segment(rig, self.session.limits().motion)
    }

    fn play(
        &mut self,
        source: &Source,
        mut keeper: Option<&mut dyn Keeper>,
    ) -> Result<Played, SessionError> {
        let own = match read(source) {
            Ok(own) => Arc::new(own),
            Err(skip) => return Ok(Played::skipped(skip)),
        };
        if let Some(skip) = self.player.not_begun(&own) {
            return Ok(Played::skipped(skip));
        }
        let real = self.session.link().time_tolerance() > Span::ZERO;
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

    fn conversations(&self) -> Vec<Source> {
        conversations(self.session.axes())
    }

    fn qualified(&mut self, began: &str, whole: bool) -> Option<Qualified> {
        let rig = self.session.rig();
        Some(qualify(&self.player, rig, began, whole))
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

/// Judges a record: of simulated drives by playing it again, of others from what was received.
pub(crate) struct Judge {
    rig: Rig,
    allow_motion: bool,
    qualifies: bool,
    player: Player,
    tolerance: Span,
    /// The simulated rig, from the first attempt on.
    run: Option<DrivesInUse>,
}

impl Judge {
    /// For a run in which motors may have turned, as far as the rig's file permits it, or for one in which they may not; of a qualification or not.
    pub(crate) fn new(rig: &Rig, allow_motion: bool, qualifies: bool) -> Self {
        let limits = limits(rig, allow_motion);
        let tolerance = segment(rig, limits.motion).tolerance;
        let mut player = player(rig, limits);
        if qualifies {
            player.qualify();
        }
        Self {
            tolerance,
            allow_motion,
            qualifies,
            run: None,
            player,
            rig: rig.clone(),
        }
    }
}

impl Judge {
    /// Plays an attempt on the simulated rig again, behind those before it.
    fn again(&mut self, own: &Arc<Own>) -> Result<RepeatedVerdict, String> {
        let mut run = match self.run.take() {
            Some(run) => run,
            None => {
                let options = Options {
                    allow_motion: self.allow_motion,
                    ill_as_well: self.qualifies,
                    ..Options::default()
                };
                // Nothing outside the folder is touched.
                let mut rig = self.rig.clone();
                rig.file.hooks = Default::default();
                rig.file.power.clear();
                rig.file.quarantine = None;
                DrivesInUse::open(&rig, &options).map_err(|error| error.to_string())?
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

impl SegmentJudge for Judge {
    fn segments(&self) -> [OnSegment; 2] {
        [true, false].map(|motion| segment(&self.rig, limits(&self.rig, motion).motion))
    }

    fn not_begun(&self, source: &Source) -> Option<Outcome> {
        let skip = match read(source) {
            Err(skip) => Some(skip),
            Ok(own) => self.player.not_begun(&own),
        };
        skip.map(Outcome::skipped)
    }

    fn conversations(&self) -> Vec<Source> {
        conversations(&self.rig.port().map(axes).unwrap_or_default())
    }

    fn qualified(&mut self, began: &str, whole: bool) -> Option<Qualified> {
        match &mut self.run {
            Some(run) => run.qualified(began, whole),
            None => Some(qualify(&self.player, &self.rig, began, whole)),
        }
    }

    fn judge(&mut self, source: &Source, events: &[LinkEvent]) -> Result<RepeatedVerdict, String> {
        let own = Own::read(source).map_err(|problems| problems.to_string())?;
        let own = Arc::new(own);
        if self.rig.is_simulated() {
            return self.again(&own);
        }
        let mut replay = self.player.replay(events, self.tolerance);
        let (outcome, before) = self.player.attempt(&own, &mut replay);
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
        Bus::Unitek => Own::read(source).map_err(|_| Skip::not_on_rig(Bus::Unitek)),
        other => Err(Skip::not_on_rig(other)),
    }
}

fn player(rig: &Rig, limits: Limits) -> Player {
    let capabilities = capabilities(&limits, rig.is_simulated());
    let port = rig.port();
    let patience = port.map_or(std::time::Duration::ZERO, |port| port.patience.0);
    Player::new(
        port.map(axes).unwrap_or_default(),
        port.map_or(harness_proto::can::BitRate::K500, rate),
        Span::from_nanos(u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX)),
        limits,
        (capabilities, port.is_none_or(Port::carries_remote_frames)),
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
            false => crate::link::frames::SLACK,
        },
        capabilities: capabilities(&all, simulated),
    }
}

/// What a rig's capabilities are within limits, beside what no record shows.
fn capabilities(limits: &Limits, simulated: bool) -> Vec<Capability> {
    let all = match simulated {
        true => Bench::CAPABILITIES.as_slice(),
        false => &[Capability::Memory, Capability::Motion, Capability::Eeprom],
    };
    let has = |own: &&Capability| match own {
        Capability::Motion => limits.motion,
        Capability::Eeprom => limits.eeprom,
        Capability::Tap | Capability::Simulator | Capability::Power => false,
        _ => true,
    };
    all.iter().filter(has).copied().collect()
}
