//! Jobs of the master: `read 1 SPEED_ACTUAL = 50%`, and those of the driver after `master`.

use super::super::syntax::{JobKind, JobStep};
use super::value;
use harness_bench::scenario::expression;
use harness_bench::scenario::parse::words::{equals, named, required};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;

/// Jobs that are compiled to one frame.
pub(in super::super) const NAMES: [&str; 6] =
    ["read", "write", "every", "stop-every", "lock", "release"];

/// Jobs of the driver.
pub(in super::super) const DRIVER: [&str; 5] = ["read", "write", "every", "stop-every", "start-up"];

/// Reads the rest of a job; `None` if there is none of this name.
pub(super) fn job(name: &str, scanner: &mut Scanner<'_>) -> Option<Result<JobStep, Problem>> {
    NAMES.contains(&name).then(|| one(name, scanner))
}

/// Reads what stands after `master`.
pub(super) fn by_driver(scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let names = DRIVER.map(|name| (name, name));
    let name = named(scanner, &names, "what the driver is to do")?;
    one(name, scanner)
}

fn one(name: &str, scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let drive = expression::sum(scanner)?;
    let what = match name {
        "lock" => JobKind::Lock,
        "release" => JobKind::Release,
        "start-up" => {
            let fails = scanner.eat("=");
            if fails {
                required(scanner, &["not-ready"])?;
            }
            JobKind::StartUp(fails)
        }
        name => {
            let register = value::register(scanner)?;
            match name {
                "read" if scanner.at_end() => JobKind::Read(register, None),
                "read" => {
                    let expect = value::expect(scanner, &register)?;
                    JobKind::Read(register, Some(expect))
                }
                "write" => {
                    equals(scanner)?;
                    let value = value::value(scanner, register.unit())?;
                    JobKind::Write(register, value)
                }
                "every" => JobKind::Every(register, times::duration(scanner)?),
                _ => JobKind::StopEvery(register),
            }
        }
    };
    Ok(JobStep { drive, what })
}
