//! What a master reports, and what it counts.

use super::fault::{BusStop, Fault};
use super::job::{JobId, Outcome};
use alloc::collections::VecDeque;

/// The most events, results not counted, that wait to be fetched.
const MOST_EVENTS: usize = 64;

/// Something to report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The ring answers and has as many drives as it should; jobs go out from now on.
    Ready,
    /// A job has ended. There is one of these for each job.
    Ended {
        /// The job.
        id: JobId,
        /// How it ended.
        outcome: Outcome,
    },
    /// All drives of the cyclic exchange have answered. If several rounds end before the event is fetched, they
    /// are reported once, with the last number.
    Round {
        /// How many rounds there have been since the master was made.
        number: u64,
    },
    /// Something went wrong, and this is what. A check sequence follows, or the end of the bus.
    Disturbed {
        /// What.
        fault: Fault,
        /// The first recovery from this disturbance is 1.
        attempt: u8,
    },
    /// The ring is back, and what was not done is repeated.
    Recovered {
        /// How many recoveries it took.
        attempts: u8,
    },
    /// The bus has been stopped; nothing more is sent.
    Stopped(BusStop),
}

/// What a master has done since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes sent.
    pub sent: u64,
    /// SYNCO and PAUSE among them.
    pub idle: u64,
    /// Telegrams begun, that which counts the drives among them (ND21 9.1).
    pub telegrams: u64,
    /// Bytes received.
    pub received: u64,
    /// Bytes received with a line error: parity, framing, break, overrun.
    pub line_errors: u64,
    /// Jobs that ran.
    pub done: u64,
    /// Jobs that had to be sent again, once for each time.
    pub repeated: u64,
    /// Rounds of the cyclic exchange.
    pub rounds: u64,
    /// Times at which something went wrong.
    pub disturbed: u64,
    /// Times at which it was put right: the figure of `NB_BusError` (ND21 11.5, 12.1).
    pub corrected: u64,
    /// Events that were dropped because they were not fetched in time. Results are never dropped.
    pub lost_events: u64,
}

/// Events that wait to be fetched: bounded.
#[derive(Clone, Debug, Default)]
pub(super) struct Events {
    waiting: VecDeque<Event>,
    results: usize,
    round: Option<u64>,
}

impl Events {
    /// How many results wait to be fetched.
    pub(super) fn results(&self) -> usize {
        self.results
    }

    /// Adds a result. Their number is bounded by the capacity for jobs.
    pub(super) fn ended(&mut self, id: JobId, outcome: Outcome) {
        self.results += 1;
        self.waiting.push_back(Event::Ended { id, outcome });
    }

    /// Adds any other event; false where there is no room.
    pub(super) fn add(&mut self, event: Event) -> bool {
        let room = self.waiting.len() - self.results < MOST_EVENTS;
        if room {
            self.waiting.push_back(event);
        }
        room
    }

    /// A round has ended.
    pub(super) fn round(&mut self, number: u64) {
        self.round = Some(number);
    }

    pub(super) fn next(&mut self) -> Option<Event> {
        let event = self.waiting.pop_front();
        if matches!(event, Some(Event::Ended { .. })) {
            self.results -= 1;
        }
        event.or_else(|| self.round.take().map(|number| Event::Round { number }))
    }
}
