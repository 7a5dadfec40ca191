//! Jobs of the master in the manual's terms: `read-byte 95 FE13 = 88`, `go 3`, `recover`.

use super::parse::{address, drives, equals};
use super::pattern::{self, Pattern};
use super::problem::{Problem, Spanned};
use super::scanner::Scanner;
use super::syntax::Drives;

/// A job as written.
#[derive(Clone, Debug)]
pub enum Job {
    /// `recover`: 17 zeros and the check sequence (ND21 9.8), on the given ring.
    Recover(usize),
    /// `exchange K SEND = RECEIVE`: process data (ND21 9.4).
    Exchange {
        /// Which drive.
        drive: Drives,
        /// What is sent.
        send: Pattern,
        /// What must come back.
        receive: Option<Pattern>,
    },
    /// A command to a drive.
    Command {
        /// Which command.
        kind: JobKind,
        /// Which drive.
        drive: Drives,
        /// The cell, where the command has one.
        address: Option<Spanned<u16>>,
        /// The data that are written, or that must be read.
        data: Option<Pattern>,
    },
}

/// The jobs that are one command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// `read-byte K CELL [= HH]` (10.1)
    ReadByte,
    /// `read-word K CELL [= HHHH]` (10.1)
    ReadWord,
    /// `read-long K CELL [= HHHHHHHH]` (10.1)
    ReadLong,
    /// `write-byte K CELL = HH` (10.2)
    WriteByte,
    /// `write-word K CELL = HHHH` (10.2)
    WriteWord,
    /// `and K CELL = HH` (10.3)
    And,
    /// `or K CELL = HH` (10.3)
    Or,
    /// `write-io K = CODE` (10.4)
    WriteIo,
    /// `reset K` (10.5)
    Reset,
    /// `go K`: software block and software stop off (11.8)
    Go,
    /// `stop K`: software stop on (11.8)
    Stop,
    /// `block K`: software block on (11.8)
    Block,
    /// `delete-error K` (14.10.1)
    DeleteError,
}

/// What stands behind a job's name.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Form {
    name: &'static str,
    kind: JobKind,
    cell: bool,
    data: Data,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Data {
    None,
    Read,
    Written,
}

const fn form(name: &'static str, kind: JobKind, cell: bool, data: Data) -> Form {
    Form {
        name,
        kind,
        cell,
        data,
    }
}

const FORMS: [Form; 13] = [
    form("read-byte", JobKind::ReadByte, true, Data::Read),
    form("read-word", JobKind::ReadWord, true, Data::Read),
    form("read-long", JobKind::ReadLong, true, Data::Read),
    form("write-byte", JobKind::WriteByte, true, Data::Written),
    form("write-word", JobKind::WriteWord, true, Data::Written),
    form("and", JobKind::And, true, Data::Written),
    form("or", JobKind::Or, true, Data::Written),
    form("write-io", JobKind::WriteIo, false, Data::Written),
    form("reset", JobKind::Reset, false, Data::None),
    form("go", JobKind::Go, false, Data::None),
    form("stop", JobKind::Stop, false, Data::None),
    form("block", JobKind::Block, false, Data::None),
    form("delete-error", JobKind::DeleteError, false, Data::None),
];

/// Every name that a job can have.
pub(super) fn names() -> Vec<&'static str> {
    let mut names: Vec<_> = FORMS.iter().map(|form| form.name).collect();
    names.extend(["recover", "exchange"]);
    names
}

/// Reads what stands behind the job's name; `None` where there is no such job.
pub(super) fn job(name: &str, scanner: &mut Scanner<'_>) -> Option<Result<Job, Problem>> {
    match name {
        "recover" => Some(recover(scanner)),
        "exchange" => Some(exchange(scanner)),
        _ => {
            let form = FORMS.iter().find(|form| form.name == name)?;
            Some(command(*form, scanner))
        }
    }
}

fn recover(scanner: &mut Scanner<'_>) -> Result<Job, Problem> {
    let ring = if scanner.eat_word("ring") {
        match scanner.take_while(|c| c.is_ascii_digit()).map(|d| d.value) {
            Some("1") => 0,
            Some("2") => 1,
            _ => return Err(scanner.unexpected("1 or 2")),
        }
    } else {
        0
    };
    Ok(Job::Recover(ring))
}

fn exchange(scanner: &mut Scanner<'_>) -> Result<Job, Problem> {
    let drive = one(scanner)?;
    let here = scanner.here();
    let send = scanner.take_while(|c| c.is_ascii_hexdigit());
    let Some(send) = send.filter(|send| send.value.len() == 4) else {
        return Err(Problem::new(
            here,
            "process data are two bytes",
            "four hexadecimal digits expected here, such as 1234",
        ));
    };
    let send = pattern::pattern(&mut Scanner::new(send.value, send.span.start))?;
    let receive = if scanner.eat("=") {
        Some(pattern::pattern(scanner)?)
    } else {
        None
    };
    Ok(Job::Exchange {
        drive,
        send,
        receive,
    })
}

fn command(form: Form, scanner: &mut Scanner<'_>) -> Result<Job, Problem> {
    let drive = one(scanner)?;
    let address = if form.cell {
        Some(address(scanner)?)
    } else {
        None
    };
    let data = match form.data {
        Data::None => None,
        Data::Read if scanner.at_end() => None,
        Data::Read | Data::Written => {
            equals(scanner)?;
            Some(pattern::pattern(scanner)?)
        }
    };
    Ok(Job::Command {
        kind: form.kind,
        drive,
        address,
        data,
    })
}

fn one(scanner: &mut Scanner<'_>) -> Result<Drives, Problem> {
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
