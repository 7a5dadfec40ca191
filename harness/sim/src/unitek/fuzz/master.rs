//! The master of a drive on a bus that sends arbitrary frames.

use crate::fuzz::{Feature, LONGEST, Notebook};
use crate::unitek::{Drive, Inputs};
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::can::{Frame, Id};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{CYCLES, DEFAULT_RX, DEFAULT_TX};
use harness_proto::unitek::master::{
    CanMaster, Disturbance, Job, JobNumber, JobRefusal, MasterEvent, Options, Outcome,
};
use harness_proto::unitek::properties::{Dlc4, Properties};
use harness_proto::unitek::words::MODE_LOCK;
use harness_proto::unitek::{Data, Reply, Request};
use std::collections::VecDeque;

/// Most steps without a wait, and after the input until every job has ended.
const MOST_STEPS: usize = 100_000;

/// Most frames that a start-up sends: two bits polled every 10 ms for 300 ms, each poll repeated, and four writes read back.
const MOST_FRAMES: usize = 500;

/// What happens, and how much time passes after it.
#[derive(Clone, Copy, Debug)]
struct MasterStep {
    what: MasterOperation,
    wait: Span,
}

#[derive(Clone, Copy, Debug)]
enum MasterOperation {
    /// A job is given to the master.
    Give(Job),
    /// The next frame of a drive that hears the master arrives this number of times.
    Answer(usize),
    /// A frame arrives.
    Frame(Id, [u8; 8], usize),
    /// A frame with the register that was asked last arrives.
    Asked([u8; 8], usize),
    /// A remote frame arrives.
    Remote(Id),
    /// The hardware enable of the drive is switched.
    Enable(bool),
    /// Time passes.
    Time,
}

impl<'a> Arbitrary<'a> for MasterStep {
    /// Seven bytes: what, register, four bytes of a value, time in ms. Of the first byte, bits 3 to 0 are the number of data bytes (9 to 11 mean 4,
    /// 12 to 15 mean 6) or the kind of a job. 0_ to 3_: a job; 4_ to 7_: the next frame of a sound drive arrives; 8_: it is lost; 9_: it arrives
    /// twice; A_: a frame with the drive's identifier; B_: with another; C_: with the register that was asked last; D_: a remote frame; E_: the
    /// hardware enable; F_: time.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let mut bytes = [0; 7];
        input.fill_buffer(&mut bytes)?;
        let [what, register, a, b, c, d, wait] = bytes;
        let low = usize::from(what & 0xF);
        let len = match low {
            0..=8 => low,
            9..=11 => 4,
            _ => 6,
        };
        let data = [register, a, b, c, d, 7, 8, 9];
        let tx = Id::base(DEFAULT_TX);
        let what = match (what >> 4, tx) {
            (0..=3, _) => MasterOperation::Give(job(low, register, [a, b, c, d])),
            (4..=7, _) => MasterOperation::Answer(1),
            (8, _) => MasterOperation::Answer(0),
            (9, _) => MasterOperation::Answer(2),
            (0xA, Some(tx)) => MasterOperation::Frame(tx, data, len),
            (0xB, _) => Id::extended(u32::from_be_bytes([0, 0, a, b]))
                .map_or(MasterOperation::Time, |id| {
                    MasterOperation::Frame(id, data, len)
                }),
            (0xC, _) => MasterOperation::Asked(data, len),
            (0xD, Some(tx)) => MasterOperation::Remote(tx),
            (0xE, _) => MasterOperation::Enable(register & 1 == 0),
            _ => MasterOperation::Time,
        };
        let wait = Span::from_millis(u64::from(wait & 0x3F));
        Ok(Self { what, wait })
    }
}

fn job(kind: usize, register: u8, [a, b, c, d]: [u8; 4]) -> Job {
    let low = u16::from_le_bytes([a, b]);
    match kind {
        0..=3 => Job::Read { register },
        4..=6 => Job::Write {
            register,
            data: Data::Short(low),
        },
        7 => Job::Write {
            register,
            data: Data::Long(u32::from_le_bytes([a, b, c, d])),
        },
        8..=11 => Job::Cycle { register, every: a },
        12 | 13 => Job::Stop { register },
        _ => Job::StartUp {
            patience: Span::from_millis(u64::from(a)),
        },
    }
}

/// The first byte: bits 1 and 0 are the number of repeats, bit 2 means that writes are not read back. The others are operations of seven
/// bytes.
///
/// # Panics
/// A job ends twice, never, or as something that it is not; the master sends a frame that no job asks for, repeats a write, or releases a
/// lock before the drive was ready and enabled.
pub fn master(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and the ends of jobs and what is reported besides are noted.
///
/// # Panics
/// As [`master`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let Some((&options, data)) = data.split_first() else {
        return;
    };
    let mut play = Play::new(Options {
        repeats: options & 3,
        read_back: options & 4 == 0,
        ..Options::default()
    });
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    while let (false, Ok(operation)) = (input.is_empty(), input.arbitrary::<MasterStep>()) {
        play.happens(operation.what, notes);
        play.run_until(play.now + operation.wait, notes);
    }
    for _ in 0..MOST_STEPS {
        if play.open.is_empty() {
            return;
        }
        let next = play.master.poll_timeout();
        assert!(next.is_some(), "{:?} waits for nothing", play.open[0].job);
        play.run_until(next.unwrap_or(play.now), notes);
    }
    panic!("{:?} never ends", play.open[0].job);
}

/// A job that has not ended.
#[derive(Debug)]
struct Open {
    id: JobNumber,
    job: Job,
    /// Frames that were sent for it.
    sent: usize,
    writes: usize,
    /// A frame with E2 = 1, and one with E8 = 1, has arrived since it began.
    ready: bool,
    closed: bool,
}

struct Play {
    master: CanMaster,
    options: Options,
    drive: Drive,
    now: Instant,
    open: VecDeque<Open>,
    /// The register that was asked last.
    asked: u8,
    /// Identifiers that the master may use.
    identifiers: Vec<u16>,
}

impl Play {
    fn new(options: Options) -> Self {
        Self {
            master: CanMaster::new(DEFAULT_RX, DEFAULT_TX, options),
            options,
            drive: Drive::new(Properties::default(), Inputs::default(), Instant::START),
            now: Instant::START,
            open: VecDeque::new(),
            asked: 0,
            identifiers: vec![DEFAULT_RX],
        }
    }

    fn happens(&mut self, what: MasterOperation, notes: &mut Notebook<'_>) {
        match what {
            MasterOperation::Give(job) => self.give(job, notes),
            MasterOperation::Answer(times) => {
                self.drive.advance(self.now);
                if let Some(waiting) = self.drive.sent() {
                    (0..times).for_each(|_| self.arrives(&waiting.frame, notes));
                }
            }
            MasterOperation::Frame(id, data, len) => {
                if let Ok(frame) = Frame::new(id, &data[..len]) {
                    self.arrives(&frame, notes);
                }
            }
            MasterOperation::Asked(mut data, len) => {
                data[0] = self.asked;
                if let Ok(frame) = Frame::base(DEFAULT_TX, &data[..len]) {
                    self.arrives(&frame, notes);
                }
            }
            MasterOperation::Remote(id) => {
                if let Ok(frame) = Frame::remote(id, 4) {
                    self.arrives(&frame, notes);
                }
            }
            MasterOperation::Enable(run) => {
                let inputs = Inputs {
                    run,
                    ..*self.drive.inputs()
                };
                self.drive.set_inputs(self.now, inputs);
            }
            MasterOperation::Time => {}
        }
        self.settle(notes);
    }

    fn give(&mut self, job: Job, notes: &mut Notebook<'_>) {
        match self.master.submit(job) {
            Ok(id) => {
                if let Job::Write {
                    register: 0x68,
                    data,
                } = job
                {
                    self.identifiers.push((data.bits() & 0xFFFF) as u16);
                }
                let (ready, closed) = (false, false);
                self.open.push_back(Open {
                    id,
                    job,
                    sent: 0,
                    writes: 0,
                    ready,
                    closed,
                });
            }
            Err(refused) => {
                let what = match refused {
                    JobRefusal::Full => "too many wait",
                    JobRefusal::EightCycles => "eight cycles",
                    JobRefusal::Interval => "interval",
                };
                notes.note(|| Feature::new("5.2", "a job is refused", what));
            }
        }
    }

    fn arrives(&mut self, frame: &Frame, notes: &mut Notebook<'_>) {
        if let Some(open) = self.open.front_mut()
            && let Ok(reply) = Reply::decode(frame, self.master.identifiers().1)
            && reply.data.bits() & 0xFFFF == 1
        {
            open.ready |= reply.register == 0xE2;
            open.closed |= reply.register == 0xE8;
        }
        self.master.handle_frame(self.now, frame);
        self.settle(notes);
    }

    /// Time passes; whenever something of the master is due, it is done.
    fn run_until(&mut self, end: Instant, notes: &mut Notebook<'_>) {
        for _ in 0..MOST_STEPS {
            let due = self.master.poll_timeout().filter(|due| *due <= end);
            self.now = self.now.max(due.unwrap_or(end));
            self.master.handle_timeout(self.now);
            self.settle(notes);
            if due.is_none() {
                return;
            }
        }
        panic!("the master is never done at {:?}", self.now);
    }

    /// All that the master has to send and to report now.
    fn settle(&mut self, notes: &mut Notebook<'_>) {
        for _ in 0..MOST_STEPS {
            self.events(notes);
            let Some(frame) = self.master.poll_transmit(self.now) else {
                assert!(
                    self.master.slots().count() <= CYCLES,
                    "more than 8 cycles (App 8)"
                );
                assert_eq!(self.master.lost_events(), 0, "events are lost");
                return self.events(notes);
            };
            self.transmitted(&frame);
            // What it ignores is its own affair.
            let _ = self.drive.receive(self.now, &frame);
        }
        panic!("the master sends without end at {:?}", self.now);
    }

    /// A frame is one that the job under way asks for.
    fn transmitted(&mut self, frame: &Frame) {
        let rx = u16::try_from(frame.id().number()).unwrap_or(0);
        assert!(
            self.identifiers.contains(&rx),
            "{frame} has an identifier of no drive"
        );
        assert!(matches!(frame.dlc(), 3 | 5), "{frame} (4.1)");
        let request = Request::decode(frame, rx, Dlc4::Ignore);
        let Ok(request) = request else {
            panic!("no drive takes {frame}: {request:?}");
        };
        let Some(open) = self.open.front_mut() else {
            panic!("{frame} belongs to no job");
        };
        self.asked = request.register();
        open.sent += 1;
        let writes = matches!(request, Request::Write { .. } | Request::Stop { .. });
        open.writes += usize::from(writes);
        let asks = match (open.job, request) {
            (Job::Read { register }, Request::Read { register: asked }) => register == asked,
            (
                Job::Write { register, data },
                Request::Write {
                    register: asked,
                    data: its,
                },
            ) => (register, data) == (asked, its),
            // 3D cannot be written: what is written to it is a request for sending.
            (Job::Write { register: 0x3D, .. }, _) => true,
            (Job::Write { register, .. }, Request::Read { register: asked }) => register == asked,
            (
                Job::Cycle { register, every },
                Request::Cycle {
                    register: asked,
                    every: its,
                },
            ) => (register, every) == (asked, its),
            (Job::Stop { register }, Request::Stop { register: asked }) => register == asked,
            (Job::StartUp { .. }, Request::Read { register }) => {
                matches!(register, 0xE2 | 0xE8 | 0x51 | 0x31 | 0x90)
            }
            (
                Job::StartUp { .. },
                Request::Write {
                    register: 0x51,
                    data,
                },
            ) => {
                let released = data.bits() & u32::from(MODE_LOCK) == 0;
                assert!(
                    !released || (open.ready && open.closed),
                    "{frame} releases too early (ex 11)"
                );
                true
            }
            (
                Job::StartUp { .. },
                Request::Write {
                    register: 0x31 | 0x90,
                    data,
                },
            ) => data.bits() == 0,
            _ => false,
        };
        assert!(asks, "{:?} does not ask for {frame}", open.job);
        let (most, most_writes) = match open.job {
            Job::StartUp { .. } => (MOST_FRAMES, 4),
            _ => (2 + usize::from(self.options.repeats), 1),
        };
        assert!(
            open.sent <= most && open.writes <= most_writes,
            "{open:?}: {frame} is sent too often"
        );
    }

    fn events(&mut self, notes: &mut Notebook<'_>) {
        while let Some(event) = self.master.poll_event() {
            match event {
                MasterEvent::Ended { id, outcome } => self.ended(id, outcome, notes),
                MasterEvent::Cyclic { .. } => {
                    notes.note(|| Feature::new("5.2", "reported", "cyclic"))
                }
                MasterEvent::Status { .. } => {
                    notes.note(|| Feature::new("5.2", "reported", "status"))
                }
                MasterEvent::Disturbance(disturbance) => {
                    let what = match disturbance {
                        Disturbance::Odd(_) => "odd",
                        Disturbance::Unasked { .. } => "unasked",
                        Disturbance::Missing { .. } => "missing",
                        Disturbance::Early { .. } => "early",
                    };
                    notes.note(|| {
                        Feature::new(
                            "5.2",
                            format!("reported, {} slots", self.master.slots().count()),
                            what,
                        )
                    });
                }
            }
        }
    }

    /// Jobs end in their order, once, and as what they are.
    fn ended(&mut self, id: JobNumber, outcome: Outcome, notes: &mut Notebook<'_>) {
        let Some(open) = self.open.pop_front() else {
            panic!("a job ended that was not open: {outcome:?}");
        };
        assert_eq!(open.id, id, "{:?} is first in the queue", open.job);
        let fits = match (open.job, outcome) {
            (Job::Read { register }, Outcome::Read(reply)) => reply.register == register,
            (Job::Cycle { register, .. }, Outcome::Started(reply)) => reply.register == register,
            (Job::Write { register, data }, Outcome::Written(reply)) => {
                reply.register == register && (data.bits() ^ reply.data.bits()) & 0xFFFF == 0
            }
            (Job::Write { register, data }, Outcome::Differs { wrote, reads }) => {
                reads.register == register && data == wrote && reads.data != wrote
            }
            (Job::Write { .. } | Job::Stop { .. }, Outcome::Sent) => true,
            (Job::Stop { .. }, _) => false,
            (Job::StartUp { .. }, Outcome::Released) => open.ready && open.closed,
            (Job::StartUp { .. }, Outcome::NotReady(reply)) => {
                matches!(reply.register, 0xE2 | 0xE8)
            }
            (Job::StartUp { .. }, Outcome::Differs { .. }) => true,
            (_, Outcome::NoReply { tries }) => tries == self.options.repeats + 1,
            _ => false,
        };
        assert!(fits, "{:?} ended as {outcome:?}", open.job);
        notes.note(|| {
            let job = match open.job {
                Job::Read { .. } => "read",
                Job::Write {
                    data: Data::Short(_),
                    ..
                } => "write of 16 bits",
                Job::Write {
                    data: Data::Long(_),
                    ..
                } => "write of 32 bits",
                Job::Cycle { .. } => "cycle",
                Job::Stop { .. } => "stop",
                Job::StartUp { .. } => "start-up",
            };
            Feature::new(
                "5.3",
                format!("{job}, {} frames", open.sent.min(9)),
                words(outcome),
            )
        });
    }
}

/// How a job ended, in words.
const fn words(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Read(Reply {
            data: Data::Short(_),
            ..
        }) => "read 16 bits",
        Outcome::Read(_) => "read 32 bits",
        Outcome::Written(_) => "written",
        Outcome::Differs { .. } => "reads differently",
        Outcome::Sent => "sent",
        Outcome::Started(_) => "started",
        Outcome::Released => "released",
        Outcome::NotReady(_) => "not ready",
        Outcome::NoReply { .. } => "no reply",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuzz::features;

    /// A drive whose frames all arrive: every job ends well.
    #[test]
    fn a_sound_drive_does_every_job() {
        let mut input = vec![0];
        for job in [
            [0u8, 0x40, 0, 0],
            [4, 0x31, 1, 0],
            [8, 0x30, 10, 0],
            [12, 0x30, 0, 0],
            [15, 0, 50, 0],
        ] {
            input.extend([job[0], job[1], job[2], job[3], 0, 0, 1]);
            for _ in 0..10 {
                input.extend([0x40, 0, 0, 0, 0, 0, 12]);
            }
        }
        let said = features(noted, &input);
        let said: Vec<_> = said.iter().map(ToString::to_string).collect();
        for end in ["read 16 bits", "written", "started", "sent", "released"] {
            assert!(
                said.iter().any(|said| said.ends_with(end)),
                "{end}: {said:#?}"
            );
        }
    }

    /// A release before the drive was ready is found.
    #[test]
    #[should_panic(expected = "releases too early")]
    fn an_early_release_is_found() {
        let mut play = Play::new(Options::default());
        play.give(
            Job::StartUp {
                patience: Span::ZERO,
            },
            &mut Notebook::none(),
        );
        let release = Frame::base(DEFAULT_RX, &[0x51, 0, 0]);
        play.transmitted(&release.expect("a frame"));
    }
}
