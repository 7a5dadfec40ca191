//! The bench of a command: taken, used, and given back in the state that the command asks for.

use crate::buses::commands::{Axes, RigArguments, Use};
use crate::buses::nordac::driver::{Driver, Options as Master, Timing};
use crate::buses::nordac::rig::{Session, rate, setup};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::rig_failure::{alarm, exit_of, tell_end};
use crate::link::{Line, Trouble};
use crate::rig::{Options, Rig};
use crate::scenario::source::Source;
use crate::signals::interrupt_flag;
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;
use std::time::Duration;

/// How often the master looks at a line in real time.
const STEP: Span = Span::from_micros(500);

/// Takes a rig, runs `act` on it and gives it back. The slaves stay as they are if `as_what` says so and `act` succeeds, or if nothing
/// was done. In all other cases the bench is given back in its safe state.
pub(super) fn on(
    rig: &Rig,
    arguments: &RigArguments,
    as_what: Use,
    output: &mut Output,
    act: impl FnOnce(&mut Session, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    let mut rig = rig.clone();
    if let Some(path) = &arguments.setup {
        if !rig.origin.starts_with("sim:") {
            return Err(Failure::refused(
                "--setup is for sim:nordac:N; what stands in a rig's file is set up by its [sim] setup",
            ));
        }
        let source = Source::read(path).map_err(|error| Failure::File(error.into()))?;
        if let Some(port) = rig.port() {
            setup(port, &source)?;
        }
        if let Some(sim) = &mut rig.file.sim {
            sim.setup = vec![source.text.to_string()];
        }
    }
    let options = Options {
        purpose: as_what.purpose.to_owned(),
        wait: Duration::from_nanos(arguments.patience.as_nanos()),
        allow_motion: as_what.moves,
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..Options::default()
    };
    let session = Session::open(&rig, &options);
    let mut session = session.map_err(|error| Failure::Said(exit_of(&error), error.to_string()))?;
    let result = act(&mut session, output);
    Ok(give_back(session, as_what, result, output))
}

fn give_back(
    mut session: Session,
    as_what: Use,
    result: Result<Exit, Failure>,
    output: &mut Output,
) -> Exit {
    let (exit, leave) = match result {
        Ok(exit) => (exit, as_what.holds),
        // Impossible requests and missing permissions are refused before anything is done.
        Err(failure @ (Failure::Said(Exit::Usage, _) | Failure::Told(_) | Failure::File(_))) => {
            (failure.tell(output), true)
        }
        Err(failure) => (failure.tell(output), as_what.looks_only()),
    };
    let trouble = session.link().trouble().cloned();
    let exit = match trouble {
        Some(Trouble::Interrupted) => Exit::Interrupted,
        _ => exit,
    };
    let end = match leave && trouble.is_none() {
        true => session.release(),
        false => session.close(matches!(exit, Exit::RigError | Exit::Interlock)),
    };
    tell_end(&end, exit, output)
}

/// The master of a bench.
pub(super) fn driver(session: &mut Session) -> Driver<'_> {
    let rate = session.rig().port().map_or(BusRate::default(), rate);
    let mut timing = Timing::simulated(rate);
    if !session.rig().is_simulated() {
        timing.patience = timing.patience + session.patience();
        timing.step = STEP;
    }
    let watchdog = Master::WATCHDOG;
    Driver::new(Box::new(session.link()), Master { timing, watchdog })
}

/// The addresses that are meant, each once, in the order in which they are named.
pub(super) fn select(wanted: &[Axes], session: &Session) -> Result<Vec<u8>, Failure> {
    let all: Vec<u8> = session.slaves().iter().map(|own| own.address).collect();
    let mut selected = Vec::new();
    for axes in wanted {
        let named: Vec<u8> = match axes {
            Axes::All => all.clone(),
            Axes::Some(0, addresses) => {
                if let Some(missing) = addresses.clone().find(|own| !all.contains(own)) {
                    let known: Vec<_> = all.iter().map(u8::to_string).collect();
                    return Err(Failure::refused(format!(
                        "the rig has no slave {missing}: {} expected",
                        known.join(", ")
                    )));
                }
                addresses.clone().collect()
            }
            Axes::Some(ring, _) => {
                let message = format!("a PROFIBUS segment has no ring {}", ring + 1);
                return Err(Failure::refused(message));
            }
        };
        for address in named {
            if !selected.contains(&address) {
                selected.push(address);
            }
        }
    }
    Ok(selected)
}

/// The only slave that is meant.
pub(super) fn single(wanted: &Axes, session: &Session) -> Result<u8, Failure> {
    match select(std::slice::from_ref(wanted), session)?[..] {
        [address] => Ok(address),
        _ => Err(Failure::refused("one slave expected here, not several")),
    }
}

/// Slaves in a sentence: `slave 8`, `slaves 8, 9`.
pub(super) fn named(addresses: &[u8]) -> String {
    let names: Vec<_> = addresses.iter().map(u8::to_string).collect();
    let s = if names.len() == 1 { "" } else { "s" };
    format!("slave{s} {}", names.join(", "))
}
