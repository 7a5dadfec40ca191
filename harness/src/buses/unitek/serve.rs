//! Simulated UNITEK drives that clients share, in real time.

use super::simulate::{Bench, Setup};
use crate::serve::frames::{FrameJob, MOST_CLIENTS, SharedBus, serve_frames};
use crate::serve::{Answer, End, Host, ServeError};
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_sim::segment;
use harness_sim::unitek::Member;

/// Serves the drives of a setup until the job is done.
///
/// # Errors
/// A place cannot be opened, or the system fails.
pub(crate) fn serve(setup: &Setup, job: &FrameJob, host: &mut dyn Host) -> Result<End, ServeError> {
    serve_frames(shared(setup), job, host)
}

/// A bench with places for clients. Its own host neither sends nor acknowledges.
pub(crate) fn shared(setup: &Setup) -> Bench {
    let mut bench = Bench::with_guests(setup, MOST_CLIENTS);
    bench.segment.keep_no_record();
    if let Some(host) = bench.host() {
        *host = segment::Host::listener();
    }
    bench
}

impl Bench {
    /// The place of a client: behind the bench's host and the drives.
    fn guest(&self, client: usize) -> usize {
        1 + self.nodes.len() + client
    }
}

impl SharedBus for Bench {
    fn rate(&self) -> BitRate {
        self.segment.rate()
    }

    fn about(&self) -> String {
        let drives = crate::counted::counted(self.nodes.len() as u64, "drive");
        format!("{drives}, {}", self.segment.rate())
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn advance(&mut self, to: Instant) {
        while let Some(&(at, _)) = self.scheduled.front()
            && at <= to
        {
            self.run_to(at);
        }
        self.run_to(to);
        if let Some(host) = self.host() {
            host.forget();
        }
    }

    fn next_event(&self) -> Option<Instant> {
        let scheduled = self.scheduled.front().map(|(at, _)| *at);
        self.segment.next_event().into_iter().chain(scheduled).min()
    }

    fn host(&mut self, client: usize) -> Option<&mut segment::Host> {
        let place = self.guest(client);
        self.segment.station_mut(place).host_mut()
    }

    fn put(&mut self, client: usize, host: segment::Host) {
        let place = self.guest(client);
        *self.segment.station_mut(place) = Member::Host(host);
        self.segment.restart(place);
    }

    fn control(&mut self, _line: &str) -> Option<Answer> {
        None
    }
}
