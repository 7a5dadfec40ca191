//! The benches that commands on drives work on. `sim:3`, or `sim:2,3` with two rings, is created for each command. A rig, given by its
//! file or name, is taken and given back as by `run --rig`.

use super::axes;
use crate::driver::{Axis, OpenRings, Options, Width};
use crate::drives;
use crate::language::parse::header::parse_setup;
use crate::language::plan::Plan;
use crate::link::SimulatedLink;
use crate::rig::session;
use crate::rig::shared::Shared;
use crate::rig::sim::RigOfRings;
use crate::rig::{OfRings as _, Session};
use harness_bench::command::drive::RigArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::outcome;
use harness_bench::command::rig_commands::unusable;
use harness_bench::command::rig_failure::{exit_of_end, find_any_rig, tell_end, use_options};
use harness_bench::command::rig_name::{RigName, Use};
use harness_bench::counted::counted;
use harness_bench::link::{Line, Link};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::rig::buses::RigBuses;
use harness_bench::rig::{Rig, UseOptions};
use harness_bench::scenario::source::Source;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange};
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How long a simulated bench has been on when a command starts: the self-tests are over (11.8).
const WARM: Span = Span::from_millis(200);

/// How long a drive may take to process a confirmation: some of its cycles of 432 us (4.1).
const CYCLES: Span = Span::from_millis(5);

/// A bench that has been opened.
pub(crate) struct OpenBench {
    pub(crate) bus: OpenRings<'static>,
    plan: Plan,
    place: BenchPlace,
}

/// Where the drives of a bench are.
enum BenchPlace {
    /// On a rig in use.
    Rig(Shared),
    /// In simulated rings that were created for this command.
    Created(CreatedRings),
}

/// Simulated rings of a command. Its driver uses them as a line, and a page looks at them.
#[derive(Clone)]
struct CreatedRings(Arc<Mutex<SimulatedLink>>);

impl CreatedRings {
    fn link(&self) -> MutexGuard<'_, SimulatedLink> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Line for CreatedRings {
    fn medium(&self, port: usize) -> Medium {
        self.link().medium(port)
    }

    fn now(&self) -> Instant {
        self.link().now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        self.link().send(port, what)
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        self.link().receive(port)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.link().wait(until)
    }
}

impl fmt::Debug for OpenBench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OpenBench")
            .field("rig", &self.rig())
            .finish_non_exhaustive()
    }
}

impl OpenBench {
    /// The rings of a rig that a session holds.
    ///
    /// # Errors
    /// [`Failure`]: the rings do not answer.
    pub(crate) fn held(plan: Plan, rig: Shared) -> Result<Self, Failure> {
        let sizes = rig.with(|session| session.rings().to_vec());
        let line = Box::new(rig.line());
        let bus = OpenRings::open(line, &sizes.unwrap_or_default(), Options::default())?;
        Ok(Self {
            bus,
            plan,
            place: BenchPlace::Rig(rig),
        })
    }

    const fn rig(&self) -> Option<&Shared> {
        match &self.place {
            BenchPlace::Rig(rig) => Some(rig),
            BenchPlace::Created(_) => None,
        }
    }

    /// How many drives each ring has.
    pub(crate) fn sizes(&self) -> Vec<u8> {
        self.plan.rings.iter().map(|ring| ring.drives()).collect()
    }

    /// The values that the scales of a drive's cells depend on: its type, which the bench knows, and its range of speeds, which is read from
    /// the drive (14.3.2).
    pub(crate) fn units(&self, axis: Axis) -> Result<DriveUnits, Failure> {
        Ok(drives::units_of(&self.plan, &self.bus, axis)?)
    }

    /// The same without asking the drive: `range` is the range of speeds that it reported.
    pub(crate) fn units_with(&self, axis: Axis, range: SpeedRange) -> DriveUnits {
        DriveUnits {
            range,
            ..self.plan.units(axis.ring(), axis.drive())
        }
    }

    /// Whether the drives are behind ports: a rig in use that is not simulated.
    pub(crate) fn has_ports(&self) -> bool {
        self.with_rig(|session| !session.rig().is_simulated())
            .unwrap_or(false)
    }

    /// Runs `act` on the rig in use, if there is one. The bus carries nothing meanwhile.
    pub(crate) fn with_rig<T>(&self, act: impl FnOnce(&mut Session) -> T) -> Option<T> {
        self.rig()?.with(act)
    }

    /// Runs `act` on the link to the drives; `None` where the rig has been given back. The bus carries nothing meanwhile.
    pub(crate) fn with_link<T>(&self, act: impl FnOnce(&mut dyn Link) -> T) -> Option<T> {
        match &self.place {
            BenchPlace::Rig(rig) => rig.with(|session| act(session.link())),
            BenchPlace::Created(rings) => Some(act(&mut *rings.link())),
        }
    }

    /// The zeros of the check sequence (9.8), with which a rig is opened, put every drive in error, and so does a silence where time-outs are
    /// monitored (9.9). Before a command that may move drives the error is confirmed, with a nominal speed of 0: a drive that was in go
    /// stands there, released.
    pub(crate) fn confirm_bus_errors(
        &self,
        as_what: Use,
        output: &mut Output,
    ) -> Result<(), Failure> {
        let mut confirmed: BTreeMap<bool, Vec<Axis>> = BTreeMap::new();
        let axes = self.bus.axes();
        // All are asked before the first answers: each alone would take a round of the ring.
        let cells = axes.iter().map(|axis| (*axis, ram::ERRORCODE, Width::Word));
        let errors = self.bus.read_many(cells)?;
        for (axis, error) in axes.into_iter().zip(errors) {
            let Some(error) = BusError::from_code(error) else {
                continue;
            };
            if as_what.moves {
                self.bus.write_word(axis, ram::NSOLL, 0)?;
                self.bus.delete_error(axis)?;
            }
            let missed = error == BusError::TimeOut;
            confirmed.entry(missed).or_default().push(axis);
        }
        let end = match as_what.moves {
            true => "; the error was confirmed, and the nominal speed is 0 now",
            false => "",
        };
        for (missed, drives) in &confirmed {
            let drives = axes::named(drives);
            let what = match missed {
                true => format!(
                    "no master has sent for 10 ms, and {drives} monitors that: error 0508 (ND21 9.9)"
                ),
                false => format!("the check sequence has put {drives} in error 0504 (ND21 9.8)"),
            };
            output.say(&format!("{what}{end}\n"));
        }
        if confirmed.is_empty() {
            return Ok(());
        }
        // `Status` follows in the drive's next cycles.
        self.bus.run(CYCLES);
        Ok(())
    }
}

/// Opens a bench, runs `act` on it and gives it back. The drives stay as they are if `as_what` says so and `act` succeeds, or if
/// nothing was done. In all other cases the bench is given back in its safe state.
pub(crate) fn on(
    arguments: &RigArguments,
    as_what: Use,
    output: &mut Output,
    act: impl FnOnce(&OpenBench, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    on_after(arguments, as_what, output, |_, _| Ok(()), act)
}

/// The same, but runs `first` on a rig before its master starts: for actions after which a master does not know the drives' state.
pub(crate) fn on_after(
    arguments: &RigArguments,
    as_what: Use,
    output: &mut Output,
    first: impl FnOnce(&mut Session, &mut Output) -> Result<(), Failure>,
    act: impl FnOnce(&OpenBench, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    if let Some(bench) = arguments.held.as_ref().and_then(|held| held.downcast_ref()) {
        return act(bench, output);
    }
    let Some(RigName::Named(_)) = &arguments.rig else {
        let sizes = arguments.rig.as_ref().and_then(RigName::sizes);
        let (plan, link) = link(arguments, sizes)?;
        let created = CreatedRings(Arc::new(Mutex::new(link)));
        let line = Box::new(created.clone());
        let bus = OpenRings::open(line, &plan.rings, Options::default())?;
        bus.run(WARM);
        let place = BenchPlace::Created(created);
        return act(&OpenBench { bus, plan, place }, output);
    };
    let rig = named(arguments)?;
    let plan = rig.plan()?;
    let mut session = take(rig, arguments, as_what, false)?;
    let done = first(&mut session, output);
    let sizes = session.rings().to_vec();
    let shared = Shared::new(session);
    let result = done.and_then(|()| {
        let bus = OpenRings::open(Box::new(shared.line()), &sizes, Options::default())?;
        let bench = OpenBench {
            bus,
            plan,
            place: BenchPlace::Rig(shared.clone()),
        };
        let ready = bench.confirm_bus_errors(as_what, output);
        let result = ready.and_then(|()| act(&bench, output));
        bench.bus.close();
        result
    });
    Ok(give_back(&shared, as_what, result, output))
}

/// Takes a rig for a command.
pub(crate) fn take(
    rig: &Rig,
    arguments: &RigArguments,
    as_what: Use,
    ill_as_well: bool,
) -> Result<Session, Failure> {
    let wait = Duration::from_nanos(arguments.patience.as_nanos());
    let options = UseOptions {
        ill_as_well,
        keeps_lines: true,
        ..use_options(as_what.purpose, as_what.moves, Some(wait))
    };
    session::open(rig, &options).map_err(unusable)
}

/// The rig that has been found for a command.
pub(crate) fn named(arguments: &RigArguments) -> Result<&Rig, Failure> {
    without_setup(arguments)?;
    arguments.found.as_deref().ok_or(Failure::Told(Exit::Usage))
}

/// Refuses a setup beside the name of a rig.
pub(crate) fn without_setup(arguments: &RigArguments) -> Result<(), Failure> {
    match arguments.setup {
        Some(_) => Err(Failure::refused(
            "--setup is for sim:N; what stands in a rig's file is set up by its [sim] setup",
        )),
        None => Ok(()),
    }
}

/// Finds the rig of this name, for a command that serves rings only; reports what is wrong with it.
pub(crate) fn find_rig(name: &str, buses: &'static RigBuses, output: &mut Output) -> Option<Rig> {
    let rig = find_any_rig(name, buses, output)?;
    match rig.of_rings() {
        Ok(()) => Some(rig),
        Err(error) => {
            output.complain(&error.to_string());
            None
        }
    }
}

/// Gives a rig back and reports its state.
fn give_back(
    rig: &Shared,
    as_what: Use,
    result: Result<Exit, Failure>,
    output: &mut Output,
) -> Exit {
    let trouble = rig
        .with(|session| session.link().trouble().cloned())
        .flatten();
    let (exit, leave) = outcome(result, [as_what.holds, false], output);
    let exit = exit_of_end(trouble.as_ref(), exit, output);
    let end = if leave {
        rig.release()
    } else {
        rig.close(matches!(exit, Exit::RigError | Exit::Interlock))
    };
    end.map_or(exit, |end| tell_end(&end, exit, output))
}

/// Gives a rig back in its safe state and reports how. What ended the work early is more serious than its outcome.
pub(crate) fn give_back_session(mut session: Session, exit: Exit, output: &mut Output) -> Exit {
    let exit = exit_of_end(session.link().trouble(), exit, output);
    let end = session::close(
        &mut session,
        matches!(exit, Exit::RigError | Exit::Interlock),
    );
    tell_end(&end, exit, output)
}

/// Simulated drives, with nothing sent to them, on rings of these sizes where they are given.
pub(crate) fn link(
    arguments: &RigArguments,
    given: Option<&[u8]>,
) -> Result<(Plan, SimulatedLink), Failure> {
    let source = match (&arguments.setup, given) {
        (Some(path), _) => read(path)?,
        (None, sizes) => drives::released_header(sizes.unwrap_or(&[3])),
    };
    if let Some(sizes) = given {
        let stated = parse_setup(&source, sizes)?.header.rings.len();
        if sizes.len() != stated {
            return Err(Failure::refused(format!(
                "{} is for {}, the bench has {}",
                source.name,
                counted(stated, "ring"),
                sizes.len()
            )));
        }
    }
    Ok(drives::simulated(&source, given)?)
}

fn read(path: &Path) -> Result<Source, Failure> {
    Source::read(path).map_err(|error| Failure::File(error.into()))
}
