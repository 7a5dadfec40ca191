//! The drives of a port, as the commands of all buses and a session use them.

use super::bench::scaling;
use super::params::{PARAMETERS, RegisterValue};
use super::read::Found;
use crate::rig::{Axis, OfUnitek as _, Player, Session, UnitekDrives};
use crate::value::registers;
use harness_bench::command::check::{CheckAnswer, CheckedDrive};
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::drives::CommandDrives;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::params::ParameterFile;
use harness_bench::command::port_bench::PortBench;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use harness_proto::unitek::units::{Scaling, usual};
use harness_proto::unitek::words::{ERRORS, set_bits};
use serde_json::json;

impl HeldDrives for UnitekDrives {
    const SPEED: &'static str = "SPEED_ACTUAL";

    type Player = Player;

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(bench, command, output)
    }

    fn pass(session: &mut Session, time: Span) -> Result<(), Failure> {
        Ok(session.driver().run(time)?)
    }
}

impl CommandDrives for UnitekDrives {
    type Cell = &'static Register;
    type Reading = Found;
    type Parameter = RegisterValue;

    const PARAMETERS: ParameterFile<Self, RegisterValue> = PARAMETERS;

    fn cells(texts: &[String]) -> Result<Vec<Self::Cell>, String> {
        registers(texts)
    }

    fn read(
        session: &mut Session,
        drives: &[Axis],
        registers: &[Self::Cell],
    ) -> Result<Vec<Found>, Failure> {
        let mut driver = session.driver();
        let mut found = Vec::new();
        for &axis in drives {
            let scaling = match registers.iter().any(|own| usual(own.unit).is_some()) {
                true => scaling(&mut driver, axis)?,
                false => Scaling::default(),
            };
            for register in registers {
                let reply = driver.read(axis, register.number)?;
                found.push(Found {
                    axis,
                    reply,
                    scaling,
                });
            }
        }
        Ok(found)
    }

    const SILENT: &'static str = "does not answer";

    fn check(session: &mut Session) -> Vec<CheckedDrive> {
        let mut checked = Vec::new();
        for axis in session.axes().to_vec() {
            checked.push(CheckedDrive {
                name: format!("drive {} ({:03X}, {:03X})", axis.node, axis.rx, axis.tx),
                answer: (!session.listens_only()).then(|| ask(session, axis)),
            });
        }
        checked
    }
}

fn ask(session: &mut Session, axis: Axis) -> CheckAnswer {
    let mut driver = session.driver();
    let mut read = |register| Ok::<_, Failure>(driver.read(axis, register)?.data.bits());
    let (version, ready, errors) = (read(0x1B)?, read(0xE2)? & 1 == 1, read(0x8F)?);
    let names: Vec<_> = set_bits(ERRORS, errors).map(|bit| bit.name).collect();
    let object = json!({
        "node": axis.node, "rx": axis.rx, "tx": axis.tx, "firmware": version, "ready": ready, "errors": names,
    });
    let ready = if ready { "ready" } else { "not ready" };
    let errors = match names.is_empty() {
        true => "no errors".to_owned(),
        false => format!("errors {}", names.join(" ")),
    };
    Ok((object, format!("firmware {version}, {ready}, {errors}")))
}
