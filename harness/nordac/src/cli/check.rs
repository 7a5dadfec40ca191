//! `drivebench rig check` of NORDAC inverters: the bench is opened, and every slave is asked for its diagnosis and its configuration.

use crate::rig::OfNordac as _;
use crate::rig::Session;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::{exit_of, exit_of_end, tell_end};
use harness_bench::link::Line as _;
use harness_bench::port::UNPROVEN_RATE;
use harness_bench::rig::{Rig, UseOptions};
use harness_proto::profibus::dp::Diagnosis;
use serde_json::json;
use std::fmt::Write as _;

/// Opens a bench and says what it shows, as text or for tools. Nothing is changed: no slave is taken into the exchange.
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
    let listens = rig.port().is_some_and(|port| port.listen_only);
    let slaves = session.slaves().to_vec();
    let mut text = String::new();
    let mut drives = Vec::new();
    let mut exit = Exit::Passed;
    let mut talk = session.talk();
    for slave in slaves {
        let address = slave.address;
        let ppo = slave.ppo.map(|own| own.number());
        talk.restart(address);
        let asked = match listens {
            true => Ok(None),
            false => talk.diagnose(address).map(Some),
        };
        let about = match &asked {
            Ok(Some(diagnosis)) => {
                let names: Vec<_> = diagnosis.names().collect();
                drives.push(json!({
                    "address": address, "ppo": ppo, "diagnosis": names, "master": diagnosis.master,
                }));
                let exchanges = !diagnosis.has(Diagnosis::NOT_READY);
                let state = match diagnosis.master.filter(|_| exchanges) {
                    None => "not in the exchange".to_owned(),
                    Some(master) => format!("in the exchange with master {master}"),
                };
                let ppo = ppo.map_or("of no PPO type".to_owned(), |own| format!("PPO type {own}"));
                let names = names.join(", ");
                format!("{ppo}, {state}; diagnosis: {names}")
            }
            Ok(None) => "not asked: the bench only listens".to_owned(),
            Err(_) => "does not reply".to_owned(),
        };
        if let Err(error) = asked {
            output.complain(&error.to_string());
            exit = exit.max(Exit::Failed);
        }
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "slave {address}: {about}");
    }
    drop(talk);
    if session
        .link()
        .inner_mut()
        .ports_mut()
        .is_some_and(|own| own.has_unproven_rate(0))
    {
        let _infallible = writeln!(text, "{UNPROVEN_RATE}");
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
