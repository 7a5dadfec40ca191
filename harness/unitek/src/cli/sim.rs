//! `drivebench sim --bus unitek`: simulated drives on a CAN bus that its clients share.

use crate::serve::{bench, serve};
use harness_bench::bus::Served;
use harness_bench::bus_name::BusName;
use harness_bench::command::output::Output;
use harness_bench::command::sim::{SimArguments, SimSpeed, header, options, refuse};
use harness_bench::medium::ErrorMarks;

pub(crate) fn sim(arguments: &SimArguments, output: &mut Output) -> Served {
    let rings = [
        ("--tcp", !arguments.tcp.is_empty()),
        ("--pty", !arguments.pty.is_empty()),
        ("--tap", !arguments.tap.is_empty()),
        ("--cut", !arguments.cut.is_empty()),
        ("--pace", arguments.pace != SimSpeed::Line),
        ("--marks", arguments.marks != ErrorMarks::None),
        ("--slaves", arguments.frames.slaves.is_some()),
        ("--rig", arguments.rig.rig.is_some()),
    ];
    refuse(
        BusName::Unitek,
        &rings,
        "--slcan, --slcan-pty or --socketcand, and --drives",
    )?;
    let options = options(arguments, arguments.frames.places());
    let plan = bench(arguments.frames.drives, header(arguments)?.as_ref())?;
    Ok(serve(plan, &options, output))
}
