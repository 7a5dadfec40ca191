//! Steps that are done at once, beside the conversations of other masters.

use super::plan::PlannedAct;
use crate::simulate::Bench;
use harness_bench::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::serve::ControlAnswer;

/// Does a step at once. No time passes and nothing is sent: faults, what happens to slaves from outside the bus, and checks of parameters. If the
/// octet or the telegram of a fault has passed, the next one of all stations is meant.
///
/// # Errors
/// The check does not hold, or the step cannot be done at once.
pub(crate) fn now(
    bench: &mut Bench,
    act: &PlannedAct,
    span: TextSpan,
) -> Result<(), ControlAnswer> {
    match act {
        PlannedAct::Fault(placed) => {
            let placed = bench.not_passed(*placed);
            let what = AnyStimulus::Line(placed);
            bench.inject(0, PlacedFault::Stimulus(0, what), Moment::Now);
        }
        PlannedAct::Power(slave, on) => {
            let fault = if *on { DriveFault::On } else { DriveFault::Off };
            bench.inject(0, PlacedFault::Drive(*slave, fault), Moment::Now);
        }
        PlannedAct::Restart(slave) => {
            for fault in [DriveFault::Off, DriveFault::On] {
                bench.inject(0, PlacedFault::Drive(*slave, fault), Moment::Now);
            }
        }
        PlannedAct::Outside(slave, stimulus) => {
            let what = AnyStimulus::Nordac(*stimulus);
            bench.inject(0, PlacedFault::Stimulus(*slave, what), Moment::Now);
        }
        PlannedAct::Parameter(slave, parameter, raw) => {
            let found = bench.parameter(*slave, parameter.known, parameter.index);
            let found = found.and_then(|found| parameter.known?.raw_of(found));
            let found = found.ok_or_else(|| {
                ControlAnswer::No(format!("slave {slave} has no {}", parameter.name()))
            })?;
            let compared = parameter.compare(span, found, *raw);
            compared.map_err(|stop| ControlAnswer::No(stop.into_message()))?;
        }
        PlannedAct::Quiet | PlannedAct::Job(..) => {
            return Err(ControlAnswer::Error(ONLY.to_owned()));
        }
    }
    Ok(())
}

pub(crate) const ONLY: &str = "only faults (`!`), checks of parameters (`? slave 8 parameter ...`) and what happens to slaves (`slave ...`) can be done at \
                    once: the telegrams are the clients'";
