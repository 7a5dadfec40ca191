//! A rig in use, whatever its bus: locked, opened, guarded, and taken to its safe state on every way out.

use super::left::NotPutBack;
use super::lock::{PortLock, PortLockError};
use super::playing::observed::Beats;
use super::port_file::Port;
use super::taken::{TakenRig, take};
use super::watchdog::{Watchdog, watch_over};
use super::{Alarm, End, Ends, Rig, SessionError, UseOptions, file, standing};
use crate::guard::{Guarded, Safe, Standstill, StandstillStep, Watch};
use crate::link::{Line, PortLink, Trouble};
use crate::medium::{HeardPiece, Pieces};
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
pub trait RigDrives: std::fmt::Debug + Sized + 'static {
    /// Opens the drives of a rig that is taken, behind a gate: simulated ones, or ports with their locks. Nothing is sent.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    fn open(rig: &Rig, options: &UseOptions) -> Result<OpenDrives<Self>, SessionError>;

    /// Listens to the drives of an open rig, and finds out whether they can be used.
    ///
    /// # Errors
    /// Why they cannot be used. After [`SessionError::Interrupted`] they are taken to their safe state.
    fn ready(session: &mut RigSession<Self>, options: &UseOptions) -> Result<(), SessionError>;

    /// What watches the interlocks of the rig's file; `None` where it has none.
    fn watch(&self, rig: &Rig) -> Option<Box<dyn Watch>>;

    /// Takes every drive to its safe state and reads it back.
    fn safe_state(&self, link: &mut Guarded<Ends>, standing: &Standstill) -> Safe;

    /// What stops every drive without waiting for anything, port by port: for a watchdog.
    fn last_words(&self) -> Vec<Pieces>;

    /// The last that is done before the rig is given back. `safe` tells whether the drives were seen in their safe state; it is `None` where
    /// they stay as they are. Returns what is left to say.
    fn leave(_session: &mut RigSession<Self>, _safe: Option<bool>) -> Vec<String> {
        Vec::new()
    }
}

/// Drives of a rig that is taken, their guarded link, and the locks of its ports.
pub type OpenDrives<D> = (D, Guarded<Ends>, Vec<PortLock>);

/// A rig in use.
#[derive(Debug)]
pub struct RigSession<D: RigDrives> {
    rig: Rig,
    link: Guarded<Ends>,
    drives: D,
    /// When the longest run is over.
    deadline: Option<Instant>,
    /// The drives are as they are to be left.
    ended: bool,
    left: NotPutBack,
    // Given back in this order.
    watchdog: Option<Watchdog>,
    _locks: Vec<PortLock>,
    taken: TakenRig,
}

impl<D: RigDrives> RigSession<D> {
    /// Takes a rig: lock, hook, ports. Then finds out whether its drives can be used.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        let taken = take(rig, options)?;
        let left = NotPutBack::of(rig);
        Self::over(rig, options, (taken, left), D::open(rig, options)?)
    }

    /// Over drives that are open, of a rig without a lock.
    ///
    /// # Errors
    /// See [`Self::open`].
    #[cfg(any(test, feature = "trials"))]
    pub fn over_open(
        rig: &Rig,
        options: &UseOptions,
        open: OpenDrives<D>,
    ) -> Result<Self, SessionError> {
        let taken = TakenRig::begin(rig, None)?;
        Self::over(rig, options, (taken, NotPutBack::default()), open)
    }

    fn over(
        rig: &Rig,
        options: &UseOptions,
        (taken, left): (TakenRig, NotPutBack),
        (drives, link, locks): OpenDrives<D>,
    ) -> Result<Self, SessionError> {
        let mut session = Self {
            rig: rig.clone(),
            link,
            drives,
            deadline: rig.deadline(Instant::now()),
            // Nothing has been moved: there is nothing to make safe while the drives have not been found ready.
            ended: true,
            watchdog: None,
            left,
            _locks: locks,
            taken,
        };
        if rig.is_simulated() {
            session.link.set_interrupt(options.interrupt.clone());
        }
        if let Err(error) = D::ready(&mut session, options) {
            return Err(session.unready(error));
        }
        session.taken.around.used();
        session.ended = session.listens_only() || rig.is_simulated();
        let watch = session.drives.watch(rig);
        session.link.set_watch(watch);
        session.link.set_deadline(session.deadline);
        session.watchdog = session.watched(options.alarm.clone())?;
        Ok(session)
    }

    /// Gives a rig back whose drives cannot be used. An interrupted program takes them to their safe state.
    fn unready(mut self, error: SessionError) -> SessionError {
        let interrupted = self.link.trouble() == Some(&Trouble::Interrupted);
        match error {
            _ if interrupted || matches!(error, SessionError::Interrupted { .. }) => {
                self.ended = self.listens_only();
                SessionError::Interrupted {
                    rig: self.rig.id().to_owned(),
                    end: Some(Box::new(self.end(false))),
                }
            }
            SessionError::Drives { rig, why } => {
                let why: Vec<_> = [Some(why), self.left.before()]
                    .into_iter()
                    .flatten()
                    .collect();
                let why = why.join("; ");
                SessionError::Drives { rig, why }
            }
            other => other,
        }
    }

    /// Listens to a shared line before anything is sent: a bench must not disturb another master. Simulated drives are alone.
    ///
    /// # Errors
    /// The link is in trouble.
    pub fn listen(&mut self, mut hear: impl FnMut(HeardPiece)) -> Result<(), SessionError> {
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

    /// Whether this program holds the lock of the rig: not of a simulated one.
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.taken.lock.is_some()
    }

    /// Whether nothing is ever sent.
    #[must_use]
    pub fn listens_only(&self) -> bool {
        self.rig.port().is_some_and(|port| port.listen_only)
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

    /// The link over its ports, with what was measured there; `None` if the rig is simulated.
    pub fn ports(&mut self) -> Option<&mut dyn PortLink> {
        self.link.inner_mut().ports_mut()
    }

    /// Waits as long as an adapter may take to report a loss, at ports.
    pub(crate) fn hear_of_losses(&mut self) {
        if self.ports().is_none() {
            return;
        }
        let end = self.link.now() + LOSSES;
        while self.link.now() < end && self.link.wait(end) {
            while self.link.receive(0).is_some() {}
        }
    }

    /// Line errors and losses that the transport has reported without their place since the last call.
    pub fn take_unplaced(&mut self) -> u64 {
        self.ports().map_or(0, |ports| ports.take_unplaced())
    }

    /// The same, and what may have been lost.
    pub fn take_doubtful(&mut self) -> u64 {
        let ports = self.ports();
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

    /// Makes the link of use again after a signal: for the safe state, and what is set back after it.
    pub fn resume(&mut self) {
        self.link.clear_the_way();
        self.go_on();
    }

    /// Makes the link of use again after a denial or a request that was cancelled.
    pub fn go_on(&mut self) {
        if let Some(ports) = self.ports() {
            ports.resume();
        }
        self.link.reset_after_denial();
    }

    /// What a scenario has changed and is not put back yet.
    pub const fn left(&self) -> &NotPutBack {
        &self.left
    }

    /// The counter by which the watchdog sees that the program works.
    pub fn beats(&mut self) -> Beats {
        let ports = self.ports();
        ports.map_or_else(Beats::default, |ports| Beats::of(ports.beats()))
    }

    /// Lets a thread watch that the program lives.
    fn watched(&mut self, alarm: Alarm) -> Result<Option<Watchdog>, SessionError> {
        if self.listens_only() {
            return Ok(None);
        }
        let (words, alarm) = (self.last_words(), alarm.telling(self.left.clone()));
        let Some(ports) = self.ports() else {
            return Ok(None);
        };
        let (said, beats) = (ports.last_words(), ports.beats());
        let said = said.map_err(SessionError::Watchdog)?;
        watch_over(&self.rig, beats, (said, words), alarm).map(Some)
    }

    /// What stops every drive of a port without waiting for anything: where the rig's file has it, and then where a scenario may have moved it.
    pub fn last_words(&self) -> impl Fn(usize) -> Vec<Pieces> + Send + use<D> {
        let (words, left) = (self.drives.last_words(), self.left.clone());
        move |port| {
            let words = words.get(port).cloned();
            words.into_iter().chain(left.stops()).collect()
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

    /// As [`Self::close`], of a session that its owner cannot give away: it carries nothing more.
    pub fn end(&mut self, error: bool) -> End {
        let mut end = End::default();
        if std::mem::replace(&mut self.ended, true) {
            end.remarks = D::leave(self, None);
            self.watchdog = None;
        } else {
            self.resume();
            let wanted = self.rig.file.safe_state.clone();
            let standing = standing(&wanted);
            if !standing.order.is_empty() {
                end.safe = Some(self.drives.safe_state(&mut self.link, &standing));
            }
            let safe = end.safe.as_ref().is_some_and(|safe| safe.confirmed);
            end.remarks = D::leave(self, Some(safe));
            self.watchdog = None;
            if wanted.order.contains(&file::SafeStep::PowerOff) {
                end.power = self.taken.around.power_off();
            }
        }
        end.remarks.extend(self.taken.around.end(error));
        end
    }

    /// Takes the drives of a session that was not closed to their safe state. Returns what is to be said.
    fn abandon(&mut self) -> Vec<String> {
        let end = self.end(true);
        let safe = end.safe.iter().map(ToString::to_string);
        let mut words: Vec<_> = safe.chain(end.power).chain(end.remarks).collect();
        for note in self.left.all() {
            if !words.contains(&note) {
                words.push(note);
            }
        }
        words
    }

    /// The same of a session over simulated drives, as if they were behind a port.
    #[cfg(any(test, feature = "trials"))]
    pub fn abandon_as_at_port(&mut self) -> Vec<String> {
        self.ended = false;
        self.abandon()
    }
}

impl<D: RigDrives> Drop for RigSession<D> {
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

/// The header lines that a rig's file has for its drives: those of its profile, then those of `[sim]`.
pub(crate) fn setup_lines(rig: &Rig) -> Vec<String> {
    let profile = rig.profile.iter().flat_map(|profile| &profile.lines);
    let simulated = rig.file.sim.iter().flat_map(|sim| &sim.setup);
    profile.chain(simulated).cloned().collect()
}

/// The same as a text.
pub fn setup_text(rig: &Rig) -> Source {
    Source {
        name: rig.origin.clone(),
        text: setup_lines(rig).join("\n").into(),
    }
}

/// The port of a rig on a shared line.
///
/// # Errors
/// It has none.
pub fn port_of(rig: &Rig) -> Result<&Port, SessionError> {
    rig.port().ok_or_else(|| failed(rig, "it has no [port.1]"))
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
