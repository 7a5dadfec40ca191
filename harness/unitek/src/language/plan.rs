//! A scenario settled: drives as they are switched on, frames and what they must be, jobs as frames.

use super::syntax::{
    Content, DriveHarm, DriveLine, Expect, FrameHarm, FrameStep, JobKind, JobStep, Message,
    Outside, PropertyValue, RegisterName, SetupKind, ValueKind, WrittenValue,
};
use super::{Unitek, parse};
use crate::simulate::{DriveSetup, Setup};
use harness_bench::counted::counted;
use harness_bench::link::{Capability, FrameFault};
use harness_bench::scenario::expression::{Located, Scope};
use harness_bench::scenario::language::Settle;
use harness_bench::scenario::pattern::{Expected, MAX_CELLS, Pattern};
use harness_bench::scenario::plan::Unroll;
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_bench::scenario::syntax::Scenario;
use harness_bench::scenario::times::Duration;
use harness_proto::can::{BitRate, Frame, Id, MAX_DATA};
use harness_proto::time::Span;
use harness_proto::unitek::master;
use harness_proto::unitek::properties::{Properties, Setting};
use harness_proto::unitek::units::{Scaling, to_raw};
use harness_proto::unitek::{Access, Data, Register, Request};
use harness_sim::unitek::Stimulus;

/// The most frames that a scenario sends.
const ROOM: usize = 100_000;
/// How long a start-up waits for ready and for the hardware enable.
const PATIENCE: Span = Span::from_millis(1000);
/// The highest number of a drive (UNITEK 3.1).
const MOST_NODES: i64 = 127;

#[derive(Clone, Debug)]
pub(crate) struct WantedFrame {
    pub(crate) id: Id,
    /// The length that it asks for, if it is a remote frame.
    pub(crate) remote: Option<u8>,
    pub(crate) data: Vec<Expected>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WantedValue {
    pub(crate) register: u8,
    pub(crate) raw: u32,
    /// How far its number may be off.
    pub(crate) tolerance: u64,
}

/// A step of this bus, settled.
#[derive(Clone, Debug)]
pub(crate) enum Act {
    /// This happens to a frame of the segment, counted from 1.
    Frame(u64, FrameFault),
    /// This happens to a drive.
    Harm(u8, DriveHarm),
    /// This happens to a drive from outside its bus.
    Outside(u8, Stimulus),
    Restart(u8),
    /// No frame has come that no line asked for.
    Quiet,
    /// A drive's register, beside the bus where it can be seen.
    Register(u8, WantedValue),
    /// A job that is one frame.
    Send(Frame),
    /// A request and its reply.
    Read {
        request: Frame,
        /// The identifier of the reply.
        tx: u16,
        register: u8,
        /// What it must read, if that matters.
        wanted: Option<WantedValue>,
    },
    /// A job of the driver, and how it must end.
    Driver(u8, master::Job, WantedOutcome),
}

/// How a job of the driver must end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WantedOutcome {
    Done,
    /// It has read this.
    Reads(WantedValue),
    /// The drive did not become ready, and is not released.
    NotReady,
}

#[derive(Debug)]
pub(crate) struct Planner {
    setup: Setup,
    scope: Scope,
}

pub(super) fn settle(
    scenario: &Scenario<Unitek>,
    size: Option<u8>,
    found: &mut Vec<Problem>,
) -> Result<Planner, Problem> {
    let header = &scenario.header;
    let rate = header.rate.unwrap_or(BitRate::K500);
    let mut drives: Vec<DriveSetup> = Vec::new();
    for line in &header.drives {
        if let Err(problem) = apply(line, &mut drives, rate) {
            found.push(problem);
        }
    }
    let count = drives.len();
    if let Some(size) = size.filter(|size| usize::from(*size) != count) {
        let span = header
            .drives
            .first()
            .map_or(TextSpan::default(), |line| line.span);
        let what = format!(
            "the bench has {}, and the scenario {count}",
            counted(size, "drive")
        );
        return Err(Problem::new(span, what, "as many `drive` lines expected"));
    }
    Ok(resume(&Setup {
        rate,
        drives,
        master: header.master,
    }))
}

/// What settles one more step.
pub(super) fn resume(setup: &Setup) -> Planner {
    let count = i64::try_from(setup.drives.len()).unwrap_or(0);
    Planner {
        scope: Scope::new(count),
        setup: setup.clone(),
    }
}

/// A header line about a drive. One about a drive that no line has named before adds it.
fn apply(line: &DriveLine, drives: &mut Vec<DriveSetup>, rate: BitRate) -> Result<(), Problem> {
    let node = node(&line.drive, Scope::default())?;
    let place = drives.iter().position(|drive| drive.node == node);
    let place = place.unwrap_or_else(|| {
        drives.push(DriveSetup::new(node));
        drives.len() - 1
    });
    let drive = &mut drives[place];
    match &line.what {
        SetupKind::There { rx, tx } => {
            drive.identifiers.0 = rx.unwrap_or(drive.identifiers.0);
            drive.identifiers.1 = tx.unwrap_or(drive.identifiers.1);
        }
        SetupKind::Profile(name) => {
            drive.properties = Properties::profile(name).unwrap_or(drive.properties);
        }
        SetupKind::Property(property, value) => {
            let setting = match value {
                PropertyValue::Word(word) => Setting::Word(word),
                PropertyValue::Time(time) => Setting::Time(time.on(octet_time(rate))),
            };
            if !property.set(&mut drive.properties, setting) {
                let what = format!("the property {} does not take this value", property.name);
                return Err(Problem::new(line.span, what, "a time up to 10s expected"));
            }
        }
        SetupKind::Mode(mode) => drive.control = Some(*mode),
        SetupKind::Deviates(deviation) => drive.deviation = Some(deviation),
        SetupKind::Outside(outside) => {
            let scaling = scaling(drive);
            if let Some(stimulus) = stimulus(outside, Scope::default(), scaling)? {
                drive.apply(stimulus);
            }
        }
    }
    Ok(())
}

/// Eight bits: what `bytes` means as a unit of time.
pub(crate) fn octet_time(rate: BitRate) -> Span {
    rate.time_of(8)
}

pub(crate) fn node(drive: &Located, scope: Scope) -> Result<u8, Problem> {
    let number = drive.value(scope)?;
    let fits = (1..=MOST_NODES).contains(&number);
    let node = u8::try_from(number).ok().filter(|_| fits);
    node.ok_or_else(|| {
        let what = format!("there is no drive {number} on this bus");
        Problem::new(drive.span, what, "a number from 1 to 127 expected here")
    })
}

/// What the scales of a drive depend on, as the header sets it.
fn scaling(drive: &DriveSetup) -> Scaling {
    let usual = Scaling::default();
    let set = |number: u8, usual: u16| {
        let setting = drive.registers.iter().rev().find(|(set, _)| *set == number);
        setting.map_or(usual, |(_, raw)| (raw & 0xFFFF) as u16)
    };
    Scaling {
        rpm_max: set(0xC8, usual.rpm_max),
        device_current: set(0xC6, usual.device_current),
        units_at_200: set(0xD9, usual.units_at_200),
    }
}

/// What a line does to a drive from outside; `None` for `restart`.
fn stimulus(
    outside: &Outside,
    scope: Scope,
    scaling: Scaling,
) -> Result<Option<Stimulus>, Problem> {
    Ok(Some(match outside {
        Outside::Input(name, high) => Stimulus::Input(name, *high),
        Outside::Force(name, None) => Stimulus::Force(name, None),
        Outside::Force(name, Some(value)) => {
            let shown = parse::register_of_force(name).unwrap_or(Register::of(0xF4));
            Stimulus::Force(name, Some(raw(value, shown, scope, scaling)?))
        }
        Outside::Register(name, value) => {
            let register = register(name, scope)?;
            let raw = raw(value, register, scope, scaling)?;
            setting(register.number, raw).ok_or_else(|| {
                let what = format!(
                    "register {:02X} ({}) shows what the drive finds by itself and cannot be set",
                    register.number, register.name
                );
                Problem::new(value.span, what, "another register expected")
                    .help("inputs are set by `drive 1 input run low`, values of the plant by `drive 1 force tol = 1`")
            })?
        }
        Outside::Restart => return Ok(None),
    }))
}

/// How the contents of a register are set: a cell, an input, or a value of the plant; `None` where it only shows others.
fn setting(register: u8, raw: u32) -> Option<Stimulus> {
    let input = |name| (raw <= 1).then_some(Stimulus::Input(name, raw == 1));
    match register {
        0x30 => Some(Stimulus::Force("speed", Some(raw))),
        0x49 => Some(Stimulus::Force("motor-temperature", Some(raw))),
        0x4A => Some(Stimulus::Force("igbt-temperature", Some(raw))),
        0x4B => Some(Stimulus::Force("air-temperature", Some(raw))),
        0x8F => Some(Stimulus::Force("errors", Some(raw))),
        0xEB => Some(Stimulus::Force("bus-voltage", Some(raw))),
        0xF4 => Some(Stimulus::Force("tol", Some(raw))),
        0xE4 => input("limit1"),
        0xE5 => input("limit2"),
        0xE6 => input("din1"),
        0xE7 => input("din2"),
        0xE8 => input("run"),
        0xF3 => input("icns"),
        0x20 | 0x27 | 0x5F | 0x32 | 0xA8 | 0x40 | 0x70 | 0x91 | 0xCE | 0xD8 | 0xE2 | 0xE3
        | 0xEF | 0xF2 | 0xF5 => None,
        register => Some(Stimulus::Register(register, raw)),
    }
}

/// What setting the contents of a register needs: one that can be written is written over the bus.
fn of_register(register: &Register) -> Capability {
    let written = matches!(register.access, Access::RW | Access::SP);
    let held = matches!(setting(register.number, 0), Some(Stimulus::Register(..)));
    match written && held {
        true => Capability::Memory,
        false => Capability::Simulator,
    }
}

fn register(name: &RegisterName, scope: Scope) -> Result<&'static Register, Problem> {
    match name {
        RegisterName::Known { register, .. } => Ok(register),
        RegisterName::Counted(number) => {
            let value = number.value(scope)?;
            u8::try_from(value).map(Register::of).map_err(|_| {
                let what = format!("there is no register {value}");
                Problem::new(number.span, what, "a number from 0 to 255 expected here")
            })
        }
    }
}

/// Contents of a register.
fn raw(
    value: &WrittenValue,
    register: &Register,
    scope: Scope,
    scaling: Scaling,
) -> Result<u32, Problem> {
    let too_wide = |shown: String| {
        let what = format!(
            "{shown} does not fit into register {:02X} ({}), which has {} bits",
            register.number,
            register.name,
            register.width.bits()
        );
        Problem::new(value.span, what, "a smaller number expected here")
    };
    match &value.kind {
        ValueKind::Raw(raw, digits) => match raw & !register.mask() {
            0 => Ok(*raw),
            _ => Err(too_wide(format!("{raw:0digits$X}"))),
        },
        ValueKind::Given(decimal, given) => to_raw(register, *decimal, *given, scaling)
            .map_err(|bad| Problem::new(value.span, bad.to_string(), "another value expected")),
        ValueKind::Counted(number) => {
            let number = number.value(scope)?;
            let most = i64::from(register.mask());
            let least = -(most / 2 + 1);
            if !(least..=most).contains(&number) {
                return Err(too_wide(number.to_string()));
            }
            Ok((number & most) as u32)
        }
    }
}

impl DriveSetup {
    /// What happens to the drive before it is switched on.
    fn apply(&mut self, stimulus: Stimulus) {
        match stimulus {
            Stimulus::Input(name, on) => {
                if let Some(input) = self.inputs.switch(name) {
                    *input = on;
                }
            }
            Stimulus::Force(name, raw) => {
                let _known = self.inputs.force(name, raw);
            }
            Stimulus::Register(0x68, raw) => self.identifiers.0 = (raw & 0x7FF) as u16,
            Stimulus::Register(0x69, raw) => self.identifiers.1 = (raw & 0x7FF) as u16,
            Stimulus::Register(number, raw) => self.registers.push((number, raw)),
            // No header line says so.
            Stimulus::BusOff => {}
        }
    }
}

impl Planner {
    fn drive(&self, drive: &Located) -> Result<&DriveSetup, Problem> {
        let node = node(drive, self.scope)?;
        let found = self.setup.drives.iter().find(|drive| drive.node == node);
        found.ok_or_else(|| {
            let what = format!("the scenario has no drive {node}");
            let problem = Problem::new(drive.span, what, "a drive of the header expected here");
            problem.help(format!("add the line `drive {node}` to the header"))
        })
    }

    fn wanted(
        &self,
        expect: &Expect,
        register: &Register,
        drive: &DriveSetup,
    ) -> Result<WantedValue, Problem> {
        let scaling = scaling(drive);
        let tolerance = match &expect.tolerance {
            None => 0,
            Some(value) => {
                let raw = raw(value, register, self.scope, scaling)?;
                register.number_of(raw).unsigned_abs()
            }
        };
        Ok(WantedValue {
            register: register.number,
            raw: raw(&expect.value, register, self.scope, scaling)?,
            tolerance,
        })
    }

    fn outside(&self, drive: &Located, outside: &Outside) -> Result<Act, Problem> {
        let setup = self.drive(drive)?;
        let stimulus = stimulus(outside, self.scope, scaling(setup))?;
        let restart = Act::Restart(setup.node);
        Ok(stimulus.map_or(restart, |stimulus| Act::Outside(setup.node, stimulus)))
    }

    /// A job that is compiled to one frame.
    fn job(&self, job: &JobStep, span: TextSpan) -> Result<Act, Problem> {
        let drive = self.drive(&job.drive)?;
        let (rx, tx) = drive.identifiers;
        let encoded = |request: Request| {
            request
                .encode(rx)
                .map_err(|bad| Problem::new(span, bad.to_string(), "another identifier expected"))
        };
        let mode = |value| Request::Write {
            register: 0x51,
            data: Data::Short(value),
        };
        let request = match &job.what {
            JobKind::Read(name, expect) => {
                let register = register(name, self.scope)?;
                let wanted = expect.as_ref();
                let wanted = wanted.map(|expect| self.wanted(expect, register, drive));
                return Ok(Act::Read {
                    request: encoded(Request::Read {
                        register: register.number,
                    })?,
                    tx,
                    register: register.number,
                    wanted: wanted.transpose()?,
                });
            }
            JobKind::Write(name, value) => {
                let register = register(name, self.scope)?;
                Request::Write {
                    register: register.number,
                    data: Data::of(register, raw(value, register, self.scope, scaling(drive))?),
                }
            }
            JobKind::Every(name, time) => Request::Cycle {
                register: register(name, self.scope)?.number,
                every: interval(*time)?,
            },
            JobKind::StopEvery(name) => Request::Stop {
                register: register(name, self.scope)?.number,
            },
            JobKind::Lock => mode(harness_proto::unitek::words::MODE_LOCK),
            JobKind::Release | JobKind::StartUp(_) => mode(0),
        };
        Ok(Act::Send(encoded(request)?))
    }

    /// A job of the driver.
    fn by_driver(&self, job: &JobStep) -> Result<Act, Problem> {
        let drive = self.drive(&job.drive)?;
        let number = |name| register(name, self.scope).map(|register| register.number);
        let (task, wanted) = match &job.what {
            JobKind::Read(name, expect) => {
                let register = register(name, self.scope)?;
                let wanted = expect.as_ref();
                let wanted = wanted.map(|expect| self.wanted(expect, register, drive));
                let register = register.number;
                (master::Job::Read { register }, wanted.transpose()?)
            }
            JobKind::Write(name, value) => {
                let register = register(name, self.scope)?;
                let raw = raw(value, register, self.scope, scaling(drive))?;
                let data = Data::of(register, raw);
                let register = register.number;
                (master::Job::Write { register, data }, None)
            }
            JobKind::Every(name, time) => {
                let every = interval(*time)?;
                let register = number(name)?;
                (master::Job::Cycle { register, every }, None)
            }
            JobKind::StopEvery(name) => {
                let register = number(name)?;
                (master::Job::Stop { register }, None)
            }
            JobKind::StartUp(_) | JobKind::Lock | JobKind::Release => {
                let patience = PATIENCE;
                (master::Job::StartUp { patience }, None)
            }
        };
        let wanted = match job.what {
            JobKind::StartUp(true) => WantedOutcome::NotReady,
            _ => wanted.map_or(WantedOutcome::Done, WantedOutcome::Reads),
        };
        Ok(Act::Driver(drive.node, task, wanted))
    }

    fn bytes(&self, pattern: &Pattern) -> Result<Vec<Expected>, Problem> {
        let bytes = pattern.expand(self.scope, MAX_CELLS)?;
        if bytes.len() > MAX_DATA {
            let what = format!(
                "a frame has at most 8 data bytes, and these are {}",
                bytes.len()
            );
            return Err(Problem::new(
                pattern.span,
                what,
                "fewer bytes expected here",
            ));
        }
        Ok(bytes)
    }
}

fn interval(time: Duration) -> Result<u8, Problem> {
    let span = time.on(Span::ZERO);
    let millis = span.units() / Span::from_millis(1).units();
    let whole = Span::from_millis(millis) == span;
    let every = u8::try_from(millis)
        .ok()
        .filter(|every| whole && (1..=254).contains(every));
    every.ok_or_else(|| {
        let what = format!("{time} is no interval of a cycle");
        let problem = Problem::new(time.span(), what, "1ms to 254ms expected here");
        problem
            .help("00 asks for one reply and FF stops a cycle (UNITEK 5.2): `read`, `stop-every`")
    })
}

impl Settle<Unitek> for Planner {
    fn unroll<'s>(&self, scenario: &'s Scenario<Unitek>) -> Unroll<'s, Unitek> {
        Unroll::new(&scenario.steps, self.scope)
    }

    fn enter(&mut self, scope: Scope) {
        self.scope = scope;
    }

    fn byte_time(&self) -> Span {
        octet_time(self.setup.rate)
    }

    fn room(&self) -> usize {
        ROOM
    }

    fn send(&self, _port: usize, message: &Message) -> Result<Vec<Frame>, Problem> {
        let frame = match &message.content {
            Content::Empty => Frame::new(message.id, &[]),
            Content::Remote(length) => Frame::remote(message.id, (*length).into()),
            Content::Data(pattern) => {
                let known = self.bytes(pattern)?;
                let unknown = known.iter().any(|byte| !matches!(byte, Expected::Byte(_)));
                if unknown {
                    let _refused = pattern.expand_known(self.scope, MAX_CELLS)?;
                }
                let bytes = known.iter().map(|expected| match expected {
                    Expected::Byte(byte) => *byte,
                    _ => 0,
                });
                Frame::new(message.id, &bytes.collect::<Vec<_>>())
            }
        };
        let frame = frame
            .map_err(|bad| Problem::new(message.span, bad.to_string(), "a frame expected here"))?;
        Ok(vec![frame])
    }

    fn receive(&self, _port: usize, message: &Message) -> Result<Vec<WantedFrame>, Problem> {
        let (remote, data) = match &message.content {
            Content::Empty => (None, Vec::new()),
            Content::Remote(length) => (Some(*length), Vec::new()),
            Content::Data(pattern) => (None, self.bytes(pattern)?),
        };
        let id = message.id;
        Ok(vec![WantedFrame { id, remote, data }])
    }

    fn act(
        &mut self,
        step: &FrameStep,
        span: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<Act, Problem> {
        Ok(match step {
            FrameStep::Frame(number, harm) => {
                needs.push(Capability::Interposer);
                let frame = number.value(self.scope)?;
                let Some(frame) = u64::try_from(frame).ok().filter(|number| *number > 0) else {
                    let what = format!("there is no frame {frame}");
                    return Err(Problem::new(number.span, what, "1 or more expected here"));
                };
                Act::Frame(frame, self.fault(*harm))
            }
            FrameStep::Drive(drive, harm) => {
                needs.push(match harm {
                    DriveHarm::Off | DriveHarm::On => Capability::Power,
                    DriveHarm::BusOff => Capability::Simulator,
                });
                Act::Harm(self.drive(drive)?.node, *harm)
            }
            FrameStep::Outside(drive, outside) => {
                needs.push(match outside {
                    Outside::Restart => Capability::Power,
                    Outside::Register(name, _) => of_register(register(name, self.scope)?),
                    Outside::Input(..) | Outside::Force(..) => Capability::Simulator,
                });
                self.outside(drive, outside)?
            }
            FrameStep::Quiet => Act::Quiet,
            FrameStep::Register(drive, name, expect) => {
                let setup = self.drive(drive)?;
                let register = register(name, self.scope)?;
                Act::Register(setup.node, self.wanted(expect, register, setup)?)
            }
            FrameStep::Job(job) => self.job(job, span)?,
            FrameStep::Master(job) => self.by_driver(job)?,
        })
    }

    fn pieces(act: &Act) -> (usize, usize) {
        match act {
            Act::Send(_) => (1, 0),
            Act::Read { .. } | Act::Driver(..) => (1, 1),
            _ => (0, 0),
        }
    }

    fn judges(act: &Act) -> bool {
        match act {
            Act::Frame(..) | Act::Harm(..) | Act::Outside(..) | Act::Restart(_) | Act::Send(_) => {
                false
            }
            Act::Quiet | Act::Register(..) | Act::Read { .. } | Act::Driver(..) => true,
        }
    }

    fn needs(&self, scenario: &Scenario<Unitek>) -> Vec<Capability> {
        let lines = scenario.header.drives.iter();
        let needs = lines.filter_map(|line| match &line.what {
            // A rig has drives with properties of their own, which are found out.
            SetupKind::There { .. } | SetupKind::Profile(_) | SetupKind::Property(..) => None,
            SetupKind::Outside(Outside::Register(RegisterName::Known { register, .. }, _)) => {
                Some(of_register(register))
            }
            _ => Some(Capability::Simulator),
        });
        let master = scenario.header.master.as_ref();
        let wrong = master.map(|_| Capability::Simulator);
        needs.chain(wrong).collect()
    }

    fn finish(self) -> Setup {
        self.setup
    }
}

impl Planner {
    fn fault(&self, harm: FrameHarm) -> FrameFault {
        match harm {
            FrameHarm::Lost => FrameFault::Lost,
            FrameHarm::Doubled => FrameFault::Doubled,
            FrameHarm::Delay(time) => FrameFault::Late(time.on(self.byte_time())),
            FrameHarm::Corrupt => FrameFault::Corrupt,
            FrameHarm::NoAcknowledge => FrameFault::NoAcknowledge,
            FrameHarm::BusOff => FrameFault::BusOff,
        }
    }
}
