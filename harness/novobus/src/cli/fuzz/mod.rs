//! What `fuzz` and `shrink` do on rings. A rig with ports is opened as `run --rig` opens it and given back in its safe state.

mod power;
mod replay;
mod run;
mod shrink;

use super::give_back_session as give_back;
use crate::explore::{Case, CaseScope, RingScope, RingSetup, Spice, page};
use crate::language::run::over_bus::start_anew;
use crate::rig::session;
use crate::rig::wrong_parity;
use crate::rig::{OfRings as _, Run, Session};
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::promote::keep;
use harness_bench::command::fuzz::{FuzzCommands, verify_as};
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::exit_of;
use harness_bench::link::Line as _;
use harness_bench::link::{Capability, Link, Trouble};
use harness_bench::rig::{Rig, UseOptions};
use harness_proto::novobus::guard::Limits;

/// How rings are explored.
pub(crate) const COMMANDS: FuzzCommands = FuzzCommands {
    run: run::run,
    replay: replay::replay,
    shrink: shrink::shrink,
    promote: keep::<Case>,
    verify: verify_as::<Case>,
    power: Some(power::power),
    page: Some(page),
};

/// Opens a rig with ports, works on it, and gives it back in its safe state.
pub(crate) fn on_ports(
    rig: &Rig,
    options: &UseOptions,
    output: &mut Output,
    work: impl FnOnce(&mut Run<'_>, &mut Output) -> std::io::Result<Exit>,
) -> std::io::Result<Exit> {
    let mut session = match session::open(rig, options) {
        Ok(session) => session,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    match wrong_parity::obstacles(&mut session) {
        Ok(all) => all.iter().for_each(|why| output.say(&format!("{why}\n"))),
        Err(error) => {
            output.complain(&error.to_string());
            let exit = exit_of(&error);
            return Ok(give_back(session, exit, output));
        }
    }
    let worked = match Run::new(&mut session) {
        Ok(mut run) => work(&mut run, output),
        Err(problems) => {
            output.mistakes(&problems);
            Ok(Exit::Usage)
        }
    };
    leave_clean(&mut session, output);
    session.end_if_overdue();
    let exit = worked.unwrap_or_else(|error| output.unwritable(&error));
    Ok(give_back(session, exit, output))
}

/// What cases have left in the drives' RAM goes with a reset, where that is allowed.
fn leave_clean(session: &mut Session, output: &mut Output) {
    let limits = session.limits();
    let lost = |trouble: &Trouble| !matches!(trouble, Trouble::Denied(_));
    if !(limits.reset && limits.motion) || session.link().trouble().is_some_and(lost) {
        return;
    }
    let rings = session.rings().to_vec();
    let done = match session.health() {
        Ok(_) => start_anew(session.link(), &rings).map_err(|why| why.to_string()),
        Err(error) => Err(error.to_string()),
    };
    if let Err(why) = done {
        output.complain(&format!("the drives were not reset after the run: {why}"));
    }
}

/// The rings of a rig, and where faults can be put on them.
pub(crate) fn rings(
    rig: &Rig,
    reaches: impl Fn(usize, u8) -> bool,
) -> (RingScope, Option<RingScope>) {
    let second = rig.file.rings().nth(1).map(|ring| ring.drives);
    RingScope::both(rig.ring_size(), second, reaches)
}

/// What cases may have on simulated rings; plain drives have nothing behind their bus.
pub(crate) fn simulated(rig: &Rig, limits: Limits, setup: &RingSetup) -> CaseScope {
    let behind = [Spice::Motion, Spice::Eeprom];
    let all = Spice::NAMES.iter().map(|(_, spice)| *spice);
    let (first, second) = rings(rig, |_, _| true);
    CaseScope {
        first,
        second,
        spices: all
            .filter(|spice| !setup.is_plain() || !behind.contains(spice))
            .collect(),
        limits,
        spare_eeprom: false,
    }
}

/// What cases may have on a rig with ports. What a case leaves in a drive's RAM the next reset takes away (ND21 10.5): without leave for
/// it cases only read, stop and block. The EEPROM is never written.
pub(crate) fn scope(run: &mut Run<'_>) -> CaseScope {
    let capabilities = run.capabilities();
    let session = run.session();
    let allowed = session.limits();
    let limits = match allowed.reset && allowed.motion {
        true => allowed,
        false => Limits {
            bytes_per_second: allowed.bytes_per_second,
            most_bytes: allowed.most_bytes,
            ..Limits::default()
        },
    };
    let rig = session.rig().clone();
    let has = |capability| capabilities.contains(&capability);
    let link = session.link();
    // On a simulated ring that is tried like one behind a port, only the master's own link is in reach.
    let (first, second) = rings(&rig, |ring, place| match rig.is_simulated() {
        true => place == 0,
        false => {
            let place = usize::from(place);
            // A case's fault may be one of parity.
            link.reaches(ring, place) && link.damages_parity(ring, place)
        }
    });
    let reaches = |ring: &RingScope| !ring.links.is_empty();
    let reached = reaches(&first) || second.as_ref().is_some_and(reaches);
    let possible = |spice: &Spice| match spice {
        Spice::Power => false,
        Spice::Flip | Spice::Framing => has(Capability::LineErrors) && reached,
        Spice::Slip => limits.allow_everything() && reached,
        // The manual leaves open what drives take a broken byte for.
        Spice::Late => false,
        // Time-outs of drives are not judged in real time. A reset takes as long as 100 commands; the tour has some.
        Spice::Silence | Spice::Reset => false,
        Spice::ProcessData => limits.motion,
        Spice::WriteIo => limits.outputs,
        Spice::Motion => limits.motion,
        Spice::Eeprom => false,
        _ => true,
    };
    let all = Spice::NAMES.iter().map(|(_, spice)| *spice);
    CaseScope {
        first,
        second,
        spices: all.filter(possible).collect(),
        limits,
        spare_eeprom: true,
    }
}
