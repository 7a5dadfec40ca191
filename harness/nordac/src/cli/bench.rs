//! The master of a bench.

use crate::driver::{Driver, Options, Timing};
use crate::rig::OfNordac as _;
use crate::rig::interlock::InverterInterlock;
use crate::rig::{Session, rate};
use harness_bench::link::Line;
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::profibus::BusRate;
use harness_proto::time::{Instant, Span};
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, PoisonError};

/// How often the master looks at a line in real time.
const STEP: Span = Span::from_micros(500);

/// Where the master of a bench is kept between two requests.
pub(crate) type ParkedDriver = Arc<Mutex<Option<Driver<'static>>>>;

/// The master of a bench while a request uses it. It is kept with its slaves for the next request.
pub(super) struct Master<'l> {
    driver: Driver<'l>,
    options: Options,
    parked: ParkedDriver,
}

impl<'l> Deref for Master<'l> {
    type Target = Driver<'l>;

    fn deref(&self) -> &Driver<'l> {
        &self.driver
    }
}

impl DerefMut for Master<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.driver
    }
}

impl Drop for Master<'_> {
    fn drop(&mut self) {
        let none = Driver::new(Box::new(UnpluggedLine), self.options);
        let driver = std::mem::replace(&mut self.driver, none).onto(Box::new(UnpluggedLine));
        *self.parked.lock().unwrap_or_else(PoisonError::into_inner) = Some(driver);
    }
}

/// The line of a master that is kept: it carries nothing.
struct UnpluggedLine;

impl Line for UnpluggedLine {
    fn medium(&self, _port: usize) -> Medium {
        harness_proto::line::Rate::default().into()
    }

    fn now(&self) -> Instant {
        Instant::START
    }

    fn send(&mut self, _port: usize, _what: Out<'_>) -> Instant {
        Instant::START
    }

    fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
        None
    }

    fn wait(&mut self, _until: Instant) -> bool {
        false
    }
}

/// The master of a bench, as the last request has left it.
pub(super) fn driver(session: &mut Session) -> Master<'_> {
    let rate = session.rig().port().map_or(BusRate::default(), rate);
    let mut timing = Timing::simulated(rate);
    if !session.rig().is_simulated() {
        timing.patience = timing.patience + session.patience();
        timing.late = session.patience();
        timing.step = STEP;
    }
    let watchdog = Options::WATCHDOG;
    let options = Options { timing, watchdog };
    let interlocks = InverterInterlock::parameters(session.rig());
    let parked = Arc::clone(&session.drives().parked);
    let kept = parked.lock().unwrap_or_else(PoisonError::into_inner).take();
    let line = Box::new(session.link());
    Master {
        driver: match kept {
            Some(driver) => driver.onto(line),
            None => {
                let mut driver = Driver::new(line, options);
                driver.watch(interlocks);
                driver
            }
        },
        options,
        parked,
    }
}
