//! The drives of a port, as the commands of all buses and a session use them.

use super::bench::driver;
use super::params::PARAMETERS;
use super::read::{Found, find};
use crate::rig::{Inverters, OfNordac as _, Player, RigSlave, Session};
use crate::value::{Assignment, Cell, cells};
use harness_bench::command::check::CheckedDrive;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::drives::CommandDrives;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::params::ParameterFile;
use harness_bench::command::port_bench::PortBench;
use harness_bench::link::Line;
use harness_proto::profibus::dp::Diagnosis;
use harness_proto::time::Span;
use serde_json::{Value, json};

impl HeldDrives for Inverters {
    const SPEED: &'static str = "HIW";

    type Player = Player;

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(bench, command, output)
    }

    fn pass(session: &mut Session, time: Span) -> Result<(), Failure> {
        let mut driver = driver(session);
        if driver.slaves().next().is_some() {
            return Ok(driver.run(time)?);
        }
        drop(driver);
        let link = session.link();
        let end = link.now() + time;
        while link.now() < end && link.wait(end) {}
        Ok(())
    }

    fn forget(&self) {
        *self
            .parked
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner) = None;
    }
}

impl CommandDrives for Inverters {
    type Cell = Cell;
    type Reading = Found;
    type Parameter = Assignment;

    const PARAMETERS: ParameterFile<Self, Assignment> = PARAMETERS;

    fn cells(texts: &[String]) -> Result<Vec<Cell>, String> {
        cells(texts)
    }

    fn read(session: &mut Session, slaves: &[u8], cells: &[Cell]) -> Result<Vec<Found>, Failure> {
        let mut driver = driver(session);
        let mut found = Vec::new();
        for slave in slaves {
            driver.join(*slave)?;
            found.extend(find(&mut driver, *slave, cells)?);
        }
        Ok(found)
    }

    const SILENT: &'static str = "does not reply";

    fn check(session: &mut Session) -> Vec<CheckedDrive> {
        let listens = session.listens_only();
        let slaves = session.slaves().to_vec();
        let mut talk = session.talk();
        let mut checked = Vec::new();
        for slave in slaves {
            let address = slave.address;
            talk.restart(address);
            let asked = (!listens).then(|| talk.diagnose(address));
            checked.push(CheckedDrive {
                name: format!("slave {address}"),
                answer: asked.map(|asked| match asked {
                    Ok(diagnosis) => Ok(answer(slave, &diagnosis)),
                    Err(error) => Err(Failure::Bus(Exit::Failed, error.to_string())),
                }),
            });
        }
        checked
    }
}

/// What a slave has answered, for tools and in words.
fn answer(slave: RigSlave, diagnosis: &Diagnosis) -> (Value, String) {
    let ppo = slave.ppo.map(|own| own.number());
    let names: Vec<_> = diagnosis.names().collect();
    let object = json!({
        "address": slave.address, "ppo": ppo, "diagnosis": names, "master": diagnosis.master,
    });
    let exchanges = !diagnosis.has(Diagnosis::NOT_READY);
    let state = match diagnosis.master.filter(|_| exchanges) {
        None => "not in the exchange".to_owned(),
        Some(master) => format!("in the exchange with master {master}"),
    };
    let ppo = ppo.map_or("of no PPO type".to_owned(), |own| format!("PPO type {own}"));
    let names = names.join(", ");
    (object, format!("{ppo}, {state}; diagnosis: {names}"))
}
