//! What the driver is to do: `master reference 1`, `master read-byte 95..99 FE13 = 88`.

use super::job::{driver_command, which_ring};
use super::value::eeprom_place;
use super::words::{drives, equals};
use crate::scenario::expression;
use crate::scenario::pattern;
use crate::scenario::problem::Problem;
use crate::scenario::quantity::{self, Dimension};
use crate::scenario::scanner::Scanner;
use crate::scenario::syntax::{Job, MasterCall, Target};

/// The calls that are more than one command.
const CALLS: [&str; 10] = [
    "read-eeprom",
    "write-eeprom",
    "ram-to-eeprom",
    "reference",
    "set-actual-value",
    "init-ps",
    "write-ps",
    "start-ps",
    "wait-for-end",
    "count",
];

/// Reads what stands behind `master`.
pub(super) fn call(scanner: &mut Scanner<'_>) -> Result<Job, Problem> {
    let before = scanner.clone();
    let name = scanner.word().map_or("", |word| word.value);
    if let Some(job) = driver_command(name, scanner) {
        return job;
    }
    if !CALLS.contains(&name) {
        *scanner = before;
        let mut known = super::job::names();
        known.extend(CALLS);
        known.retain(|name| !["master", "recover", "exchange"].contains(name));
        known.push(super::header::DEVIATES);
        let problem = scanner.unexpected("what the driver is to do");
        return Err(problem.did_you_mean(name, &known));
    }
    if name == "count" {
        let ring = which_ring(scanner)?;
        equals(scanner)?;
        return Ok(Job::Count(ring, expression::sum(scanner)?));
    }
    let drives = drives(scanner)?;
    let call = match name {
        "read-eeprom" => {
            let place = eeprom_place(scanner)?;
            let data = if scanner.at_end() {
                None
            } else {
                equals(scanner)?;
                Some(pattern::pattern(scanner)?)
            };
            MasterCall::ReadEeprom(place, data)
        }
        "write-eeprom" => {
            let place = eeprom_place(scanner)?;
            equals(scanner)?;
            MasterCall::WriteEeprom(place, pattern::pattern(scanner)?)
        }
        "ram-to-eeprom" => MasterCall::RamToEeprom,
        "reference" => MasterCall::Reference,
        "set-actual-value" => MasterCall::SetActualValue(target(scanner, false)?),
        "init-ps" => MasterCall::InitPs,
        "write-ps" => MasterCall::WritePs(target(scanner, true)?),
        "start-ps" => MasterCall::StartPs,
        _ => MasterCall::WaitForEnd,
    };
    Ok(Job::Master(drives, call))
}

fn target(scanner: &mut Scanner<'_>, relative: bool) -> Result<Target, Problem> {
    equals(scanner)?;
    if relative && scanner.eat_word("by") {
        return Ok(Target::By(quantity::quantity(
            scanner,
            Some(Dimension::Angle),
        )?));
    }
    if quantity::ahead(scanner) {
        let turns = quantity::quantity(scanner, Some(Dimension::Angle))?;
        return Ok(Target::At(turns));
    }
    Ok(Target::Bytes(pattern::pattern(scanner)?))
}
