//! `drivebench rig check` of drives behind `[port.1]`: the bench is opened, and every drive is asked.

use super::drives::CommandDrives;
use super::exit::Exit;
use super::failure::Failure;
use super::output::Output;
use super::rig_commands::unusable;
use super::rig_failure::{exit_of_end, tell_end};
use crate::link::Line as _;
use crate::port::UNPROVEN_RATE;
use crate::rig::session::RigSession;
use crate::rig::{Rig, UseOptions};
use serde_json::{Value, json};

/// What a drive answers: its object for tools, and the same in words.
pub type CheckAnswer = Result<(Value, String), Failure>;

/// A drive of a bench that is checked.
pub struct CheckedDrive {
    /// How its line begins.
    pub name: String,
    /// `None` where the bench only listens.
    pub answer: Option<CheckAnswer>,
}

/// Opens a bench and says what it shows, as text or for tools.
///
/// # Errors
/// [`Failure`].
pub(super) fn check<D: CommandDrives>(
    rig: &Rig,
    options: &UseOptions,
    for_tools: bool,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let mut session = RigSession::<D>::open(rig, options).map_err(unusable)?;
    let (mut text, mut objects) = (String::new(), Vec::new());
    let mut exit = Exit::Passed;
    for CheckedDrive { name, answer } in D::check(&mut session) {
        let about = match answer {
            Some(Ok((object, about))) => {
                objects.push(object);
                about
            }
            Some(Err(failure)) => {
                exit = exit.max(failure.tell(output));
                D::SILENT.to_owned()
            }
            None => "not asked: the bench only listens".to_owned(),
        };
        text.push_str(&format!("{name}: {about}\n"));
    }
    let ports = session.ports();
    if ports.is_some_and(|ports| ports.has_unproven_rate(0)) {
        text.push_str(&format!("{UNPROVEN_RATE}\n"));
    }
    session.look_at_interlocks();
    let exit = exit_of_end(session.link().trouble(), exit, output);
    let end = session.release();
    if for_tools {
        let whole = json!({"schema": 1, "rig": rig.id(), "drives": objects});
        text = format!("{whole:#}\n");
    }
    let exit = match output.result(&text) {
        Ok(()) => exit,
        Err(error) => output.unwritable(&error),
    };
    Ok(tell_end(&end, exit, output))
}
