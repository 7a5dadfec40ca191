//! A rig of UNITEK drives in use: locked, opened, found to answer, guarded, and taken to its safe state on every way out.

use super::{Axis, axes, limits, rate, setup};
use crate::buses::unitek::driver::Driver;
use crate::buses::unitek::gate::guarded;
use crate::buses::unitek::safe_state::{last_words, safe_state};
use crate::buses::unitek::simulate::Bench;
use crate::guard::{Guarded, Safe, SafeStep, Standstill};
use crate::link::frames::{AdapterPlace, AdapterSettings, FrameLink};
use crate::link::{Line, Trouble};
use crate::medium::{Heard, Pieces};
use crate::rig::file;
use crate::rig::lock::PortLock;
use crate::rig::taken::{Taken, take};
use crate::rig::watchdog::{Watchdog, watch_over};
use crate::rig::{Alarm, End, Ends, Options, Rig, SessionError, standing};
use crate::scenario::source::Source;
use harness_proto::can::{self, Id};
use harness_proto::time::Span;
use harness_proto::unitek::guard::Limits;
use std::time::Instant;

/// How long a bus is listened to before anything is sent.
const LISTEN: Span = Span::from_millis(150);

/// Which firmware a drive has: the register that every drive is asked for at first.
const FIRMWARE: u8 = 0x1B;

/// The registers that a highest speed is measured by: the rpm of 100 %, and the limit of the speed.
const SPEEDS: [u8; 2] = [0xC8, 0x34];

/// A rig in use.
#[derive(Debug)]
pub struct Session {
    rig: Rig,
    link: Guarded<Ends>,
    axes: Vec<Axis>,
    patience: Span,
    started: Instant,
    listen_only: bool,
    /// The drives are as they are to be left.
    ended: bool,
    // Given back in this order.
    watchdog: Option<Watchdog>,
    _locks: Vec<PortLock>,
    taken: Taken,
}

impl Session {
    /// Takes a rig: lock, hook, port. Listens first. Then asks every drive for its firmware, unless the file says `listen_only`.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub fn open(rig: &Rig, options: &Options) -> Result<Self, SessionError> {
        let port = rig
            .port()
            .ok_or_else(|| failed(rig, "it has no [port.1]"))?;
        let taken = take(rig, options)?;
        let axes = axes(port);
        let (ends, locks) = if rig.is_simulated() {
            let lines = rig.file.sim.iter().flat_map(|sim| sim.setup.clone());
            let source = Source {
                name: rig.origin.clone(),
                text: lines.collect::<Vec<_>>().join("\n").into(),
            };
            let setup = setup(port, &source);
            let setup = setup.map_err(|problems| failed(rig, &problems.to_string()))?;
            (Ends::Simulated(Box::new(Bench::new(&setup))), Vec::new())
        } else {
            open(rig, &axes, options)?
        };
        let identifiers: Vec<_> = axes.iter().map(|axis| (axis.rx, axis.tx)).collect();
        let limits = limits(rig, options.allow_motion);
        let mut session = Self {
            rig: rig.clone(),
            link: guarded(ends, limits, &identifiers, port.listen_only),
            axes,
            patience: span(port.patience.0),
            started: Instant::now(),
            listen_only: port.listen_only,
            // Nothing has been sent: there is nothing to make safe.
            ended: true,
            watchdog: None,
            _locks: locks,
            taken,
        };
        if rig.is_simulated() {
            session.link.set_interrupt(options.interrupt.clone());
        }
        let ready = session
            .listen()
            .and_then(|()| session.ask(options.ill_as_well));
        match ready {
            Err(_) if session.link.trouble() == Some(&Trouble::Interrupted) => {
                let end = Some(Box::new(session.end(false)));
                let rig = rig.id().to_owned();
                return Err(SessionError::Interrupted { rig, end });
            }
            other => other?,
        }
        session.taken.around.used();
        session.ended = session.listen_only || rig.is_simulated();
        session.watchdog = session.watched(options.alarm.clone())?;
        Ok(session)
    }

    /// The rig.
    #[must_use]
    pub const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Its drives.
    #[must_use]
    pub fn axes(&self) -> &[Axis] {
        &self.axes
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

    /// What the rig's file and the command line allow together.
    #[must_use]
    pub fn limits(&self) -> Limits {
        let gate = self.link.segment();
        gate.map(|own| own.limits().clone()).unwrap_or_default()
    }

    /// Whether it has been used for longer than its file allows.
    #[must_use]
    pub fn overdue(&self) -> bool {
        let longest = self.rig.file.limits.max_run.as_ref();
        longest.is_some_and(|longest| self.started.elapsed() > longest.0)
    }

    /// Takes every drive to its safe state, whatever the file wants at the end, and reads it back.
    pub fn make_safe(&mut self) -> Safe {
        self.link.reset_after_denial();
        let wanted = Standstill {
            order: vec![SafeStep::Stop, SafeStep::Block],
            ..standing(&self.rig.file.safe_state)
        };
        safe_state(&mut self.link, &self.axes, self.patience, &wanted)
    }

    /// A driver of its drives.
    pub fn driver(&mut self) -> Driver<'_> {
        Driver::new(Box::new(&mut self.link), &self.axes, self.patience)
    }

    /// Listens before anything is sent: a bench must not disturb another master.
    fn listen(&mut self) -> Result<(), SessionError> {
        if self.rig.is_simulated() {
            return Ok(());
        }
        let end = self.link.now() + LISTEN;
        while self.link.now() < end && self.link.trouble().is_none() {
            self.link.wait(end);
            while let Some((_, heard)) = self.link.receive(0) {
                let Heard::Frame(can::Heard::Frame(frame)) = heard else {
                    continue;
                };
                let number = frame.id().number();
                let meant =
                    |axis: &&Axis| u32::from(axis.rx) == number && !frame.id().is_extended();
                if let Some(axis) = self.axes.iter().find(meant)
                    && !self.listen_only
                {
                    let why = format!(
                        "another master sends to drive {} ({frame}): end it first, or set `listen_only = true`",
                        axis.node
                    );
                    return Err(failed(&self.rig, &why));
                }
            }
        }
        self.sound()
    }

    /// Asks every drive for its firmware, and learns what a highest speed is measured by.
    fn ask(&mut self, ill_as_well: bool) -> Result<(), SessionError> {
        if self.listen_only || !self.rig.file.health.before && !self.needs_speeds() {
            return Ok(());
        }
        let speeds = self.needs_speeds();
        let mut learnt = Vec::new();
        let mut silent = Ok(());
        let axes = self.axes.clone();
        let mut driver = self.driver();
        for axis in axes {
            let mut read = |register| {
                let reply = driver.read(axis, register);
                reply.map(|reply| (reply.data.bits() & 0xFFFF) as u16)
            };
            let done = read(FIRMWARE).and_then(|_| {
                if speeds {
                    learnt.push((axis.rx, read(SPEEDS[0])?, read(SPEEDS[1])?));
                }
                Ok(())
            });
            if silent.is_ok() {
                silent = done;
            }
        }
        drop(driver);
        if let Some(gate) = self.link.segment_mut() {
            for (rx, full, limit) in learnt {
                gate.learn(rx, full, limit);
            }
        }
        self.sound()?;
        match silent {
            Err(error) if !ill_as_well => Err(failed(&self.rig, &error.to_string())),
            _ => Ok(()),
        }
    }

    /// Whether a highest speed needs to know what drives hold.
    fn needs_speeds(&self) -> bool {
        let limits = self
            .link
            .segment()
            .map(harness_proto::unitek::guard::Gate::limits);
        limits.is_some_and(|limits| limits.motion && limits.max_speed.is_some())
    }

    fn sound(&self) -> Result<(), SessionError> {
        self.link.trouble().map_or(Ok(()), |trouble| {
            Err(failed(&self.rig, &trouble.to_string()))
        })
    }

    /// Lets a thread watch that the program lives.
    fn watched(&mut self, alarm: Alarm) -> Result<Option<Watchdog>, SessionError> {
        if self.listen_only {
            return Ok(None);
        }
        let frames = last_words(&self.axes);
        let Some(ports) = self.link.inner_mut().ports_mut() else {
            return Ok(None);
        };
        let words = |_| Pieces::Frames(frames.clone());
        let words = ports.last_words(&words).map_err(SessionError::Watchdog)?;
        watch_over(&self.rig, ports.beats(), words, alarm).map(Some)
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    #[must_use]
    pub fn close(mut self, error: bool) -> End {
        self.end(error)
    }

    /// Gives the rig back with its drives as they are: after what has only looked, or was asked to let motors turn.
    #[must_use]
    pub fn release(mut self) -> End {
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
                let axes = self.axes.clone();
                end.safe = Some(safe_state(&mut self.link, &axes, self.patience, &standing));
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

impl Drop for Session {
    /// A panic unwinds through here.
    fn drop(&mut self) {
        if !self.ended {
            let _told_by_nobody = self.end(true);
        }
    }
}

/// Opens the adapter of a rig, and locks its port. Nothing is sent to the bus.
fn open(
    rig: &Rig,
    axes: &[Axis],
    options: &Options,
) -> Result<(Ends, Vec<PortLock>), SessionError> {
    let port = rig
        .port()
        .ok_or_else(|| failed(rig, "it has no [port.1]"))?;
    let place = match (&port.slcan, &port.socketcand) {
        (Some(place), _) => AdapterPlace::slcan(place),
        (None, Some(address)) => AdapterPlace::Socketcand {
            address: address.clone(),
            channel: port.channel.clone().unwrap_or_else(|| "can0".to_owned()),
        },
        (None, None) => AdapterPlace::Kernel {
            interface: port
                .socketcan
                .clone()
                .ok_or_else(|| failed(rig, "its port has no adapter"))?,
        },
    };
    let settings = AdapterSettings {
        place,
        rate: rate(port),
        listen_only: port.listen_only,
    };
    let senders = axes
        .iter()
        .filter_map(|axis| Some((Id::base(axis.tx)?, axis.node)));
    let link = FrameLink::open(&settings, senders.collect(), options.interrupt.clone());
    options.unless_interrupted(rig)?;
    let link = link.map_err(|error| failed(rig, &error.to_string()))?;
    let device = port.slcan.as_ref().filter(|place| place.contains('/'));
    let lock = device.map(|place| {
        let lock = PortLock::acquire(link.fd());
        lock.map_err(|error| failed(rig, &format!("{place}: {error}")))
    });
    let locks = lock.transpose()?.into_iter().collect();
    Ok((Ends::Ports(Box::new(link)), locks))
}

fn failed(rig: &Rig, why: &str) -> SessionError {
    SessionError::Drives {
        rig: rig.id().to_owned(),
        why: why.to_owned(),
    }
}

fn span(time: std::time::Duration) -> Span {
    Span::from_nanos(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX))
}
