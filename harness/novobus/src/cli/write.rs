//! `drivebench write`: cells of drives are set, read back and shown.

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::Axis;
use crate::driver::cell::{self, CellFound, find, hex};
use crate::language::argument::{MemoryKind, MemoryRange, assignments, encode};
use crate::language::syntax::Written;
use harness_bench::command::drive::WriteArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::Use;
use harness_proto::nd21::bits::status;
use harness_proto::nd21::ram;

/// The cells with which a master orders a motion of a drive in go.
const ORDERS: [u16; 7] = [
    ram::NSOLL,
    ram::UMDRSOLL,
    ram::LAGESOLL,
    ram::PS_STATUS,
    ram::FLAGS2,
    ram::AS_COMMAND,
    ram::STATUS,
];

/// What is to be written into a drive.
pub(crate) struct Orders {
    axis: Axis,
    cells: Vec<(MemoryRange, Vec<u8>)>,
}

impl Orders {
    /// Resolves the values of a command line for a drive. Values that can make its motor turn need a permission.
    pub(crate) fn new(
        bench: &OpenBench,
        axis: Axis,
        (texts, values): (&[String], &[(MemoryRange, Written)]),
        leave: bool,
        output: &mut Output,
    ) -> Result<Self, Failure> {
        let bytes = encode(texts, values, bench.units(axis)?)?;
        let locations = values.iter().map(|(location, _)| location.clone());
        let orders = Self {
            axis,
            cells: locations.zip(bytes).collect(),
        };
        if let Some(reason) = orders.turns(bench)? {
            let warning = format!("{reason}: its motor can turn");
            if !leave {
                return Err(Failure::refused(format!(
                    "{warning}; nothing was written, add --move to allow it"
                )));
            }
            output.say(&format!("{warning}\n"));
        }
        Ok(orders)
    }

    /// Why the motor can turn, if it can.
    fn turns(&self, bench: &OpenBench) -> Result<Option<String>, Failure> {
        let mode = bench.bus.state(self.axis)?.mode();
        for (location, bytes) in &self.cells {
            let first = location.address();
            let last = first.saturating_add(u16::try_from(bytes.len()).unwrap_or(u16::MAX) - 1);
            let reaches = |order: &u16| (first..=last).contains(order);
            if location.memory != MemoryKind::Ram || !ORDERS.iter().any(reaches) {
                continue;
            }
            let name = location.name();
            if reaches(&ram::STATUS) {
                let set = bytes.get(usize::from(ram::STATUS - first)).copied();
                if set.is_none_or(|byte| byte & (status::BLOCK | status::STOP) == 0) {
                    let text = format!("drive {} is in {mode}, and {name} releases it", self.axis);
                    return Ok(Some(text));
                }
            } else if mode == "go" {
                let text = format!("drive {} is in go, and {name} orders a motion", self.axis);
                return Ok(Some(text));
            }
        }
        Ok(None)
    }

    /// Writes all of it, in order.
    pub(crate) fn write(&self, bench: &OpenBench) -> Result<(), Failure> {
        for (location, bytes) in &self.cells {
            cell::write(&bench.bus, self.axis, location, bytes)?;
        }
        Ok(())
    }
}

/// Writes cells and shows them before and after.
pub(crate) fn write(arguments: &WriteArguments, output: &mut Output) -> Result<Exit, Failure> {
    let values = assignments(&arguments.values)?;
    let what = Use::new("write", arguments.leave, arguments.hold.hold);
    rig::on(&arguments.rig, what, output, |bench, output| {
        change(arguments, &values, bench, output)
    })
}

fn change(
    arguments: &WriteArguments,
    values: &[(MemoryRange, Written)],
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let drives = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
    let mut orders = Vec::new();
    for axis in drives {
        let texts = (&arguments.values[..], values);
        orders.push(Orders::new(bench, axis, texts, arguments.leave, output)?);
    }
    let mut exit = Exit::Passed;
    for orders in &orders {
        for (location, bytes) in &orders.cells {
            let drive = (orders.axis, bench.units(orders.axis)?);
            let before = find(&bench.bus, drive, location)?;
            cell::write(&bench.bus, orders.axis, location, bytes)?;
            // A write may have changed the scale itself (14.3.2).
            let drive = (orders.axis, bench.units(orders.axis)?);
            let after = find(&bench.bus, drive, location)?;
            let line = format!(
                "drive {} {}: {} -> {}\n",
                orders.axis,
                location.name(),
                before.text(),
                after.text()
            );
            output.result(&line)?;
            if !holds(&after, bytes) {
                output.complain(&format!(
                    "drive {} {} holds {} where {} was written",
                    orders.axis,
                    location.name(),
                    after.raw(),
                    hex(bytes)
                ));
                exit = Exit::Failed;
            }
        }
    }
    Ok(exit)
}

/// Whether what was found is what was written, but for the bits that are read only (14.2.1).
fn holds(found: &CellFound<'_>, written: &[u8]) -> bool {
    let fixed = found.location.cell().map_or(0, |cell| cell.read_only_bits);
    let mut pairs = found.bytes.iter().zip(written);
    pairs.all(|(found, written)| (found ^ written) & !fixed == 0)
}
