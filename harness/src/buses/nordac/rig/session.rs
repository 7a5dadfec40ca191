//! A rig of NORDAC inverters in use: locked, opened, found to answer, guarded, and taken to its safe state on every way out.

use super::talk::Talk;
use super::{RigSlave, failed, limits, rate, setup, slaves};
use crate::buses::nordac::gate::guarded;
use crate::buses::nordac::safe_state::{last_words, safe_state};
use crate::buses::nordac::simulate::Bench;
use crate::buses::nordac::stream::{SegmentLink, TOLERANCE};
use crate::guard::{Guarded, Safe, Standstill};
use crate::link::Line;
use crate::medium::Pieces;
use crate::port::{Endpoint, PortSettings};
use crate::rig::file::Marks;
use crate::rig::lock::PortLock;
use crate::rig::port_file::Port;
use crate::rig::port_session::{PortDrives, PortSession};
use crate::rig::taken::take;
use crate::rig::{End, Ends, Options, Rig, SessionError};
use crate::scenario::source::Source;
use harness_proto::nordac::guard::{GuardedSlave, Limits};
use harness_proto::profibus::dp::Diagnosis;
use harness_proto::time::Span;

/// How long a line is listened to before anything is sent.
const LISTEN: Span = Span::from_millis(150);

/// The inverters of a rig.
#[derive(Clone, Debug)]
struct Inverters {
    slaves: Vec<RigSlave>,
    patience: Span,
}

impl PortDrives for Inverters {
    fn safe_state(&self, line: &mut Guarded<Ends>, standing: &Standstill) -> Safe {
        safe_state(line, &self.slaves, self.patience, standing)
    }

    fn last_words(&self) -> Pieces {
        Pieces::Octets(last_words(&self.slaves).concat())
    }
}

/// A rig in use.
#[derive(Debug)]
pub struct Session(PortSession<Inverters>);

impl Session {
    /// Takes a rig: lock, hook, port. Listens first. Then asks every slave for its diagnosis and its configuration, which changes nothing,
    /// unless the file says `listen_only`.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub fn open(rig: &Rig, options: &Options) -> Result<Self, SessionError> {
        let port = rig
            .port()
            .ok_or_else(|| failed(rig, "it has no [port.1]"))?;
        let taken = take(rig, options)?;
        let slaves = slaves(port);
        let (ends, locks) = ends(rig, options)?;
        let known: Vec<_> = slaves.iter().map(|own| GuardedSlave::from(*own)).collect();
        let limits = limits(rig, options.allow_motion);
        let link = guarded(ends, limits, &known, port.listen_only);
        let drives = Inverters {
            slaves,
            patience: patience_of(rig, port),
        };
        let ill_as_well = options.ill_as_well;
        let ready = |session: &mut PortSession<Inverters>| {
            listen(session)?;
            ask(session, ill_as_well)
        };
        let opened = PortSession::open(rig, options, taken, (link, locks), drives, ready);
        opened.map(Self)
    }

    /// The rig.
    #[must_use]
    pub const fn rig(&self) -> &Rig {
        self.0.rig()
    }

    /// Its slaves. Their PPO types are those that they were found with.
    #[must_use]
    pub fn slaves(&self) -> &[RigSlave] {
        &self.0.drives().slaves
    }

    /// How long a reply may take beside its own time on the line.
    #[must_use]
    pub const fn patience(&self) -> Span {
        self.0.drives().patience
    }

    /// Its guarded link.
    pub const fn link(&mut self) -> &mut Guarded<Ends> {
        self.0.link()
    }

    /// Its guarded link, to look at.
    #[must_use]
    pub const fn guarded(&self) -> &Guarded<Ends> {
        self.0.guarded()
    }

    /// What the rig's file and the command line allow together.
    #[must_use]
    pub fn limits(&self) -> Limits {
        let gate = self.0.guarded().slaves();
        gate.map(|own| *own.limits()).unwrap_or_default()
    }

    /// Whether it has been used for longer than its file allows.
    #[must_use]
    pub fn overdue(&self) -> bool {
        self.0.overdue()
    }

    /// Takes every slave to its safe state, whatever the file wants at the end, and reads it back.
    pub fn make_safe(&mut self) -> Safe {
        self.0.make_safe()
    }

    /// A master for single requests.
    pub fn talk(&mut self) -> Talk<'_> {
        let patience = self.patience();
        Talk::new(Box::new(self.0.link()), patience)
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    #[must_use]
    pub fn close(self, error: bool) -> End {
        self.0.close(error)
    }

    /// Gives the rig back with its slaves as they are: after what has only looked.
    #[must_use]
    pub fn release(self) -> End {
        self.0.release()
    }
}

/// Listens before anything is sent: a bench must not disturb another master.
fn listen(session: &mut PortSession<Inverters>) -> Result<(), SessionError> {
    if session.rig().is_simulated() {
        return Ok(());
    }
    let listens_only = session.rig().port().is_some_and(|port| port.listen_only);
    let link = session.link();
    let end = link.now() + LISTEN;
    let mut heard = 0_u32;
    while link.now() < end && link.trouble().is_none() {
        link.wait(end);
        while link.receive(0).is_some() {
            heard += 1;
        }
    }
    session.sound()?;
    match heard {
        0 => Ok(()),
        _ if listens_only => Ok(()),
        _ => Err(session.failed(&format!(
            "{heard} octets came before anything was sent: another master uses the line, or its rate is another one; end it first, or set \
             `listen_only = true`"
        ))),
    }
}

/// Asks every slave for its diagnosis and its configuration.
fn ask(session: &mut PortSession<Inverters>, ill_as_well: bool) -> Result<(), SessionError> {
    let listens_only = session.rig().port().is_some_and(|port| port.listen_only);
    let unknown = session.drives().slaves.iter().any(|own| own.ppo.is_none());
    if listens_only || !session.rig().file.health.before && !unknown {
        return Ok(());
    }
    let Inverters { slaves, patience } = session.drives().clone();
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
                let wrong = differs(&slave, &diagnosis, ppo.map(|own| own.number()));
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
        Err(why) if !ill_as_well => Err(session.failed(&why)),
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
fn ends(rig: &Rig, options: &Options) -> Result<(Ends, Vec<PortLock>), SessionError> {
    let port = rig
        .port()
        .ok_or_else(|| failed(rig, "it has no [port.1]"))?;
    if rig.is_simulated() {
        let lines = rig.file.sim.iter().flat_map(|sim| sim.setup.clone());
        let source = Source {
            name: rig.origin.clone(),
            text: lines.collect::<Vec<_>>().join("\n").into(),
        };
        let setup = setup(port, &source);
        let setup = setup.map_err(|problems| failed(rig, &problems.to_string()))?;
        return Ok((Ends::Simulated(Box::new(Bench::new(&setup))), Vec::new()));
    }
    let (endpoint, locks) = match (&port.serial, &port.tcp) {
        (Some(path), _) if is_pseudo_terminal(path) => (Endpoint::Pty(path.into()), true),
        (Some(path), _) => (Endpoint::Serial(path.into()), true),
        (None, Some(address)) => (Endpoint::Tcp(address.clone()), false),
        (None, None) => return Err(failed(rig, "its port has no adapter")),
    };
    let place = endpoint.to_string();
    let rate = rate(port);
    let wire = crate::port::open(&PortSettings {
        endpoint,
        format: rate.format(),
        marks: port.marks == Marks::InBand,
        low_latency: true,
    });
    options.unless_interrupted(rig)?;
    let wire = wire.map_err(|error| failed(rig, &error.to_string()))?;
    let lock = locks.then(|| {
        let lock = PortLock::acquire(wire.fd());
        lock.map_err(|error| failed(rig, &format!("{place}: {error}")))
    });
    let locks = lock.transpose()?.into_iter().collect();
    let addresses = slaves(port).iter().map(|own| own.address).collect();
    let how = (patience(port), port.echo);
    let link = SegmentLink::new(wire, rate, addresses, how, options.interrupt.clone());
    Ok((Ends::Ports(Box::new(link)), locks))
}

/// Whether a device is the end of a pseudo terminal, behind links such as those that `sim --pty` makes.
fn is_pseudo_terminal(path: &str) -> bool {
    let real = std::fs::canonicalize(path);
    real.is_ok_and(|own| own.starts_with("/dev/pts"))
}

/// How long a reply may take beside its own time on the line, with what an adapter and a busy computer add.
pub(super) fn patience_of(rig: &Rig, port: &Port) -> Span {
    match rig.is_simulated() {
        true => patience(port),
        false => patience(port) + TOLERANCE,
    }
}

/// How long a reply may take beside its own time on the line.
fn patience(port: &Port) -> Span {
    let nanos = u64::try_from(port.patience.0.as_nanos()).unwrap_or(u64::MAX);
    Span::from_nanos(nanos)
}
