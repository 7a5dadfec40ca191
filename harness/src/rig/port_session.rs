//! A rig with a port in use, whatever its bus: locked, opened, guarded, and taken to its safe state on every way out.

use super::lock::PortLock;
use super::taken::Taken;
use super::watchdog::{Watchdog, watch_over};
use super::{Alarm, End, Ends, Options, Rig, SessionError, file, standing};
use crate::guard::{Guarded, Safe, SafeStep, Standstill};
use crate::link::{Line, Trouble};
use crate::medium::Pieces;
use std::time::Instant;

/// What a session asks of the bus of its drives.
pub(crate) trait PortDrives {
    /// Takes every drive to its safe state and reads it back.
    fn safe_state(&self, line: &mut Guarded<Ends>, standing: &Standstill) -> Safe;

    /// What stops every drive without waiting for anything: for a watchdog.
    fn last_words(&self) -> Pieces;
}

/// A rig in use.
#[derive(Debug)]
pub(crate) struct PortSession<D: PortDrives> {
    rig: Rig,
    link: Guarded<Ends>,
    drives: D,
    started: Instant,
    listen_only: bool,
    /// The drives are as they are to be left.
    ended: bool,
    // Given back in this order.
    watchdog: Option<Watchdog>,
    _locks: Vec<PortLock>,
    taken: Taken,
}

impl<D: PortDrives> PortSession<D> {
    /// Uses a rig that is taken, over its guarded link. `ready` finds out whether its drives can be used.
    ///
    /// # Errors
    /// [`SessionError`], those of `ready` among them; nothing is left locked or open.
    pub(crate) fn open(
        rig: &Rig,
        options: &Options,
        taken: Taken,
        (link, locks): (Guarded<Ends>, Vec<PortLock>),
        drives: D,
        ready: impl FnOnce(&mut Self) -> Result<(), SessionError>,
    ) -> Result<Self, SessionError> {
        let listen_only = rig.port().is_some_and(|port| port.listen_only);
        let mut session = Self {
            rig: rig.clone(),
            link,
            drives,
            started: Instant::now(),
            listen_only,
            // Nothing has been sent: there is nothing to make safe.
            ended: true,
            watchdog: None,
            _locks: locks,
            taken,
        };
        if rig.is_simulated() {
            session.link.set_interrupt(options.interrupt.clone());
        }
        match ready(&mut session) {
            Err(_) if session.link.trouble() == Some(&Trouble::Interrupted) => {
                let end = Some(Box::new(session.end(false)));
                let rig = rig.id().to_owned();
                return Err(SessionError::Interrupted { rig, end });
            }
            other => other?,
        }
        session.taken.around.used();
        session.ended = listen_only || rig.is_simulated();
        session.watchdog = session.watched(options.alarm.clone())?;
        Ok(session)
    }

    /// The rig.
    pub(crate) const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// What is known of its drives.
    pub(crate) const fn drives(&self) -> &D {
        &self.drives
    }

    /// The same, to be changed.
    pub(crate) const fn drives_mut(&mut self) -> &mut D {
        &mut self.drives
    }

    /// Its guarded link.
    pub(crate) const fn link(&mut self) -> &mut Guarded<Ends> {
        &mut self.link
    }

    /// Its guarded link, to look at.
    pub(crate) const fn guarded(&self) -> &Guarded<Ends> {
        &self.link
    }

    /// Whether it has been used for longer than its file allows.
    pub(crate) fn overdue(&self) -> bool {
        let longest = self.rig.file.limits.max_run.as_ref();
        longest.is_some_and(|longest| self.started.elapsed() > longest.0)
    }

    /// An error where the link is in trouble.
    pub(crate) fn sound(&self) -> Result<(), SessionError> {
        self.link
            .trouble()
            .map_or(Ok(()), |trouble| Err(self.failed(&trouble.to_string())))
    }

    /// An error about its drives.
    pub(crate) fn failed(&self, why: &str) -> SessionError {
        SessionError::Drives {
            rig: self.rig.id().to_owned(),
            why: why.to_owned(),
        }
    }

    /// Takes every drive to its safe state, whatever the file wants at the end, and reads it back.
    pub(crate) fn make_safe(&mut self) -> Safe {
        self.link.reset_after_denial();
        let wanted = Standstill {
            order: vec![SafeStep::Stop, SafeStep::Block],
            ..standing(&self.rig.file.safe_state)
        };
        self.drives.safe_state(&mut self.link, &wanted)
    }

    /// Lets a thread watch that the program lives.
    fn watched(&mut self, alarm: Alarm) -> Result<Option<Watchdog>, SessionError> {
        if self.listen_only {
            return Ok(None);
        }
        let pieces = self.drives.last_words();
        let Some(ports) = self.link.inner_mut().ports_mut() else {
            return Ok(None);
        };
        let words = |_| pieces.clone();
        let words = ports.last_words(&words).map_err(SessionError::Watchdog)?;
        watch_over(&self.rig, ports.beats(), words, alarm).map(Some)
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    #[must_use]
    pub(crate) fn close(mut self, error: bool) -> End {
        self.end(error)
    }

    /// Gives the rig back with its drives as they are: after what has only looked, or was asked to let motors turn.
    #[must_use]
    pub(crate) fn release(mut self) -> End {
        self.ended = true;
        self.end(false)
    }

    fn end(&mut self, error: bool) -> End {
        let mut end = End {
            safe: None,
            power: Vec::new(),
            remarks: Vec::new(),
        };
        let wanted = self.rig.file.safe_state.clone();
        if !std::mem::replace(&mut self.ended, true) {
            self.link.set_watch(None);
            if let Some(ports) = self.link.inner_mut().ports_mut() {
                ports.resume();
            }
            self.link.reset_after_denial();
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

impl<D: PortDrives> Drop for PortSession<D> {
    /// A panic unwinds through here.
    fn drop(&mut self) {
        if !self.ended {
            let _told_by_nobody = self.end(true);
        }
    }
}
