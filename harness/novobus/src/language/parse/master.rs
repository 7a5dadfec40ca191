//! What the driver is to do: `master reference 1`, `master read-byte 95..99 FE13 = 88`.

use super::job::{driver_command, process_data, which_ring};
use super::value::eeprom_place;
use super::words::{drives, equals};
use crate::language::syntax::{DriveRange, JobStep, MasterCall, WrittenTarget};
use harness_bench::scenario::expression;
use harness_bench::scenario::pattern;
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::quantity::{self, Dimension};
use harness_bench::scenario::scanner::Scanner;

/// The calls that are more than one command.
const CALLS: [&str; 11] = [
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
    "exchange",
];

/// Maximum number of jobs in one line.
const MOST_CALLS: usize = 64;

/// Reads what follows `master`: one call, or several behind semicolons that go out together.
pub(crate) fn call(scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let once = scanner.eat_word("once");
    let mut ahead = scanner.clone();
    if !once && ahead.eat_word("count") {
        *scanner = ahead;
        let ring = which_ring(scanner)?;
        equals(scanner)?;
        return Ok(JobStep::Count(ring, expression::sum(scanner)?));
    }
    let mut calls = Vec::new();
    loop {
        let here = scanner.here();
        let (drives, call) = one_call(scanner)?;
        let span = scanner.since(here);
        if once && !matches!(call, MasterCall::Command(..)) {
            let message = "`once` is for jobs that are one command";
            return Err(Problem::new(span, message, "a command expected here"));
        }
        let first = calls
            .first()
            .map(|(drives, _): &(DriveRange, _)| drives.ring);
        if first.is_some_and(|ring| ring != drives.ring) {
            let message = "jobs that go out together are for one ring";
            return Err(Problem::new(
                span,
                message,
                "a drive of the same ring expected",
            ));
        }
        calls.push((drives, call));
        if !scanner.eat(";") {
            return Ok(JobStep::Master { calls, once });
        }
        if calls.len() == MOST_CALLS {
            return Err(scanner.unexpected("the end of the line (no more jobs fit into one line)"));
        }
    }
}

fn one_call(scanner: &mut Scanner<'_>) -> Result<(DriveRange, MasterCall), Problem> {
    let before = scanner.clone();
    let name = scanner.word().map_or("", |word| word.value);
    if let Some(job) = driver_command(name, scanner) {
        return job;
    }
    if !CALLS.contains(&name) || name == "count" {
        *scanner = before;
        let mut known = super::job::names();
        known.extend(CALLS);
        known.retain(|name| !["master", "recover"].contains(name));
        known.extend([super::header::DEVIATES, "once"]);
        let problem = scanner.unexpected("a job of the driver");
        return Err(problem.did_you_mean(name, &known));
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
        "exchange" => {
            let (send, receive) = process_data(scanner)?;
            MasterCall::Exchange(send, receive)
        }
        "start-ps" => MasterCall::StartPs,
        _ => MasterCall::WaitForEnd,
    };
    Ok((drives, call))
}

fn target(scanner: &mut Scanner<'_>, relative: bool) -> Result<WrittenTarget, Problem> {
    equals(scanner)?;
    if relative && scanner.eat_word("by") {
        return Ok(WrittenTarget::By(quantity::quantity(
            scanner,
            Some(Dimension::Angle),
        )?));
    }
    if quantity::ahead(scanner) {
        let turns = quantity::quantity(scanner, Some(Dimension::Angle))?;
        return Ok(WrittenTarget::At(turns));
    }
    Ok(WrittenTarget::Bytes(pattern::pattern(scanner)?))
}
