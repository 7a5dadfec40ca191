//! From a rig's file to its rings' ends: ports opened and locked, or simulated rings set up.

use super::sim::RigOfRings;
use crate::simulate::warm;
use crate::stream::StreamLink;
use harness_bench::link::{InnerLink, InnerPorts};
use harness_bench::medium::ErrorMarks;
use harness_bench::port::{self, OpenError, PortSettings, Wire};
use harness_bench::rig::ends::Ends;
use harness_bench::rig::file::{Endpoint, Transport};
use harness_bench::rig::lock::{PortLock, PortLockError};
use harness_bench::rig::scan::{self, FoundPort, MatchError};
use harness_bench::rig::{Rig, SessionError};
use harness_bench::scenario::problem::Problems;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Why a rig's ports cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenRigError {
    #[error(transparent)]
    Port(#[from] OpenError),
    /// No port, or several, fit what the file says of one.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// Another program uses a port.
    #[error("{port}: {error}")]
    Lock {
        port: String,
        /// Why not.
        error: PortLockError,
    },
    /// The lines of `[sim]`.
    #[error(transparent)]
    Setup(#[from] Problems),
    /// Several transports that have no line in common.
    #[error(
        "ring 2 runs at {second} bit/s, ring 1 at {first}: both rings of a rig must have the same rate"
    )]
    Rates {
        /// Ring 1.
        first: u32,
        /// Ring 2.
        second: u32,
    },
}

impl OpenRigError {
    /// The same as an error of the rig's.
    pub(crate) fn of_rig(self, rig: &Rig) -> SessionError {
        let busy = matches!(
            self,
            Self::Port(OpenError::InUse { .. })
                | Self::Lock {
                    error: PortLockError::Busy { .. },
                    ..
                }
        );
        let name = rig.id().to_owned();
        match busy {
            true => SessionError::PortInUse {
                rig: name,
                why: self.to_string(),
            },
            false => SessionError::Open {
                rig: name,
                error: Box::new(self),
            },
        }
    }
}

/// Open ends, and the locks of their ports.
#[derive(Debug)]
pub(crate) struct Opened {
    pub(crate) ends: Ends,
    pub(crate) locks: Vec<PortLock>,
}

/// The rate of a rig's line.
pub(crate) fn line_rate(rig: &Rig) -> Rate {
    let simulated = rig.is_simulated().then(|| rig.plan().ok()).flatten();
    simulated.map_or_else(|| stated_rate(rig), |plan| plan.rate)
}

/// The rate in a rig's file.
pub(crate) fn stated_rate(rig: &Rig) -> Rate {
    let first = rig.file.rings().next();
    first.map_or_else(Rate::default, |ring| ring.endpoint.line.into())
}

/// Opens a rig's ends; nothing is sent.
pub(crate) fn open(rig: &Rig, interrupt: Arc<AtomicBool>) -> Result<Opened, OpenRigError> {
    if rig.is_simulated() {
        return Ok(Opened {
            ends: Ends::Simulated(Box::new(warm(&rig.plan()?))),
            locks: Vec::new(),
        });
    }
    let ports = scan::scan(Path::new("/"));
    let mut locks = Vec::new();
    let rate = stated_rate(rig);
    let mut wires = Vec::new();
    for (_, ring) in rig.rings() {
        let own = Rate::from(ring.endpoint.line);
        if own != rate {
            return Err(OpenRigError::Rates {
                first: rate.bits_per_second(),
                second: own.bits_per_second(),
            });
        }
        wires.push((wire(&ring.endpoint, &ports, &mut locks)?, ring.drives));
    }
    let mut inner = Vec::new();
    for tap in &rig.file.tap {
        let wire = wire(&tap.endpoint, &ports, &mut locks)?;
        inner.push(inner_link(
            rig,
            tap.ring,
            tap.link.from,
            InnerPorts::Tap(wire),
        ));
    }
    for interposer in &rig.file.interposer {
        let up = wire(&interposer.upstream, &ports, &mut locks)?;
        let interposer_ports = if interposer.upstream == interposer.downstream {
            InnerPorts::Interposer(up)
        } else {
            let down = wire(&interposer.downstream, &ports, &mut locks)?;
            InnerPorts::TwoPortInterposer(up, down)
        };
        let from = interposer.link.from;
        inner.push(inner_link(rig, interposer.ring, from, interposer_ports));
    }
    let tolerance = rig.rings().map(|(_, ring)| ring.time_tolerance.0).max();
    let tolerance = tolerance.map_or(0, |t| u64::try_from(t.as_nanos()).unwrap_or(u64::MAX));
    let tolerance = Span::from_nanos(tolerance);
    let mut link = StreamLink::new(wires, inner, rate, interrupt);
    link.set_time_tolerance(tolerance);
    Ok(Opened {
        ends: Ends::Ports(Box::new(link)),
        locks,
    })
}

fn inner_link(rig: &Rig, ring: u8, from: Option<u8>, ports: InnerPorts) -> InnerLink {
    let index = usize::from(ring.saturating_sub(1));
    let drives = rig.rings().nth(index).map_or(0, |(_, ring)| ring.drives);
    let place = from.map_or(0, |from| usize::from(drives.saturating_sub(from)));
    InnerLink::new(index, place, ports)
}

fn wire(
    endpoint: &Endpoint,
    ports: &[FoundPort],
    locks: &mut Vec<PortLock>,
) -> Result<Wire, OpenRigError> {
    let named = endpoint.port.clone().unwrap_or_default();
    let place = match endpoint.transport {
        Transport::Serial if endpoint.port.is_none() => {
            port::PortAddress::Serial(scan::resolve(ports, &endpoint.udev)?)
        }
        Transport::Serial => port::PortAddress::Serial(named.into()),
        Transport::Pty => port::PortAddress::Pty(named.into()),
        Transport::Rfc2217 => port::PortAddress::Rfc2217(named),
        // Checked before: a rig is simulated as a whole or not at all.
        Transport::Tcp | Transport::Sim => port::PortAddress::Tcp(named),
    };
    let name = place.to_string();
    let wire = port::open(&PortSettings {
        address: place,
        format: Rate::from(endpoint.line).into(),
        marks: endpoint.marks == ErrorMarks::InBand,
        low_latency: endpoint.low_latency,
    })?;
    if matches!(endpoint.transport, Transport::Serial | Transport::Pty) {
        let lock = PortLock::acquire(wire.fd());
        locks.push(lock.map_err(|error| OpenRigError::Lock { port: name, error })?);
    }
    Ok(wire)
}
