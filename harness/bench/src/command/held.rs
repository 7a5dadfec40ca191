//! A bench that a session holds, whatever its bus.

use crate::command::drive::DriveCommand;
use crate::command::drives::{CommandDrives, perform};
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::output::Output;
use crate::command::port_bench::PortBench;
use crate::command::rig_commands::unusable;
use crate::guard::{Guarded, Safe};
use crate::link::{Line, Link, Trouble};
use crate::medium::Medium;
use crate::rig::playing::RigRun;
use crate::rig::playing::run::{PortPlayer, PortRun};
use crate::rig::session::{RigDrives, RigSession};
use crate::rig::{End, Ends, PlayedScenario, Rig, SessionError, UseOptions};
use crate::scenario::source::Source;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;

/// What a held bench has recorded of its bus.
pub struct HeldRecord {
    /// Everything since its link began, or since its record was last emptied.
    pub traces: Vec<Trace>,
    /// What its ports carry.
    pub medium: Medium,
    /// How many pieces its link has carried since it began.
    pub carried: u64,
    /// The link's time.
    pub now: Instant,
}

impl HeldRecord {
    /// What the `ports` of a link have recorded.
    pub fn of(link: &Guarded<Ends>, ports: usize) -> Self {
        Self {
            traces: (0..ports).map(|port| link.trace(port)).collect(),
            medium: link.medium(0),
            carried: link.carried(),
            now: link.now(),
        }
    }
}

/// A bench that stays open between requests.
pub trait HeldBench {
    /// The numbers of its drives.
    fn drives(&self) -> Vec<String>;

    /// The name of a drive's actual speed.
    fn speed(&self) -> &'static str;

    /// Runs a command on it.
    ///
    /// # Errors
    /// [`Failure`].
    fn perform(&mut self, command: DriveCommand, output: &mut Output) -> Result<Exit, Failure>;

    /// Lets time pass while the bus stays at work. Virtual time passes at once.
    ///
    /// # Errors
    /// [`Failure`]: the port is lost.
    fn pass(&mut self, time: Span) -> Result<(), Failure>;

    /// Plays a scenario on its drives.
    ///
    /// # Errors
    /// [`Failure`]: the bench cannot be used any more, or not for scenarios.
    fn play(&mut self, source: &Source) -> Result<PlayedScenario, Failure>;

    /// Does a line of the scenario language to simulated drives at once: a fault, or what happens to a drive from outside the bus.
    ///
    /// # Errors
    /// [`Failure`]: the line has a mistake, or the drives are not simulated.
    fn strike(&mut self, line: &str) -> Result<(), Failure>;

    /// Brings rings out of the error mode; returns what was found.
    ///
    /// # Errors
    /// [`Failure`]: the bus has no error mode.
    fn recover(&mut self) -> Result<String, Failure>;

    /// What is recorded of the bus.
    ///
    /// # Errors
    /// [`Failure`]: the bench has been given back.
    fn record(&mut self) -> Result<HeldRecord, Failure>;

    /// Forgets what is recorded of the bus. Simulated drives record what comes if `most` says how many pieces at most, or nothing where it is
    /// `None`; ports always record, within their bound.
    fn record_from_now(&mut self, most: Option<u64>);

    /// Whether no telegram is under way on a shared line, so that its record does not end in the middle of one.
    fn is_between_telegrams(&self) -> bool;

    /// What happened on the bus that no answer reports, since the last call.
    fn events(&mut self) -> Vec<String>;

    /// Why the link carries nothing.
    fn trouble(&self) -> Option<Trouble>;

    /// Whether the bench has been used for longer than its file allows.
    fn overdue(&self) -> bool;

    /// Makes the link of use again after a denial or a cancelled request.
    ///
    /// # Errors
    /// [`Failure`]: the drives do not answer.
    fn resume(&mut self) -> Result<(), Failure>;

    /// Takes the drives to their safe state and gives the bench back.
    fn end(self: Box<Self>, error: bool) -> End;
}

/// As [`HeldBench::record_from_now`].
pub fn record_from_now(link: &mut Guarded<Ends>, most: Option<u64>) {
    let simulated = link.inner().ports().is_none();
    link.record(most.is_some());
    link.limit_record(most.filter(|_| simulated));
}

/// What a session asks of the drives of a port.
pub trait HeldDrives: RigDrives {
    /// What a drive is called, and what the stations share.
    const WORDS: [&'static str; 2];

    /// What stands for one of them.
    type Drive: Copy + PartialEq;

    /// The drives, in the order of the rig's file.
    fn listed(&self) -> Vec<Self::Drive>;

    /// The number of a drive.
    fn number(drive: &Self::Drive) -> u8;

    /// Drives in a sentence: `drive 1`, `drives 1, 2`.
    fn named(drives: &[Self::Drive]) -> String {
        let names: Vec<_> = drives
            .iter()
            .map(|drive| Self::number(drive).to_string())
            .collect();
        let s = if names.len() == 1 { "" } else { "s" };
        format!("{}{s} {}", Self::WORDS[0], names.join(", "))
    }

    /// The name of a drive's actual speed.
    const SPEED: &'static str;

    /// What plays scenarios on them.
    type Player: PortPlayer<Drives = Self>;

    /// Runs a command that has another form on every bus.
    ///
    /// # Errors
    /// [`Failure`].
    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure>;

    /// Lets time pass.
    ///
    /// # Errors
    /// [`Failure`]: the port is lost.
    fn pass(session: &mut RigSession<Self>, time: Span) -> Result<(), Failure>;

    /// Forgets what a master knows of slaves: the conversation was broken off.
    fn forget(&self) {}
}

/// The drives of a port that a session holds.
pub struct HeldPort<D: HeldDrives>(PortRun<D::Player>);

impl<D: HeldDrives> HeldPort<D> {
    /// Takes a rig, and looks at its interlocks.
    ///
    /// # Errors
    /// See [`RigSession::open`].
    pub fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        let mut session = RigSession::open(rig, options)?;
        session.look_at_interlocks();
        Ok(Self(PortRun::on(session, options)))
    }

    const fn session(&mut self) -> &mut RigSession<D> {
        self.0.session_mut()
    }
}

impl<D: CommandDrives> HeldBench for HeldPort<D> {
    fn drives(&self) -> Vec<String> {
        let drives = self.0.session().drives().listed();
        drives
            .iter()
            .map(|drive| D::number(drive).to_string())
            .collect()
    }

    fn speed(&self) -> &'static str {
        D::SPEED
    }

    fn perform(&mut self, command: DriveCommand, output: &mut Output) -> Result<Exit, Failure> {
        perform::<D>(PortBench::Held(self.session()), &command, output)
    }

    fn pass(&mut self, time: Span) -> Result<(), Failure> {
        D::pass(self.session(), time)
    }

    fn play(&mut self, source: &Source) -> Result<PlayedScenario, Failure> {
        if self.session().listens_only() {
            return Err(Failure::refused(
                "scenarios send, and the rig's file says `listen_only = true`",
            ));
        }
        self.0.forget_drives();
        let played = self.0.play(source, None);
        // The scenario's master asked them, and they are in their safe state.
        self.session().drives().forget();
        let played = played.map_err(unusable)?;
        // A scenario that was cancelled is cleared up when the link is of use again.
        let cancelled = self.trouble() == Some(Trouble::Interrupted);
        match self.0.over().filter(|_| !cancelled) {
            Some(why) => Err(Failure::Said(Exit::RigError, why)),
            None => Ok(played),
        }
    }

    fn strike(&mut self, _: &str) -> Result<(), Failure> {
        Err(Failure::refused(
            "a session injects faults into simulated rings only; write the fault into a scenario",
        ))
    }

    fn recover(&mut self) -> Result<String, Failure> {
        Err(Failure::refused(
            "this bus has no error mode: recover is for rings",
        ))
    }

    fn record(&mut self) -> Result<HeldRecord, Failure> {
        Ok(HeldRecord::of(self.0.session().guarded(), 1))
    }

    fn record_from_now(&mut self, most: Option<u64>) {
        record_from_now(self.session().link(), most);
    }

    fn is_between_telegrams(&self) -> bool {
        let link = self.0.session().guarded();
        matches!(link.medium(0), Medium::Frames(_)) || !link.busy()
    }

    fn events(&mut self) -> Vec<String> {
        self.0.notes()
    }

    fn trouble(&self) -> Option<Trouble> {
        self.0.session().guarded().trouble().cloned()
    }

    fn overdue(&self) -> bool {
        self.0.session().overdue()
    }

    fn resume(&mut self) -> Result<(), Failure> {
        let session = self.session();
        session.go_on();
        session.drives().forget();
        let said = |safe: Safe| Failure::Said(Exit::NotSafe, safe.to_string());
        self.0.clear_up().map_err(said)
    }

    fn end(self: Box<Self>, error: bool) -> End {
        Box::new(self.0).close(error)
    }
}
