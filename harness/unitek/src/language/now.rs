//! Steps that are done at once, beside the conversations of other masters.

use super::plan::Act;
use super::play::from_outside;
use super::syntax::DriveHarm;
use crate::simulate::Bench;
use harness_bench::link::{DriveFault, Link, Moment, PlacedFault};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::serve::ControlAnswer;
use harness_sim::unitek::Stimulus;

/// Does a step at once. No time passes and nothing is sent: faults, what happens to drives from outside the bus, and checks of registers.
/// If the frame of a fault has passed, the next one is meant.
///
/// # Errors
/// The check does not hold, or the step cannot be done at once.
pub(crate) fn now(bench: &mut Bench, act: &Act, span: TextSpan) -> Result<(), ControlAnswer> {
    match act {
        Act::Frame(number, fault) => {
            let number = (*number).max(bench.frames() + 1);
            bench.inject(0, PlacedFault::Frame(*fault), Moment::Byte(number));
        }
        Act::Harm(node, DriveHarm::Off) => power(bench, *node, &[DriveFault::Off]),
        Act::Harm(node, DriveHarm::On) => power(bench, *node, &[DriveFault::On]),
        Act::Restart(node) => power(bench, *node, &[DriveFault::Off, DriveFault::On]),
        Act::Harm(node, DriveHarm::BusOff) => outside(bench, *node, Stimulus::BusOff),
        Act::Outside(node, stimulus) => outside(bench, *node, *stimulus),
        Act::Register(node, wanted) => {
            let drive = bench
                .drive(*node)
                .ok_or(ControlAnswer::Error(ONLY.to_owned()))?;
            let compared = wanted.compare(span, drive.register(wanted.register));
            compared.map_err(|stop| ControlAnswer::No(stop.into_message()))?;
        }
        Act::Quiet | Act::Send(_) | Act::Read { .. } | Act::Driver(..) => {
            return Err(ControlAnswer::Error(ONLY.to_owned()));
        }
    }
    Ok(())
}

pub(crate) const ONLY: &str = "only faults (`!`), checks of registers (`? drive 1 register ...`) and what happens to drives (`drive ...`) can be \
                    done at once: the frames are the clients'";

fn power(bench: &mut Bench, node: u8, faults: &[DriveFault]) {
    for fault in faults {
        bench.inject(0, PlacedFault::Drive(node, *fault), Moment::Now);
    }
}

fn outside(bench: &mut Bench, node: u8, stimulus: Stimulus) {
    bench.inject(0, from_outside(node, stimulus), Moment::Now);
}
