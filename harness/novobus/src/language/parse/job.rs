//! Jobs of the master in the manual's terms: `read-byte 95 FE13 = 88`, `go 3`, `recover`.

use super::master;
use super::value::{assigned, place, tolerance};
use super::words::{drives, equals};
use crate::language::syntax::{CellPlace, DriveRange, JobKind, JobStep, MasterCall, Written};
use harness_bench::scenario::expression;
use harness_bench::scenario::pattern::{self, Pattern};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;

/// What follows a job's name.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Form {
    pub(crate) name: &'static str,
    pub(crate) kind: JobKind,
    cell: bool,
    data: JobData,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum JobData {
    None,
    Read,
    Written,
}

const fn form(name: &'static str, kind: JobKind, cell: bool, data: JobData) -> Form {
    Form {
        name,
        kind,
        cell,
        data,
    }
}

pub(crate) const FORMS: [Form; 13] = [
    form("read-byte", JobKind::ReadByte, true, JobData::Read),
    form("read-word", JobKind::ReadWord, true, JobData::Read),
    form("read-long", JobKind::ReadLong, true, JobData::Read),
    form("write-byte", JobKind::WriteByte, true, JobData::Written),
    form("write-word", JobKind::WriteWord, true, JobData::Written),
    form("and", JobKind::And, true, JobData::Written),
    form("or", JobKind::Or, true, JobData::Written),
    form("write-io", JobKind::WriteIo, false, JobData::Written),
    form("reset", JobKind::Reset, false, JobData::None),
    form("go", JobKind::Go, false, JobData::None),
    form("stop", JobKind::Stop, false, JobData::None),
    form("block", JobKind::Block, false, JobData::None),
    form("delete-error", JobKind::DeleteError, false, JobData::None),
];

/// Every name that a job can have.
pub(crate) fn names() -> Vec<&'static str> {
    let mut names: Vec<_> = FORMS.iter().map(|form| form.name).collect();
    names.extend(["recover", "exchange", "master"]);
    names
}

/// Reads the text after a job's name; `None` if there is no such job.
pub(crate) fn job(name: &str, scanner: &mut Scanner<'_>) -> Option<Result<JobStep, Problem>> {
    match name {
        "recover" => Some(recover(scanner)),
        "exchange" => Some(exchange(scanner)),
        "master" => Some(master::call(scanner)),
        _ => {
            let form = FORMS.iter().find(|form| form.name == name)?;
            Some(command(*form, scanner))
        }
    }
}

fn recover(scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    Ok(JobStep::Recover(which_ring(scanner)?))
}

/// `ring 2`, or nothing for the first one.
pub(crate) fn which_ring(scanner: &mut Scanner<'_>) -> Result<usize, Problem> {
    let named = scanner.eat_word("ring");
    let mut ahead = scanner.clone();
    let ring = match ahead.take_while(|c| c.is_ascii_digit()).map(|d| d.value) {
        None if !named => return Ok(0),
        Some("1") => 0,
        Some("2") => 1,
        _ => return Err(scanner.unexpected("the ring, 1 or 2")),
    };
    *scanner = ahead;
    Ok(ring)
}

fn exchange(scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let drive = one(scanner)?;
    let (send, receive) = process_data(scanner)?;
    Ok(JobStep::Exchange {
        drive,
        send,
        receive,
    })
}

/// `1234 = ABCD`: what a drive gets as process data, and what it gives.
pub(crate) fn process_data(
    scanner: &mut Scanner<'_>,
) -> Result<(Pattern, Option<Pattern>), Problem> {
    let here = scanner.here();
    let text = scanner
        .take_while(|c| c.is_ascii_hexdigit() || c == ' ')
        .map_or("", |text| text.value);
    let send = pattern::pattern(&mut Scanner::new(text, here.start))
        .map_err(|_| scanner.unexpected("process data: four hexadecimal digits such as 1234"))?;
    let receive = if scanner.eat("=") {
        Some(pattern::pattern(scanner)?)
    } else {
        None
    };
    Ok((send, receive))
}

/// What stands behind the drive: the cell and the data.
fn operands(
    form: Form,
    scanner: &mut Scanner<'_>,
) -> Result<(Option<CellPlace>, Option<Written>), Problem> {
    let place = if form.cell {
        let place = place(scanner)?;
        let offset = match scanner.eat("+") {
            true => Some(Box::new(expression::sum(scanner)?)),
            false => None,
        };
        Some(CellPlace { offset, ..place })
    } else {
        None
    };
    let data = match (form.data, &place) {
        (JobData::None, _) => None,
        (JobData::Read, _) if scanner.at_end() || scanner.peek() == Some(';') => None,
        (_, Some(place)) => Some(assigned(scanner, place)?),
        (_, None) => {
            equals(scanner)?;
            Some(Written::Bytes(pattern::pattern(scanner)?))
        }
    };
    Ok((place, data))
}

/// A command of the driver; `None` where there is none of this name.
pub(crate) fn driver_command(
    name: &str,
    scanner: &mut Scanner<'_>,
) -> Option<Result<(DriveRange, MasterCall), Problem>> {
    let form = FORMS.iter().find(|form| form.name == name)?;
    let job = drives(scanner).and_then(|drives| {
        let (place, data) = operands(*form, scanner)?;
        let call = MasterCall::Command(form.kind, place, data);
        Ok((drives, call))
    });
    Some(job)
}

fn command(form: Form, scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let drive = one(scanner)?;
    let (place, data) = operands(form, scanner)?;
    let tolerance = match &data {
        Some(data) if form.data == JobData::Read => tolerance(scanner, data)?,
        _ => None,
    };
    Ok(JobStep::Command {
        kind: form.kind,
        drive,
        place,
        data,
        tolerance,
    })
}

fn one(scanner: &mut Scanner<'_>) -> Result<DriveRange, Problem> {
    let drives = drives(scanner)?;
    match &drives.to {
        None => Ok(drives),
        Some(to) => Err(Problem::new(
            to.span,
            "a job goes to one drive",
            "one drive expected here",
        )),
    }
}
