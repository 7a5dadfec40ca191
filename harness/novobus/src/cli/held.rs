//! Rings that a session holds.

use super::rig::OpenBench;
use crate::gate::GuardsRings as _;
use crate::language::plan::{Plan, PlannedStep, RingAct};
use crate::language::read::RingScenario;
use crate::language::run::now::{Now, now};
use crate::link::BesideTheBus;
use crate::rig::put_back::put_back;
use crate::rig::session;
use crate::rig::shared::Shared;
use crate::rig::sim::RigOfRings;
use crate::rig::{OfRings as _, Run, Session};
use harness_bench::bus_name::BusName;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::{HeldBench, HeldRecord, record_from_now};
use harness_bench::command::output::Output;
use harness_bench::command::rig_commands::unusable;
use harness_bench::command::rig_name::Use;
use harness_bench::link::{Line, Link, Moment, PlacedFault, Trouble};
use harness_bench::rig::{End, PlayedScenario, Rig, UseOptions};
use harness_bench::scenario::files;
use harness_bench::scenario::parse::{self, parse_step};
use harness_bench::scenario::plan::{PlannedAction, plan_step};
use harness_bench::scenario::source::Source;
use harness_bench::serve::first;
use harness_proto::time::Span;
use std::rc::Rc;

struct HeldRings {
    rig: Shared,
    plan: Plan,
    moves: bool,
    /// `None` while the rings are used without their master.
    bench: Option<Rc<OpenBench>>,
}

/// Takes a rig with rings for a session. With permission to move, errors of the opening are confirmed.
///
/// # Errors
/// [`SessionError`], as text with its exit code.
pub(super) fn hold(
    rig: &Rig,
    options: &UseOptions,
    output: &mut Output,
) -> Result<Box<dyn HeldBench>, Failure> {
    let plan = rig.plan()?;
    let rig = Shared::new(session::open(rig, options).map_err(unusable)?);
    let mut held = HeldRings {
        rig,
        plan,
        moves: options.allow_motion,
        bench: None,
    };
    let ready = held.open().and_then(|()| {
        let as_what = Use::new("shell", held.moves, true);
        held.bench()?.confirm_bus_errors(as_what, output)
    });
    match ready {
        Ok(()) => Ok(Box::new(held)),
        Err(failure) => {
            let _given_back = Box::new(held).end(true);
            Err(failure)
        }
    }
}

impl HeldRings {
    fn open(&mut self) -> Result<(), Failure> {
        self.bench = None;
        self.bench = Some(Rc::new(OpenBench::held(
            self.plan.clone(),
            self.rig.clone(),
        )?));
        Ok(())
    }

    fn bench(&self) -> Result<Rc<OpenBench>, Failure> {
        let gone = || Failure::Bus(Exit::RigError, "the rings do not answer".to_owned());
        self.bench.clone().ok_or_else(gone)
    }

    /// Does something with the rings without their master.
    fn apart<T>(&mut self, act: impl FnOnce(&mut Session) -> T) -> Result<T, Failure> {
        if let Some(bench) = self.bench.take() {
            bench.bus.clone().close();
        }
        let done = self.rig.with(act).ok_or_else(given_back)?;
        self.open()?;
        Ok(done)
    }
}

fn given_back() -> Failure {
    Failure::Bus(Exit::RigError, "the rig has been given back".to_owned())
}

/// A scenario counts bytes from its start; a session has none and counts from now. A time of a fault cannot be counted like this.
fn from_now_on(step: &mut PlannedStep, link: &dyn Link) -> bool {
    let PlannedAction::Own(RingAct::Fault(ring, fault, moment)) = &mut step.action else {
        return true;
    };
    match moment {
        Moment::Now => true,
        Moment::At(_) => false,
        Moment::Byte(byte) => {
            let place = match fault {
                PlacedFault::Link(place, _) => Some(*place),
                // The link that ends at the drive.
                PlacedFault::Drive(drive, _) => {
                    let before = link.drives(*ring).checked_sub(*drive + 1);
                    before.map(usize::from)
                }
                _ => None,
            };
            let arrived = place.and_then(|place| link.arrived(*ring, place));
            *byte += arrived.unwrap_or(0);
            true
        }
    }
}

impl HeldBench for HeldRings {
    fn drives(&self) -> Vec<String> {
        let axes = self.rig.with(|session| session.axes());
        axes.iter().flatten().map(ToString::to_string).collect()
    }

    fn speed(&self) -> &'static str {
        "nist"
    }

    fn perform(&mut self, mut command: DriveCommand, output: &mut Output) -> Result<Exit, Failure> {
        if matches!(command, DriveCommand::Reset(_)) {
            return Err(Failure::refused(
                "a session keeps the state of its drives and does not reset them; end it and use `drivebench reset`",
            ));
        }
        if let Some(rig) = command.rig_mut() {
            rig.held = Some(self.bench()?);
        }
        super::perform(&command, output)
    }

    fn pass(&mut self, time: Span) -> Result<(), Failure> {
        let bench = self.bench()?;
        bench.bus.run(time);
        match bench.bus.halted() {
            Some(error) => Err(error.into()),
            None => Ok(()),
        }
    }

    fn play(&mut self, source: &Source) -> Result<PlayedScenario, Failure> {
        let size = self.plan.rings.first().map(|ring| ring.drives());
        if parse::bus(source) != BusName::DEFAULT {
            return Err(Failure::refused(format!(
                "{}: the scenario is for another bus",
                files::last(&source.name)
            )));
        }
        let entry = RingScenario::fitting(source.clone(), size);
        let entry = entry.map_err(|problems| Failure::refused(problems.lines()))?;
        let plan = &entry.plan;
        self.apart(|session| {
            let played = Run::new(session)?.play(plan, None);
            // What is written between scenarios is meant to stay.
            let ended = session.link().trouble().is_some_and(Trouble::ends_a_run);
            let notes = put_back(session, !ended);
            let mut played = played.map_err(unusable)?;
            played.outcome.remarks.extend(notes);
            Ok(played)
        })?
    }

    fn strike(&mut self, line: &str) -> Result<(), Failure> {
        let bench = self.bench()?;
        let source = Source::from_bytes("fault".to_owned(), line.as_bytes().to_vec());
        let source = source.map_err(|error| Failure::refused(error.to_string()))?;
        let step = parse_step(&source).and_then(|step| plan_step(&self.plan, &step, &source));
        let mut step = step.map_err(|problems| Failure::refused(first(&source.text, &problems)))?;
        let plan = &self.plan;
        let done = bench.with_rig(|session| {
            if !session.rig().is_simulated() {
                return Now::Refused("faults are injected into simulated drives only");
            }
            let link = session.link().inner_mut();
            if !from_now_on(&mut step, link) {
                return Now::Refused(
                    "a time has no start to count from here: leave it out, or name a byte",
                );
            }
            now(plan, link, &step)
        });
        match done {
            Some(Now::Done) => Ok(()),
            Some(Now::Otherwise(found)) => Err(Failure::drive(found)),
            Some(Now::Refused(why)) => Err(Failure::refused(why)),
            None => Err(Failure::refused("the rig has been given back")),
        }
    }

    fn recover(&mut self) -> Result<String, Failure> {
        let rings = self.plan.rings.len();
        let found = self.apart(|session| super::recover::every(session.link(), rings))?;
        let texts = found.iter().enumerate();
        Ok(texts
            .map(|(ring, recovered)| super::recover::text(ring, recovered))
            .collect())
    }

    fn record(&mut self) -> Result<HeldRecord, Failure> {
        let rings = self.plan.rings.len();
        let record = self.rig.with(|session| {
            let link = session.link();
            let mut record = HeldRecord::of(link, rings);
            // Inner links without a port are not silent: nobody listens.
            for (ring, trace) in record.traces.iter_mut().enumerate() {
                let mut places = 0..;
                trace
                    .channels
                    .retain(|_| places.next().is_some_and(|place| link.listens(ring, place)));
            }
            record
        });
        record.ok_or_else(given_back)
    }

    fn record_from_now(&mut self, most: Option<u64>) {
        self.rig
            .with(|session| record_from_now(session.link(), most));
    }

    fn is_between_telegrams(&self) -> bool {
        true
    }

    fn events(&mut self) -> Vec<String> {
        let bench = self.bench.as_ref();
        bench.map_or_else(Vec::new, |bench| bench.bus.take_log())
    }

    fn trouble(&self) -> Option<Trouble> {
        let trouble = self.rig.with(|session| session.link().trouble().cloned());
        trouble.flatten()
    }

    fn overdue(&self) -> bool {
        self.rig.with(|session| session.overdue()).unwrap_or(true)
    }

    fn resume(&mut self) -> Result<(), Failure> {
        self.bench = None;
        self.rig.with(|session| {
            session.go_on();
            let link = session.link();
            // Unless everything is allowed, nothing but the recovery passes where the guard does not know where the drives are (9.8).
            if !link.limits().allow_everything() {
                link.synchronise();
            }
            link.begin();
        });
        self.open()
    }

    fn end(mut self: Box<Self>, error: bool) -> End {
        if let Some(bench) = self.bench.take() {
            bench.bus.clone().close();
        }
        self.rig.close(error).unwrap_or_default()
    }
}
