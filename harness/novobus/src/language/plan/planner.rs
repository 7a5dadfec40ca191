//! Settles a scenario, line by line.

use super::drive::RunningRecords;
use super::setup::model_unless_said;
use super::types::{PlannedBench, PlannedCheck, RingAct};
use crate::language::Novobus;
use crate::language::parse::header::parse_lines;
use crate::language::plan::Plan;
use crate::language::syntax::{
    Check, DriveRange, FaultKind, FaultStep, Header, LinkEnds, LinkFaultKind, RingStep,
};
use harness_bench::link::{
    AnyStimulus, Capability, Moment, PlacedFault, needs_line_errors, only_simulated,
};
use harness_bench::scenario::expression::{Located, Scope};
use harness_bench::scenario::language::Settle;
use harness_bench::scenario::pattern::{Expected, MAX_BYTES, Pattern};
use harness_bench::scenario::plan::{MAX_CARRIED, Unroll, plan};
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::LinkFault;
use harness_sim::nd21;
use harness_sim::novobus::drive::Model;
use std::ops::{Deref, DerefMut, RangeInclusive};

/// The longest delay or break.
const MAX_FAULT: Span = Span::from_millis(10_000);

/// Settles a header for rings of these sizes: what a bench is before anything is sent.
///
/// # Errors
/// Everything that cannot be in these rings, placed in the lines of the header as they are written. `name` says where they come from.
pub(crate) fn plan_header(name: &str, header: &Header, sizes: &[u8]) -> Result<Plan, Problems> {
    let source = Source {
        name: name.to_owned(),
        text: header.lines().join("\n").into(),
    };
    let settle = |header: &Header| {
        let whole = header.and(&Header::of_rings(sizes));
        plan(&Scenario::new("", whole), &source, None)
    };
    settle(header).map_err(|mistakes: Problems| {
        // What was put together from several texts has its places in none of them.
        match parse_lines(&source).and_then(|header| settle(&header)) {
            Err(placed) => placed,
            Ok(_) => mistakes,
        }
    })
}

fn sizes(scenario: &Scenario<Novobus>, size: Option<u8>) -> Result<Vec<RingSize>, Problem> {
    let mut rings = Vec::new();
    for (index, range) in scenario.header.rings.iter().enumerate() {
        let wanted = size.filter(|_| index == 0).unwrap_or(range.default);
        if !range.contains(wanted) {
            return Err(Problem::new(
                range.span,
                format!("the scenario is not for a ring of {wanted}"),
                format!("{} to {} drives", range.smallest, range.largest),
            ));
        }
        let ring = RingSize::new(u64::from(wanted))
            .map_err(|error| Problem::new(range.span, error.to_string(), "this ring"))?;
        rings.push(ring);
    }
    Ok(rings)
}

/// Settles the header for a first ring of `size` drives where that is given.
///
/// # Errors
/// The scenario is not for a ring of this size.
pub(crate) fn settle(
    scenario: &Scenario<Novobus>,
    size: Option<u8>,
    found: &mut Vec<Problem>,
) -> Result<Planner, Problem> {
    let header = &scenario.header;
    let mut planner = Planner {
        bench: PlannedBench {
            rings: sizes(scenario, size)?,
            sizes: {
                let ranges = header.rings.iter();
                ranges.map(|size| (size.smallest, size.largest)).collect()
            },
            rate: header.rate.unwrap_or_default(),
            master: header.master.as_ref().map(|master| master.value),
            setups: Vec::new(),
            units: Vec::new(),
            models: Vec::new(),
        },
        model: model_unless_said(scenario),
        scope: Scope::default(),
        running: RunningRecords::default(),
    };
    found.extend(planner.set_up(&header.setups));
    Ok(planner)
}

/// Settles one more step for rings that are settled.
pub(crate) fn resume(bench: &PlannedBench) -> Planner {
    Planner {
        bench: bench.clone(),
        // The model of every drive is settled.
        model: Model::default(),
        scope: Scope::default(),
        running: RunningRecords::default(),
    }
}

/// Settles the lines of a scenario for rings of given sizes.
#[derive(Debug)]
pub struct Planner {
    pub(crate) bench: PlannedBench,
    /// The model of drives of which the header does not say it.
    pub(crate) model: Model,
    /// The counters of the loops around the step in hand.
    pub(crate) scope: Scope,
    running: RunningRecords,
}

impl Deref for Planner {
    type Target = PlannedBench;

    fn deref(&self) -> &PlannedBench {
        &self.bench
    }
}

impl DerefMut for Planner {
    fn deref_mut(&mut self) -> &mut PlannedBench {
        &mut self.bench
    }
}

impl Settle<Novobus> for Planner {
    fn unroll<'s>(&self, scenario: &'s Scenario<Novobus>) -> Unroll<'s, Novobus> {
        Unroll::new(&scenario.steps, self.size(0))
    }

    fn enter(&mut self, scope: Scope) {
        self.scope = scope;
    }

    fn byte_time(&self) -> Span {
        self.rate.byte_time()
    }

    fn room(&self) -> usize {
        let links = self.rings.iter().map(|ring| u64::from(ring.drives()) + 1);
        let room = MAX_CARRIED / links.sum::<u64>().max(1);
        MAX_BYTES.min(usize::try_from(room).unwrap_or(MAX_BYTES))
    }

    fn send(&self, port: usize, message: &Pattern) -> Result<Vec<u8>, Problem> {
        self.ring(port, message.span)?;
        message.expand_known(self.size(port), MAX_BYTES)
    }

    fn receive(&self, port: usize, message: &Pattern) -> Result<Vec<Expected>, Problem> {
        self.ring(port, message.span)?;
        message.expand(self.size(port), MAX_BYTES)
    }

    fn act(
        &mut self,
        step: &RingStep,
        span: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<RingAct, Problem> {
        let act = self.step(step, span, needs)?;
        if let RingAct::Record(record) = &act {
            self.running.take(record)?;
        }
        Ok(act)
    }

    fn pieces(act: &RingAct) -> (usize, usize) {
        match act {
            RingAct::Telegram(_, sent, expected, _) => (sent.len(), expected.len()),
            RingAct::Recover(_) => (CHECK_SEQUENCE.len(), 0),
            _ => (0, 0),
        }
    }

    fn judges(act: &RingAct) -> bool {
        match act {
            RingAct::Fault(..) | RingAct::Influence(..) | RingAct::Record(_) => false,
            RingAct::Check(_)
            | RingAct::Telegram(..)
            | RingAct::Recover(_)
            | RingAct::Master(..)
            | RingAct::Count(..)
            | RingAct::Until(..) => true,
        }
    }

    fn needs(&self, scenario: &Scenario<Novobus>) -> Vec<Capability> {
        let two = (self.rings.len() > 1).then_some(Capability::TwoRings);
        let setups = self.setups.iter().filter_map(|setup| setup.what.needs());
        // The effect of a wrong master on a machine is unknown.
        let master = scenario.header.master.iter().map(|_| Capability::Simulator);
        two.into_iter().chain(setups).chain(master).collect()
    }

    fn finish(self) -> PlannedBench {
        self.bench
    }
}

impl Planner {
    pub(crate) fn ring(&self, index: usize, span: TextSpan) -> Result<RingSize, Problem> {
        self.rings.get(index).copied().ok_or_else(|| {
            Problem::new(
                span,
                "the scenario has one ring",
                "a drive or link of ring 1 expected here",
            )
            .help("a second ring follows a comma in the header: `ring 4, 3`")
        })
    }

    /// What the expressions of a line for this ring can refer to.
    pub(crate) fn size(&self, ring: usize) -> Scope {
        let drives = self.rings.get(ring).map_or(0, |r| i64::from(r.drives()));
        self.scope.of_ring(drives)
    }

    fn drive(&self, ring: usize, number: &Located) -> Result<u8, Problem> {
        let size = self.ring(ring, number.span)?;
        let value = number.value(self.size(ring))?;
        match u8::try_from(value) {
            Ok(drive) if drive < size.drives() => Ok(drive),
            _ => Err(Problem::new(
                number.span,
                format!("there is no drive {value} in a ring of {}", size.drives()),
                format!("0 to {} expected here (ND21 8.5)", size.first()),
            )),
        }
    }

    pub(crate) fn drives(&self, drives: &DriveRange) -> Result<RangeInclusive<u8>, Problem> {
        let from = self.drive(drives.ring, &drives.from)?;
        let to = match &drives.to {
            Some(to) => self.drive(drives.ring, to)?,
            None => from,
        };
        Ok(from.min(to)..=from.max(to))
    }

    pub(crate) fn one(&self, drives: &DriveRange) -> Result<(usize, u8), Problem> {
        Ok((drives.ring, self.drive(drives.ring, &drives.from)?))
    }

    fn step(
        &self,
        step: &RingStep,
        span: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<RingAct, Problem> {
        match step {
            RingStep::Fault(fault) => self.fault(fault, needs),
            RingStep::Check(check) => Ok(RingAct::Check(self.check(check, needs)?)),
            RingStep::Job(job) => {
                needs.extend(job.needs());
                self.job(job)
            }
            RingStep::Until(check, within) => {
                let check = self.drive_check(check, needs)?;
                Ok(RingAct::Until(check, within.on(self.byte_time())))
            }
            RingStep::Influence(drives, influence) => {
                needs.push(influence.needs());
                self.influence(drives, influence, span)?;
                let range = self.drives(drives)?;
                Ok(RingAct::Influence(drives.ring, range, influence.clone()))
            }
            RingStep::Record(recording) => Ok(RingAct::Record(self.record(recording)?)),
        }
    }

    fn fault(&self, fault: &FaultStep, needs: &mut Vec<Capability>) -> Result<RingAct, Problem> {
        let size = self.size(fault.ring);
        let last = self.rings.get(fault.ring);
        let last = last.map_or(0, |ring| usize::from(ring.drives()));
        let placed = match &fault.what {
            FaultKind::Link(place, ends, kind) => {
                let link = self.link(fault.ring, place.span, ends)?;
                let fault = self.link_fault(*kind)?;
                // The master's own two links begin and end in the bench.
                if link > 0 && link < last {
                    needs.push(Capability::Interposer);
                }
                if needs_line_errors(fault) {
                    needs.push(Capability::LineErrors);
                }
                if only_simulated(fault) {
                    needs.push(Capability::Simulator);
                }
                PlacedFault::Link(link, fault)
            }
            FaultKind::Drive(drive, kind) => {
                needs.push(Capability::Power);
                PlacedFault::Drive(self.drive(fault.ring, drive)?, *kind)
            }
            FaultKind::Error(drive, error) => {
                needs.push(Capability::Simulator);
                if let Some(byte) = &fault.byte {
                    return Err(Problem::new(
                        byte.span,
                        "the drive's monitoring is not timed in bytes of the bus",
                        "a time expected here, as in `@20ms`",
                    ));
                }
                let drives = DriveRange {
                    ring: fault.ring,
                    from: drive.clone(),
                    to: None,
                };
                self.only_nd21(&drives, "monitoring", drive.span)?;
                let drive = self.drive(fault.ring, drive)?;
                PlacedFault::Stimulus(drive, AnyStimulus::Novobus(nd21::Stimulus::Error(*error)))
            }
        };
        let moment = match (&fault.byte, fault.at) {
            (Some(byte), _) => {
                let number = byte.value(size)?;
                match u64::try_from(number) {
                    Ok(number @ 1..) => Moment::Byte(number),
                    _ => {
                        return Err(Problem::new(
                            byte.span,
                            format!("there is no byte {number}"),
                            "bytes on a link are counted from 1",
                        ));
                    }
                }
            }
            (None, Some(at)) => Moment::At(Instant::START + at.on(self.byte_time())),
            (None, None) => Moment::Now,
        };
        Ok(RingAct::Fault(fault.ring, placed, moment))
    }

    fn link(&self, ring: usize, span: TextSpan, ends: &LinkEnds) -> Result<usize, Problem> {
        let size = self.ring(ring, span)?;
        let from = ends
            .from
            .as_ref()
            .map(|k| self.drive(ring, k))
            .transpose()?;
        let to = ends.to.as_ref().map(|k| self.drive(ring, k)).transpose()?;
        let next = match from {
            None => Some(size.first()),
            Some(k) => k.checked_sub(1),
        };
        if to == next {
            let place = from.map_or(0, |k| usize::from(size.drives() - k));
            return Ok(place);
        }
        let name = |end: Option<u8>| end.map_or("master".to_owned(), |k| k.to_string());
        Err(Problem::new(
            span,
            format!("there is no link {}->{}", name(from), name(to)),
            "a link of the ring expected here",
        )
        .help(format!(
            "{} sends to {}: did you mean `{}->{}`?",
            from.map_or("the master".to_owned(), |k| format!("drive {k}")),
            next.map_or("the master".to_owned(), |k| format!("drive {k}")),
            name(from),
            name(next),
        )))
    }

    fn link_fault(&self, kind: LinkFaultKind) -> Result<LinkFault, Problem> {
        if let LinkFaultKind::Delay(span) | LinkFaultKind::Break(span) = kind
            && span.on(self.byte_time()) > MAX_FAULT
        {
            return Err(Problem::new(
                span.span(),
                "the fault lasts too long",
                format!("at most {MAX_FAULT} expected here"),
            ));
        }
        Ok(match kind {
            LinkFaultKind::Flip(flips) => LinkFault::Flip(flips),
            LinkFaultKind::Replace(byte) => LinkFault::Replace(byte),
            LinkFaultKind::Drop => LinkFault::Drop,
            LinkFaultKind::Duplicate => LinkFault::Duplicate,
            LinkFaultKind::Insert(byte) => LinkFault::Insert(byte),
            LinkFaultKind::Delay(span) => LinkFault::Delay(span.on(self.byte_time())),
            LinkFaultKind::Break(span) => LinkFault::Break(span.on(self.byte_time())),
            LinkFaultKind::Overrun => LinkFault::Overrun,
            LinkFaultKind::Cut => LinkFault::Cut,
            LinkFaultKind::Join => LinkFault::Join,
        })
    }

    fn check(&self, check: &Check, needs: &mut Vec<Capability>) -> Result<PlannedCheck, Problem> {
        let count = |number: &Located| {
            let value = number.value(self.size(0))?;
            u64::try_from(value).map_err(|_| {
                Problem::new(
                    number.span,
                    format!("{value} is negative"),
                    "0 or more expected here",
                )
            })
        };
        Ok(match check {
            Check::Located { drive, within } => {
                let (ring, drive) = self.one(drive)?;
                PlannedCheck::Located(ring, drive, within.as_ref().map(count).transpose()?)
            }
            Check::Within(zeros) => PlannedCheck::Within(count(zeros)?),
            Check::Drive(check) => PlannedCheck::Drive(self.drive_check(check, needs)?),
            Check::Error { error, drive } => {
                needs.push(Capability::Tap);
                let (ring, drive) = self.one(drive)?;
                PlannedCheck::Error(ring, drive, *error)
            }
            Check::Corrected(times) => PlannedCheck::Corrected(count(times)?),
            Check::Named {
                ring,
                broken,
                link,
                ends,
            } => PlannedCheck::Named(*ring, self.link(*ring, link.span, ends)?, *broken),
            Check::Ended(ending) => PlannedCheck::Ended(*ending),
            Check::RulesKept(ring) => PlannedCheck::RulesKept(*ring),
            Check::Sent { bytes, time } => {
                let time = time.map(|t| (t.on(self.byte_time()), t.tolerance(self.byte_time())));
                PlannedCheck::Sent(count(bytes)?, time)
            }
            Check::Received(bytes) => PlannedCheck::Received(count(bytes)?),
        })
    }
}
