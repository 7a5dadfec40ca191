//! A ring in use, as the commands of all buses play scenarios on it.

use super::run::{RigModel, Run};
use super::session::{self, Session};
use super::wrong_parity;
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::qualify::{Qualification, QualificationFacts, QualifiedBench};
use crate::twin::Twin;
use harness_bench::bus_name::BusName;
use harness_bench::counted::counted;
use harness_bench::link::{Line as _, Octets as _, Trouble};
use harness_bench::rig::playing::{
    QualificationKeeper, QualificationStopped, Qualified, RecordedBench, RigRun, of_bus,
};
use harness_bench::rig::{End, Keeper, PlayedScenario, Rig, SessionError, UseOptions};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_proto::line::Rate;

/// A ring in use.
pub(crate) struct RingRun {
    run: Run<'static>,
    qualification: Option<Qualification>,
    obstacles: Result<Vec<String>, SessionError>,
}

impl RingRun {
    /// Takes a rig.
    ///
    /// # Errors
    /// [`SessionError`]; nothing is left locked or open.
    pub(crate) fn open(rig: &Rig, options: &UseOptions) -> Result<Self, SessionError> {
        let model = RigModel::of(rig).map_err(|why| SessionError::Mistakes(Box::new(why)))?;
        let mut session = session::open(rig, options)?;
        let tries = options.tries_line_errors && session.drives().opening.is_some();
        let obstacles = match tries {
            true => wrong_parity::obstacles(&mut session),
            false => Ok(Vec::new()),
        };
        let mut run = Run::of(session, model);
        let qualification = options.ill_as_well.then(|| {
            run.repeat();
            Qualification::new(QualificationFacts::of(&mut run))
        });
        Ok(Self {
            run,
            qualification,
            obstacles,
        })
    }
}

impl RigRun for RingRun {
    fn segment(&mut self) -> RecordedBench {
        let way = self.run.way();
        let byte_time = self.run.session().link().byte_time();
        let mut rates = Rate::ALL.into_iter();
        let rate = rates.find(|rate| rate.byte_time() == byte_time);
        RecordedBench {
            rate: rate.unwrap_or_default().bits_per_second(),
            drives: way.rings.first().map_or(0, |ring| ring.drives()),
            tolerance: self.run.exactness().tolerance,
            capabilities: self.run.capabilities(),
            anew: way.anew,
        }
    }

    fn obstacles(&mut self) -> Result<Vec<String>, SessionError> {
        std::mem::replace(&mut self.obstacles, Ok(Vec::new()))
    }

    fn rehearse(&mut self, rehearses: bool) {
        self.run.rehearse(rehearses);
    }

    fn play(
        &mut self,
        source: &Source,
        keeper: Option<&mut dyn Keeper>,
    ) -> Result<PlayedScenario, SessionError> {
        let drives = self.run.session().rig().ring_size();
        let read = |source: &Source| RingScenario::fitting(source.clone(), Some(drives));
        match of_bus(BusName::Novobus, source, read) {
            Ok(entry) => self.run.play(&entry.plan, keeper),
            Err(skip) => Ok(PlayedScenario::skipped(skip)),
        }
    }

    fn note(&mut self, name: &str, played: &PlayedScenario) {
        if let Some(qualification) = &mut self.qualification {
            qualification.note(name, played);
        }
    }

    fn qualify(
        &mut self,
        thorough: bool,
        keeper: &mut dyn QualificationKeeper,
    ) -> Result<Qualified, QualificationStopped> {
        let Some(qualification) = self.qualification.take() else {
            return Err(QualificationStopped);
        };
        let began = keeper.began();
        let mut bench = BenchInUse { ring: self, keeper };
        qualification.settle(&mut bench, began, thorough)
    }

    fn over(&mut self) -> Option<String> {
        // The link is in trouble then, which ends the run.
        self.run.session().end_if_overdue();
        None
    }

    fn trouble(&mut self) -> Option<Trouble> {
        self.run.session().link().trouble().cloned()
    }

    fn measured(&mut self) -> Vec<String> {
        measured(self.run.session())
    }

    fn close(mut self: Box<Self>, error: bool) -> End {
        session::close(self.run.session(), error)
    }
}

/// A ring in use, and what keeps the scenarios of its qualification.
struct BenchInUse<'b> {
    ring: &'b mut RingRun,
    keeper: &'b mut dyn QualificationKeeper,
}

impl QualifiedBench for BenchInUse<'_> {
    type Stop = QualificationStopped;

    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, QualificationStopped> {
        let run = &mut self.ring.run;
        let mut play = |keeper: Option<&mut dyn Keeper>| run.play(&entry.plan, keeper);
        self.keeper.play(&entry.source, &mut play)
    }

    fn over(&mut self) -> bool {
        let Self { ring, keeper } = self;
        ring.is_over(&mut |why| keeper.complain(why))
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        self.ring.run.twin_with(header)
    }

    fn tell(&mut self, text: &str) -> Result<(), QualificationStopped> {
        self.keeper.tell(text)
    }

    fn show(
        &mut self,
        entry: &RingScenario,
        played: &PlayedScenario,
    ) -> Result<(), QualificationStopped> {
        self.keeper.show(&entry.source, played)
    }
}

/// What bytes with a wrong parity bit and interposers have cost.
fn measured(session: &mut Session) -> Vec<String> {
    let Some(ports) = session.ports() else {
        return Vec::new();
    };
    let switches = ports.take_switches();
    let mut lines = Vec::new();
    if let Some(longest) = switches.iter().map(|switch| switch.idle).max() {
        lines.push(format!(
            "{} sent with a wrong parity bit; the line was idle for at most {:.1} ms around one\n",
            counted(switches.len(), "byte"),
            longest.as_secs_f64() * 1e3
        ));
    }
    let unknown: u64 = switches.iter().map(|switch| switch.unknown).sum();
    if unknown > 0 {
        let marked: u64 = switches.iter().map(|switch| switch.marked).sum();
        lines.push(format!(
            "{} came meanwhile or soon after, {marked} of them with an error: they are compared without their line status, since a UART has one parity \
             setting for both directions\n",
            counted(unknown, "byte")
        ));
    }
    for inner in ports.inner_links().iter().filter(|inner| inner.passes()) {
        let delay = inner.delay();
        lines.push(format!(
            "interposer: {} passed on, each delayed by a byte time and {:.3} ms (mean; {:.3} ms at most)\n",
            counted(delay.bytes, "byte"),
            delay.mean().as_secs_f64() * 1e3,
            delay.longest.as_secs_f64() * 1e3
        ));
    }
    lines
}
