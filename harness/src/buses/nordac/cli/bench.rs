//! The master of a bench.

use crate::buses::nordac::driver::{Driver, Options as Master, Timing};
use crate::buses::nordac::rig::{Session, rate};
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;

/// How often the master looks at a line in real time.
const STEP: Span = Span::from_micros(500);

/// The master of a bench.
pub(super) fn driver(session: &mut Session) -> Driver<'_> {
    let rate = session.rig().port().map_or(BusRate::default(), rate);
    let mut timing = Timing::simulated(rate);
    if !session.rig().is_simulated() {
        timing.patience = timing.patience + session.patience();
        timing.step = STEP;
    }
    let watchdog = Master::WATCHDOG;
    Driver::new(Box::new(session.link()), Master { timing, watchdog })
}
