//! What the tests of the master share: a master and a simulated ring, coupled in virtual time.

use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{Event, Job, JobId, Master, MasterOptions, Outcome, Phase};
use harness_proto::time::Instant;
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

/// A master, its ring, and all that went over the master's two links.
pub(crate) struct Couple<D = PlainDrive> {
    pub(crate) master: Master,
    pub(crate) ring: Ring<D>,
    /// What the master sent, with the times; nothing where it left a gap.
    pub(crate) sent: Vec<(Instant, Option<u8>)>,
    pub(crate) heard: Vec<Received>,
    pub(crate) events: Vec<(Instant, Event)>,
}

pub(crate) fn size(drives: u8) -> RingSize {
    RingSize::new(u64::from(drives)).expect("1 to 250")
}

impl Couple<PlainDrive> {
    /// Plain drives, and a master with these options.
    pub(crate) fn plain(drives: u8, options: MasterOptions) -> Self {
        Self::new(drives, options, |_| PlainDrive::default())
    }

    pub(crate) fn peek(&self, drive: u8, address: u16) -> u8 {
        let drive = self.ring.drive(drive).expect("a drive of the ring");
        drive.memory().peek(address)
    }

    pub(crate) fn poke(&mut self, drive: u8, address: u16, byte: u8) {
        let drive = self.ring.drive_mut(drive).expect("a drive of the ring");
        assert!(drive.memory_mut().poke(address, byte));
    }
}

impl<D: Device> Couple<D> {
    pub(crate) fn new(drives: u8, options: MasterOptions, device: impl FnMut(u8) -> D) -> Self {
        let ring = Ring::new(size(drives), Rate::Baud38400, device);
        Self::with(Master::new(size(drives), Rate::Baud38400, options), ring)
    }

    pub(crate) fn with(master: Master, mut ring: Ring<D>) -> Self {
        ring.stop_recording();
        Self {
            master,
            ring,
            sent: Vec::new(),
            heard: Vec::new(),
            events: Vec::new(),
        }
    }

    /// One byte time: what has come is taken, what is due is done, one byte goes out.
    pub(crate) fn step(&mut self) {
        let now = self.ring.now();
        while let Some(byte) = self.ring.receive() {
            if let Some(received) = byte.arrival() {
                self.master.handle_byte(byte.at, received);
                self.heard.push(received);
            }
        }
        if self.master.poll_timeout().is_some_and(|due| due <= now) {
            self.master.handle_timeout(now);
        }
        while let Some(event) = self.master.poll_event() {
            self.events.push((now, event));
        }
        let byte = self.master.poll_transmit(now);
        self.sent.push((now, byte));
        if let Some(byte) = byte {
            self.ring.send(now, &[byte]);
        }
        self.ring.run_until(now + self.ring.byte_time());
    }

    pub(crate) fn steps(&mut self, count: usize) {
        (0..count).for_each(|_| self.step());
    }

    /// Lets everything that is under way come back; the master is not asked for more.
    pub(crate) fn come_home(&mut self) {
        let most = usize::from(self.ring.size().drives()) + 4;
        for _ in 0..most {
            let now = self.ring.now();
            while let Some(byte) = self.ring.receive() {
                if let Some(received) = byte.arrival() {
                    self.master.handle_byte(byte.at, received);
                }
            }
            self.ring.run_until(now + self.ring.byte_time());
        }
    }

    /// Runs until the drives are counted.
    pub(crate) fn ready(mut self) -> Self {
        self.steps(usize::from(self.ring.size().drives()) + 6);
        assert_eq!(self.master.phase(), Phase::Running);
        assert_eq!(self.events.len(), 1);
        assert_eq!(self.events[0].1, Event::Ready);
        self.events.clear();
        self.sent.clear();
        self
    }

    pub(crate) fn submit(&mut self, job: Job) -> JobId {
        self.master.submit(job).expect("a job that can be done")
    }

    /// Runs until all jobs have ended, for at most `most` byte times.
    pub(crate) fn finish(&mut self, most: usize) {
        for _ in 0..most {
            if self.master.jobs() == 0 {
                break;
            }
            self.step();
        }
        while let Some(event) = self.master.poll_event() {
            self.events.push((self.ring.now(), event));
        }
        assert_eq!(self.master.jobs(), 0, "jobs after {most} byte times");
    }

    /// How a job ended.
    pub(crate) fn outcome(&self, id: JobId) -> Option<&Outcome> {
        self.events.iter().find_map(|(_, event)| match event {
            Event::Ended { id: found, outcome } if *found == id => Some(outcome),
            _ => None,
        })
    }

    /// The bytes that the master sent, gaps left out.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.sent.iter().filter_map(|(_, byte)| *byte).collect()
    }

    /// Whether no drive is in the error mode.
    pub(crate) fn healthy(&self) -> bool {
        let drives = self.ring.size().drives();
        (0..drives).all(|k| self.ring.drive(k).is_some_and(|drive| !drive.in_error()))
    }
}

/// The seed of every random test: `DRIVEBENCH_SEED`, or always the same.
pub(crate) fn seed() -> u64 {
    std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400)
}

/// The command that repeats a random failure.
pub(crate) fn repeat(test: &str) -> String {
    format!(
        "repeat with: DRIVEBENCH_SEED={} cargo test -p harness-sim-tests --test sim {test}",
        seed()
    )
}

/// A small generator of numbers (splitmix64): the same seed gives the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number below `limit`; `limit` is small, so that the bias does not matter.
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % limit.max(1)
    }
}
