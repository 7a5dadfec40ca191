//! `drivebench read` on UNITEK drives: registers with their units and bits.

use super::bench::scaling;
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives};
use crate::value::{bits, hex, registers, words};
use harness_bench::command::drive::{OutputForm, ReadArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::output::columns;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::units::{Scaling, usual};
use harness_proto::unitek::words::set_bits;
use harness_proto::unitek::{Data, Register};
use serde_json::json;

/// What was read of a register.
pub(super) struct Found {
    pub(super) axis: Axis,
    pub(super) reply: Reply,
    pub(super) scaling: Scaling,
}

impl Found {
    pub(super) fn register(&self) -> &'static Register {
        Register::of(self.reply.register)
    }

    pub(super) fn words(&self) -> String {
        words(&self.reply, self.scaling)
    }
}

/// Reads registers and shows them.
pub(super) fn read(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &ReadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let registers = registers(&arguments.cells).map_err(Failure::refused)?;
    on(
        bench,
        &arguments.rig,
        Use::look("read"),
        output,
        |session, output| {
            let drives = select(std::slice::from_ref(&arguments.drives), session)?;
            let found = find(session, &drives, &registers)?;
            match arguments.format {
                OutputForm::Text => output.result(&output.fitted(&table(&found)))?,
                OutputForm::Json => {
                    let registers: Vec<_> = found.iter().map(object).collect();
                    let whole = json!({"schema": 1, "registers": registers});
                    output.result(&format!("{whole}\n"))?;
                }
            }
            Ok(Exit::Passed)
        },
    )
}

/// Reads registers of drives.
pub(super) fn find(
    session: &mut Session,
    drives: &[Axis],
    registers: &[&'static Register],
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

/// Drive, number, name, digits, value or bits, place in the manual and meaning.
fn table(found: &[Found]) -> String {
    let row = |found: &Found| {
        let register = found.register();
        [
            found.axis.node.to_string(),
            format!("{:02X}", register.number),
            register.name.to_owned(),
            hex(found.reply.data),
            found.words(),
            register.origin.to_owned(),
            register.label.to_owned(),
        ]
    };
    let heading = ["drive", "reg", "name", "raw", "value", "origin", "label"];
    columns(&heading, &found.iter().map(row).collect::<Vec<_>>())
}

fn object(found: &Found) -> serde_json::Value {
    let register = found.register();
    let names = set_bits(bits(register.unit), found.reply.data.bits());
    json!({
        "drive": found.axis.node,
        "register": format!("{:02X}", register.number),
        "name": register.name,
        "raw": hex(found.reply.data),
        "number": found.reply.number(),
        "value": found.words(),
        "bits": names.map(|bit| bit.name).collect::<Vec<_>>(),
        "bytes": match found.reply.data { Data::Short(_) => 4, Data::Long(_) => 6 },
        "origin": register.origin,
    })
}
