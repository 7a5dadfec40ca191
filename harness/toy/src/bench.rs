//! The bench: the bus as a scenario sees it, in virtual time.

use crate::valve::Valve;
use harness_bench::link::bench_clock::BenchClock;
use harness_bench::link::{Capability, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_sim::participant::Participant;
use harness_sim::record::{Channel, LineFrame, Trace};
use harness_sim::segment::{Host, Segment, Station as _};
use std::any::Any;

/// The bench's own host is at place 0, valve `k` of the list at place `k + 1`.
const BENCH: usize = 0;
const RATE: BitRate = BitRate::K500;

/// A simulated segment with valves.
#[derive(Debug)]
pub(crate) struct Bench {
    segment: Segment<Participant<Host, Valve>>,
    valves: Vec<u8>,
    clock: BenchClock,
}

impl Bench {
    /// A bench with these valves; true for one that sticks.
    pub(crate) fn new(valves: &[(u8, bool)]) -> Self {
        let host = Participant::Host(Host::default());
        let station =
            |&(number, sticks): &(u8, bool)| Participant::Drive(Valve::new(number, sticks));
        let stations = std::iter::once(host).chain(valves.iter().map(station));
        Self {
            segment: Segment::new(RATE, stations.collect()),
            valves: valves.iter().map(|valve| valve.0).collect(),
            clock: BenchClock::default(),
        }
    }

    /// How far a valve is open, beside the bus.
    pub(crate) fn place(&self, valve: u8) -> Option<u8> {
        let place = self.valves.iter().position(|known| *known == valve)?;
        let station = self.segment.station(place + 1);
        station.drive().map(|drive| drive.place)
    }

    fn host(&mut self) -> Option<&mut Host> {
        self.segment.station_mut(BENCH).host_mut()
    }

    fn heard_at(&self) -> Option<Instant> {
        self.segment.station(BENCH).host().and_then(Host::heard_at)
    }

    fn run_to(&mut self, at: Instant) {
        self.segment.run_until(at);
        self.clock.now = self.clock.now.max(at);
    }
}

impl Line for Bench {
    fn medium(&self, _port: usize) -> Medium {
        Medium::Frames(RATE)
    }

    fn now(&self) -> Instant {
        self.clock.since_origin(self.clock.now)
    }

    fn send(&mut self, _port: usize, what: Out<'_>) -> Instant {
        let now = self.clock.now;
        let free = self.clock.left.max(now).max(self.segment.free_at());
        self.clock.left = free + self.medium(0).time_of(what);
        if let Some(host) = self.host() {
            what.frames()
                .iter()
                .for_each(|frame| host.send(now, *frame));
        }
        self.clock.since_origin(self.clock.left)
    }

    fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
        let now = self.clock.now;
        self.heard_at().filter(|at| *at <= now)?;
        let (at, heard) = self.host()?.receive()?;
        Some((self.clock.since_origin(at), HeardPiece::Frame(heard)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let until = self.clock.on_bench(until);
        let heard = self.heard_at().filter(|at| *at > self.clock.now);
        let next = [heard, self.segment.next_event()]
            .into_iter()
            .flatten()
            .min();
        self.run_to(next.unwrap_or(until).min(until));
        next.is_some()
    }
}

impl Link for Bench {
    fn capabilities(&self) -> &[Capability] {
        &[Capability::Simulator]
    }

    fn begin(&mut self) {
        self.clock.begin();
        self.segment.begin();
        if let Some(host) = self.host() {
            host.forget();
        }
    }

    fn busy(&self) -> bool {
        let host = self.segment.station(BENCH).host();
        let sends = host.is_some_and(|host| host.waiting() > 0);
        let hears = self.heard_at().is_some_and(|at| at > self.clock.now);
        let mut valves = (1..=self.valves.len()).filter_map(|k| self.segment.station(k).drive());
        sends || hears || valves.any(|valve| valve.wants().is_some())
    }

    fn inject(&mut self, _port: usize, _fault: PlacedFault, _moment: Moment) {}

    fn beside(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn carried(&self) -> u64 {
        self.segment.frames()
    }

    fn drives(&self, _port: usize) -> u8 {
        u8::try_from(self.valves.len()).unwrap_or(u8::MAX)
    }

    fn trace(&self, port: usize) -> Trace {
        let sender = |frame: &LineFrame| LineFrame {
            from: frame
                .from
                .and_then(|place| self.valves.get(usize::from(place).checked_sub(1)?))
                .copied(),
            ..*frame
        };
        let frames = self.segment.record().iter().map(sender).collect();
        let mut trace = Trace {
            channels: vec![Channel::of_frames(frames)],
            ..Trace::empty(self.drives(port))
        };
        trace.count_from(self.clock.origin().since_start());
        trace
    }
}
