//! What the commands that all buses share ask of the drives of a port.

use super::bench::scaling;
use super::info::{info, top};
use super::params::{PARAMETERS, RegisterValue};
use super::read::RegisterReading;
use crate::rig::{Axis, OfUnitek as _, Session, UnitekDrives};
use crate::value::registers;
use harness_bench::command::check::{CheckAnswer, CheckedDrive};
use harness_bench::command::drives::{CommandDrives, DriveInfo};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::line_top::LineTop;
use harness_bench::command::output::Output;
use harness_bench::command::params::ParameterFile;
use harness_proto::unitek::Register;
use harness_proto::unitek::units::{Scaling, usual};
use harness_proto::unitek::words::{ERRORS, set_bits};
use serde_json::json;

impl CommandDrives for UnitekDrives {
    type Cell = &'static Register;
    type Reading = RegisterReading;
    type Parameter = RegisterValue;

    const PARAMETERS: ParameterFile<Self, RegisterValue> = PARAMETERS;
    const PLACE: &'static str = "register";
    const SILENT: &'static str = "does not answer";

    fn cells(texts: &[String]) -> Result<Vec<Self::Cell>, String> {
        registers(texts)
    }

    fn read(
        session: &mut Session,
        drives: &[Axis],
        registers: &[Self::Cell],
    ) -> Result<Vec<RegisterReading>, Failure> {
        let mut driver = session.driver();
        let mut found = Vec::new();
        for &axis in drives {
            let mut units = registers.iter().map(|register| register.unit);
            let scaling = match units.any(|unit| usual(unit).is_some()) {
                true => scaling(&mut driver, axis)?,
                false => Scaling::default(),
            };
            for register in registers {
                let reply = driver.read(axis, register.number)?;
                found.push(RegisterReading {
                    axis,
                    reply,
                    scaling,
                });
            }
        }
        Ok(found)
    }

    fn info(
        session: &mut Session,
        drives: &[Axis],
        _: &mut Output,
    ) -> Result<(Vec<DriveInfo>, Exit), Failure> {
        Ok((info(session, drives)?, Exit::Passed))
    }

    fn top(session: &Session) -> LineTop<Self> {
        top(session)
    }

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
