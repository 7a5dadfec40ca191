//! A scenario of this bus, read for a rig.

use super::{AT_REST, KnownDrives};
use crate::language::Unitek;
use crate::language::plan::{Act, WantedFrame, WantedOutcome};
use crate::language::syntax::Header;
use crate::rig::Axis;
use crate::simulate::DriveSetup;
use harness_bench::qualify::segment::CONVERSATION;
use harness_bench::scenario::parse::parse;
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::plan::{Plan, PlannedAction, PlannedStep, plan};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::can::Frame;
use harness_proto::unitek::frame::{READ, Request};
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::words::MODE_EVENT;
use std::collections::BTreeSet;

/// CAN_TIMEOUT.
const TIME_OUT: u8 = 0xD0;

/// FUNC_REF_START.
const HOMING: u8 = 0x78;

/// The firmware, which each drive has of its own (dump).
const FIRMWARE: u8 = 0x1B;

/// A scenario, read for a rig.
#[derive(Clone, Debug)]
pub(crate) struct RigScenario {
    pub(super) name: String,
    pub(super) header: Header,
    pub(in super::super) plan: Plan<Unitek>,
    /// Whether no line waits for a frame: what comes is judged by right drives alone.
    pub(super) by_frames: bool,
}

impl RigScenario {
    pub(in super::super) fn read(source: &Source) -> Result<Self, Box<Problems>> {
        let scenario: Scenario<Unitek> = parse(source)?;
        let mut plan = plan(&scenario, source, None)?;
        let waits = |step: &Step| {
            let receives = matches!(step.action, PlannedAction::Receive(..));
            receives || matches!(step.action, PlannedAction::Own(Act::Quiet))
        };
        let steps = &plan.steps;
        let alone = !steps.iter().any(waits) && steps.iter().any(is_answered);
        let by_frames = alone && source.name.starts_with(CONVERSATION);
        plan.strict &= !by_frames;
        Ok(Self {
            name: source.name.clone(),
            header: scenario.header,
            plan,
            by_frames,
        })
    }

    pub(in super::super) fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.plan.steps.iter().flat_map(|step| match &step.action {
            PlannedAction::Send(_, frames) => frames.as_slice(),
            PlannedAction::Own(Act::Send(frame) | Act::Read { request: frame, .. }) => {
                std::slice::from_ref(frame)
            }
            _ => &[],
        })
    }

    /// Whether a drive may supervise the time between frames in it (T-Out): every query of the bench would begin that time again.
    pub(super) fn may_time_out(&self, drives: &[KnownDrives]) -> bool {
        let held = drives.iter().any(|known| known.cell(TIME_OUT) != 0);
        let header = self.plan.setup.drives.iter();
        let mut header = header.flat_map(|drive| &drive.registers);
        held || header.any(|(register, _)| *register == TIME_OUT)
            || self.frames().any(|frame| writes(frame, TIME_OUT))
    }

    /// Whether something beside what the bench sends decides what a drive does: a fault of a frame, power, an input.
    pub(super) fn acts_beside_the_bus(&self) -> bool {
        let mut steps = self.plan.steps.iter();
        steps.any(|step| {
            matches!(
                step.action,
                PlannedAction::Own(
                    Act::Frame(..) | Act::Harm(..) | Act::Outside(..) | Act::Restart(_)
                )
            )
        })
    }

    /// Whether right drives can be compared in all of it: how long homing takes is not known.
    pub(super) fn is_foretold(&self) -> bool {
        !self.frames().any(|frame| writes(frame, HOMING))
    }

    /// The registers whose contents its lines ask for.
    pub(super) fn asks_for(&self) -> BTreeSet<u8> {
        self.plan.steps.iter().flat_map(asks).collect()
    }

    /// The registers whose contents the lines at these places ask for.
    pub(super) fn asks_at(&self, places: &[usize]) -> BTreeSet<u8> {
        let steps = self.plan.steps.iter();
        let named = steps.filter(|step| places.contains(&step.span.start));
        named.flat_map(asks).collect()
    }

    /// The scenario in which lines that ask for the firmware ask for what it read on the drive: the scenario is for drives of any. Where its
    /// header or a step states it, it stays.
    pub(super) fn with_firmware(&self, known: &[KnownDrives]) -> Self {
        let mut scenario = self.clone();
        let stated = |drive: &DriveSetup| {
            drive
                .registers
                .iter()
                .any(|(number, _)| *number == FIRMWARE)
        };
        if scenario.plan.setup.drives.iter().any(stated) {
            return scenario;
        }
        let read = |is: &dyn Fn(&Axis) -> bool| {
            let known = known.iter().find(|known| is(&known.axis))?;
            known.cells.get(&FIRMWARE).map(|raw| raw & 0xFFFF)
        };
        for step in &mut scenario.plan.steps {
            match &mut step.action {
                PlannedAction::Receive(_, wanted) => {
                    for frame in wanted {
                        let id = frame.id.number();
                        let Some(raw) = read(&|axis| u32::from(axis.tx) == id) else {
                            continue;
                        };
                        let [low, high, ..] = raw.to_le_bytes();
                        if let [Expected::Byte(FIRMWARE), contents @ ..] = &mut frame.data[..] {
                            for (expected, byte) in contents.iter_mut().zip([low, high]) {
                                if matches!(expected, Expected::Byte(_)) {
                                    *expected = Expected::Byte(byte);
                                }
                            }
                        }
                    }
                }
                PlannedAction::Own(Act::Read {
                    tx,
                    register: FIRMWARE,
                    wanted: Some(wanted),
                    ..
                }) => {
                    if let Some(raw) = read(&|axis| axis.tx == *tx) {
                        wanted.raw = raw;
                    }
                }
                PlannedAction::Own(Act::Driver(node, _, WantedOutcome::Reads(wanted)))
                    if wanted.register == FIRMWARE =>
                {
                    if let Some(raw) = read(&|axis| axis.node == *node) {
                        wanted.raw = raw;
                    }
                }
                _ => {}
            }
        }
        scenario
    }
}

type Step = PlannedStep<Unitek>;

/// Whether a drive sends something by what a step sends: a request, a cycle (UNITEK 5.2), or events (ex 10).
fn is_answered(step: &Step) -> bool {
    let PlannedAction::Send(_, frames) = &step.action else {
        return false;
    };
    frames.iter().any(|frame| match frame.data() {
        [READ, ..] => true,
        [0x51, low, ..] => u16::from(*low) & MODE_EVENT != 0,
        _ => false,
    })
}

/// The registers whose contents a step asks for.
fn asks(step: &Step) -> Vec<u8> {
    let first = |wanted: &WantedFrame| match &wanted.data[..] {
        [Expected::Byte(register), contents @ ..] => {
            let any = contents.iter().all(|expected| *expected == Expected::Any);
            (!any).then_some(*register)
        }
        _ => None,
    };
    match &step.action {
        PlannedAction::Receive(_, wanted) => wanted.iter().filter_map(first).collect(),
        PlannedAction::Own(Act::Read { register, .. }) => vec![*register],
        PlannedAction::Own(Act::Register(_, wanted)) => vec![wanted.register],
        PlannedAction::Own(Act::Driver(..)) => AT_REST.to_vec(),
        _ => Vec::new(),
    }
}

pub(in super::super) fn stores(frame: &Frame) -> bool {
    writes(frame, 0x84)
}

fn writes(frame: &Frame, number: u8) -> bool {
    let rx = u16::try_from(frame.id().number()).unwrap_or(0);
    let request = Request::decode(frame, rx, Dlc4::As3);
    matches!(request, Ok(Request::Write { register, .. }) if register == number)
}
