//! From a rig's file to its rings' ends: ports opened and locked, or simulated rings set up.

use super::sim::RigOfRings;
use crate::simulate::warm;
use crate::stream::StreamLink;
use harness_bench::link::{InnerLink, InnerPorts};
use harness_bench::medium::ErrorMarks;
use harness_bench::port::{self, PortSettings, Wire};
use harness_bench::rig::ends::Ends;
use harness_bench::rig::file::{Endpoint, Transport};
use harness_bench::rig::lock::PortLock;
use harness_bench::rig::scan::{self, FoundPort};
use harness_bench::rig::session::{failed, lock, unopened};
use harness_bench::rig::{Rig, SessionError};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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

/// Opens a rig's ends, and locks its ports; nothing is sent.
pub(crate) fn open(
    rig: &Rig,
    interrupt: Arc<AtomicBool>,
) -> Result<(Ends, Vec<PortLock>), SessionError> {
    if rig.is_simulated() {
        let plan = rig.plan();
        let plan = plan.map_err(|problems| failed(rig, &problems.to_string()))?;
        return Ok((Ends::Simulated(Box::new(warm(&plan))), Vec::new()));
    }
    let ports = scan::scan(Path::new("/"));
    let mut locks = Vec::new();
    let rate = stated_rate(rig);
    let mut wires = Vec::new();
    for (_, ring) in rig.rings() {
        let ring_rate = Rate::from(ring.endpoint.line);
        if ring_rate != rate {
            let why = format!(
                "ring 2 runs at {} bit/s, ring 1 at {}: both rings of a rig must have the same rate",
                ring_rate.bits_per_second(),
                rate.bits_per_second()
            );
            return Err(failed(rig, &why));
        }
        wires.push((wire(rig, &ring.endpoint, &ports, &mut locks)?, ring.drives));
    }
    let mut inner = Vec::new();
    for tap in &rig.file.tap {
        let wire = wire(rig, &tap.endpoint, &ports, &mut locks)?;
        inner.push(inner_link(
            rig,
            tap.ring,
            tap.link.from,
            InnerPorts::Tap(wire),
        ));
    }
    for interposer in &rig.file.interposer {
        let up = wire(rig, &interposer.upstream, &ports, &mut locks)?;
        let interposer_ports = if interposer.upstream == interposer.downstream {
            InnerPorts::Interposer(up)
        } else {
            let down = wire(rig, &interposer.downstream, &ports, &mut locks)?;
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
    Ok((Ends::Ports(Box::new(link)), locks))
}

fn inner_link(rig: &Rig, ring: u8, from: Option<u8>, ports: InnerPorts) -> InnerLink {
    let index = usize::from(ring.saturating_sub(1));
    let drives = rig.rings().nth(index).map_or(0, |(_, ring)| ring.drives);
    let place = from.map_or(0, |from| usize::from(drives.saturating_sub(from)));
    InnerLink::new(index, place, ports)
}

fn wire(
    rig: &Rig,
    endpoint: &Endpoint,
    ports: &[FoundPort],
    locks: &mut Vec<PortLock>,
) -> Result<Wire, SessionError> {
    let named = endpoint.port.clone().unwrap_or_default();
    let place = match endpoint.transport {
        Transport::Serial if endpoint.port.is_none() => {
            let found = scan::resolve(ports, &endpoint.udev);
            port::PortAddress::Serial(found.map_err(|error| failed(rig, &error.to_string()))?)
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
    })
    .map_err(|error| unopened(rig, &error))?;
    if matches!(endpoint.transport, Transport::Serial | Transport::Pty) {
        locks.push(lock(rig, &name, wire.fd())?);
    }
    Ok(wire)
}
