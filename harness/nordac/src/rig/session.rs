//! NORDAC inverters of a rig in use: opened behind their gate, found to answer, and taken to their safe state.

use super::interlock::InverterInterlocks;
use super::talk::Talk;
use super::{RigSlave, limits, rate, setup, slaves};
use crate::cli::ParkedDriver;
use crate::gate::guarded;
use crate::safe_state::{last_words, safe_state};
use crate::simulate::Bench;
use crate::stream::{SegmentLink, TOLERANCE};
use harness_bench::counted::counted;
use harness_bench::guard::{Guarded, Safe, Standstill, Watch};
use harness_bench::medium::{ErrorMarks, Pieces};
use harness_bench::port::UNPROVEN_RATE;
use harness_bench::port::{PortAddress, PortSettings};
use harness_bench::rig::lock::PortLock;
use harness_bench::rig::port_file::Port;
use harness_bench::rig::session::{
    OpenDrives, RigDrives, RigSession, failed, lock, patience, port_of, setup_text, unopened,
};
use harness_bench::rig::{Ends, Rig, SessionError, UseOptions};
use harness_proto::nordac::guard::GuardedSlave;
use harness_proto::profibus::dp::Diagnosis;
use harness_proto::time::Span;

#[derive(Clone, Debug)]
pub(crate) struct Inverters {
    pub(crate) slaves: Vec<RigSlave>,
    patience: Span,
    /// The master, between two requests of a session.
    pub(crate) parked: ParkedDriver,
}

/// A rig in use.
pub(crate) type Session = RigSession<Inverters>;

impl RigDrives for Inverters {
    fn open(rig: &Rig, options: &UseOptions) -> Result<OpenDrives<Self>, SessionError> {
        let port = port_of(rig)?;
        let slaves = slaves(port);
        let (ends, locks) = ends(rig, port, options)?;
        let known: Vec<GuardedSlave> = slaves.iter().copied().map(Into::into).collect();
        let limits = limits(rig, options.allow_motion);
        let link = guarded(ends, limits, &known, port.listen_only);
        let patience = patience_of(rig, port);
        let parked = ParkedDriver::default();
        Ok((
            Self {
                slaves,
                patience,
                parked,
            },
            link,
            locks,
        ))
    }

    /// Asks every slave for its diagnosis and its configuration, which changes nothing.
    fn ready(session: &mut Session, options: &UseOptions) -> Result<(), SessionError> {
        listen(session)?;
        // A simulated slave is there: what it does wrong is for verdicts.
        let ill_as_well = options.ill_as_well || session.rig().is_simulated();
        ask(session, ill_as_well)
    }

    fn watch(&self, rig: &Rig) -> Option<Box<dyn Watch>> {
        InverterInterlocks::of(rig, &self.slaves, self.patience)
            .map(|interlocks| Box::new(interlocks) as Box<dyn Watch>)
    }

    fn safe_state(&self, line: &mut Guarded<Ends>, standing: &Standstill) -> Safe {
        safe_state(line, &self.slaves, self.patience, standing)
    }

    fn last_words(&self) -> Vec<Pieces> {
        vec![Pieces::Octets(last_words(&self.slaves).concat())]
    }
}

/// What a session of these drives has beside what all have.
pub(crate) trait OfNordac {
    /// Its slaves. Their PPO types are those that they were found with.
    fn slaves(&self) -> &[RigSlave];

    /// How long a reply may take beside its own time on the line.
    fn patience(&self) -> Span;

    /// A master for single requests.
    fn talk(&mut self) -> Talk<'_>;
}

impl OfNordac for Session {
    fn slaves(&self) -> &[RigSlave] {
        &self.drives().slaves
    }

    fn patience(&self) -> Span {
        self.drives().patience
    }

    fn talk(&mut self) -> Talk<'_> {
        let patience = self.patience();
        Talk::new(Box::new(self.link()), patience)
    }
}

/// Listens for another master.
fn listen(session: &mut Session) -> Result<(), SessionError> {
    let mut heard = 0_u32;
    session.listen(|_| heard += 1)?;
    match heard {
        0 => Ok(()),
        _ if session.listens_only() => Ok(()),
        _ => Err(session.failed(&format!(
            "{} came before anything was sent: another master uses the line, or its rate is another one; end it first, or set \
             `listen_only = true`",
            counted(heard, "octet")
        ))),
    }
}

/// Asks every slave for its diagnosis and its configuration.
fn ask(session: &mut Session, ill_as_well: bool) -> Result<(), SessionError> {
    let mut slaves = session.drives().slaves.iter();
    let unknown = slaves.any(|slave| slave.ppo.is_none());
    if session.listens_only() || !session.rig().file.health.before && !unknown {
        return Ok(());
    }
    let Inverters {
        slaves, patience, ..
    } = session.drives().clone();
    let mut silent = Ok(());
    let mut found = Vec::new();
    let mut talk = Talk::new(Box::new(session.link()), patience);
    for slave in slaves {
        let address = slave.address;
        talk.restart(address);
        let asked = talk.diagnose(address).and_then(|diagnosis| {
            let ppo = talk.configuration(address)?;
            Ok((diagnosis, ppo))
        });
        match asked {
            Ok((diagnosis, ppo)) => {
                found.push(RigSlave { ppo, ..slave });
                let wrong = differs(&slave, &diagnosis, ppo.map(|ppo| ppo.number()));
                if silent.is_ok() {
                    silent = wrong;
                }
            }
            Err(error) => {
                found.push(slave);
                if silent.is_ok() {
                    silent = Err(error.to_string());
                }
            }
        }
    }
    drop(talk);
    session.drives_mut().slaves = found;
    session.sound()?;
    match silent {
        Err(mut why) if !ill_as_well => {
            let ports = session.link().inner_mut().ports_mut();
            if ports.is_some_and(|ports| ports.has_unproven_rate(0)) {
                why = format!("{why}; {UNPROVEN_RATE}");
            }
            Err(session.failed(&why))
        }
        _ => Ok(()),
    }
}

/// In what a slave differs from the rig's file.
fn differs(slave: &RigSlave, diagnosis: &Diagnosis, ppo: Option<u8>) -> Result<(), String> {
    let address = slave.address;
    let ident = harness_proto::nordac::IDENT;
    if diagnosis.ident != ident {
        return Err(format!(
            "station {address} has the ident number {:04X}, and a NORDAC vector {ident:04X}",
            diagnosis.ident
        ));
    }
    match (slave.ppo, ppo) {
        (_, None) => Err(format!(
            "the configuration of slave {address} is of no PPO type"
        )),
        (Some(listed), Some(found)) if listed.number() != found => Err(format!(
            "slave {address} is set to PPO type {found} (1622), and the rig's file says {}",
            listed.number()
        )),
        _ => Ok(()),
    }
}

/// The end of the line: simulated, or an adapter that is opened and locked. Nothing is sent.
fn ends(
    rig: &Rig,
    port: &Port,
    options: &UseOptions,
) -> Result<(Ends, Vec<PortLock>), SessionError> {
    if rig.is_simulated() {
        let setup = setup(port, &setup_text(rig));
        let setup = setup.map_err(|problems| failed(rig, &problems.to_string()))?;
        return Ok((Ends::Simulated(Box::new(Bench::new(&setup))), Vec::new()));
    }
    let address = port.line();
    let address = address.ok_or_else(|| failed(rig, "its port has no adapter"))?;
    let locks = matches!(address, PortAddress::Serial(_) | PortAddress::Pty(_));
    let place = address.to_string();
    let rate = rate(port);
    let wire = harness_bench::port::open(&PortSettings {
        address,
        format: rate.format(),
        marks: port.marks == ErrorMarks::InBand,
        low_latency: true,
    });
    options.unless_interrupted(rig)?;
    let wire = wire.map_err(|error| unopened(rig, &error))?;
    let lock = locks.then(|| lock(rig, &place, wire.fd()));
    let locks = lock.transpose()?.into_iter().collect();
    let addresses = slaves(port).iter().map(|slave| slave.address).collect();
    let (patience, interrupt) = (patience(port), options.interrupt.clone());
    let link = SegmentLink::new(wire, rate, addresses, patience, port.echo, interrupt);
    Ok((Ends::Ports(Box::new(link)), locks))
}

/// How long a reply may take beside its own time on the line, with what an adapter and a busy computer add.
pub(super) fn patience_of(rig: &Rig, port: &Port) -> Span {
    match rig.is_simulated() {
        true => patience(port),
        false => patience(port) + TOLERANCE,
    }
}
