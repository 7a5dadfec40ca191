//! A conversation of the master with a drive on a segment.

use super::Frames;
use super::file::CampaignStep;
use harness_bench::campaign::line::{Conversation, MasterPiece};
use harness_bench::counted::counted;
use harness_proto::can::{BitRate, CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::master::{CanMaster, Disturbance, Job, MasterEvent, Options, Outcome};
use harness_proto::unitek::properties::Properties;
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX};
use harness_sim::segment::{Host, Placed, Segment};
use harness_sim::unitek::{Control, Drive, Inputs, Member};
use std::fmt;

const MASTER: usize = 0;
const DRIVE: usize = 1;

/// How long a job may take; every job of the master ends in a shorter time.
const PATIENCE: Span = Span::from_millis(5_000);

/// Behind the last step: what is late arrives, and what was not stopped shows.
const REST: Span = Span::from_millis(300);

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum JobEnd {
    /// The outcome of a job; the stuff byte of a reply is left out.
    Job(Outcome),
    Waited,
}

impl fmt::Display for JobEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::Job(outcome) = self else {
            return f.write_str("waited");
        };
        match outcome {
            Outcome::Read(reply) => write!(f, "read {:X}", reply.data.bits()),
            Outcome::Written(reply) => write!(f, "written {:X}", reply.data.bits()),
            Outcome::Differs { wrote, reads } => {
                write!(f, "wrote {:X}, reads {:X}", wrote.bits(), reads.data.bits())
            }
            Outcome::Sent => f.write_str("sent"),
            Outcome::Started(_) => f.write_str("started"),
            Outcome::Released => f.write_str("released"),
            Outcome::NotReady(_) => f.write_str("not ready"),
            Outcome::NoReply { tries } => write!(f, "no reply to {}", counted(*tries, "request")),
        }
    }
}

/// What the drive holds at the end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DriveState {
    cells: [u32; 256],
    control: Control,
    enabled: bool,
    cycles: Vec<(u8, u8)>,
}

impl DriveState {
    /// The registers in which it differs from another state, and what they hold.
    pub(super) fn differing(&self, other: &Self) -> impl Iterator<Item = (u8, u32)> {
        let cells = self.cells.into_iter().zip(other.cells).zip(0..=u8::MAX);
        cells.filter_map(|((cell, other), number)| (cell != other).then_some((number, cell)))
    }
}

/// Plays the steps, with a fault or without.
pub(super) fn converse(frames: &Frames, fault: Option<Placed>) -> Conversation<Frames> {
    let mut desk = Desk::new(frames.options);
    if let Some(fault) = fault {
        desk.segment.inject(fault);
    }
    let ends = frames.steps.iter().map(|step| desk.step(*step)).collect();
    desk.run(desk.now + REST);
    let carried = desk.segment.record().iter().map(|line| line.frame);
    let carried = carried.collect();
    let drive = desk.segment.station(DRIVE).drive();
    let state = drive.map(|drive| DriveState {
        cells: *drive.held(),
        control: drive.control(),
        enabled: drive.is_enabled(),
        cycles: drive.running_cycles().collect(),
    });
    Conversation {
        ends,
        troubles: desk.disturbances,
        starts: 0,
        requests: desk.sent,
        carried,
        state,
        log: desk.log,
        end: desk.now,
    }
}

struct Desk {
    segment: Segment<Member<Box<Drive>>>,
    master: CanMaster,
    now: Instant,
    sent: u64,
    disturbances: Vec<String>,
    ended: Option<Outcome>,
    log: Vec<MasterPiece<Frame>>,
}

impl Desk {
    fn new(options: Options) -> Self {
        let drive = Drive::new(Properties::default(), Inputs::default(), Instant::START);
        let stations = vec![
            Member::Host(Host::default()),
            Member::Drive(Box::new(drive)),
        ];
        Self {
            segment: Segment::new(BitRate::K500, stations),
            master: CanMaster::new(DEFAULT_RX, DEFAULT_TX, options),
            now: Instant::START,
            sent: 0,
            disturbances: Vec::new(),
            ended: None,
            log: Vec::new(),
        }
    }

    fn step(&mut self, step: CampaignStep) -> Result<JobEnd, String> {
        match step {
            CampaignStep::Wait(time) => {
                self.run(self.now + time);
                Ok(JobEnd::Waited)
            }
            CampaignStep::Job(job) => self.job(job),
        }
    }

    /// Does a job; what the master does not report as done is an error.
    fn job(&mut self, job: Job) -> Result<JobEnd, String> {
        let open = || "not ended".to_owned();
        self.ended = None;
        self.master.submit(job).map_err(|_| open())?;
        let end = self.now + PATIENCE;
        while self.ended.is_none() && self.now < end {
            self.advance(end);
        }
        let done = JobEnd::Job(plain(self.ended.take().ok_or_else(open)?));
        match done {
            JobEnd::Job(
                Outcome::NoReply { .. } | Outcome::NotReady(_) | Outcome::Differs { .. },
            ) => Err(done.to_string()),
            done => Ok(done),
        }
    }

    fn run(&mut self, end: Instant) {
        while self.now < end {
            self.advance(end);
        }
    }

    /// To the next thing that happens, and at most to `end`.
    fn advance(&mut self, end: Instant) {
        self.transmit();
        let due = [
            self.segment.next_due(),
            self.master.poll_timeout(),
            self.host().and_then(|host| host.heard_at()),
        ];
        let next = due.into_iter().flatten().min().unwrap_or(end);
        self.now = self.now.max(next.min(end));
        self.segment.run_to(self.now);
        while let Some(at) = self.host().and_then(|host| host.heard_at()) {
            if at > self.now {
                break;
            }
            let heard = self.host().and_then(Host::receive);
            if let Some((at, CanEvent::Frame(frame))) = heard {
                self.log.push(MasterPiece::Received(frame));
                self.master.handle_frame(at, &frame);
            }
        }
        if self
            .master
            .poll_timeout()
            .is_some_and(|due| due <= self.now)
        {
            self.master.handle_timeout(self.now);
        }
        self.transmit();
        while let Some(event) = self.master.poll_event() {
            match event {
                MasterEvent::Ended { outcome, .. } => self.ended = Some(outcome),
                MasterEvent::Disturbance(disturbance) => self.disturbances.push(words(disturbance)),
                MasterEvent::Cyclic { .. } | MasterEvent::Status { .. } => {}
            }
        }
    }

    fn transmit(&mut self) {
        while let Some(frame) = self.master.poll_transmit(self.now) {
            let now = self.now;
            if let Some(host) = self.host() {
                host.send(now, frame);
            }
            self.log.push(MasterPiece::Sent(now, frame));
            self.sent += 1;
        }
    }

    fn host(&mut self) -> Option<&mut Host> {
        self.segment.station_mut(MASTER).host_mut()
    }
}

/// An outcome without the byte that means nothing.
fn plain(outcome: Outcome) -> Outcome {
    match outcome {
        Outcome::Read(mut reply) => {
            reply.stuff = 0;
            Outcome::Read(reply)
        }
        Outcome::Written(mut reply) => {
            reply.stuff = 0;
            Outcome::Written(reply)
        }
        other => other,
    }
}

/// What the master reports, in words.
fn words(disturbance: Disturbance) -> String {
    match disturbance {
        Disturbance::Odd(why) => format!("a frame that is no reply: {why}"),
        Disturbance::Unasked { reply } => format!("{:02X} comes unasked", reply.register),
        Disturbance::Missing { register } => format!("a cyclic frame of {register:02X} is missing"),
        Disturbance::Early { register, after } => {
            format!("{register:02X} comes {after} behind the last one")
        }
    }
}
