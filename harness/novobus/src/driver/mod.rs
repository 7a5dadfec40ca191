//! The driver: what NOVOBUS.LIB did for a program, over any link (ND21 chapters 11, 12, 13.2).
//!
//! [`OpenRings`] opens one or two rings and hands out drives by their axis number ([`Axis`], 12.2). Its calls block,
//! each with a time-out; [`OpenRings::start`], [`OpenRings::test`] and [`OpenRings::result`] are the non-blocking form (11.6). A
//! `OpenRings` is a handle: clones of it may be used from several threads, and jobs of all of them go out pipelined.
//! Every function has the manual's name as an alias for the search of the documentation.
//!
//! The functions of several steps follow the manual's numbered steps, which the code cites.

mod access;
mod axis;
pub(crate) mod cell;
mod control;
mod discovery;
mod eeprom;
mod error;
mod exchange;
mod positioning;
mod pump;
mod scope;

pub(crate) use access::Width;
pub(crate) use axis::Axis;
pub(crate) use discovery::{COUNT, count_behind, unasked};
pub(crate) use discovery::{
    Identity, Recovery, SpelledOut, SpellingCause, count_drives, recover, recover_up_to,
};
pub(crate) use error::Error;
/// What a master may send, by the rules of the bus alone.
pub(crate) use harness_sim::novobus::fuzz::jobs::conduct;
pub(crate) use scope::{Measurement, ScopeSettings, Trigger};

use harness_bench::link::Line;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{self, Counters, Event, Job, JobId, Outcome, Phase, Refused};
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::deviation::MasterDeviation;
use pump::Masters;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How a bus works. All of it can be left at its default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    /// How the masters of the rings work.
    pub master: master::MasterOptions,
    /// How long a call waits for the end of its job, beside what the ring itself needs.
    pub patience: Span,
    /// How long a call of several steps waits for the drive: an EEPROM byte, a calculation.
    pub drive_patience: Span,
    /// How long it waits for a motion to end.
    pub motion_patience: Span,
    /// How the masters break the manual on purpose, for tests of what must find a wrong one.
    pub deviates: Option<&'static MasterDeviation>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            master: master::MasterOptions::default(),
            patience: Span::from_millis(5_000),
            drive_patience: Span::from_millis(5_000),
            motion_patience: Span::from_millis(60_000),
            deviates: None,
        }
    }
}

/// One or two open rings. Clones are handles of the same bus.
#[derive(Clone)]
pub(crate) struct OpenRings<'l> {
    pump: Arc<Mutex<Masters<'l>>>,
    options: Options,
}

/// The number of a job that was started: an order of NOVOBUS.LIB (11.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct OrderNumber {
    ring: usize,
    id: JobId,
}

impl<'l> OpenRings<'l> {
    /// Opens a bus with one ring or two over `link`; the drives are counted by the first telegram, and a
    /// ring of another size is an error.
    ///
    /// # Errors
    /// The rings do not answer, or have another number of drives.
    #[doc(alias = "InitNovobus1")]
    #[doc(alias = "InitNovobus2")]
    #[doc(alias = "NB_OpenBus1")]
    pub(crate) fn open(
        link: Box<dyn Line + 'l>,
        rings: &[RingSize],
        options: Options,
    ) -> Result<Self, Error> {
        let bus = Self {
            pump: Arc::new(Mutex::new(Masters::new(link, rings, &options))),
            options,
        };
        bus.wait_until_open()?;
        Ok(bus)
    }

    fn wait_until_open(&self) -> Result<(), Error> {
        let mut pump = self.lock();
        let began = pump.begin();
        loop {
            let end = pump.end(began, self.options.patience);
            if let Some(halt) = pump.halt() {
                return Err(halt);
            }
            if pump.phases().all(|phase| phase == Phase::Running) {
                return Ok(());
            }
            if pump.now() >= end {
                return Err(Error::TimeOut {
                    waited: self.options.patience,
                    what: "the ring to answer".to_owned(),
                });
            }
            pump.step(end);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Masters<'l>> {
        // A panic in another thread leaves masters and link as they are: each byte is done whole.
        self.pump.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Closes the bus: sends nothing more and waits until all bytes are back.
    #[doc(alias = "CloseNovobus")]
    #[doc(alias = "NB_CloseBus")]
    pub(crate) fn close(self) {
        let mut pump = self.lock();
        let end = pump.now() + self.options.patience;
        pump.drain(end);
    }

    /// SpellingCause nothing goes on any more, if so: a ring has been stopped (11.5), or the link carries nothing. Time may stand still then.
    #[must_use]
    pub(crate) fn halted(&self) -> Option<Error> {
        self.lock().halt()
    }

    /// How many errors were corrected since the bus was opened (11.5).
    #[doc(alias = "NB_BusError")]
    #[must_use]
    pub(crate) fn corrected_errors(&self) -> u64 {
        self.counters().iter().map(|ring| ring.corrected).sum()
    }

    /// What the master of each ring has done.
    #[must_use]
    pub(crate) fn counters(&self) -> Vec<Counters> {
        self.lock().counters()
    }

    /// Every axis of the bus, ring after ring.
    #[must_use]
    pub(crate) fn axes(&self) -> Vec<Axis> {
        let sizes = self.lock().sizes();
        sizes
            .iter()
            .enumerate()
            .flat_map(|(ring, size)| (0..size.drives()).filter_map(move |k| Axis::new(ring, k)))
            .collect()
    }

    /// The time on the clock of the link.
    #[must_use]
    pub(crate) fn now(&self) -> Instant {
        self.lock().now()
    }

    /// Lets the bus work for this long: what a program does while it waits for something else.
    pub(crate) fn run(&self, span: Span) {
        let mut pump = self.lock();
        let end = pump.now() + span;
        while pump.now() < end && pump.halt().is_none() {
            pump.pause();
            let due = pump.pause_due().unwrap_or(end);
            pump.pass(due.min(end));
        }
    }

    /// Keeps the line for some milliseconds without the caller: before he does something else that takes its time, such as drawing.
    /// Drives that watch for silence take 10 ms of it for an error (ND21 9.9).
    pub(crate) fn keep(&self) {
        self.lock().keep();
    }

    /// What happened on the way that no call reports: faults and recoveries, oldest first, in words.
    #[must_use]
    pub(crate) fn take_log(&self) -> Vec<String> {
        let several = self.lock().sizes().len() > 1;
        let words = |(ring, event): (usize, Event)| {
            let words = match event {
                Event::Disturbed { fault, attempt } => format!("recovery {attempt}: {fault}"),
                Event::Recovered { attempts } => {
                    format!("the ring is back after {attempts} recoveries")
                }
                Event::Stopped(stop) => stop.to_string(),
                Event::Ended { .. } | Event::Ready | Event::Round { .. } => return None,
            };
            let ring = several.then(|| format!("ring {}: ", ring + 1));
            Some(ring.unwrap_or_default() + &words)
        };
        self.take_events().into_iter().filter_map(words).collect()
    }

    /// The same as events, with the ring of each, counted from 0.
    #[must_use]
    pub(crate) fn take_events(&self) -> Vec<(usize, Event)> {
        self.lock().take_log()
    }

    /// Starts a job; its order is for [`Self::test`] and [`Self::result`].
    ///
    /// # Errors
    /// [`Error::Refused`] where the ring, the drive or the address does not exist, or too many jobs wait.
    #[doc(alias = "NB_StartReadByte")]
    #[doc(alias = "NB_StartReadWord")]
    pub(crate) fn start(
        &self,
        axis: Axis,
        job: impl FnOnce(u8) -> Job,
    ) -> Result<OrderNumber, Error> {
        let ring = axis.ring();
        let mut pump = self.lock();
        pump.pause();
        match pump.submit(ring, job(axis.drive())) {
            None => Err(Error::Value(format!("the bus has no ring {}", ring + 1))),
            // A bus that was stopped is not the job's fault.
            Some(Err(Refused::Stopped(stop))) => Err(Error::Stopped(stop)),
            Some(Err(refused)) => Err(Error::Refused(refused)),
            Some(Ok(id)) => Ok(OrderNumber { ring, id }),
        }
    }

    /// Waits for the end of a job and fetches its result, which can be fetched only once (11.6).
    ///
    /// # Errors
    /// [`Error::TimeOut`], [`Error::Unknown`], [`Error::Stopped`], or [`Error::NoSuchOrder`] for an order whose
    /// result has been fetched.
    #[doc(alias = "NB_Result")]
    pub(crate) fn result(&self, order: OrderNumber) -> Result<Option<u32>, Error> {
        value_of(self.outcome(order)?)
    }

    /// Waits for the end of a job and fetches its outcome, good or bad, which can be fetched only once.
    ///
    /// # Errors
    /// [`Error::TimeOut`], [`Error::Link`] or [`Error::NoSuchOrder`]: the job has not ended.
    pub(crate) fn outcome(&self, order: OrderNumber) -> Result<Outcome, Error> {
        let began = self.lock().begin();
        loop {
            let mut pump = self.lock();
            let end = pump.end(began, self.options.patience);
            if let Some(outcome) = pump.take(order.ring, order.id) {
                return Ok(outcome);
            }
            if !pump.knows(order.ring, order.id) {
                return Err(Error::NoSuchOrder);
            }
            if let Some(trouble) = pump.trouble() {
                pump.forget(order.ring, order.id);
                return Err(Error::Link(trouble));
            }
            if pump.now() >= end {
                pump.forget(order.ring, order.id);
                return Err(Error::TimeOut {
                    waited: self.options.patience,
                    what: "the end of a job".to_owned(),
                });
            }
            pump.step(end);
        }
    }

    /// Starts a job and waits for it.
    fn run_job(&self, axis: Axis, job: impl FnOnce(u8) -> Job) -> Result<Option<u32>, Error> {
        let order = self.start(axis, job)?;
        self.result(order)
    }
}

/// What a job read, or why it is unknown whether it ran.
fn value_of(outcome: Outcome) -> Result<Option<u32>, Error> {
    match outcome {
        Outcome::Read(data) => Ok(data.value()),
        Outcome::Done { .. } => Ok(None),
        Outcome::Unknown(fault) => Err(Error::Unknown(fault)),
        Outcome::Failed(stop) => Err(Error::Stopped(stop)),
    }
}
