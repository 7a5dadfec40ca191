//! Settles a scenario, line by line.

use super::drive::Running;
use super::setup::model_unless_said;
use super::types::{
    Plan, PlannedAction, PlannedCheck, PlannedSetup, PlannedStep, PlannedWhen, PlannedWindow,
};
use super::unroll::Unroll;
use crate::buses::Stimulus;
use crate::link::{Capability, Moment, PlacedFault, needs_line_errors, only_simulated};
use crate::scenario::expression::{Located, Scope};
use crate::scenario::parse::parse_header;
use crate::scenario::pattern::MAX_BYTES;
use crate::scenario::problem::{Problem, Problems, Span};
use crate::scenario::source::Source;
use crate::scenario::syntax::{
    Action, Check, Drives, Fault, FaultKind, Header, LinkEnds, LinkFaultKind, Scenario, Step, When,
};
use crate::scenario::times::Window;
use harness_proto::nd21::units;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::time::{self, Instant};
use harness_sim::fault::LinkFault;
use harness_sim::nd21;
use harness_sim::novobus::drive::Model;
use std::ops::RangeInclusive;

/// Maximum number of bytes that a run may carry on all links together: its record is kept in memory.
pub(crate) const MAX_CARRIED: u64 = 20_000_000;

/// The longest delay or break.
const MAX_FAULT: time::Span = time::Span::from_millis(10_000);

/// Default wait of a line without a time.
const DEADLINE: time::Span = time::Span::from_millis(1000);

/// Settles a scenario, for a first ring of `size` drives where that is given.
///
/// # Errors
/// Everything that cannot be in rings of these sizes.
pub fn plan(scenario: &Scenario, source: &Source, size: Option<u8>) -> Result<Plan, Problems> {
    let problems = |all| Problems::new(&source.name, source.text.clone(), all);
    let rings = sizes(scenario, size).map_err(|problem| problems(vec![problem]))?;
    let mut planner = Planner {
        byte_time: scenario.header.rate.unwrap_or_default().byte_time(),
        rings,
        setups: Vec::new(),
        units: Vec::new(),
        model: model_unless_said(scenario),
        models: Vec::new(),
        scope: Scope::default(),
    };
    let mut found = planner.set_up(&scenario.header.setups);
    let mut running = Running::default();
    let mut steps = Vec::new();
    let mut needs = scenario.needs.clone();
    let (mut sent, mut expected) = (0, 0);
    let links: u64 = planner
        .rings
        .iter()
        .map(|ring| u64::from(ring.drives()) + 1)
        .sum();
    let room = MAX_BYTES.min(usize::try_from(MAX_CARRIED / links.max(1)).unwrap_or(MAX_BYTES));
    let mut unroll = Unroll::new(&scenario.steps, planner.size(0));
    while let Some(next) = unroll.next() {
        let step = match next {
            Ok((step, scope)) => {
                planner.scope = scope;
                step
            }
            Err(problem) => {
                found.push(problem);
                break;
            }
        };
        let action = planner.action(step, &mut needs);
        let action = action.and_then(|action| match &action {
            PlannedAction::Record(record) => running.take(record).map(|()| action),
            _ => Ok(action),
        });
        match action {
            Ok(action) => {
                sent += action.bytes_sent();
                expected += action.bytes_expected();
                if expected > MAX_BYTES {
                    found.push(Problem::new(
                        step.span,
                        format!("more than {MAX_BYTES} bytes expected in one scenario"),
                        "fewer bytes expected here",
                    ));
                    break;
                }
                if sent > room {
                    found.push(Problem::new(
                        step.span,
                        format!("more than {room} bytes sent in one scenario on this ring"),
                        "fewer bytes expected here",
                    ));
                    break;
                }
                steps.push(PlannedStep {
                    when: planner.when(step.when),
                    action,
                    span: step.span,
                });
            }
            Err(problem) => {
                found.push(problem);
                // Another turn would tell the same again.
                if unroll.in_loop() {
                    break;
                }
            }
        }
    }
    if !found.is_empty() {
        found.sort_by_key(|problem| problem.span.start);
        return Err(problems(found));
    }
    if planner.rings.len() > 1 {
        needs.push(Capability::TwoRings);
    }
    needs.extend(planner.setups.iter().filter_map(|setup| setup.what.needs()));
    // The effect of a wrong master on a machine is unknown.
    needs.extend(
        scenario
            .header
            .master
            .as_ref()
            .map(|_| Capability::Simulator),
    );
    needs.sort();
    needs.dedup();
    Ok(Plan {
        rate: scenario.header.rate.unwrap_or_default(),
        strict: scenario.strict,
        deadline: scenario
            .deadline
            .map_or(DEADLINE, |deadline| deadline.on(planner.byte_time)),
        needs,
        master: scenario.header.master.as_ref().map(|master| master.value),
        steps,
        setups: planner.setups,
        units: planner.units,
        models: planner.models,
        rings: planner.rings,
    })
}

/// Settles a header for rings of these sizes: what a bench is before anything is sent.
///
/// # Errors
/// Everything that cannot be in these rings, placed in the lines of the header as they are written. `name` says where they come from.
pub fn plan_header(name: &str, header: &Header, sizes: &[u8]) -> Result<Plan, Problems> {
    let source = Source {
        name: name.to_owned(),
        text: header.lines().join("\n").into(),
    };
    let whole = header.and(&Header::of_rings(sizes));
    let settled = plan(&Scenario::new("", whole), &source, None);
    settled.map_err(|mistakes| {
        // What was put together from several texts has its places in none of them.
        let placed = parse_header(&source, sizes).map(|own| plan(&own, &source, None));
        match placed {
            Err(placed) | Ok(Err(placed)) => placed,
            Ok(Ok(_)) => mistakes,
        }
    })
}

/// Settles one more step for the rings and drives of a plan.
///
/// # Errors
/// What cannot be in these rings.
pub fn plan_step(plan: &Plan, step: &Step, source: &Source) -> Result<PlannedStep, Problems> {
    let planner = Planner {
        byte_time: plan.rate.byte_time(),
        rings: plan.rings.clone(),
        setups: plan.setups.clone(),
        units: plan.units.clone(),
        // The model of every drive is settled.
        model: Model::default(),
        models: plan.models.clone(),
        scope: Scope::default(),
    };
    let action = planner
        .action(step, &mut Vec::new())
        .map_err(|problem| Problems::new(&source.name, source.text.clone(), vec![problem]))?;
    Ok(PlannedStep {
        when: planner.when(step.when),
        action,
        span: step.span,
    })
}

fn sizes(scenario: &Scenario, size: Option<u8>) -> Result<Vec<RingSize>, Problem> {
    let mut rings = Vec::new();
    for (index, range) in scenario.header.rings.iter().enumerate() {
        let wanted = size.filter(|_| index == 0).unwrap_or(range.default);
        if !(range.smallest..=range.largest).contains(&wanted) {
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

impl PlannedAction {
    /// How many bytes the master sends.
    fn bytes_sent(&self) -> usize {
        match self {
            Self::Send(_, bytes) | Self::Telegram(_, bytes, ..) => bytes.len(),
            Self::Recover(_) => CHECK_SEQUENCE.len(),
            _ => 0,
        }
    }

    /// How many bytes the master must receive.
    fn bytes_expected(&self) -> usize {
        match self {
            Self::Receive(_, bytes) | Self::Telegram(_, _, bytes, _) => bytes.len(),
            _ => 0,
        }
    }
}

pub(crate) struct Planner {
    pub(crate) byte_time: time::Span,
    pub(crate) rings: Vec<RingSize>,
    pub(crate) setups: Vec<PlannedSetup>,
    /// What the scales of each ring's drives depend on.
    pub(crate) units: Vec<Vec<units::Drive>>,
    /// The model of drives of which the header does not say it.
    pub(crate) model: Model,
    /// The model of each ring's drives.
    pub(crate) models: Vec<Vec<Model>>,
    /// The counters of the loops around the step in hand.
    pub(crate) scope: Scope,
}

impl Planner {
    pub(crate) fn ring(&self, index: usize, span: Span) -> Result<RingSize, Problem> {
        self.rings.get(index).copied().ok_or_else(|| {
            Problem::new(
                span,
                "the scenario has one ring",
                "a drive or link of ring 1 expected here",
            )
            .help("a second ring stands behind a comma in the header: `ring 4, 3`")
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

    pub(crate) fn drives(&self, drives: &Drives) -> Result<RangeInclusive<u8>, Problem> {
        let from = self.drive(drives.ring, &drives.from)?;
        let to = match &drives.to {
            Some(to) => self.drive(drives.ring, to)?,
            None => from,
        };
        Ok(from.min(to)..=from.max(to))
    }

    pub(crate) fn one(&self, drives: &Drives) -> Result<(usize, u8), Problem> {
        Ok((drives.ring, self.drive(drives.ring, &drives.from)?))
    }

    fn when(&self, when: When) -> PlannedWhen {
        match when {
            When::Now => PlannedWhen::Now,
            When::After(window) => PlannedWhen::After(self.window(window)),
            When::At(window) => PlannedWhen::At(self.window(window)),
        }
    }

    fn window(&self, window: Window) -> PlannedWindow {
        let tolerance = if window.is_exact() {
            window.from.tolerance(self.byte_time)
        } else {
            time::Span::ZERO
        };
        PlannedWindow {
            from: window.from.on(self.byte_time),
            to: window.to.on(self.byte_time),
            tolerance,
        }
    }

    fn action(&self, step: &Step, needs: &mut Vec<Capability>) -> Result<PlannedAction, Problem> {
        match &step.action {
            Action::Send { ring, bytes } => {
                self.ring(*ring, bytes.span)?;
                Ok(PlannedAction::Send(
                    *ring,
                    bytes.expand_known(self.size(*ring), MAX_BYTES)?,
                ))
            }
            Action::Receive { ring, bytes } => {
                self.ring(*ring, bytes.span)?;
                Ok(PlannedAction::Receive(
                    *ring,
                    bytes.expand(self.size(*ring), MAX_BYTES)?,
                ))
            }
            Action::Fault(fault) => self.fault(fault, needs),
            Action::Check(check) => Ok(PlannedAction::Check(self.check(check, needs)?)),
            Action::Job(job) => {
                needs.extend(job.needs());
                self.job(job)
            }
            Action::Until(check, within) => {
                let check = self.drive_check(check, needs)?;
                Ok(PlannedAction::Until(check, within.on(self.byte_time)))
            }
            Action::Wait(time) => Ok(PlannedAction::Wait(time.on(self.byte_time))),
            Action::Influence(drives, influence) => {
                needs.push(influence.needs());
                self.influence(drives, influence, step.span)?;
                let range = self.drives(drives)?;
                Ok(PlannedAction::Influence(
                    drives.ring,
                    range,
                    influence.clone(),
                ))
            }
            Action::Record(recording) => Ok(PlannedAction::Record(self.record(recording)?)),
            Action::For(..) | Action::End => Err(Problem::new(
                step.span,
                "a loop stands where one step is expected",
                "a step expected here",
            )),
        }
    }

    fn fault(&self, fault: &Fault, needs: &mut Vec<Capability>) -> Result<PlannedAction, Problem> {
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
                        "the drive's monitoring knows no bytes of the bus",
                        "a time expected here, as in `@20ms`",
                    ));
                }
                let drives = Drives {
                    ring: fault.ring,
                    from: drive.clone(),
                    to: None,
                };
                self.only_nd21(&drives, "monitoring", drive.span)?;
                let drive = self.drive(fault.ring, drive)?;
                PlacedFault::Stimulus(drive, Stimulus::Novobus(nd21::Stimulus::Error(*error)))
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
            (None, Some(at)) => Moment::At(Instant::START + at.on(self.byte_time)),
            (None, None) => Moment::Now,
        };
        Ok(PlannedAction::Fault(fault.ring, placed, moment))
    }

    fn link(&self, ring: usize, span: Span, ends: &LinkEnds) -> Result<usize, Problem> {
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
            && span.on(self.byte_time) > MAX_FAULT
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
            LinkFaultKind::Delay(span) => LinkFault::Delay(span.on(self.byte_time)),
            LinkFaultKind::Break(span) => LinkFault::Break(span.on(self.byte_time)),
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
                    format!("{value} is less than nothing"),
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
                let time = time.map(|t| (t.on(self.byte_time), t.tolerance(self.byte_time)));
                PlannedCheck::Sent(count(bytes)?, time)
            }
            Check::Received(bytes) => PlannedCheck::Received(count(bytes)?),
        })
    }
}
