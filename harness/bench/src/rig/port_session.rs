//! A rig with a port in use, whatever its bus: locked, opened, guarded, and taken to its safe state on every way out.

use super::left::NotPutBack;
use super::lock::{PortLock, PortLockError};
use super::playing::observed::Beats;
use super::port_file::Port;
use super::taken::{Taken, take};
use super::watchdog::{Watchdog, watch_over};
use super::{Alarm, End, Ends, Rig, SessionError, UseOptions, file, standing};
use crate::guard::{Guarded, Safe, Standstill, StandstillStep, Watch};
use crate::link::{Line, Trouble};
use crate::medium::{Heard, Pieces};
use crate::port::OpenError;
use crate::scenario::source::Source;
use harness_proto::time::Span;
use std::io::Write as _;
use std::os::fd::AsFd;
use std::time::Instant;

/// How long a port is listened to before anything is sent.
const LISTEN: Span = Span::from_millis(150);

/// An SLCAN adapter is asked for its status every 250 ms.
const LOSSES: Span = Span::from_millis(300);

/// What a session asks of the bus of its drives.
pub trait PortDrives: Clone + std::fmt::Debug + 'static {
    /// What a drive is called, and what the stations share.
    const WORDS: [&'static str; 2];

    /// What stands for one of them.
    type Drive: Copy + PartialEq;

    /// Opens the drives of a rig that is taken, behind a gate: simulated ones, or an adapter with its lock. Nothing is sent.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    fn open(
        rig: &Rig,
        port: &Port,
        options: &UseOptions,
    ) -> Result<(Self, Guarded<Ends>, Vec<PortLock>), SessionError>;

    /// Finds out whether the drives of an open rig can be used; even `ill_as_well` where a drive does not answer.
    ///
    /// # Errors
    /// Why they cannot be used.
    fn ready(session: &mut PortSession<Self>, ill_as_well: bool) -> Result<(), SessionError>;

    /// What watches the interlocks of the rig's file; `None` where it has none.
    fn watch(&self, rig: &Rig) -> Option<Box<dyn Watch>>;

    /// The drives, in the order of the rig's file.
    fn listed(&self) -> Vec<Self::Drive>;

    /// The number of a drive.
    fn number(drive: &Self::Drive) -> u8;

    /// Drives in a sentence: `drive 1`, `drives 1, 2`.
    fn named(drives: &[Self::Drive]) -> String {
        let names: Vec<_> = drives
            .iter()
            .map(|own| Self::number(own).to_string())
            .collect();
        let s = if names.len() == 1 { "" } else { "s" };
        format!("{}{s} {}", Self::WORDS[0], names.join(", "))
    }

    /// Takes every drive to its safe state and reads it back.
    fn safe_state(&self, line: &mut Guarded<Ends>, standing: &Standstill) -> Safe;

    /// What stops every drive without waiting for anything: for a watchdog.
    fn last_words(&self) -> Pieces;
}

/// A rig in use.
#[derive(Debug)]
pub struct PortSession<D: PortDrives> {
    rig: Rig,
    link: Guarded<Ends>,
    drives: D,
    /// When the longest run is over.
    deadline: Option<Instant>,
    listen_only: bool,
    /// The drives are as they are to be left.
    ended: bool,
    left: NotPutBack,
    // Given back in this order.
    watchdog: Option<Watchdog>,
    _locks: Vec<PortLock>,
    taken: Taken,
}

impl<D: PortDrives> PortSession<D> {
    /// Takes a rig: lock, hook, port. Listens first. Then finds out whether its drives can be used, unless the file says `listen_only`.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        let port = rig
            .port()
            .ok_or_else(|| failed(rig, "it has no [port.1]"))?;
        let taken = take(rig, options)?;
        let deadline = rig.deadline(Instant::now());
        let (drives, link, locks) = D::open(rig, port, options)?;
        let mut session = Self {
            rig: rig.clone(),
            link,
            drives,
            deadline,
            listen_only: port.listen_only,
            // Nothing has been moved: there is nothing to make safe while the drives have not been found ready.
            ended: true,
            watchdog: None,
            left: NotPutBack::of(rig),
            _locks: locks,
            taken,
        };
        if rig.is_simulated() {
            session.link.set_interrupt(options.interrupt.clone());
        }
        match D::ready(&mut session, options.ill_as_well) {
            Err(_) if session.link.trouble() == Some(&Trouble::Interrupted) => {
                session.ended = session.listen_only;
                let end = Some(Box::new(session.end(false)));
                let rig = rig.id().to_owned();
                return Err(SessionError::Interrupted { rig, end });
            }
            Err(SessionError::Drives { rig, why }) => {
                let why = [Some(why), session.left.before()];
                let why: Vec<_> = why.into_iter().flatten().collect();
                let why = why.join("; ");
                return Err(SessionError::Drives { rig, why });
            }
            other => other?,
        }
        session.taken.around.used();
        session.ended = session.listen_only || rig.is_simulated();
        let watch = session.drives.watch(rig);
        session.link.set_watch(watch);
        session.link.set_deadline(session.deadline);
        session.watchdog = session.watched(options.alarm.clone())?;
        Ok(session)
    }

    /// Listens before anything is sent: a bench must not disturb another master. Simulated drives are alone.
    ///
    /// # Errors
    /// The link is in trouble.
    pub fn listen(&mut self, mut hear: impl FnMut(Heard)) -> Result<(), SessionError> {
        if self.rig.is_simulated() {
            return Ok(());
        }
        let end = self.link.now() + LISTEN;
        while self.link.now() < end && self.link.trouble().is_none() {
            self.link.wait(end);
            while let Some((_, heard)) = self.link.receive(0) {
                hear(heard);
            }
        }
        self.sound()
    }

    /// Looks at every interlock; nothing is under way. One that does not hold, or cannot be read, is trouble of the link from then on.
    pub fn look_at_interlocks(&mut self) {
        self.link.look_at_all();
    }

    #[must_use]
    pub const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Whether nothing is ever sent.
    #[must_use]
    pub const fn listens_only(&self) -> bool {
        self.listen_only
    }

    /// What is known of its drives.
    #[must_use]
    pub const fn drives(&self) -> &D {
        &self.drives
    }

    /// The same, to be changed.
    pub const fn drives_mut(&mut self) -> &mut D {
        &mut self.drives
    }

    /// Its guarded link, and what is known of its drives.
    pub const fn parts(&mut self) -> (&mut Guarded<Ends>, &D) {
        (&mut self.link, &self.drives)
    }

    /// Its guarded link.
    pub const fn link(&mut self) -> &mut Guarded<Ends> {
        &mut self.link
    }

    /// Its guarded link, to look at.
    #[must_use]
    pub const fn guarded(&self) -> &Guarded<Ends> {
        &self.link
    }

    /// Waits as long as an adapter may take to report a loss, at ports.
    pub(crate) fn hear_of_losses(&mut self) {
        if self.link.inner().ports().is_none() {
            return;
        }
        let end = self.link.now() + LOSSES;
        while self.link.now() < end && self.link.wait(end) {
            while self.link.receive(0).is_some() {}
        }
    }

    /// Line errors and losses that the transport has reported without their place since the last call.
    pub fn take_unplaced(&mut self) -> u64 {
        let ports = self.link.inner_mut().ports_mut();
        ports.map_or(0, |ports| ports.take_unplaced())
    }

    /// The same, and what may have been lost.
    pub fn take_doubtful(&mut self) -> u64 {
        let ports = self.link.inner_mut().ports_mut();
        ports.map_or(0, |ports| ports.take_unplaced() + ports.take_doubtful())
    }

    /// Whether it has been used for longer than its file allows.
    #[must_use]
    pub fn overdue(&self) -> bool {
        let now = Instant::now();
        self.deadline.is_some_and(|deadline| deadline <= now)
    }

    /// Ends the work if it has been used for longer than its file allows.
    pub fn end_if_overdue(&mut self) {
        self.link.set_deadline(self.deadline);
        self.link.end_if_overdue();
    }

    /// Does something that is not ended in its middle by the end of the longest run.
    pub(crate) fn without_deadline<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> T {
        self.link.set_deadline(None);
        let result = act(self);
        self.link.set_deadline(self.deadline);
        result
    }

    /// Whether the link is sound.
    ///
    /// # Errors
    /// It is in trouble.
    pub fn sound(&self) -> Result<(), SessionError> {
        self.link
            .trouble()
            .map_or(Ok(()), |trouble| Err(self.failed(&trouble.to_string())))
    }

    /// An error about its drives.
    #[must_use]
    pub fn failed(&self, why: &str) -> SessionError {
        failed(&self.rig, why)
    }

    /// Takes every drive to its safe state, whatever the file wants at the end, and reads it back.
    pub fn make_safe(&mut self) -> Safe {
        self.link.reset_after_denial();
        let wanted = Standstill {
            order: vec![StandstillStep::Stop, StandstillStep::Block],
            ..standing(&self.rig.file.safe_state)
        };
        let drives = &self.drives;
        self.link.unwatched(|link| drives.safe_state(link, &wanted))
    }

    /// Makes the link of use again after a signal: for the safe state, and what is set back behind it.
    pub fn resume(&mut self) {
        self.link.clear_the_way();
        if let Some(ports) = self.link.inner_mut().ports_mut() {
            ports.resume();
        }
        self.link.reset_after_denial();
    }

    /// What a scenario has changed and is not put back yet.
    pub const fn left(&self) -> &NotPutBack {
        &self.left
    }

    /// What shows the watchdog that the program works.
    pub fn beats(&mut self) -> Beats {
        let ports = self.link.inner_mut().ports_mut();
        ports.map_or_else(Beats::default, |own| Beats::of(own.beats()))
    }

    /// Lets a thread watch that the program lives.
    fn watched(&mut self, alarm: Alarm) -> Result<Option<Watchdog>, SessionError> {
        if self.listen_only {
            return Ok(None);
        }
        let (words, alarm) = (self.last_words(), alarm.telling(self.left.clone()));
        let Some(ports) = self.link.inner_mut().ports_mut() else {
            return Ok(None);
        };
        let own = ports.last_words().map_err(SessionError::Watchdog)?;
        let words = move |_| words();
        watch_over(&self.rig, ports.beats(), (own, words), alarm).map(Some)
    }

    /// What stops every drive without waiting for anything: where the rig's file has it, and then where a scenario may have moved it.
    pub fn last_words(&self) -> impl Fn() -> Vec<Pieces> + Send + use<D> {
        let (own, left) = (self.drives.last_words(), self.left.clone());
        move || {
            [Some(own.clone()), left.stops()]
                .into_iter()
                .flatten()
                .collect()
        }
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    #[must_use]
    pub fn close(mut self, error: bool) -> End {
        self.end(error)
    }

    /// Gives the rig back with its drives as they are: after what has only looked, or was asked to let motors turn. Where trouble has ended
    /// that, they are taken to their safe state all the same.
    #[must_use]
    pub fn release(mut self) -> End {
        let trouble = self.link.trouble();
        self.ended |= trouble.is_none();
        let error = trouble.is_some_and(Trouble::is_of_the_bench);
        self.end(error)
    }

    fn end(&mut self, error: bool) -> End {
        let mut end = End {
            safe: None,
            power: Vec::new(),
            remarks: Vec::new(),
        };
        let wanted = self.rig.file.safe_state.clone();
        if !std::mem::replace(&mut self.ended, true) {
            self.resume();
            let standing = standing(&wanted);
            if !standing.order.is_empty() {
                end.safe = Some(self.drives.safe_state(&mut self.link, &standing));
            }
            self.watchdog = None;
            if wanted.order.contains(&file::SafeStep::PowerOff) {
                end.power = self.taken.around.power_off();
            }
        }
        end.remarks = self.taken.around.end(error);
        end
    }
}

impl<D: PortDrives> PortSession<D> {
    /// Takes the drives of a session that was not closed to their safe state. Returns what is to be said.
    fn abandon(&mut self) -> Vec<String> {
        let end = self.end(true);
        let safe = end.safe.iter().map(ToString::to_string);
        safe.chain(self.left.all()).collect()
    }

    /// The same of a session over simulated drives, as if they were behind a port.
    #[cfg(any(test, feature = "trials"))]
    pub fn abandon_as_at_port(&mut self) -> Vec<String> {
        self.ended = false;
        self.abandon()
    }
}

impl<D: PortDrives> Drop for PortSession<D> {
    /// A panic unwinds through here.
    fn drop(&mut self) {
        if !self.ended {
            let words = self.abandon().join("\n");
            if std::thread::panicking() {
                let _nobody_reads = writeln!(std::io::stderr(), "{words}");
            }
        }
    }
}

/// The header lines that a rig's file has for its drives: those of its profile, and behind them those of `[sim]`.
pub(crate) fn setup_lines(rig: &Rig) -> Vec<String> {
    let profile = rig.profile.iter().flat_map(|own| &own.lines);
    let own = rig.file.sim.iter().flat_map(|sim| &sim.setup);
    profile.chain(own).cloned().collect()
}

/// The same as a text.
pub fn setup_text(rig: &Rig) -> Source {
    Source {
        name: rig.origin.clone(),
        text: setup_lines(rig).join("\n").into(),
    }
}

/// How long a reply may take, by a rig's file.
pub fn patience(port: &Port) -> Span {
    let nanos = u64::try_from(port.patience.0.as_nanos()).unwrap_or(u64::MAX);
    Span::from_nanos(nanos)
}

/// Locks the port of an open adapter.
///
/// # Errors
/// It is in use.
pub fn lock(rig: &Rig, place: &str, port: impl AsFd) -> Result<PortLock, SessionError> {
    locked(rig, place, PortLock::acquire(port))
}

/// The lock of a place, or an error about it.
pub fn locked(
    rig: &Rig,
    place: &str,
    lock: Result<PortLock, PortLockError>,
) -> Result<PortLock, SessionError> {
    lock.map_err(|error| match error {
        PortLockError::Busy { .. } | PortLockError::Other(_) => {
            in_use(rig, &format!("{place}: {error}"))
        }
        PortLockError::Io(_) => failed(rig, &format!("{place}: {error}")),
    })
}

/// An error about a port that another program has.
pub fn in_use(rig: &Rig, why: &str) -> SessionError {
    SessionError::PortInUse {
        rig: rig.id().to_owned(),
        why: why.to_owned(),
    }
}

/// An error about a port that is not opened.
pub fn unopened(rig: &Rig, error: &OpenError) -> SessionError {
    match error {
        OpenError::InUse { .. } => in_use(rig, &error.to_string()),
        _ => failed(rig, &error.to_string()),
    }
}

/// An error about the drives of a rig.
pub fn failed(rig: &Rig, why: &str) -> SessionError {
    SessionError::Drives {
        rig: rig.id().to_owned(),
        why: why.to_owned(),
    }
}
