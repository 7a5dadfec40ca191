//! UNITEK drives of a rig in use: opened behind their gate, found to answer, and taken to their safe state.

use super::interlock::RegisterInterlocks;
use super::{Axis, axes, limits, rate, setup};
use crate::driver::Driver;
use crate::gate::GuardsSegment as _;
use crate::gate::guarded;
use crate::safe_state::{last_words, safe_state};
use crate::simulate::Bench;
use harness_bench::guard::{Guarded, Safe, Standstill, Watch};
use harness_bench::link::frames::{AdapterError, AdapterSettings, FrameLink};
use harness_bench::medium::{HeardPiece, Pieces};
use harness_bench::rig::lock::PortLock;
use harness_bench::rig::port_file::Port;
use harness_bench::rig::session::{
    OpenDrives, RigDrives, RigSession, failed, lock, locked, patience, port_of, setup_text,
    unopened,
};
use harness_bench::rig::{Ends, Rig, SessionError, UseOptions};
use harness_proto::can::{self, Id};
use harness_proto::time::Span;
use harness_proto::unitek::guard::FrameGate;

/// Which firmware a drive has: the register that every drive is asked for at first.
const FIRMWARE: u8 = 0x1B;

/// The registers that a highest speed is measured by: the rpm of 100 %, and the limit of the speed.
const SPEEDS: [u8; 2] = [0xC8, 0x34];

#[derive(Clone, Debug)]
pub(crate) struct UnitekDrives {
    pub(crate) axes: Vec<Axis>,
    patience: Span,
    /// How a drive with another bit rate is reached, by the rig's file.
    way_back: Option<String>,
}

/// A rig in use.
pub(crate) type Session = RigSession<UnitekDrives>;

impl RigDrives for UnitekDrives {
    fn open(rig: &Rig, options: &UseOptions) -> Result<OpenDrives<Self>, SessionError> {
        let port = port_of(rig)?;
        let axes = axes(port);
        let (ends, locks) = if rig.is_simulated() {
            let setup = setup(port, &setup_text(rig));
            let setup = setup.map_err(|problems| failed(rig, &problems.to_string()))?;
            (Ends::Simulated(Box::new(Bench::new(&setup))), Vec::new())
        } else {
            adapter(rig, port, &axes, options)?
        };
        let identifiers: Vec<_> = axes.iter().map(|axis| (axis.rx, axis.tx)).collect();
        let limits = limits(rig, options.allow_motion);
        let link = guarded(ends, limits, &identifiers, port.listen_only);
        let patience = patience(port);
        let way_back = rig.file.limits.port.bit_rate_way_back.clone();
        let drives = Self {
            axes,
            patience,
            way_back,
        };
        Ok((drives, link, locks))
    }

    /// Asks every drive for its firmware.
    fn ready(session: &mut Session, options: &UseOptions) -> Result<(), SessionError> {
        listen(session)?;
        ask(session, options.ill_as_well)
    }

    fn watch(&self, rig: &Rig) -> Option<Box<dyn Watch>> {
        RegisterInterlocks::of(rig, &self.axes, self.patience)
            .map(|interlocks| Box::new(interlocks) as Box<dyn Watch>)
    }

    fn safe_state(&self, line: &mut Guarded<Ends>, standing: &Standstill) -> Safe {
        let way_back = self.way_back.as_deref();
        safe_state(line, &self.axes, self.patience, standing, way_back)
    }

    fn last_words(&self) -> Vec<Pieces> {
        vec![Pieces::Frames(last_words(&self.axes))]
    }
}

/// What a session of these drives has beside what all have.
pub(crate) trait OfUnitek {
    fn axes(&self) -> &[Axis];

    fn driver(&mut self) -> Driver<'_>;
}

impl OfUnitek for Session {
    fn axes(&self) -> &[Axis] {
        &self.drives().axes
    }

    fn driver(&mut self) -> Driver<'_> {
        let (link, drives) = self.parts();
        Driver::new(Box::new(link), &drives.axes, drives.patience)
    }
}

/// Listens for another master.
fn listen(session: &mut Session) -> Result<(), SessionError> {
    let axes = session.axes().to_vec();
    let mut other = None;
    session.listen(|heard| {
        let HeardPiece::Frame(can::CanEvent::Frame(frame)) = heard else {
            return;
        };
        let number = frame.id().number();
        let meant = |axis: &&Axis| u32::from(axis.rx) == number && !frame.id().is_extended();
        let meant = axes.iter().find(meant);
        other = other
            .take()
            .or_else(|| meant.map(|axis| (axis.node, frame)));
    })?;
    match other {
        Some((node, frame)) if !session.listens_only() => Err(session.failed(&format!(
            "another master sends to drive {node} ({frame}): end it first, or set `listen_only = true`"
        ))),
        _ => Ok(()),
    }
}

/// Asks every drive for its firmware, and learns what a highest speed is measured by.
fn ask(session: &mut Session, ill_as_well: bool) -> Result<(), SessionError> {
    if session.listens_only() || !session.rig().file.health.before && !needs_speeds(session) {
        return Ok(());
    }
    let speeds = needs_speeds(session);
    let mut learnt = Vec::new();
    let mut silent = Ok(());
    let axes = session.axes().to_vec();
    let mut driver = session.driver();
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
    if let Some(gate) = session.link().segment_mut() {
        for (rx, full, limit) in learnt {
            gate.learn(rx, full, limit);
        }
    }
    session.sound()?;
    let lost = match session.take_doubtful() {
        0 => "",
        _ => "; frames were lost on the way to the bench, so it may have answered",
    };
    match silent {
        Err(error) if !ill_as_well => Err(session.failed(&format!("{error}{lost}"))),
        _ => Ok(()),
    }
}

/// Whether a highest speed needs to know what drives hold.
fn needs_speeds(session: &Session) -> bool {
    let limits = session.guarded().segment().map(FrameGate::limits);
    limits.is_some_and(|limits| limits.motion && limits.max_speed.is_some())
}

/// Opens the adapter of a rig, and locks its port. Nothing is sent to the bus.
fn adapter(
    rig: &Rig,
    port: &Port,
    axes: &[Axis],
    options: &UseOptions,
) -> Result<(Ends, Vec<PortLock>), SessionError> {
    let place = port.can_adapter();
    let place = place.ok_or_else(|| failed(rig, "its port has no adapter"))?;
    let settings = AdapterSettings {
        place,
        rate: rate(port),
        listen_only: port.listen_only,
        may_acknowledge: false,
    };
    let senders = axes
        .iter()
        .filter_map(|axis| Some((Id::base(axis.tx)?, axis.node)));
    let link = FrameLink::open(&settings, senders.collect(), options.interrupt.clone());
    options.unless_interrupted(rig)?;
    let link = link.map_err(|error| match &error {
        AdapterError::Open(error) => unopened(rig, error),
        _ => failed(rig, &error.to_string()),
    })?;
    let device = port.slcan.as_ref().filter(|place| place.contains('/'));
    let lock = device.map(|place| lock(rig, place, link.fd()));
    let interface = port.socketcan.as_ref();
    let interface = interface.map(|name| locked(rig, name, PortLock::of_interface(name)));
    let locks = lock.or(interface).transpose()?.into_iter().collect();
    Ok((Ends::Ports(Box::new(link)), locks))
}
