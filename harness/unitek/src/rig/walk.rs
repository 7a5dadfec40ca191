//! The conversations that walk a right drive: locked, released and turning, with and without a cycle and events, with each input.
//!
//! What takes its own time (the time-out, homing, the EEPROM, positions) and what moves a drive to other identifiers is left to the
//! conversations in corpora/qualify/unitek.

use super::Axis;
use super::values::values;
use harness_bench::qualify::walk::{Walk, WalkBounds, WalkModel, WalkPart, walk};
use harness_proto::can::{BadFrame, BitRate, Frame, Id};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{Data, Request};
use harness_proto::unitek::guard::{Denial, FrameGate, Limits};
use harness_proto::unitek::properties::Properties;
use harness_proto::unitek::words::MODE_EVENT;
use harness_sim::unitek::{Drive, Inputs};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A conversation of more would have more worlds of a right drive than are kept.
const BOUNDS: WalkBounds = WalkBounds {
    conversation: Span::from_millis(800),
    all: Span::from_millis(6_000),
};

/// How long a request and its reply take behind an adapter, at most, in ms (our choice).
const REPLY: u64 = 2;

/// The measured speed (App 7).
const SPEED: u8 = 0x30;

/// What may be sent to a drive.
#[derive(Clone, Copy)]
enum DriveInput {
    /// A request of a register (UNITEK 5.2 item 1).
    Read(u8),
    /// Frames on its identifier, and the time in ms after each.
    Frames(&'static [(&'static [u8], u64)]),
    /// A remote frame (4.4).
    Remote,
    /// A request on the next higher identifier (4.1).
    Neighbour,
    /// A request with an identifier of 29 bits (4.1).
    Extended,
    /// A value for a register, or why it is not written.
    Value(u8, Data, Option<&'static str>),
}

use DriveInput::{Extended, Frames, Neighbour, Read, Remote, Value};

/// An input of a walk: its name, what is sent, and the registers that are read after it, beside STATUS.
type Input = (&'static str, DriveInput, &'static [u8]);

/// The register of the cycle: nothing else asks for it, so that a frame of it is one of the cycle.
const CYCLIC: u8 = 0x34;

/// The inputs of a walk beside the values of registers.
const INPUTS: [Input; 36] = [
    ("a request of firmware", Read(0x1B), &[]),
    ("a request of MODE", Read(0x51), &[]),
    ("a request of STATUS_MASK", Read(0x52), &[]),
    ("a request of errors", Read(0x8F), &[]),
    ("a request of the speed command", Read(0x31), &[]),
    ("a request of the speed", Read(0x30), &[]),
    ("a request of 100 % of the speed", Read(0xC8), &[]),
    ("a request of a variable", Read(0xD1), &[]),
    ("a request of ready", Read(0xE2), &[]),
    ("a request of running", Read(0xE3), &[]),
    ("a request of an input", Read(0xE8), &[]),
    ("a request of a function", Read(0x83), &[]),
    (
        "0 to a variable",
        Frames(&[(&[0xD4, 0, 0, 0, 0], 0)]),
        &[0xD4],
    ),
    (
        "1 to a variable",
        Frames(&[(&[0xD4, 1, 0, 0, 0], 0)]),
        &[0xD4],
    ),
    (
        "the highest number to a variable",
        Frames(&[(&[0xD4, 0xFF, 0xFF, 0xFF, 0x7F], 0)]),
        &[0xD4],
    ),
    (
        "the lowest number to a variable",
        Frames(&[(&[0xD4, 0, 0, 0, 0x80], 0)]),
        &[0xD4],
    ),
    (
        "-1 to a variable",
        Frames(&[(&[0xD4, 0xFF, 0xFF, 0xFF, 0xFF], 0)]),
        &[0xD4],
    ),
    (
        "16 bits to a variable",
        Frames(&[(&[0xD4, 0xFE, 0x7F], 0)]),
        &[0xD4],
    ),
    ("a write of one byte", Frames(&[(&[0xD4], 0)]), &[0xD4]),
    (
        "a write of two bytes",
        Frames(&[(&[0xD4, 0x55], 0)]),
        &[0xD4],
    ),
    (
        "a write of six bytes",
        Frames(&[(&[0xD4, 0x66, 0x66, 0x66, 0x66, 0], 0)]),
        &[0xD4],
    ),
    (
        "a write of eight bytes",
        Frames(&[(&[0xD4, 0x77, 0x77, 0x77, 0x77, 0, 0, 0], 0)]),
        &[0xD4],
    ),
    (
        "a write to firmware",
        Frames(&[(&[0x1B, 0x34, 0x12], 0)]),
        &[0x1B],
    ),
    ("a cycle", Frames(&[(&[0x3D, CYCLIC, 10], 12)]), &[]),
    (
        "the end of a cycle",
        Frames(&[(&[0x3D, CYCLIC, 0xFF], 12)]),
        &[],
    ),
    (
        "a cycle and its end",
        Frames(&[(&[0x3D, 0xD4, 5], 12), (&[0x3D, 0xD4, 0xFF], 6)]),
        &[],
    ),
    (
        "a lock",
        Frames(&[(&[0x51, 0x04, 0], 5)]),
        &[0x51, 0xE3, 0x30],
    ),
    (
        "a lock with events",
        Frames(&[(&[0x51, 0x14, 0], 5)]),
        &[0x51, 0xE3, 0x30],
    ),
    (
        "a release",
        Frames(&[(&[0x51, 0, 0], 5)]),
        &[0x51, 0xE3, 0x30],
    ),
    (
        "a release with events",
        Frames(&[(&[0x51, 0x10, 0], 5)]),
        &[0x51, 0xE3, 0x30],
    ),
    (
        "a speed forwards",
        Frames(&[(&[0x31, 0x66, 0x06], 10)]),
        &[0x31, 0x30],
    ),
    (
        "a speed backwards",
        Frames(&[(&[0x31, 0x9A, 0xF9], 10)]),
        &[0x31, 0x30],
    ),
    (
        "a speed of 0",
        Frames(&[(&[0x31, 0, 0], 25)]),
        &[0x31, 0x30],
    ),
    ("a remote frame", Remote, &[]),
    ("a request on the next identifier", Neighbour, &[]),
    ("a request with 29 bits", Extended, &[]),
];

/// Frames in front of a walk, as far as the rig's file permits them: locked, without command, cycle and mask, and ramps that a walk can wait for.
const FIRST: [&[u8]; 6] = [
    &[0x51, 0x04, 0],
    &[0x31, 0, 0],
    &[0x52, 0x01, 0, 0, 0],
    &[0x35, 0xC8, 0, 0x64, 0],
    &[0xED, 0xC8, 0, 0x64, 0],
    &[0xD4, 0, 0, 0, 0],
];

/// Frames after a walk, and the time in ms after each.
const LAST: [(&[u8], u64); 4] = [
    (&[0x3D, CYCLIC, 0xFF], 12),
    (&[0x31, 0, 0], 30),
    (&[0x51, 0x04, 0], 5),
    (&[0x52, 0, 0, 0, 0], 0),
];

/// What distinguishes the states of a drive.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct State {
    enabled: bool,
    turning: bool,
    cycle: bool,
    events: bool,
}

/// A right drive behind the guard of the rig's file.
#[derive(Clone)]
struct Model {
    drive: Drive,
    gate: FrameGate,
    axis: Axis,
    now: Instant,
    inputs: Arc<[Input]>,
    /// Whether it is walked with values alone: nothing turns until they are set back.
    writes_values: bool,
}

impl Model {
    fn new(axis: Axis, limits: &Limits) -> Self {
        let registers = [(0x68, axis.rx.into()), (0x69, axis.tx.into())];
        let drive = Drive::new(Properties::default(), Inputs::default(), Instant::START);
        let drive = drive.with_setup(&registers);
        let mut gate = FrameGate::new(limits.clone(), BitRate::K500, &[(axis.rx, axis.tx)]);
        let low = |number: usize| (drive.held()[number] & 0xFFFF) as u16;
        gate.learn(axis.rx, low(0xC8), low(0x34));
        Self {
            drive,
            gate,
            axis,
            now: Instant::START,
            inputs: inputs(limits).into(),
            writes_values: false,
        }
    }

    /// Sends a frame, and lets a time in ms pass.
    fn send(&mut self, frame: &Frame, millis: u64) -> Result<(), String> {
        let admitted = self.gate.admit(self.now, frame);
        admitted.map_err(|denial| match denial {
            Denial::NotPermitted { missing, .. } => format!("needs {}", missing.name()),
            Denial::Identifier => {
                "needs `allow_other_identifiers` in the rig's [limits]".to_owned()
            }
            other => other.to_string(),
        })?;
        // What no drive hears changes none.
        _ = self.drive.receive(self.now, frame);
        self.pass(REPLY + millis);
        Ok(())
    }

    fn frame(&self, bytes: &[u8]) -> Result<Frame, String> {
        Frame::base(self.axis.rx, bytes).map_err(|error| error.to_string())
    }

    /// Sends bytes on the identifier of the drive: the lines that do so.
    fn bytes(&mut self, bytes: &[u8], millis: u64) -> Result<Vec<String>, String> {
        let frame = self.frame(bytes)?;
        self.send(&frame, millis)?;
        let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        let line = format!("> {:03X} {}", self.axis.rx, hex.join(" "));
        let wait = (millis > 0).then(|| format!("wait {millis}ms"));
        Ok([line].into_iter().chain(wait).collect())
    }

    fn read(&mut self, register: u8) -> Result<String, String> {
        let frame = self.frame(&[0x3D, register, 0])?;
        self.send(&frame, 0)?;
        Ok(format!("read {} {register:02X}", self.axis.node))
    }

    /// Waits until an axis that was locked stands: the line that does so.
    fn stands(&mut self) -> Option<String> {
        let mut waited = 0;
        while !self.drive.is_enabled() && self.drive.register(SPEED) != 0 {
            waited += 10;
            self.pass(10);
        }
        // A right drive may take longer than the model.
        (waited > 0).then(|| format!("wait {}ms", waited * 3 / 2))
    }

    /// Lets a time in ms pass.
    fn pass(&mut self, millis: u64) {
        self.now += Span::from_millis(millis);
        self.drive.advance(self.now);
        while self.drive.wants().is_some() {
            self.drive.sent();
        }
    }

    /// Sends a frame that no drive takes.
    fn other(
        &mut self,
        frame: Result<Frame, BadFrame>,
        line: String,
    ) -> Result<Vec<String>, String> {
        let frame = frame.map_err(|error| error.to_string())?;
        self.send(&frame, 3)?;
        Ok(vec![line, "wait 3ms".to_owned()])
    }
}

impl WalkModel for Model {
    type State = State;

    fn state(&self) -> State {
        let mode = self.drive.held()[0x51];
        State {
            enabled: self.drive.is_enabled(),
            turning: self.drive.register(SPEED) != 0,
            cycle: self.drive.running_cycles().next().is_some(),
            events: mode & u32::from(MODE_EVENT) != 0,
        }
    }

    fn takes(&self, input: usize) -> bool {
        matches!(self.inputs[input].1, Value(..)) == self.writes_values
    }

    fn put(&mut self, input: usize) -> Result<Vec<String>, String> {
        let (_, sent, asks) = self.inputs[input];
        let (rx, next) = (self.axis.rx, self.axis.rx + 1);
        let request = [0x3D, 0x40, 0];
        let mut lines = match sent {
            Read(register) => vec![self.read(register)?],
            Value(_, _, Some(why)) => return Err(why.to_owned()),
            Value(register, data, None) => {
                let request = Request::Write { register, data };
                let frame = request.encode(rx).map_err(|error| error.to_string())?;
                let mut lines = self.bytes(frame.data(), 0)?;
                lines.push(self.read(register)?);
                return Ok(lines);
            }
            Frames(frames) => {
                let mut lines = Vec::new();
                for (bytes, millis) in frames {
                    lines.extend(self.bytes(bytes, *millis)?);
                }
                lines
            }
            Remote => {
                let id = Id::base(rx).ok_or("no identifier")?;
                self.other(Frame::remote(id, 3), format!("> {rx:03X} rtr 3"))?
            }
            Neighbour => {
                let line = format!("> {next:03X} 3D 40 00");
                self.other(Frame::base(next, &request), line)?
            }
            Extended => {
                let id = Id::extended(rx.into()).ok_or("no identifier")?;
                self.other(Frame::new(id, &request), format!("> x{rx:08X} 3D 40 00"))?
            }
        };
        let State { cycle, events, .. } = self.state();
        if cycle && events {
            return Err("a cycle and events at once are left to kept conversations".to_owned());
        }
        lines.extend(self.stands());
        if !matches!(sent, Read(_)) {
            for register in asks.iter().chain(&[0x40]) {
                lines.push(self.read(*register)?);
            }
        }
        Ok(lines)
    }

    fn now(&self) -> Instant {
        self.now
    }
}

/// The walk of a drive. What needs no motion is walked first, in conversations of its own: they are played without --allow-motion.
pub(super) fn walk_of(axis: Axis, limits: &Limits) -> Walk<State> {
    let still = Limits {
        motion: false,
        ..limits.clone()
    };
    let both = |limits: &Limits, before: &[WalkPart<State>]| {
        let states = Model::new(axis, limits);
        let values = Model {
            writes_values: true,
            ..states.clone()
        };
        walk_from(states, before).beside(walk_from(values, before))
    };
    let first = both(&still, &[]);
    match limits.motion {
        true => {
            let second = both(limits, &first.parts);
            first.then(second)
        }
        false => first,
    }
}

/// The walk of a model to what was not walked before.
fn walk_from(mut model: Model, before: &[WalkPart<State>]) -> Walk<State> {
    let mut first = Vec::new();
    for bytes in FIRST {
        let mut tried = model.clone();
        if let Ok(lines) = tried.bytes(bytes, 0) {
            first.extend(lines);
            model = tried;
        }
    }
    let mut walk = walk(&model, model.inputs.len(), BOUNDS, before);
    for part in &mut walk.parts {
        let lines = std::mem::replace(&mut part.lines, first.clone());
        part.lines.extend(lines);
        // No later value has changed an earlier one.
        let values = part
            .walked
            .iter()
            .filter_map(|(_, input)| match model.inputs[*input].1 {
                Value(register, ..) => Some(register),
                _ => None,
            });
        let values: BTreeSet<_> = values.collect();
        let again = values
            .into_iter()
            .map(|register| model.clone().read(register));
        part.lines.extend(again.flatten());
        for (bytes, millis) in LAST {
            // What is switched off needs no more than what has switched it on.
            let last = model.clone().bytes(bytes, millis);
            part.lines.extend(last.unwrap_or_default());
        }
    }
    walk
}

/// The text of a conversation with these lines of a walk.
pub(super) fn walked(axis: Axis, lines: &[String]) -> String {
    let Axis { node, rx, tx } = axis;
    format!(
        "title   A walk through the states of a drive, with each input in each of them\nsource  unitek 5.2\nbus     unitek\n\
         drive {node} rx {rx:03X} tx {tx:03X}\n\n{}\n",
        lines.join("\n")
    )
}

/// The inputs of a walk, in the order of their numbers.
fn inputs(limits: &Limits) -> Vec<Input> {
    let values = values(limits).into_iter().map(|value| {
        let data = Data::of(value.register, value.raw);
        let sent = Value(value.register.number, data, value.left_out);
        (value.name, sent, &[][..])
    });
    INPUTS.into_iter().chain(values).collect()
}

/// The names of the inputs, in the order of their numbers.
pub(super) fn names(limits: &Limits) -> Vec<&'static str> {
    inputs(limits).into_iter().map(|(name, ..)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: Axis = Axis {
        node: 1,
        rx: 0x201,
        tx: 0x181,
    };

    fn told(limits: &Limits) -> String {
        walk_of(AXIS, limits).told(&names(limits), |_| true)
    }

    /// Each limit that is missing is named with what it would permit, and nothing that it denies is planned.
    #[test]
    fn what_the_rig_s_file_does_not_permit_is_named() {
        let all = told(&Limits::unlimited());
        assert!(!all.contains("allow_"), "{all}");
        assert!(!all.contains("not reached"), "{all}");
        let none = told(&Limits::default());
        for missing in ["allow_motion", "allow_other_identifiers"] {
            assert!(none.contains(missing), "{none}");
        }
        let lines = walk_of(AXIS, &Limits::default()).parts.into_iter();
        let lines: Vec<_> = lines.flat_map(|part| part.lines).collect();
        assert!(lines.iter().all(|line| !line.contains("> 201 31 66 06")));
        assert!(lines.iter().any(|line| line == "> 201 3D 34 0A"));
    }

    /// No drive is released with values that are tried, and each is read again at the end.
    #[test]
    fn values_are_written_to_a_locked_drive() {
        let walk = walk_of(AXIS, &Limits::unlimited()).parts.into_iter();
        let writes =
            |part: &WalkPart<State>| part.lines.iter().any(|line| line == "> 201 2C FF FF");
        let parts: Vec<_> = walk.filter(writes).collect();
        assert!(!parts.is_empty());
        for part in parts {
            assert_eq!(part.lines[0], "> 201 51 04 00");
            let modes = part
                .lines
                .iter()
                .filter(|line| line.starts_with("> 201 51 "));
            assert!(
                modes.clone().all(|line| line == "> 201 51 04 00"),
                "{part:?}"
            );
            assert!(
                !part.lines.contains(&"> 201 31 66 06".to_owned()),
                "{part:?}"
            );
            assert!(
                part.lines
                    .iter()
                    .filter(|line| *line == "read 1 2C")
                    .count()
                    > 1,
                "{part:?}"
            );
        }
    }

    /// What needs no motion stands in conversations without it.
    #[test]
    fn the_first_conversations_need_no_motion() {
        let still = Limits {
            motion: false,
            ..Limits::unlimited()
        };
        let all = walk_of(AXIS, &Limits::unlimited());
        let first = walk_of(AXIS, &still);
        for (place, part) in first.parts.iter().enumerate() {
            assert_eq!(part.lines, all.parts[place].lines);
        }
        assert!(all.parts.len() > first.parts.len());
    }
}
