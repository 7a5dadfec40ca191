//! Steps that are done at once, beside the conversations of other masters.

use super::Unitek;
use super::plan::Act;
use super::play::from_outside;
use super::syntax::DriveHarm;
use crate::simulate::Bench;
use harness_bench::link::{DriveFault, Link, Moment, PlacedFault};
use harness_bench::scenario::plan::{PlannedAction, PlannedStep, PlannedWhen};
use harness_sim::unitek::Stimulus;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum StepError {
    /// A check does not hold: what was found.
    Otherwise(String),
    /// It cannot be done at once: why.
    Refused(&'static str),
}

/// Does a step at once. No time passes and nothing is sent: faults, what happens to drives from outside the bus, and checks of registers.
/// If the frame of a fault has passed, the next one is meant.
///
/// # Errors
/// [`StepError`].
pub(crate) fn now(bench: &mut Bench, step: &PlannedStep<Unitek>) -> Result<(), StepError> {
    if step.when != PlannedWhen::Now {
        return Err(StepError::Refused(
            "a line is carried out at once: no time is allowed in front of it",
        ));
    }
    let PlannedAction::Own(act) = &step.action else {
        return Err(StepError::Refused(ONLY));
    };
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
            let drive = bench.drive(*node).ok_or(StepError::Refused(ONLY))?;
            let compared = wanted.compare(step.span, drive.register(wanted.register));
            compared.map_err(|stop| StepError::Otherwise(stop.into_message()))?;
        }
        Act::Quiet | Act::Send(_) | Act::Read { .. } | Act::Driver(..) => {
            return Err(StepError::Refused(ONLY));
        }
    }
    Ok(())
}

const ONLY: &str = "only faults (`!`), checks of registers (`? drive 1 register ...`) and what happens to drives (`drive ...`) can be \
                    done at once: the frames are the clients'";

fn power(bench: &mut Bench, node: u8, faults: &[DriveFault]) {
    for fault in faults {
        bench.inject(0, PlacedFault::Drive(node, *fault), Moment::Now);
    }
}

fn outside(bench: &mut Bench, node: u8, stimulus: Stimulus) {
    bench.inject(0, from_outside(node, stimulus), Moment::Now);
}
