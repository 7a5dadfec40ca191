//! The master against the simulated drive on a segment, with and without faults.

use super::common::Desk;
use harness_proto::can::{CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::master::{
    CanMaster, Disturbance, Job, JobRefusal, MasterEvent, Options, Outcome,
};
use harness_proto::unitek::properties::{Properties, Setting, UnitekProperty};
use harness_proto::unitek::{Data, Reply};
use harness_sim::segment::{FrameFault, Placed};
use harness_sim::unitek::Inputs;

/// A master at the desk's host.
struct Bench {
    desk: Desk,
    master: CanMaster,
    now: Instant,
    events: Vec<MasterEvent>,
}

impl Bench {
    fn new(properties: Properties) -> Self {
        Self {
            desk: Desk::with(properties),
            master: CanMaster::new(0x201, 0x181, Options::default()),
            now: Instant::START,
            events: Vec::new(),
        }
    }

    /// Runs for this many milliseconds in steps of 50 us.
    fn run(&mut self, millis: u64) {
        let end = self.now + Span::from_millis(millis);
        while self.now < end {
            if let Some(frame) = self.master.poll_transmit(self.now) {
                let now = self.now;
                self.desk.host().send(now, frame);
            }
            self.now += Span::from_micros(50);
            self.desk.segment.run_until(self.now);
            while let Some((at, heard)) = self.desk.host().receive() {
                if let CanEvent::Frame(frame) = heard {
                    self.master.handle_frame(at, &frame);
                }
            }
            if self.master.poll_timeout().is_some_and(|at| at <= self.now) {
                self.master.handle_timeout(self.now);
            }
            self.events
                .extend(std::iter::from_fn(|| self.master.poll_event()));
        }
    }

    /// Runs a job to its end.
    fn job(&mut self, job: Job) -> Outcome {
        let id = self.master.submit(job).expect("room");
        for _ in 0..10_000 {
            self.run(1);
            let ended = self.events.iter().find_map(|event| match event {
                MasterEvent::Ended { id: ended, outcome } if *ended == id => Some(*outcome),
                _ => None,
            });
            if let Some(outcome) = ended {
                return outcome;
            }
        }
        panic!("{job:?} does not end");
    }

    fn disturbances(&self) -> Vec<Disturbance> {
        let disturbance = |event: &MasterEvent| match event {
            MasterEvent::Disturbance(disturbance) => Some(*disturbance),
            _ => None,
        };
        self.events.iter().filter_map(disturbance).collect()
    }

    fn fault(&mut self, station: usize, frame: u64, fault: FrameFault) {
        self.desk.segment.inject(Placed {
            station: Some(station),
            frame,
            fault,
        });
    }
}

fn write(register: u8, value: u16) -> Job {
    Job::Write {
        register,
        data: Data::Short(value),
    }
}

fn reply(register: u8, data: Data) -> Reply {
    Reply {
        register,
        data,
        stuff: 0,
    }
}

/// 40 with 4 bytes and with 6: both end the request.
#[test]
fn replies_of_both_widths() {
    let mut bench = Bench::new(Properties::default());
    assert_eq!(
        bench.job(Job::Read { register: 0x40 }),
        Outcome::Read(reply(0x40, Data::Short(0x0101)))
    );
    let mut bench = Bench::new(Properties {
        map_reply: harness_proto::unitek::properties::MapReply::Native,
        ..Properties::default()
    });
    assert_eq!(
        bench.job(Job::Read { register: 0x40 }),
        Outcome::Read(reply(0x40, Data::Long(0x0101)))
    );
    assert_eq!(bench.disturbances(), []);
}

/// A write is read back: it holds, is refused by a read only register, or cannot be known.
#[test]
fn writes_are_read_back() {
    let mut bench = Bench::new(Properties::default());
    assert_eq!(
        bench.job(write(0x31, 3277)),
        Outcome::Written(reply(0x31, Data::Short(3277)))
    );
    let position = Data::Long(3_000_000);
    assert_eq!(
        bench.job(Job::Write {
            register: 0x6E,
            data: position
        }),
        Outcome::Written(reply(0x6E, position))
    );
    assert_eq!(
        bench.job(write(0xCE, 1)),
        Outcome::Sent,
        "read only: nothing to read back"
    );
    assert_eq!(bench.job(write(0x8E, 0)), Outcome::Sent);
    // The write is lost on the bus: frame 6 of the host (3 writes, 2 reads, 8E = 7 frames so far).
    bench.fault(0, 7, FrameFault::Lost);
    let lost = bench.job(write(0x31, 100));
    assert_eq!(
        lost,
        Outcome::Differs {
            wrote: Data::Short(100),
            reads: reply(0x31, Data::Short(3277))
        }
    );
}

/// A lost request or reply is asked again; a drive that never answers is reported with the number of tries.
#[test]
fn requests_without_a_reply() {
    for (station, frame) in [(0, 1), (1, 1)] {
        let mut bench = Bench::new(Properties::default());
        bench.fault(station, frame, FrameFault::Lost);
        assert!(matches!(
            bench.job(Job::Read { register: 0x1B }),
            Outcome::Read(_)
        ));
        assert!(bench.now.since_start() >= Span::from_millis(20));
    }
    let mut silent = Properties::default();
    assert!(
        UnitekProperty::of("unknown-register")
            .unwrap()
            .set(&mut silent, Setting::Word("silent"))
    );
    let mut bench = Bench::new(silent);
    assert_eq!(
        bench.job(Job::Read { register: 0x81 }),
        Outcome::NoReply { tries: 3 }
    );
    assert!(
        matches!(bench.job(Job::Read { register: 0x1B }), Outcome::Read(_)),
        "the next job runs"
    );
    // A doubled reply, and one that comes after the time-out.
    for fault in [FrameFault::Doubled, FrameFault::Late(Span::from_millis(25))] {
        let mut bench = Bench::new(Properties::default());
        bench.fault(1, 1, fault);
        assert!(matches!(
            bench.job(Job::Read { register: 0x1B }),
            Outcome::Read(_)
        ));
        bench.run(50);
        assert_eq!(
            bench.disturbances(),
            [Disturbance::Unasked {
                reply: reply(0x1B, Data::Short(472))
            }],
            "{fault:?}"
        );
    }
}

/// Cycles: supervised from the first frame on, eight at most, until they are stopped.
#[test]
fn cycles_are_supervised() {
    let mut bench = Bench::new(Properties::default());
    assert!(matches!(
        bench.job(Job::Cycle {
            register: 0x30,
            every: 10
        }),
        Outcome::Started(_)
    ));
    bench.run(1_000);
    let slot = *bench.master.slots().next().unwrap();
    assert!((99..=100).contains(&slot.frames), "{slot:?}");
    assert_eq!(slot.mean(), Some(Span::from_millis(10)));
    // A poll of the same register in between is no early frame.
    assert!(matches!(
        bench.job(Job::Read { register: 0x30 }),
        Outcome::Read(_)
    ));
    bench.run(100);
    assert_eq!(bench.disturbances(), []);
    // One frame is lost, and a foreign frame comes too early.
    let sent = bench
        .desk
        .record()
        .iter()
        .filter(|line| line.from == Some(1))
        .count() as u64;
    bench.fault(1, sent + 3, FrameFault::Lost);
    bench.run(100);
    assert_eq!(
        bench.disturbances(),
        [Disturbance::Missing { register: 0x30 }]
    );
    // A frame 3 ms after the last one: sent twice, or by another drive.
    let last = bench.master.slots().next().unwrap().last;
    let doubled: Frame = "181#30000000".parse().unwrap();
    let early = Span::from_millis(3);
    bench.master.handle_frame(last + early, &doubled);
    bench.run(1);
    let expected = Disturbance::Early {
        register: 0x30,
        after: early,
    };
    assert_eq!(bench.disturbances()[1..], [expected]);
    let before = bench.disturbances().len();
    assert_eq!(bench.job(Job::Stop { register: 0x30 }), Outcome::Sent);
    bench.run(100);
    assert_eq!(bench.disturbances().len(), before);
    assert_eq!(bench.master.slots().count(), 0);

    for register in 0xE2..=0xE9 {
        assert!(matches!(
            bench.job(Job::Cycle {
                register,
                every: 100
            }),
            Outcome::Started(_)
        ));
    }
    assert_eq!(
        bench.master.submit(Job::Cycle {
            register: 0x30,
            every: 100
        }),
        Err(JobRefusal::EightCycles)
    );
    assert!(
        bench
            .master
            .submit(Job::Cycle {
                register: 0xE2,
                every: 50
            })
            .is_ok()
    );
    for every in [0, 255] {
        assert_eq!(
            bench.master.submit(Job::Cycle {
                register: 0xE2,
                every
            }),
            Err(JobRefusal::Interval)
        );
    }
}

/// ex 11, 12: the start-up ends enabled, without a command; without hardware enable it ends locked.
#[test]
fn start_up() {
    let patience = Span::from_millis(200);
    let mut bench = Bench::new(Properties::default());
    bench.job(write(0x31, 5_000));
    assert_eq!(bench.job(Job::StartUp { patience }), Outcome::Released);
    assert!(bench.desk.drive().is_enabled());
    assert_eq!(bench.desk.drive().register(0x31), 0);
    let mut open = Bench::new(Properties::default());
    open.desk.inputs(|inputs| {
        *inputs = Inputs {
            run: false,
            ..Inputs::default()
        }
    });
    assert_eq!(
        open.job(Job::StartUp { patience }),
        Outcome::NotReady(reply(0xE8, Data::Short(0)))
    );
    assert_eq!(open.desk.drive().register(0x51), 4);
    // It is closed while the master waits.
    let mut late = Bench::new(Properties::default());
    late.desk.inputs(|inputs| inputs.run = false);
    late.master.submit(Job::StartUp { patience }).unwrap();
    late.run(50);
    late.desk.inputs(|inputs| inputs.run = true);
    late.run(50);
    assert!(late.desk.drive().is_enabled());
}

/// A frame with STATUS is an event where nothing asked for it.
#[test]
fn status_by_event() {
    let mut bench = Bench::new(Properties::default());
    bench.job(Job::Write {
        register: 0x52,
        data: Data::Long(0x20),
    });
    bench.job(write(0x51, 0x10));
    bench.desk.inputs(|inputs| inputs.icns = true);
    bench.run(10);
    let status = MasterEvent::Status {
        reply: reply(0x40, Data::Long(0x0121)),
    };
    assert!(bench.events.contains(&status), "{:?}", bench.events);
    assert_eq!(bench.disturbances(), []);
}

/// ex 1 under both readings: the master finds the drive at the identifier that it uses.
#[test]
fn new_identifiers() {
    for (word, rx) in [("immediate", 0x210), ("restart", 0x201)] {
        let mut properties = Properties::default();
        assert!(
            UnitekProperty::of("id-change")
                .unwrap()
                .set(&mut properties, Setting::Word(word))
        );
        let mut bench = Bench::new(properties);
        assert!(
            matches!(bench.job(write(0x68, 0x210)), Outcome::Written(_)),
            "{word}"
        );
        assert!(
            matches!(bench.job(write(0x69, 0x190)), Outcome::Written(_)),
            "{word}"
        );
        assert!(
            matches!(bench.job(Job::Read { register: 0x1B }), Outcome::Read(_)),
            "{word}"
        );
        assert_eq!(bench.master.identifiers().0, rx);
        assert_eq!(bench.disturbances(), []);
    }
}
