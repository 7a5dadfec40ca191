//! A rig in use: locked, opened, found healthy, guarded, and taken to its safe state on every way out.

use super::cause::{self, LikelyCause};
use super::health::{self, RingHealth, Unhealthy, examine};
use super::interlock::Interlocks;
use super::limits;
use super::line_test::{self, RingPace};
use super::open::{Opened, open, stated_rate};
use super::put_back::Before;
use crate::driver::{Axis, count_behind};
use crate::gate::guard_rings;
use crate::guard::blind_stop;
use crate::guard::learn::learn;
use harness_bench::guard::{Guarded, Watch};
use harness_bench::link::{Line, Link, Octets, PortLink, Trouble};
use harness_bench::medium::{ErrorMarks, Pieces};
use harness_bench::rig::around::Around;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::lock::{PortLock, RigLock};
use harness_bench::rig::taken::{Taken, take};
use harness_bench::rig::watchdog::{Watchdog, watch_over};
use harness_bench::rig::{Alarm, Ends, Rig, SessionError, UseOptions, state};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::Limits;
use harness_proto::time::Span;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

pub(super) mod end;

/// How often a port that the bench itself has just closed is tried again, and the pause in front of it.
const PORT_TRIES: usize = 5;
const PORT_PAUSE: Duration = Duration::from_millis(200);

/// How long a rig must be silent before anything is sent.
const LISTEN: Span = Span::from_millis(40);

/// How long what was sent may be on its way round a ring of 250 drives, adapters counted (ND21 8.2).
const LONGEST_ROUND: Span = Span::from_millis(1_000);

/// A rig in use.
#[derive(Debug)]
pub(crate) struct Session {
    rig: Rig,
    link: Guarded<Ends>,
    rings: Vec<RingSize>,
    /// When the longest run is over.
    deadline: Option<Instant>,
    allow_motion: bool,
    ill_as_well: bool,
    ended: bool,
    /// What the check at its opening found.
    opening: Option<RingHealth>,
    /// A ring behind in-band marks answered as one that knows none.
    damages_ff: bool,
    /// What scenarios may change of the drives, and the commands that put it back.
    pub(super) before: Before,
    pub(super) left: NotPutBack,
    // Given back in this order.
    around: Around,
    /// While drives may move.
    watchdog: Option<Watchdog>,
    _ports: Vec<PortLock>,
    /// `None` for a simulated rig.
    lock: Option<RigLock>,
}

impl Session {
    /// Takes a rig: lock, hook, ports, and its first health check.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub(crate) fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        match Self::open_as_stated(rig, options) {
            Ok(session) => {
                if !session.damages_ff {
                    return Ok(session);
                }
                let bytes = "a net byte FF comes back damaged".to_owned();
                let error = session.ill(0, Unhealthy::Foreign { bytes });
                let _end = session.release();
                Self::with_damaged_ff(rig, options, error)
            }
            Err(error @ SessionError::Ill { .. }) => {
                for (cause, other) in cause::neighbours(rig) {
                    if Self::opens(&other, options)? == Some(true) {
                        return Err(error.because(cause));
                    }
                }
                Err(error)
            }
            Err(other) => Err(other),
        }
    }

    /// Takes a rig behind which a net byte FF came back damaged: its file is wrong about in-band marks, or a drive is wrong. A drive is only
    /// where the other setting was tried and does not open the ring. The server of the port may need a moment to notice that it is free.
    fn with_damaged_ff(
        rig: &Rig,
        options: &UseOptions,
        error: SessionError,
    ) -> Result<Self, SessionError> {
        let Some((cause, other)) = cause::neighbours(rig).into_iter().next() else {
            let right = ErrorMarks::None;
            return Err(error.because(LikelyCause::Marks { right }));
        };
        for _ in 0..PORT_TRIES {
            match Self::opens(&other, options)? {
                Some(false) => {
                    let mut session = Self::open_as_stated(rig, options)?;
                    session.learn();
                    return Ok(session);
                }
                Some(true) => break,
                None => std::thread::sleep(PORT_PAUSE),
            }
        }
        Err(error.because(cause))
    }

    /// Whether a ring opens as this file says; `None` where the port itself is in the way. Nothing more is tried after an interruption, which
    /// is the error.
    fn opens(other: &Rig, options: &UseOptions) -> Result<Option<bool>, SessionError> {
        let plain = UseOptions {
            ill_as_well: false,
            allow_motion: false,
            ..options.clone()
        };
        if options.interrupt.load(Ordering::Relaxed) {
            return Ok(Some(false));
        }
        Ok(
            match Self::open_as_stated(other, &plain).map(Self::release) {
                Ok(_) => Some(true),
                Err(interrupted @ SessionError::Interrupted { .. }) => return Err(interrupted),
                Err(SessionError::Ill { ill, .. }) => match ill.downcast_ref() {
                    // Its drives have answered.
                    Some(Unhealthy::Slow { .. } | Unhealthy::Late { .. }) => Some(true),
                    Some(Unhealthy::Trouble(_)) => None,
                    _ => Some(false),
                },
                Err(_) => None,
            },
        )
    }

    /// Takes a rig as its file describes it.
    fn open_as_stated(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        rig.of_rings()?;
        let taken = take(rig, options)?;
        let opened = open(rig, options.interrupt.clone()).map_err(|error| error.of_rig(rig))?;
        Self::over(rig, options, taken, opened)
    }

    /// Takes a rig that is taken and whose ends are open: listens, examines its rings, and looks at its interlocks.
    fn over(
        rig: &Rig,
        options: &UseOptions,
        taken: Taken,
        opened: Opened,
    ) -> Result<Self, SessionError> {
        let rings: Vec<_> = rig
            .rings()
            .filter_map(|(_, ring)| RingSize::new(ring.drives.into()).ok())
            .collect();
        let mut session = Self {
            rig: rig.clone(),
            link: guard_rings(opened.ends, limits(rig, options.allow_motion)),
            rings,
            deadline: rig.deadline(Instant::now()),
            allow_motion: options.allow_motion,
            ill_as_well: options.ill_as_well,
            // Nothing has been moved: there is nothing to make safe while the rig has not been found healthy.
            ended: true,
            opening: None,
            damages_ff: false,
            before: Before::default(),
            left: NotPutBack::of(rig),
            around: taken.around,
            watchdog: None,
            _ports: opened.locks,
            lock: taken.lock,
        };
        if rig.is_simulated() {
            session.link.set_interrupt(options.interrupt.clone());
        }
        if session.listen()? {
            session.link.expect_time_outs();
            if options.keeps_lines {
                session.link.keep_lines();
            }
        }
        let ready = options.unless_interrupted(rig);
        match ready.and_then(|()| session.make_ready()) {
            Err(_) if options.interrupt.load(Ordering::Relaxed) => {
                session.ended = false;
                return Err(SessionError::Interrupted {
                    rig: rig.id().to_owned(),
                    end: Some(Box::new(session.end(false))),
                });
            }
            other => other?,
        }
        if rig.is_simulated() && !rig.file.health.before {
            session.learn();
        }
        session.ended = rig.is_simulated();
        let watch = Interlocks::of(rig).map(|watch| Box::new(watch) as Box<dyn Watch>);
        session.link.set_watch(watch);
        session.link.set_deadline(session.deadline);
        session.look_at_interlocks();
        session.around.used();
        session.watchdog = session.watched(options.alarm.clone())?;
        Ok(session)
    }

    /// A rig without a lock behind an open port.
    #[cfg(test)]
    pub(crate) fn at_port(
        rig: &Rig,
        options: &UseOptions,
        port: Box<dyn PortLink>,
    ) -> Result<Self, SessionError> {
        let taken = Taken {
            around: Around::begin(rig).expect("no hooks"),
            lock: None,
        };
        let opened = Opened {
            ends: Ends::Ports(port),
            locks: Vec::new(),
        };
        let mut session = Self::over(rig, options, taken, opened)?;
        // Tests share the folder of the file.
        session.left = NotPutBack::default();
        Ok(session)
    }

    #[must_use]
    pub(crate) fn rig(&self) -> &Rig {
        &self.rig
    }

    #[must_use]
    pub(crate) fn rings(&self) -> &[RingSize] {
        &self.rings
    }

    /// Its drives, ring after ring.
    #[must_use]
    pub(crate) fn axes(&self) -> Vec<Axis> {
        let rings = self.rings.iter().enumerate();
        let drives = rings.flat_map(|(ring, size)| (0..size.drives()).map(move |k| (ring, k)));
        drives.filter_map(|(ring, k)| Axis::new(ring, k)).collect()
    }

    /// What its file and the command line allow together.
    #[must_use]
    pub(crate) fn limits(&self) -> Limits {
        limits(&self.rig, self.allow_motion)
    }

    /// Whether the session goes on although a ring fails its health check.
    #[must_use]
    pub(crate) fn ill_as_well(&self) -> bool {
        self.ill_as_well
    }

    /// The result of the health check at opening; `None` if there was none, or if a ring failed it.
    #[must_use]
    pub(crate) fn opening(&self) -> Option<&RingHealth> {
        self.opening.as_ref()
    }

    /// Its guarded link, to look at.
    #[must_use]
    pub(crate) fn guarded(&self) -> &Guarded<Ends> {
        &self.link
    }

    pub(crate) fn link(&mut self) -> &mut Guarded<Ends> {
        &mut self.link
    }

    /// Its ports' link, if it has ports: for what was measured there.
    pub(crate) fn ports(&mut self) -> Option<&mut dyn PortLink> {
        self.link.inner_mut().ports_mut()
    }

    /// Whether it has been used for longer than its file allows.
    #[must_use]
    pub(crate) fn overdue(&self) -> bool {
        let now = Instant::now();
        self.deadline.is_some_and(|deadline| deadline <= now)
    }

    /// Ends the work if it has been used for longer than its file allows.
    pub(crate) fn end_if_overdue(&mut self) {
        self.link.set_deadline(self.deadline);
        self.link.end_if_overdue();
    }

    /// Listens before anything is sent: a bench must not disturb another program's conversation. Returns whether drives have missed their
    /// master (ND21 9.9).
    fn listen(&mut self) -> Result<bool, SessionError> {
        if self.rig.is_simulated() {
            return Ok(false);
        }
        let mut heard = vec![Vec::new(); self.rings.len()];
        let end = self.link.now() + LONGEST_ROUND;
        let mut silent = self.link.now() + LISTEN;
        while self.link.now() < silent {
            if !self.link.wait(silent) {
                // An interrupted program listens to the end too: the safe state needs the line.
                if self.link.trouble() != Some(&Trouble::Interrupted) {
                    break;
                }
                if let Some(ports) = self.link.inner_mut().ports_mut() {
                    ports.resume();
                }
            }
            for (ring, heard) in heard.iter_mut().enumerate() {
                let before = heard.len();
                heard.extend(self.take(ring));
                // These bytes may be the rest of a conversation whose bench was killed.
                if heard.len() > before {
                    silent = self.link.now() + LISTEN;
                }
            }
            if self.link.now() > end {
                break;
            }
        }
        if self.link.now() <= end {
            return Ok(false);
        }
        let timed_out = |(ring, heard): (usize, &Vec<Received>)| {
            health::sounds_timed_out(heard, self.rings.get(ring).copied())
        };
        // The zeros of the check sequence, which comes next, end a time-out (ND21 9.9).
        let talks = |place: &(usize, &Vec<Received>)| !place.1.is_empty() && !timed_out(*place);
        match heard.iter().enumerate().find(talks).map(|(ring, _)| ring) {
            Some(ring) => Err(SessionError::Ill {
                rig: self.rig.id().to_owned(),
                ring: ring + 1,
                ill: Box::new(Unhealthy::talking(&heard[ring])),
                cause: Some(Box::new(cause::unasked(&heard[ring]))),
            }),
            None => Ok(true),
        }
    }

    /// Examines its rings, unless it was left at rest.
    fn make_ready(&mut self) -> Result<(), SessionError> {
        if self.opens_quietly() || self.rig.is_simulated() && !self.rig.file.health.before {
            return Ok(());
        }
        match self.examined() {
            Err(SessionError::Ill { ill, .. })
                if self.ill_as_well
                    && !matches!(ill.downcast_ref(), Some(Unhealthy::Trouble(_))) => {}
            Err(error) => return Err(self.with_cause(error)),
            Ok(health) => self.opening = Some(health),
        }
        self.runs_at_its_rate()?;
        if self.opening.is_none() {
            return Ok(());
        }
        // Before anything else with a byte FF is sent.
        self.damages_ff = self.lacks_marks();
        if self.damages_ff {
            // It has put drives into the error mode.
            let healthy = self.examined().map(drop);
            return healthy.map_err(|error| self.with_cause(error));
        }
        self.learn();
        Ok(())
    }

    /// Adds the likely cause to the error of a ring that did not open.
    fn with_cause(&mut self, error: SessionError) -> SessionError {
        match error {
            SessionError::Ill { rig, ring, ill, .. } => {
                let file = self.rig.file.rings().nth(ring - 1).cloned();
                let cause = match self.link.trouble() {
                    Some(Trouble::Lost(_)) => {
                        file.map(|file| LikelyCause::Gone(file.endpoint.transport))
                    }
                    Some(_) => None,
                    None => {
                        self.settle();
                        let heard = line_test::listen(&mut self.link, ring - 1);
                        let drives = file.as_ref().map_or(0, |file| file.drives);
                        let of_marks = file.and_then(|file| cause::of_marks(&file, &heard));
                        let ill = ill.downcast_ref().unwrap_or(&Unhealthy::Silent);
                        let other = || cause::cause(ill, &heard, (drives, self.rate()));
                        Some(of_marks.unwrap_or_else(other))
                    }
                };
                let error = SessionError::Ill {
                    rig,
                    ring,
                    ill,
                    cause: None,
                };
                match cause {
                    Some(cause) => error.because(cause),
                    None => error,
                }
            }
            other => other,
        }
    }

    /// Refuses a ring whose bytes come back slower than they are sent: what waits for its answers would wait longer each time.
    fn runs_at_its_rate(&mut self) -> Result<(), SessionError> {
        if self.rig.is_simulated() {
            return Ok(());
        }
        let stated = self.rate();
        for ring in 0..self.rings.len() {
            self.link.begin();
            let pace = line_test::pace(&mut self.link, ring, stated);
            self.link.begin();
            let (ill, cause) = match pace {
                RingPace::Slower(found) => {
                    let ill = Unhealthy::Slow {
                        found: found.bits_per_second(),
                        stated: stated.bits_per_second(),
                    };
                    (ill, LikelyCause::AsAtRate { found })
                }
                RingPace::Late(late) => (Unhealthy::Late { late }, LikelyCause::HeldUp),
                RingPace::AsSent => continue,
            };
            return Err(self.ill(ring, ill).because(cause));
        }
        Ok(())
    }

    /// Whether a ring answers as one that knows no in-band marks, although its file says so.
    fn lacks_marks(&mut self) -> bool {
        let marked: Vec<_> = self
            .rig
            .rings()
            .map(|(_, ring)| ring.endpoint.marks == ErrorMarks::InBand)
            .collect();
        let lacks = (0..).zip(marked).any(|(ring, marked)| {
            marked && line_test::lacks_marks(&mut self.link, ring) && self.link.trouble().is_none()
        });
        self.link.begin();
        lacks
    }

    fn rate(&self) -> Rate {
        stated_rate(&self.rig)
    }

    /// Lets a thread watch that the program lives.
    fn watched(&mut self, alarm: Alarm) -> Result<Option<Watchdog>, SessionError> {
        let sizes = self.rings.clone();
        let Some(ports) = self.link.inner_mut().ports_mut() else {
            return Ok(None);
        };
        let stop = move |ring: usize| {
            let size = sizes.get(ring).into_iter();
            size.map(|own| Pieces::Octets(blind_stop(*own))).collect()
        };
        let words = ports.last_words().map_err(SessionError::Watchdog)?;
        let alarm = alarm.telling(self.left.clone());
        watch_over(&self.rig, ports.beats(), (words, stop), alarm).map(Some)
    }

    /// Whether the rig was left at rest and its drives answer: then they are asked nothing more, and go on as they are.
    fn opens_quietly(&mut self) -> bool {
        if self.lock.is_none() {
            return false;
        }
        let left = state::folder().is_ok_and(|folder| state::take_rest(&folder, self.rig.id()));
        if !left || !self.rig.file.health.quiet {
            return false;
        }
        self.link.assume_fresh();
        let counted = |session: &mut Self, ring: usize, size: RingSize| {
            count_behind(&mut session.link, ring, &[]) == Some(size)
        };
        let rings = self.rings.clone();
        let sound = (0..)
            .zip(rings)
            .all(|(ring, size)| counted(self, ring, size));
        self.link.begin();
        if sound {
            self.learn();
        }
        sound
    }

    fn take(&mut self, ring: usize) -> Vec<Received> {
        std::iter::from_fn(|| self.link.receive_octet(ring).map(|(_, byte)| byte)).collect()
    }

    /// Brings every ring back (9.8), counts its drives, and compares with the rig's file; as often as the file says.
    ///
    /// # Errors
    /// [`SessionError::Ill`].
    pub(crate) fn health(&mut self) -> Result<RingHealth, SessionError> {
        let health = self.examined()?;
        self.learn();
        Ok(health)
    }

    /// The same without learning anything of the drives.
    pub(super) fn examined(&mut self) -> Result<RingHealth, SessionError> {
        self.link.reset_after_denial();
        let attempts = self.rig.file.health.attempts;
        examine(&mut self.link, &self.rings, attempts).map_err(|(ring, ill)| self.ill(ring, ill))
    }

    /// Learns how fast the drives would turn, for `max_speed`. What is not learnt is denied when it is needed, with its cell, and a
    /// lost link is its own trouble.
    fn learn(&mut self) {
        self.link.begin();
        let _unlearnt = learn(&mut self.link);
        self.link.begin();
    }

    /// Looks at every interlock; one that does not hold, or whose drive does not answer, is [trouble](harness_bench::link::Trouble::Interlock) of the
    /// link from then on. Nothing is under way.
    pub(crate) fn look_at_interlocks(&mut self) {
        self.ask_interlocks();
        self.link.begin();
    }

    /// The same inside a conversation that goes on, so that its clock counts the time that this takes.
    pub(crate) fn ask_interlocks(&mut self) {
        self.link.look_at_all();
    }

    /// The error for a ring that failed [`examine`].
    #[must_use]
    pub(crate) fn ill(&self, ring: usize, ill: Unhealthy) -> SessionError {
        SessionError::Ill {
            rig: self.rig.id().to_owned(),
            ring: ring + 1,
            ill: Box::new(ill),
            cause: None,
        }
    }

    /// Waits until what was sent has come round. The lines are silent then.
    pub(crate) fn settle(&mut self) {
        come_round(&mut self.link);
        self.link.begin();
    }
}

/// Waits until what was sent has come round.
pub(super) fn come_round(link: &mut Guarded<Ends>) {
    let end = link.now() + LONGEST_ROUND;
    while link.busy() && link.now() < end && link.wait(end) {}
}
