//! `drivebench info`: which drives there are, and how they are.

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::cell::{CellFound, find};
use crate::driver::{Axis, Identity};
use crate::language::argument::{MemoryRange, cells};
use crate::language::scale::shown;
use harness_bench::command::drive::{InfoArguments, OutputForm};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::output::columns;
use harness_bench::command::progress::progress_bar;
use harness_bench::command::rig_name::Use;
use harness_bench::counted::counted;
use harness_proto::nd21::State;
use harness_proto::nd21::units::{Date, Scale, Value};
use serde_json::json;

/// Cells that show the state of a drive.
const CELLS: [&str; 4] = ["nist", "position", "TempKK", "TempMot"];

/// Number of drives whose EEPROM is read at a time.
const SIDE_BY_SIDE: usize = 25;

struct Drive<'a> {
    axis: Axis,
    identity: Identity,
    state: State,
    cells: Vec<CellFound<'a>>,
}

/// Shows drives.
pub(crate) fn info(arguments: &InfoArguments, output: &mut Output) -> Result<Exit, Failure> {
    rig::on(
        &arguments.rig,
        Use::look("info"),
        output,
        |bench, output| show(arguments, bench, output),
    )
}

fn show(
    arguments: &InfoArguments,
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axes = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
    let locations = cells(&CELLS.map(str::to_owned))?;
    // A long ring answers slowly, so show progress.
    let bar = progress_bar(axes.len(), output.progress);
    let mut drives = Vec::new();
    for some in axes.chunks(SIDE_BY_SIDE) {
        let identities = bench.bus.identities(some)?;
        for (axis, identity) in some.iter().zip(identities) {
            bar.set_message(format!("drive {axis}"));
            drives.push(drive(bench, *axis, identity, &locations)?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let corrected = bench.bus.corrected_errors();
    match arguments.format {
        OutputForm::Text => {
            let total = bench.bus.axes().len();
            let counts = format!(
                "{} on the bus, {} corrected\n",
                counted(total, "drive"),
                counted(corrected, "error")
            );
            output.result(&(output.fitted(&table(&drives)) + &counts))?;
        }
        OutputForm::Json => {
            let drives: Vec<_> = drives.iter().map(object).collect();
            let all = json!({"schema": 1, "corrected": corrected, "drives": drives});
            output.result(&format!("{all}\n"))?;
        }
    }
    Ok(Exit::Passed)
}

fn drive<'a>(
    bench: &OpenBench,
    axis: Axis,
    identity: Identity,
    locations: &'a [MemoryRange],
) -> Result<Drive<'a>, Failure> {
    let units = bench.units(axis)?;
    let found = locations
        .iter()
        .map(|location| find(&bench.bus, (axis, units), location));
    Ok(Drive {
        axis,
        identity,
        state: bench.bus.state(axis)?,
        cells: found.collect::<Result<_, _>>()?,
    })
}

fn day(date: Option<Date>) -> Option<String> {
    date.map(|date| shown(Value::Date(date), Scale::Date))
}

fn table(drives: &[Drive<'_>]) -> String {
    let heading = [
        "drive",
        "serial",
        "mode",
        "speed",
        "position",
        "cooler",
        "motor",
        "hours",
        "blocked",
        "started",
        "changed",
        "EE_Version",
        "error",
    ];
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let row = |drive: &Drive<'_>| {
        let value = |cell: usize| or_dash(drive.cells.get(cell).map(CellFound::value));
        let identity = &drive.identity;
        [
            drive.axis.to_string(),
            or_dash(identity.serial_number.map(|number| format!("{number:06}"))),
            drive.state.mode().to_owned(),
            value(0),
            value(1),
            value(2),
            value(3),
            format!("{} h", identity.hours.0),
            format!("{} h", identity.hours.1),
            or_dash(day(identity.start_up)),
            or_dash(day(identity.changed)),
            format!("{:02X}", identity.ee_version),
            or_dash(drive.state.error_in_words()),
        ]
    };
    columns(&heading, &drives.iter().map(row).collect::<Vec<_>>())
}

fn object(drive: &Drive<'_>) -> serde_json::Value {
    let value = |cell: usize| drive.cells.get(cell).map(CellFound::number);
    let identity = &drive.identity;
    let text = drive.state.error_in_words();
    let code = format!("{:04X}", drive.state.error);
    json!({
        "axis": drive.axis.to_string(),
        "serial_number": identity.serial_number,
        "mode": drive.state.mode(),
        "error": text.map(|text| json!({"code": code, "text": text})),
        "speed_rpm": value(0),
        "position_turns": value(1),
        "cooler_celsius": value(2),
        "motor_ohm": value(3),
        "hours": identity.hours.0,
        "hours_blocked": identity.hours.1,
        "start_up": day(identity.start_up),
        "changed": day(identity.changed),
        "ee_version": format!("{:02X}", identity.ee_version),
    })
}
