//! `drivebench rig check` of UNITEK drives: the bench is opened, and every drive is asked.

use crate::rig::OfUnitek as _;
use crate::rig::Session;
use harness_bench::command::axes::Axes;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::select;
use harness_bench::command::rig_failure::{exit_of, exit_of_end, tell_end};
use harness_bench::link::Line as _;
use harness_bench::rig::{Rig, UseOptions};
use harness_proto::unitek::words::{ERRORS, set_bits};
use serde_json::json;
use std::fmt::Write as _;

/// Opens a bench and says what it shows, as text or for tools.
///
/// # Errors
/// [`Failure`].
pub(crate) fn check(
    rig: &Rig,
    options: &UseOptions,
    for_tools: bool,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let session = Session::open(rig, options);
    let mut session = session.map_err(|error| Failure::Said(exit_of(&error), error.to_string()))?;
    let axes = select(&[Axes::All], &session)?;
    let listens = rig.port().is_some_and(|port| port.listen_only);
    let mut text = String::new();
    let mut drives = Vec::new();
    let mut exit = Exit::Passed;
    for axis in axes {
        let (rx, tx) = (axis.rx, axis.tx);
        let mut driver = session.driver();
        let mut read = |register| Ok::<_, Failure>(driver.read(axis, register)?.data.bits());
        let read = match listens {
            true => Ok(None),
            false => read(0x1B).and_then(|version| Ok(Some((version, read(0xE2)?, read(0x8F)?)))),
        };
        let about = match &read {
            Ok(Some((version, ready, errors))) => {
                let names: Vec<_> = set_bits(ERRORS, *errors).map(|bit| bit.name).collect();
                let ready = if ready & 1 == 1 { "ready" } else { "not ready" };
                drives.push(json!({
                    "node": axis.node, "rx": rx, "tx": tx, "firmware": version, "ready": ready == "ready", "errors": names,
                }));
                let errors = match names.is_empty() {
                    true => "no errors".to_owned(),
                    false => format!("errors {}", names.join(" ")),
                };
                format!("firmware {version}, {ready}, {errors}")
            }
            Ok(None) => "not asked: the bench only listens".to_owned(),
            Err(_) => "does not answer".to_owned(),
        };
        if let Err(failure) = read {
            exit = exit.max(failure.tell(output));
        }
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "drive {} ({rx:03X}, {tx:03X}): {about}", axis.node);
    }
    session.look_at_interlocks();
    let exit = exit_of_end(session.link().trouble(), exit, output);
    let end = session.release();
    let text = match for_tools {
        true => format!(
            "{:#}\n",
            json!({"schema": 1, "rig": rig.id(), "drives": drives})
        ),
        false => text,
    };
    let exit = match output.result(&text) {
        Ok(()) => exit,
        Err(error) => output.unwritable(&error),
    };
    Ok(tell_end(&end, exit, output))
}
