//! What the bench keeps of the rings while a scenario is played.

use super::Runner;
use super::bytes::resolve;
use super::record::CellRecorder;
use crate::language::Novobus;
use crate::language::plan::{PlannedStep, RingAct};
use crate::language::syntax::Ending;
use crate::link::BesideTheBus;
use harness_bench::link::{Link, Moment};
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::plan::{Plan, PlannedAction, PlannedWhen};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::{ByteDifference, Mismatch, Stop};
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::master::Fault;
use harness_proto::novobus::sync::PAUSE;
use harness_proto::time::Instant;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of bytes shown that no line asks for.
const UNASKED: usize = 16;

/// Maximum number of drives in the error mode that are named.
const NAMED: usize = 6;

/// What is kept of one ring.
#[derive(Default)]
pub(crate) struct RingState {
    /// The first byte after the last check sequence that came back.
    pub(crate) since_recovery: usize,
    /// What was sent, and whether no fault was put on it at the master's end.
    pub(crate) sent: Vec<(u8, bool)>,
    /// The commands that it was sent by the driver; `None` where there may be others.
    pub(crate) asked: Option<Vec<(u8, Command)>>,
}

/// What is kept of all rings.
pub struct RunState {
    pub(crate) rings: Vec<RingState>,
    pub(crate) recorder: CellRecorder,
    /// Cells that were read over the bus, where the link does not show them.
    pub(crate) seen: BTreeMap<(usize, u8, u16), u8>,
    /// Drives that have just answered a telegram, where the link does not show the error mode.
    pub(crate) answers: BTreeSet<(usize, u8)>,
    /// Drives whose error mode taps have just shown, with its cause; `None` where they are not in it.
    pub(crate) tapped: BTreeMap<(usize, u8), Option<BusError>>,
    /// The number of check sequences that came back.
    pub(crate) corrected: u64,
    /// The faults that the driver reported in its last job, in order.
    pub(crate) disturbed: Vec<Fault>,
    /// How the commands of that job have ended.
    pub(crate) ended: Vec<Ending>,
    /// When the driver last left the line of a ring free in the middle of its work, if it did.
    pub(crate) gap: Option<Instant>,
    /// The number of bytes sent since the last check, and when.
    pub(crate) sent: u64,
    pub(crate) sent_from: Instant,
    pub(crate) sent_to: Instant,
}

impl RunState {
    pub(crate) fn new(plan: &Plan<Novobus>, link: &dyn Link) -> Self {
        let ring = |_| RingState {
            asked: Some(Vec::new()),
            ..RingState::default()
        };
        Self {
            rings: plan.rings.iter().map(ring).collect(),
            recorder: CellRecorder::default(),
            seen: BTreeMap::new(),
            answers: BTreeSet::new(),
            tapped: BTreeMap::new(),
            corrected: 0,
            disturbed: Vec::new(),
            ended: Vec::new(),
            gap: None,
            sent: 0,
            sent_from: link.now(),
            sent_to: link.now(),
        }
    }

    /// Notes bytes that were sent into a ring, from a time to a time.
    pub(crate) fn sent(&mut self, ring: usize, bytes: &[u8], (from, to): (Instant, Instant)) {
        if self.sent == 0 {
            self.sent_from = from.max(self.sent_to);
        }
        self.sent += bytes.len() as u64;
        self.sent_to = to;
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.sent.extend(bytes.iter().map(|byte| (*byte, true)));
        }
    }

    /// Notes the last byte of what a ring has returned.
    pub(crate) fn received(&mut self, ring: usize, all: &[(Instant, Received)]) {
        let Some(ring) = self.rings.get_mut(ring) else {
            return;
        };
        if ends_with_sequence(&all[ring.since_recovery..]) {
            ring.since_recovery = all.len();
            self.corrected += 1;
        }
    }

    /// A line sends by itself what the driver is not asked for.
    pub(crate) fn by_hand(&mut self, ring: usize) {
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.asked = None;
        }
    }
}

fn ends_with_sequence(received: &[(Instant, Received)]) -> bool {
    let mut pairs = received.iter().rev().zip(SEQUENCE.iter().rev());
    received.len() >= SEQUENCE.len() && pairs.all(|((_, byte), due)| byte.is(*due))
}

/// What differs, byte by byte.
pub(crate) fn difference(
    ring: usize,
    (first, index): (usize, usize),
    wanted: &[Expected],
    received: &[(Instant, Received)],
) -> ByteDifference {
    let shown = match wanted {
        [] => UNASKED,
        _ => usize::MAX,
    };
    // A checking byte is shown as the byte that it must be, where that is known.
    let expected = wanted.iter().enumerate().map(|(i, byte)| {
        let before = received.get(..i);
        before.map_or(*byte, |before| resolve(*byte, before))
    });
    ByteDifference {
        ring,
        byte: first + index + 1,
        at: received.get(index).map(|(at, _)| *at),
        index,
        expected: expected.collect(),
        received: received.iter().take(shown).map(|(_, byte)| *byte).collect(),
    }
}

/// What the header lets happen; and a fault at a byte, which is armed from the start, wherever its line stands: its byte is counted
/// from the start too.
pub(crate) fn begin(runner: &mut Runner<'_>) -> Result<(), Stop> {
    let plan = runner.plan;
    for (ring, drives, influence) in plan.influences() {
        influence.act(runner.link, ring, drives);
    }
    for step in &plan.steps {
        if let PlannedAction::Own(RingAct::Fault(
            ring,
            fault,
            moment @ (Moment::Byte(_) | Moment::At(_)),
        )) = step.action
        {
            runner.place = step.span;
            runner.link.inject(ring, fault, moment);
            runner.halted()?;
        }
    }
    Ok(())
}

/// Plays a step of this bus.
pub(crate) fn act_of_ring(
    runner: &mut Runner<'_>,
    act: &RingAct,
    step: &PlannedStep,
) -> Result<(), Stop> {
    match act {
        RingAct::Fault(ring, fault, Moment::Now) => {
            // With a time in front it is the byte at that time, without one the first byte of the lines behind.
            let moment = match step.when {
                PlannedWhen::Now => Moment::Now,
                _ => Moment::At(runner.link.now()),
            };
            runner.link.inject(*ring, *fault, moment);
            Ok(())
        }
        RingAct::Fault(..) => Ok(()),
        RingAct::Influence(ring, drives, influence) => {
            influence.act(runner.link, *ring, drives.clone());
            Ok(())
        }
        RingAct::Record(record) => {
            super::record::record(runner, record);
            Ok(())
        }
        RingAct::Until(check, within) => super::drives::until(runner, check, *within, step.span),
        RingAct::Check(check) => {
            if step.when == PlannedWhen::Now {
                runner.settle();
                runner.line_before = runner.line_before.max(runner.link.now());
            }
            let result =
                super::check::check(runner, check, step.when != PlannedWhen::Now, step.span);
            runner.own.sent = 0;
            result
        }
        RingAct::Telegram(ring, bytes, expected, reading) => {
            runner.own.by_hand(*ring);
            runner.settle();
            let asked = runner.nothing_unasked(step.span);
            if asked.is_err() && runner.stops_at_mismatch() {
                return asked;
            }
            runner.forget(*ring);
            runner.transmit(*ring, bytes);
            asked
                .and(runner.expect(step.span, *ring, expected, None))
                .and_then(|()| {
                    super::drives::read(runner, *ring, expected.len(), reading.as_ref(), step.span)
                })
        }
        RingAct::Recover(ring) => recover(runner, *ring, step.span),
        RingAct::Master(ring, calls, once) => {
            super::master::master(runner, *ring, calls, *once, step.span)
        }
        RingAct::Count(ring, drives) => super::master::count(runner, *ring, *drives, step.span),
    }
}

/// ND21 9.8: 17 zeros and the five bytes; they must come back.
fn recover(runner: &mut Runner<'_>, ring: usize, span: TextSpan) -> Result<(), Stop> {
    runner.settle();
    let before = runner.own.corrected;
    runner.transmit(ring, &CHECK_SEQUENCE);
    runner.settle();
    runner.forget(ring);
    runner.line_before = runner.link.now();
    if runner.own.corrected > before {
        return Ok(());
    }
    Err(Stop::failed(
        span,
        "the check sequence FF 44 72 4C 41 did not come back (ND21 9.8)",
    ))
}

/// Whether fewer bytes have come round a ring than were sent into it, PAUSE left out (9.1, 9.2).
pub(crate) fn lacks_answers(runner: &Runner<'_>) -> bool {
    let mut rings = runner.own.rings.iter().zip(&runner.ports);
    rings.any(|(ring, port)| {
        let answered = ring.sent.iter().filter(|(byte, _)| *byte != PAUSE);
        port.received.len() < answered.count()
    })
}

/// The drives in the error mode, in ring order.
pub(crate) fn in_error(runner: &Runner<'_>) -> String {
    let mut named = Vec::new();
    for ring in 0..runner.ports.len() {
        for drive in (0..runner.link.drives(ring)).rev() {
            if let Some(Some(error)) = runner.link.error_of(ring, drive) {
                let prefix = if ring == 0 { "" } else { "2:" };
                named.push(format!("{prefix}{drive} ({error})"));
            }
        }
    }
    let more = named.len().saturating_sub(NAMED);
    named.truncate(NAMED);
    if more > 0 {
        named.push(format!("and {more} more"));
    }
    named.join(", ")
}

/// Adds to a finding what has been received meanwhile.
pub(crate) fn complete(runner: &Runner<'_>, finding: &mut Mismatch) {
    if let Some(difference) = &mut finding.difference {
        let first = difference.byte - 1 - difference.index;
        let wanted = difference.expected.len().max(1);
        let received = runner.ports[difference.ring].received.iter();
        difference.received = received.skip(first).take(wanted).map(|(_, b)| *b).collect();
    }
}
