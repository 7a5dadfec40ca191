//! A rig in use as a line that a driver can own, with the rig itself kept for its end.

use crate::rig::session::{self, Session};
use harness_bench::link::{Lead, Line, Trouble};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::rig::End;
use harness_proto::line::Rate;
use harness_proto::time::Instant;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A rig in use. Its [line](Self::line) goes to a driver, and behind the driver the rig is given back. Clones are handles of the
/// same rig.
#[derive(Clone, Debug)]
pub(crate) struct Shared {
    session: Arc<Mutex<Option<Session>>>,
}

/// The guarded line of a [`Shared`] rig. Behind the rig's end it carries nothing.
#[derive(Debug)]
pub(crate) struct SharedLine {
    session: Arc<Mutex<Option<Session>>>,
    /// That of its first port, for when the rig has been given back.
    medium: Medium,
    trouble: Option<Trouble>,
}

fn lock(session: &Mutex<Option<Session>>) -> MutexGuard<'_, Option<Session>> {
    // A panic leaves the rig as it is: it has still to be given back.
    session.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Shares a rig.
    #[must_use]
    pub(crate) fn new(session: Session) -> Self {
        Self {
            session: Arc::new(Mutex::new(Some(session))),
        }
    }

    #[must_use]
    pub(crate) fn line(&self) -> SharedLine {
        let medium = lock(&self.session)
            .as_mut()
            .map_or(Rate::default().into(), |session| session.link().medium(0));
        SharedLine {
            session: Arc::clone(&self.session),
            medium,
            trouble: None,
        }
    }

    /// Does something with the rig; `None` where it has been given back.
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut Session) -> T) -> Option<T> {
        lock(&self.session).as_mut().map(act)
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    pub(crate) fn close(&self, error: bool) -> Option<End> {
        let mut session = lock(&self.session).take()?;
        Some(session::close(&mut session, error))
    }

    /// Gives the rig back with its drives as they are.
    pub(crate) fn release(&self) -> Option<End> {
        Some(lock(&self.session).take()?.release())
    }
}

impl SharedLine {
    /// Does something with the line, and remembers its trouble.
    fn with<T>(&mut self, otherwise: T, act: impl FnOnce(&mut dyn Line) -> T) -> T {
        let mut session = lock(&self.session);
        let Some(session) = session.as_mut() else {
            let gone = || Trouble::Lost("the rig has been given back".to_owned());
            self.trouble.get_or_insert_with(gone);
            return otherwise;
        };
        let done = act(session.link());
        self.trouble = session.link().trouble().cloned();
        done
    }
}

impl Line for SharedLine {
    fn medium(&self, port: usize) -> Medium {
        lock(&self.session)
            .as_mut()
            .map_or(self.medium, |session| session.link().medium(port))
    }

    fn now(&self) -> Instant {
        lock(&self.session)
            .as_mut()
            .map_or(Instant::START, |session| session.link().now())
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.with(Instant::START, |line| line.send(ring, what))
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        self.with(None, |line| line.receive(ring))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.with(false, |line| line.wait(until))
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        let mut session = lock(&self.session);
        let session = session.as_mut();
        session.and_then(|session| session.link().denied(port, what))
    }

    fn permits(&self, ring: usize, what: Out<'_>) -> bool {
        lock(&self.session)
            .as_mut()
            .is_some_and(|session| session.link().permits(ring, what))
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        self.with((), |line| line.attend(ring, at));
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.trouble.as_ref()
    }

    fn pause_due(&self) -> Option<Instant> {
        lock(&self.session)
            .as_mut()
            .and_then(|session| session.link().pause_due())
    }

    fn pause(&mut self) {
        self.with((), |line| line.pause());
    }

    fn lead(&self) -> Lead {
        lock(&self.session)
            .as_mut()
            .map_or(Lead::NONE, |session| session.link().lead())
    }
}
