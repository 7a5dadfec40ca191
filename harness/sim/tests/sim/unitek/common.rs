//! A desk: a host and a drive on one segment at 500 kbit/s.

use harness_proto::can::{BitRate, CanEvent};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Properties;
use harness_sim::record::LineFrame;
use harness_sim::segment::{Host, Segment};
use harness_sim::unitek::{Drive, Inputs};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// A host or a drive.
pub(super) type Member<D = Box<Drive>> = harness_sim::unitek::Member<D>;

/// Station 0 is the host, station 1 the drive.
pub(super) struct Desk {
    pub(super) segment: Segment<Member>,
    now: Instant,
}

impl Default for Desk {
    fn default() -> Self {
        Self::with(Properties::default())
    }
}

impl Desk {
    pub(super) fn with(properties: Properties) -> Self {
        Self::new(properties, Inputs::default(), &[])
    }

    pub(super) fn new(properties: Properties, inputs: Inputs, setup: &[(u8, u32)]) -> Self {
        let drive = Drive::new(properties, inputs, Instant::START).with_setup(setup);
        let stations = vec![
            Member::Host(Host::default()),
            Member::Drive(Box::new(drive)),
        ];
        Self {
            segment: Segment::new(BitRate::K500, stations),
            now: Instant::START,
        }
    }

    pub(super) fn host(&mut self) -> &mut Host {
        match self.segment.station_mut(0) {
            Member::Host(host) => host,
            Member::Drive(_) => panic!("station 0 is the host"),
        }
    }

    pub(super) fn drive(&mut self) -> &mut Drive {
        match self.segment.station_mut(1) {
            Member::Drive(drive) => drive,
            Member::Host(_) => panic!("station 1 is the drive"),
        }
    }

    /// Sends a frame, and gives what the drive sends within 2 ms.
    pub(super) fn ask(&mut self, frame: &str) -> Vec<String> {
        let now = self.now;
        self.host().send(now, frame.parse().expect("a frame"));
        self.wait(2)
    }

    /// What the drive sends within this many milliseconds.
    pub(super) fn wait(&mut self, millis: u64) -> Vec<String> {
        self.now += Span::from_millis(millis);
        self.segment.run_until(self.now);
        let mut heard = Vec::new();
        while let Some((_, what)) = self.host().receive() {
            match what {
                CanEvent::Frame(frame) => heard.push(frame.to_string()),
                CanEvent::Error(error) => heard.push(error.to_string()),
            }
        }
        heard
    }

    pub(super) fn inputs(&mut self, change: impl FnOnce(&mut Inputs)) {
        let now = self.now;
        let mut inputs = *self.drive().inputs();
        change(&mut inputs);
        self.drive().set_inputs(now, inputs);
    }

    pub(super) fn restart(&mut self) {
        let now = self.now;
        self.drive().restart(now);
    }

    pub(super) fn record(&self) -> &[LineFrame] {
        self.segment.record()
    }
}

/// Runs a property; a failure prints the seed and the command that repeats it.
pub(super) fn property<S: Strategy>(
    name: &str,
    cases: u32,
    strategy: &S,
    test: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(500_000);
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    if let Err(error) = TestRunner::new(config).run(strategy, test) {
        panic!(
            "{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-sim-tests --test sim {name}"
        );
    }
}
