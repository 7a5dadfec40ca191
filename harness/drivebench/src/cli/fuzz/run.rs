//! `drivebench fuzz run`.

use crate::buses::{BUSES, bus_of, find_any_rig, fuzz_of};
use crate::command::exit::Exit;
use crate::command::fuzz::run::{CASES, FuzzRunArguments, planted as read_planted};
use crate::command::fuzz::tell;
use crate::command::output::Output;
use crate::command::page::writable;
use crate::explore::{Planted, rig_of};
use crate::partition::Partition;
use crate::rig::Rig;
use crate::scenario::problem::nearest;

/// A deviation of a drive, which a bus must have.
pub(super) fn planted(text: &str) -> Result<Planted, String> {
    read_planted(text, |name| {
        let names = deviation_names();
        let known = names.iter().find(|known| **known == name.trim());
        let known = known.ok_or_else(|| {
            let remedy = match nearest(name.trim(), &names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`drivebench deviations` lists them".to_owned(),
            };
            format!("there is no deviation `{name}`; {remedy}")
        })?;
        Ok((*known).to_owned())
    })
}

/// The deviations of drives of all buses.
fn deviation_names() -> Vec<&'static str> {
    let rows = BUSES.iter().flat_map(|bus| {
        let [drives, _masters] = (bus.deviations)();
        drives
    });
    rows.map(|row| row.name).collect()
}

/// Explores.
pub(crate) fn run(arguments: &FuzzRunArguments, output: &mut Output) -> std::io::Result<Exit> {
    if let Some(path) = &arguments.html
        && writable(path, output).is_err()
    {
        return Ok(Exit::Usage);
    }
    // What a run that goes on is, its record says.
    let name = match arguments.resume.as_deref().map(rig_of).transpose() {
        Ok(name) => name.unwrap_or_else(|| arguments.rig.clone()),
        Err(error) => return Ok(tell(&error, output)),
    };
    let Some(rig) = find_any_rig(&name, output) else {
        return Ok(Exit::Usage);
    };
    let part = match arguments.partition {
        None => None,
        Some(part) => {
            let share = share(arguments, part, &rig);
            if share.cases == Some(0) {
                output.complain(&format!("{part} has no case"));
                return Ok(Exit::NothingSelected);
            }
            output.say(&format!("{part} has the seed {}\n", share.seed));
            Some(share)
        }
    };
    let arguments = part.as_ref().unwrap_or(arguments);
    match fuzz_of(bus_of(&rig).name) {
        Some(fuzz) => (fuzz.run)(&rig, arguments, output),
        None => Ok(Exit::Usage),
    }
}

/// The run that is one part of this one: its seed and its share of the cases. A time on the line is that of each part.
fn share(arguments: &FuzzRunArguments, part: Partition, rig: &Rig) -> FuzzRunArguments {
    let by_number = rig.is_simulated() && !arguments.behind_port && arguments.wire_time.is_none();
    let cases = arguments.cases.or(by_number.then_some(CASES));
    FuzzRunArguments {
        seed: part.seed(arguments.seed),
        cases: cases.map(|cases| part.share(cases)),
        partition: None,
        ..arguments.clone()
    }
}
