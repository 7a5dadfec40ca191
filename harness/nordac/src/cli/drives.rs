//! What the commands that all buses share ask of the drives of a port.

use super::bench::driver;
use super::info::{info, top};
use super::params::PARAMETERS;
use super::read::{ReadCell, find};
use crate::rig::{Inverters, OfNordac as _, RigSlave, Session};
use crate::value::{Assignment, Cell, cells};
use harness_bench::command::check::CheckedDrive;
use harness_bench::command::drives::{CommandDrives, DriveInfo};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::line_top::LineTop;
use harness_bench::command::output::Output;
use harness_bench::command::params::ParameterFile;
use harness_proto::profibus::dp::Diagnosis;
use serde_json::{Value, json};

impl CommandDrives for Inverters {
    type Cell = Cell;
    type Reading = ReadCell;
    type Parameter = Assignment;

    const PARAMETERS: ParameterFile<Self, Assignment> = PARAMETERS;
    const PLACE: &'static str = "parameter";
    const SILENT: &'static str = "does not reply";

    fn cells(texts: &[String]) -> Result<Vec<Cell>, String> {
        cells(texts)
    }

    fn read(
        session: &mut Session,
        slaves: &[u8],
        cells: &[Cell],
    ) -> Result<Vec<ReadCell>, Failure> {
        let mut driver = driver(session);
        let mut found = Vec::new();
        for slave in slaves {
            driver.join(*slave)?;
            found.extend(find(&mut driver, *slave, cells)?);
        }
        Ok(found)
    }

    fn info(
        session: &mut Session,
        slaves: &[u8],
        output: &mut Output,
    ) -> Result<(Vec<DriveInfo>, Exit), Failure> {
        info(session, slaves, output)
    }

    fn top(session: &Session) -> LineTop<Self> {
        top(session)
    }

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
    let ppo = slave.ppo.map(|ppo| ppo.number());
    let names: Vec<_> = diagnosis.names().collect();
    let object = json!({
        "address": slave.address, "ppo": ppo, "diagnosis": names, "master": diagnosis.master,
    });
    let exchanges = !diagnosis.has(Diagnosis::NOT_READY);
    let state = match diagnosis.master.filter(|_| exchanges) {
        None => "not in the exchange".to_owned(),
        Some(master) => format!("in the exchange with master {master}"),
    };
    let ppo = ppo.map_or("of no PPO type".to_owned(), |ppo| format!("PPO type {ppo}"));
    let names = names.join(", ");
    (object, format!("{ppo}, {state}; diagnosis: {names}"))
}
