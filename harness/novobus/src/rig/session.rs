//! A ring in use: the settings beside those of its file where it does not open, its health, and how it is left.

use super::cause::{self, LikelyCause};
use super::health::{self, RingHealth, Unhealthy, examine};
use super::interlock::Interlocks;
use super::line_test::{self, RingPace};
use super::open::{open as open_ends, stated_rate};
use super::put_back::{HeldValues, put_back};
use super::{limits, sim};
use crate::driver::{Axis, count_behind};
use crate::gate::guard_rings;
use crate::guard::blind_stop;
use crate::guard::learn::learn as learn_speeds;
use crate::guard::safe_state;
use crate::rig::sim::RigOfRings;
use crate::simulate::warm;
use harness_bench::guard::{Guarded, Safe, Standstill, Watch};
use harness_bench::link::{Line, Link, Octets, Trouble};
use harness_bench::medium::{ErrorMarks, Pieces};
use harness_bench::rig::lock::PortLock;
use harness_bench::rig::session::{OpenDrives, RigDrives, RigSession};
use harness_bench::rig::{End, Ends, Rig, SessionError, UseOptions, standing, state};
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::Limits;
use harness_proto::time::Span;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How often a port that the bench itself has just closed is tried again, and the pause in front of it.
const PORT_TRIES: usize = 5;
const PORT_PAUSE: Duration = Duration::from_millis(200);

/// How long a rig must be silent before anything is sent.
const LISTEN: Span = Span::from_millis(40);

/// How long what was sent may be on its way round a ring of 250 drives, adapters counted (ND21 8.2).
const LONGEST_ROUND: Span = Span::from_millis(1_000);

/// The drives of a rig with rings.
#[derive(Debug)]
pub(crate) struct RingDrives {
    rings: Vec<RingSize>,
    /// What the rig's file and the command line allow together.
    limits: Limits,
    /// Whether the session goes on although a ring fails its health check.
    pub(crate) ill_as_well: bool,
    /// What the check at its opening found; `None` if there was none, or if a ring failed it.
    pub(crate) opening: Option<RingHealth>,
    /// A ring behind in-band marks answered as one that knows none.
    damages_ff: bool,
    /// What scenarios may change, before they do.
    pub(super) before: HeldValues,
}

/// A rig in use.
pub(crate) type Session = RigSession<RingDrives>;

impl RigDrives for RingDrives {
    fn open(rig: &Rig, options: &UseOptions) -> Result<OpenDrives<Self>, SessionError> {
        let opened = open_ends(rig, options.interrupt.clone())?;
        Ok(guarded(rig, options, opened))
    }

    /// Listens, and examines the rings.
    fn ready(session: &mut Session, options: &UseOptions) -> Result<(), SessionError> {
        if listen(session)? {
            session.link().expect_time_outs();
            if options.keeps_lines {
                session.link().keep_lines();
            }
        }
        options.unless_interrupted(session.rig())?;
        make_ready(session).map_err(|error| {
            let interrupted = options.unless_interrupted(session.rig());
            interrupted.err().unwrap_or(error)
        })?;
        if session.rig().is_simulated() && !session.rig().file.health.before {
            learn(session);
        }
        Ok(())
    }

    fn watch(&self, rig: &Rig) -> Option<Box<dyn Watch>> {
        Interlocks::of(rig).map(|watch| Box::new(watch) as Box<dyn Watch>)
    }

    fn safe_state(&self, link: &mut Guarded<Ends>, standing: &Standstill) -> Safe {
        link.begin();
        safe_state(link, &self.rings, standing).into()
    }

    fn last_words(&self) -> Vec<Pieces> {
        let rings = self.rings.iter();
        rings
            .map(|size| Pieces::Octets(blind_stop(*size)))
            .collect()
    }

    /// Puts back what scenarios have changed, and keeps that the rig is left at rest where it is.
    fn leave(session: &mut Session, safe: Option<bool>) -> Vec<String> {
        let notes = safe.map_or_else(Vec::new, |safe| put_back(session, safe));
        if session.is_locked() {
            come_round(session.link());
            if session.link().at_rest()
                && !session.link().busy()
                && let Ok(folder) = state::folder()
            {
                // Where it cannot be kept, the next one sends the check sequence.
                let _unkept = state::left_at_rest(&folder, session.rig().id());
            }
        }
        notes
    }
}

/// What a session of rings has beside what all have.
pub(crate) trait OfRings {
    fn rings(&self) -> &[RingSize];

    /// Its drives, ring after ring.
    fn axes(&self) -> Vec<Axis>;

    /// What its file and the command line allow together.
    fn limits(&self) -> Limits;

    /// Brings every ring back (9.8), counts its drives, and compares with the rig's file; as often as the file says.
    ///
    /// # Errors
    /// [`SessionError::Ill`].
    fn health(&mut self) -> Result<RingHealth, SessionError>;

    /// The same without learning anything of the drives.
    fn examined(&mut self) -> Result<RingHealth, SessionError>;
}

impl OfRings for Session {
    fn rings(&self) -> &[RingSize] {
        &self.drives().rings
    }

    fn axes(&self) -> Vec<Axis> {
        let rings = self.rings().iter().enumerate();
        let drives = rings.flat_map(|(ring, size)| (0..size.drives()).map(move |k| (ring, k)));
        drives.filter_map(|(ring, k)| Axis::new(ring, k)).collect()
    }

    fn limits(&self) -> Limits {
        self.drives().limits
    }

    fn health(&mut self) -> Result<RingHealth, SessionError> {
        let health = self.examined()?;
        learn(self);
        Ok(health)
    }

    fn examined(&mut self) -> Result<RingHealth, SessionError> {
        self.link().reset_after_denial();
        let attempts = self.rig().file.health.attempts;
        let (link, drives) = self.parts();
        let examined = examine(link, &drives.rings, attempts);
        examined.map_err(|(ring, error)| unhealthy(self.rig(), ring, error))
    }
}

/// The drives of open ends, behind the gates of their rings.
fn guarded(
    rig: &Rig,
    options: &UseOptions,
    (ends, locks): (Ends, Vec<PortLock>),
) -> OpenDrives<RingDrives> {
    let sizes = rig.sizes().into_iter();
    let limits = limits(rig, options.allow_motion);
    let drives = RingDrives {
        rings: sizes
            .filter_map(|size| RingSize::new(size.into()).ok())
            .collect(),
        limits,
        ill_as_well: options.ill_as_well,
        opening: None,
        damages_ff: false,
        before: HeldValues::default(),
    };
    (drives, guard_rings(ends, limits), locks)
}

/// A rig without a lock behind an open port.
#[cfg(test)]
pub(crate) fn at_port(
    rig: &Rig,
    options: &UseOptions,
    port: Box<dyn harness_bench::link::PortLink>,
) -> Result<Session, SessionError> {
    let opened = (Ends::Ports(port), Vec::new());
    let mut session = Session::over_open(rig, options, guarded(rig, options, opened))?;
    session.look_at_interlocks();
    session.link().begin();
    Ok(session)
}

/// Takes a rig: lock, hook, ports, and its first health check.
///
/// # Errors
/// [`SessionError`]; nothing is left locked or open.
pub(crate) fn open(rig: &Rig, options: &UseOptions) -> Result<Session, SessionError> {
    match as_stated(rig, options) {
        Ok(session) => {
            if !session.drives().damages_ff {
                return Ok(session);
            }
            let bytes = "a net byte FF comes back damaged".to_owned();
            let error = unhealthy(rig, 0, Unhealthy::Foreign { bytes });
            let _end = session.release();
            with_damaged_ff(rig, options, error)
        }
        Err(error @ SessionError::Ill { .. }) => {
            for (cause, other) in cause::neighbours(rig) {
                if opens(&other, options)? == Some(true) {
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
) -> Result<Session, SessionError> {
    let Some((cause, other)) = cause::neighbours(rig).into_iter().next() else {
        let right = ErrorMarks::None;
        return Err(error.because(LikelyCause::Marks { right }));
    };
    for _ in 0..PORT_TRIES {
        match opens(&other, options)? {
            Some(false) => {
                let mut session = as_stated(rig, options)?;
                learn(&mut session);
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
    Ok(match as_stated(other, &plain).map(Session::release) {
        Ok(_) => Some(true),
        Err(interrupted @ SessionError::Interrupted { .. }) => return Err(interrupted),
        Err(SessionError::Ill { ill, .. }) => match ill.downcast_ref() {
            // Its drives have answered.
            Some(Unhealthy::Slow { .. } | Unhealthy::Late { .. }) => Some(true),
            Some(Unhealthy::Trouble(_)) => None,
            _ => Some(false),
        },
        Err(_) => None,
    })
}

/// Takes a rig as its file describes it.
fn as_stated(rig: &Rig, options: &UseOptions) -> Result<Session, SessionError> {
    rig.of_rings()?;
    let mut session = Session::open(rig, options)?;
    session.look_at_interlocks();
    session.link().begin();
    Ok(session)
}

/// Takes a rig to its safe state and gives it back; `error` after a rig error or an interlock.
pub(crate) fn close(session: &mut Session, error: bool) -> End {
    let disobeying = disobey(session);
    let mut end = session.end(error);
    end.safe = end.safe.or(disobeying);
    end
}

/// How simulated drives with deviations are not brought to their safe state. They have just been switched on: a scenario may
/// have left the ring cut.
fn disobey(session: &Session) -> Option<Safe> {
    let rig = session.rig();
    let setup = sim::setup(rig);
    if !rig.is_simulated() || setup.without_deviations() == setup {
        return None;
    }
    let ends = Ends::Simulated(Box::new(warm(&rig.plan().ok()?)));
    let mut fresh = guard_rings(ends, session.limits());
    let standing = standing(&rig.file.safe_state);
    let safe = Safe::from(safe_state(&mut fresh, session.rings(), &standing));
    (!safe.confirmed).then_some(safe)
}

/// The error of a rig with a ring that is not healthy.
pub(super) fn unhealthy(rig: &Rig, ring: usize, ill: Unhealthy) -> SessionError {
    SessionError::Ill {
        rig: rig.id().to_owned(),
        ring: ring + 1,
        ill: Box::new(ill),
        cause: None,
    }
}

/// Listens before anything is sent: a bench must not disturb another program's conversation. Returns whether drives have missed their
/// master (ND21 9.9).
fn listen(session: &mut Session) -> Result<bool, SessionError> {
    if session.rig().is_simulated() {
        return Ok(false);
    }
    let mut heard = vec![Vec::new(); session.rings().len()];
    let end = session.link().now() + LONGEST_ROUND;
    let mut silent = session.link().now() + LISTEN;
    while session.link().now() < silent {
        if !session.link().wait(silent) {
            // An interrupted program listens to the end too: the safe state needs the line.
            if session.link().trouble() != Some(&Trouble::Interrupted) {
                break;
            }
            if let Some(ports) = session.ports() {
                ports.resume();
            }
        }
        for (ring, heard) in heard.iter_mut().enumerate() {
            let before = heard.len();
            heard.extend(std::iter::from_fn(|| {
                session.link().receive_octet(ring).map(|(_, byte)| byte)
            }));
            // These bytes may be the rest of a conversation whose bench was killed.
            if heard.len() > before {
                silent = session.link().now() + LISTEN;
            }
        }
        if session.link().now() > end {
            break;
        }
    }
    if session.link().now() <= end {
        return Ok(false);
    }
    let timed_out = |(ring, heard): (usize, &Vec<Received>)| {
        health::sounds_timed_out(heard, session.rings().get(ring).copied())
    };
    // The zeros of the check sequence, which comes next, end a time-out (ND21 9.9).
    let talks = |place: &(usize, &Vec<Received>)| !place.1.is_empty() && !timed_out(*place);
    match heard.iter().enumerate().find(talks).map(|(ring, _)| ring) {
        Some(ring) => {
            let talking = unhealthy(session.rig(), ring, Unhealthy::talking(&heard[ring]));
            Err(talking.because(cause::unasked(&heard[ring])))
        }
        None => Ok(true),
    }
}

/// Examines its rings, unless it was left at rest.
fn make_ready(session: &mut Session) -> Result<(), SessionError> {
    if opens_quietly(session) || session.rig().is_simulated() && !session.rig().file.health.before {
        return Ok(());
    }
    match session.examined() {
        Err(SessionError::Ill { ill, .. })
            if session.drives().ill_as_well
                && !matches!(ill.downcast_ref(), Some(Unhealthy::Trouble(_))) => {}
        Err(error) => return Err(with_cause(session, error)),
        Ok(health) => session.drives_mut().opening = Some(health),
    }
    runs_at_its_rate(session)?;
    if session.drives().opening.is_none() {
        return Ok(());
    }
    // Before anything else with a byte FF is sent.
    if lacks_marks(session) {
        session.drives_mut().damages_ff = true;
        // It has put drives into the error mode.
        let healthy = session.examined().map(drop);
        return healthy.map_err(|error| with_cause(session, error));
    }
    learn(session);
    Ok(())
}

/// Adds the likely cause to the error of a ring that did not open.
fn with_cause(session: &mut Session, error: SessionError) -> SessionError {
    let SessionError::Ill { ring, ill, .. } = &error else {
        return error;
    };
    let ring = ring - 1;
    let file = session.rig().file.rings().nth(ring).cloned();
    let cause = match session.link().trouble() {
        Some(Trouble::Lost(_)) => file.map(|file| LikelyCause::Gone(file.endpoint.transport)),
        Some(_) => None,
        None => {
            come_round(session.link());
            session.link().begin();
            let heard = line_test::listen(session.link(), ring);
            let drives = file.as_ref().map_or(0, |file| file.drives);
            let of_marks = file.and_then(|file| cause::of_marks(&file, &heard));
            let ill = ill.downcast_ref().unwrap_or(&Unhealthy::Silent);
            let other = || cause::cause(ill, &heard, (drives, stated_rate(session.rig())));
            Some(of_marks.unwrap_or_else(other))
        }
    };
    match cause {
        Some(cause) => error.because(cause),
        None => error,
    }
}

/// Refuses a ring whose bytes come back slower than they are sent: what waits for its answers would wait longer each time.
fn runs_at_its_rate(session: &mut Session) -> Result<(), SessionError> {
    if session.rig().is_simulated() {
        return Ok(());
    }
    let stated = stated_rate(session.rig());
    for ring in 0..session.rings().len() {
        session.link().begin();
        let pace = line_test::pace(session.link(), ring, stated);
        session.link().begin();
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
        return Err(unhealthy(session.rig(), ring, ill).because(cause));
    }
    Ok(())
}

/// Whether a ring answers as one that knows no in-band marks, although its file says so.
fn lacks_marks(session: &mut Session) -> bool {
    let marked: Vec<_> = session
        .rig()
        .rings()
        .map(|(_, ring)| ring.endpoint.marks == ErrorMarks::InBand)
        .collect();
    let lacks = (0..).zip(marked).any(|(ring, marked)| {
        marked && line_test::lacks_marks(session.link(), ring) && session.link().trouble().is_none()
    });
    session.link().begin();
    lacks
}

/// Whether the rig was left at rest and its drives answer: then they are asked nothing more, and go on as they are.
fn opens_quietly(session: &mut Session) -> bool {
    if !session.is_locked() {
        return false;
    }
    let left = state::folder().is_ok_and(|folder| state::take_rest(&folder, session.rig().id()));
    if !left || !session.rig().file.health.quiet {
        return false;
    }
    session.link().assume_fresh();
    let sizes = session.rings().to_vec();
    let sound = (0..)
        .zip(sizes)
        .all(|(ring, size)| count_behind(session.link(), ring, &[]) == Some(size));
    session.link().begin();
    if sound {
        learn(session);
    }
    sound
}

/// Learns how fast the drives would turn, for `max_speed`. What is not learnt is denied when it is needed, with its cell, and a
/// lost link is its own trouble.
fn learn(session: &mut Session) {
    session.link().begin();
    let _unlearnt = learn_speeds(session.link());
    session.link().begin();
}

/// Waits until what was sent has come round.
pub(super) fn come_round(link: &mut Guarded<Ends>) {
    let end = link.now() + LONGEST_ROUND;
    while link.busy() && link.now() < end && link.wait(end) {}
}
