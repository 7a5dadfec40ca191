//! `drivebench sim --bus nordac`: simulated slaves, a place for each master.

use crate::serve::{SegmentServer, bench};
use harness_bench::bus::Served;
use harness_bench::bus_name::BusName;
use harness_bench::command::output::Output;
use harness_bench::command::sim::{SimArguments, SimSpeed, header, options, places, refuse};
use harness_bench::serve::serve;

/// Serves slaves: every place is a master's.
pub(crate) fn sim(arguments: &SimArguments, output: &mut Output) -> Served {
    let others = [
        ("--tap", !arguments.tap.is_empty()),
        ("--cut", !arguments.cut.is_empty()),
        ("--pace", arguments.pace != SimSpeed::Line),
        ("--drives", arguments.frames.drives.is_some()),
        (
            "--slcan and --socketcand",
            !arguments.frames.places().is_empty(),
        ),
        ("--rig", arguments.rig.rig.is_some()),
    ];
    refuse(
        BusName::Nordac,
        &others,
        "--tcp or --pty, a place for each master, and --slaves",
    )?;
    let options = options(arguments, places(arguments, 1).collect());
    let plan = bench(
        arguments.frames.slaves.as_deref(),
        header(arguments)?.as_ref(),
    )?;
    let server = SegmentServer::new(plan, options.places.len(), arguments.marks);
    Ok(serve(server, &options, output))
}
