//! Plays the steps of this bus.

use super::Unitek;
use super::plan::{Act, WantedFrame, WantedOutcome, WantedValue};
use super::syntax::DriveHarm;
use super::write::identifier;
use crate::simulate::Bench;
use harness_bench::counted::counted;
use harness_bench::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::plan::{Plan, PlannedAction, PlannedStep, PlannedWhen};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::{Mismatch, Stop};
use harness_bench::scenario::run::player::Runner;
use harness_proto::can::{CanError, CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::master::{Job, JobNumber, MasterEvent, Options, Outcome};
use harness_proto::unitek::units::{Scaling, shown, usual};
use harness_proto::unitek::{Data, Register, Reply, Request};
use harness_sim::unitek;
use harness_sim::unitek::deviation::{DeviantCanMaster, MasterDeviation};
use std::collections::BTreeMap;

/// The longest job of the driver.
const LONGEST: Span = Span::from_millis(10_000);

/// What is kept while a scenario is played.
#[derive(Debug, Default)]
pub(crate) struct PlayState {
    /// What the bench last noticed of the bus.
    error: Option<CanError>,
    /// The reply that a `read` waits for: identifier and register.
    awaited: Option<(u16, u8)>,
    reply: Option<(Instant, Reply)>,
    drivers: BTreeMap<u8, PlayedMaster>,
    deviation: Option<&'static MasterDeviation>,
}

#[derive(Debug)]
struct PlayedMaster {
    master: DeviantCanMaster,
    ended: Vec<(JobNumber, Outcome)>,
}

impl PlayedMaster {
    /// Fetches what the master reports. True if something of it is no result of a job.
    fn reports(&mut self) -> bool {
        let mut others = false;
        while let Some(event) = self.master.poll_event() {
            match event {
                MasterEvent::Ended { id, outcome } => self.ended.push((id, outcome)),
                MasterEvent::Cyclic { .. }
                | MasterEvent::Status { .. }
                | MasterEvent::Disturbance(_) => others = true,
            }
        }
        others
    }

    /// A frame has come. True if a job took it, so that no line has to ask for it.
    fn takes(&mut self, at: Instant, tx: u16, frame: &Frame) -> bool {
        self.master.handle_frame(at, frame);
        let others = self.reports();
        !others && Reply::decode(frame, tx).is_ok()
    }
}

impl PlayState {
    /// What is kept from the first step on.
    pub(super) fn new(plan: &Plan<Unitek>) -> Self {
        Self {
            deviation: plan.master,
            ..Self::default()
        }
    }

    /// The next frame that no job takes.
    pub(super) fn fetch(&mut self, link: &mut dyn Link, port: usize) -> Option<(Instant, Frame)> {
        loop {
            let (at, heard) = link.receive(port)?;
            match heard.frame()? {
                CanEvent::Error(error) => self.error = Some(error),
                CanEvent::Frame(frame) => {
                    if !self.takes(at, &frame) {
                        return Some((at, frame));
                    }
                }
            }
        }
    }

    fn takes(&mut self, at: Instant, frame: &Frame) -> bool {
        if let Some((tx, register)) = self.awaited
            && let Ok(reply) = Reply::decode(frame, tx)
            && reply.register == register
        {
            self.awaited = None;
            self.reply = Some((at, reply));
            return true;
        }
        let mut taken = false;
        for driver in self.drivers.values_mut() {
            let tx = driver.master.identifiers().1;
            taken |= driver.takes(at, tx, frame);
        }
        taken
    }
}

pub(super) fn matches(wanted: &WantedFrame, frame: &Frame) -> bool {
    let length = usize::from(wanted.remote.unwrap_or(0)).max(wanted.data.len());
    let same = frame.id() == wanted.id
        && frame.is_remote() == wanted.remote.is_some()
        && frame.dlc() == length;
    let mut pairs = wanted.data.iter().zip(frame.data());
    same && pairs.all(|(expected, byte)| match expected {
        Expected::Byte(value) => value == byte,
        _ => true,
    })
}

/// A wanted frame as scenarios write it.
pub(super) fn describe(wanted: &WantedFrame) -> String {
    let mut text = identifier(wanted.id);
    if let Some(length) = wanted.remote {
        text.push_str(&format!(" rtr {length}"));
    }
    for byte in &wanted.data {
        text.push_str(&format!(" {byte}"));
    }
    text
}

/// A frame as scenarios write it.
pub(crate) fn written(frame: &Frame) -> String {
    let bytes = frame.data().iter().map(|byte| Expected::Byte(*byte));
    describe(&WantedFrame {
        id: frame.id(),
        remote: frame
            .is_remote()
            .then(|| u8::try_from(frame.dlc()).unwrap_or(8)),
        data: bytes.collect(),
    })
}

/// A value with its unit after the raw number.
fn value(register: u8, raw: u32) -> String {
    let register = Register::of(register);
    let digits = register.width.bits() as usize / 4;
    let unit = usual(register.unit).and_then(|unit| shown(register, raw, unit, Scaling::default()));
    match unit {
        Some(unit) => format!("{raw:0digits$X} ({unit})"),
        None => format!("{raw:0digits$X}"),
    }
}

impl WantedValue {
    fn is_met(&self, number: i64) -> bool {
        let wanted = Register::of(self.register).number_of(self.raw);
        wanted.abs_diff(number) <= self.tolerance
    }

    /// Compares what a reply says.
    fn judge(&self, span: TextSpan, reply: &Reply) -> Result<(), Stop> {
        self.compared(span, reply.number(), reply.data.bits())
    }

    /// Compares the contents of the register itself.
    pub(super) fn compare(&self, span: TextSpan, raw: u32) -> Result<(), Stop> {
        self.compared(span, Register::of(self.register).number_of(raw), raw)
    }

    fn compared(&self, span: TextSpan, number: i64, raw: u32) -> Result<(), Stop> {
        if self.is_met(number) {
            return Ok(());
        }
        let register = Register::of(self.register);
        Err(Stop::failed(
            span,
            format!(
                "register {:02X} ({}) reads {} where {} is expected",
                self.register,
                register.name,
                value(self.register, raw),
                value(self.register, self.raw)
            ),
        ))
    }
}

/// Places the faults that wait for their frame.
pub(super) fn begin(runner: &mut Runner<'_, Unitek>) {
    for step in &runner.plan.steps {
        if let PlannedAction::Own(Act::Frame(number, fault)) = &step.action
            && step.when == PlannedWhen::Now
        {
            let fault = PlacedFault::Frame(*fault);
            runner.link.inject(0, fault, Moment::Byte(*number));
        }
    }
}

pub(super) fn act(
    runner: &mut Runner<'_, Unitek>,
    act: &Act,
    step: &PlannedStep<Unitek>,
) -> Result<(), Stop> {
    let now = step.when == PlannedWhen::Now;
    let span = step.span;
    match act {
        Act::Frame(number, fault) => {
            // One without a time has been placed by `begin`.
            if !now {
                let fault = PlacedFault::Frame(*fault);
                runner.link.inject(0, fault, Moment::Byte(*number));
            }
        }
        Act::Harm(node, harm) => {
            let fault = match harm {
                DriveHarm::Off => PlacedFault::Drive(*node, DriveFault::Off),
                DriveHarm::On => PlacedFault::Drive(*node, DriveFault::On),
                DriveHarm::BusOff => from_outside(*node, unitek::Stimulus::BusOff),
            };
            runner.happen(now, &[fault]);
        }
        Act::Outside(node, unitek::Stimulus::Register(register, raw))
            if runner.link.beside().is_none() =>
        {
            if let Some(frame) = over_bus(runner, *node, *register, *raw) {
                runner.transmit(0, &[frame]);
            }
        }
        Act::Outside(node, stimulus) => runner.happen(now, &[from_outside(*node, *stimulus)]),
        Act::Restart(node) => {
            let faults = [DriveFault::Off, DriveFault::On];
            runner.happen(now, &faults.map(|fault| PlacedFault::Drive(*node, fault)));
        }
        Act::Quiet => {
            runner.settle();
            runner.nothing_unasked(span)?;
        }
        Act::Register(node, wanted) => look(runner, span, *node, wanted)?,
        Act::Send(frame) => {
            runner.transmit(0, &[*frame]);
        }
        Act::Read {
            request,
            tx,
            register,
            wanted,
        } => {
            let reply = read(runner, span, *request, (*tx, *register))?;
            if let Some(wanted) = wanted {
                wanted.judge(span, &reply)?;
            }
        }
        Act::Driver(node, job, wanted) => {
            let outcome = drive(runner, span, *node, *job)?;
            judge(span, outcome, *wanted)?;
        }
    }
    Ok(())
}

pub(super) fn from_outside(node: u8, stimulus: unitek::Stimulus) -> PlacedFault {
    PlacedFault::Stimulus(node, AnyStimulus::Unitek(stimulus))
}

/// The write that sets a register of a drive which is not simulated beside the bus.
fn over_bus(runner: &Runner<'_, Unitek>, node: u8, register: u8, raw: u32) -> Option<Frame> {
    let drives = &runner.plan.setup.drives;
    let setup = drives.iter().find(|drive| drive.node == node)?;
    let data = Data::of(Register::of(register), raw);
    let request = Request::Write { register, data };
    request.encode(setup.identifiers.0).ok()
}

/// A register beside the bus; over the bus where the drive cannot be seen.
fn look(
    runner: &mut Runner<'_, Unitek>,
    span: TextSpan,
    node: u8,
    wanted: &WantedValue,
) -> Result<(), Stop> {
    runner.settle();
    let bench = runner.link.beside();
    let drive = bench.and_then(|bench| bench.downcast_ref::<Bench>()?.drive(node));
    if let Some(drive) = drive {
        return wanted.compare(span, drive.register(wanted.register));
    }
    let drives = &runner.plan.setup.drives;
    let setup = drives.iter().find(|drive| drive.node == node);
    let request = setup.and_then(|drive| {
        let (receives, sends) = drive.identifiers;
        let request = Request::Read {
            register: wanted.register,
        };
        Some((request.encode(receives).ok()?, sends))
    });
    let Some((request, tx)) = request else {
        return Ok(());
    };
    let reply = read(runner, span, request, (tx, wanted.register))?;
    wanted.judge(span, &reply)
}

/// Sends a request and waits for its reply: the next frame with that identifier and register. Other frames are left for other lines.
fn read(
    runner: &mut Runner<'_, Unitek>,
    span: TextSpan,
    request: Frame,
    from: (u16, u8),
) -> Result<Reply, Stop> {
    runner.fetch();
    runner.own.awaited = Some(from);
    runner.own.reply = None;
    let until = runner.transmit(0, &[request]) + runner.plan.deadline;
    loop {
        runner.fetch();
        if let Some((at, reply)) = runner.own.reply.take() {
            runner.line_before = runner.line_before.max(at);
            return Ok(reply);
        }
        if runner.link.now() >= until || !runner.wait(until) && runner.own.reply.is_none() {
            runner.own.awaited = None;
            let register = Register::of(from.1);
            let message = format!(
                "no reply with register {:02X} ({}) has come on {:03X} up to {}",
                register.number,
                register.name,
                from.0,
                runner.link.now()
            );
            return Err(Stop::failed(span, message));
        }
    }
}

/// Runs a job of the driver to its end.
fn drive(
    runner: &mut Runner<'_, Unitek>,
    span: TextSpan,
    node: u8,
    job: Job,
) -> Result<Outcome, Stop> {
    runner.fetch();
    let plan = runner.plan;
    let setup = plan.setup.drives.iter().find(|drive| drive.node == node);
    let (rx, tx) = setup.map_or((0, 0), |drive| drive.identifiers);
    let deviation = runner.own.deviation;
    let driver = runner.own.drivers.entry(node);
    let driver = driver.or_insert_with(|| PlayedMaster {
        master: DeviantCanMaster::new(rx, tx, Options::default(), deviation),
        ended: Vec::new(),
    });
    let id = driver
        .master
        .submit(job)
        .map_err(|refused| Stop::aborted(span, refused.to_string()))?;
    let end = runner.link.now() + LONGEST;
    loop {
        let now = runner.link.now();
        let Some(driver) = runner.own.drivers.get_mut(&node) else {
            return Err(Stop::aborted(span, "the drive has no driver"));
        };
        if driver.master.poll_timeout().is_some_and(|at| at <= now) {
            driver.master.handle_timeout(now);
        }
        let frames: Vec<_> = std::iter::from_fn(|| driver.master.poll_transmit(now)).collect();
        driver.reports();
        let ended = driver.ended.iter().find(|(ended, _)| *ended == id);
        let ended = ended.map(|(_, outcome)| *outcome);
        let due = driver.master.poll_timeout();
        if !frames.is_empty() {
            runner.transmit(0, &frames);
        }
        if let Some(outcome) = ended {
            runner.line_before = runner.line_before.max(now);
            return Ok(outcome);
        }
        if now >= end {
            return Err(Stop::failed(span, "the driver's job has not ended in 10 s"));
        }
        if due.is_none_or(|at| at > now) {
            runner.wait(due.unwrap_or(end).min(end));
        }
    }
}

/// Whether a job of the driver has ended as it should.
fn judge(span: TextSpan, outcome: Outcome, wanted: WantedOutcome) -> Result<(), Stop> {
    let message = match (outcome, wanted) {
        (Outcome::NotReady(_), WantedOutcome::NotReady) => return Ok(()),
        (_, WantedOutcome::NotReady) => "the start-up has not ended as not ready".to_owned(),
        (Outcome::Read(reply), WantedOutcome::Reads(wanted)) => {
            return wanted.judge(span, &reply);
        }
        (
            Outcome::Read(_)
            | Outcome::Written(_)
            | Outcome::Sent
            | Outcome::Started(_)
            | Outcome::Released,
            _,
        ) => return Ok(()),
        (Outcome::Differs { wrote, reads }, _) => format!(
            "the driver wrote {:X} to register {:02X} and reads {}",
            wrote.bits(),
            reads.register,
            value(reads.register, reads.data.bits())
        ),
        (Outcome::NotReady(reply), _) => format!(
            "register {:02X} ({}) has not become 1: it reads {}",
            reply.register,
            Register::of(reply.register).name,
            value(reply.register, reply.data.bits())
        ),
        (Outcome::NoReply { tries }, _) => {
            format!(
                "no reply has come to the driver, which sent {}",
                counted(tries, "request")
            )
        }
    };
    Err(Stop::failed(span, message))
}

/// Adds what the bench noticed of the bus to a finding.
pub(super) fn complete(state: &PlayState, finding: &mut Mismatch) {
    if let Some(error) = state.error {
        finding
            .message
            .push_str(&format!(" (the bench noticed on the bus: {error})"));
    }
}
