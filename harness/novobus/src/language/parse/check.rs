//! Checks: `? located 97`, `? drive 3 memory FF08 = 1234`, `? error 0502 at 97`.

use super::drive;
use super::job;
use super::step;
use super::words::{drives, named, required};
use crate::language::syntax::{Check, DriveRange, Ending};
use harness_bench::scenario::expression::{self, Located};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_proto::novobus::error::BusError;

/// Reads the text after `?`.
pub(crate) fn check(scanner: &mut Scanner<'_>) -> Result<Check, Problem> {
    #[derive(Clone, Copy)]
    enum CheckWord {
        Located,
        Within,
        Drive,
        Error,
        Corrected,
        Named,
        Ended,
        Rules,
        Sent,
        Received,
    }
    let words = [
        ("located", CheckWord::Located),
        ("within", CheckWord::Within),
        ("drive", CheckWord::Drive),
        ("drives", CheckWord::Drive),
        ("error", CheckWord::Error),
        ("corrected", CheckWord::Corrected),
        ("named", CheckWord::Named),
        ("ended", CheckWord::Ended),
        ("rules", CheckWord::Rules),
        ("sent", CheckWord::Sent),
        ("received", CheckWord::Received),
    ];
    match named(scanner, &words, "a check")? {
        CheckWord::Located => {
            scanner.eat_word("drive");
            let drive = one_drive(scanner)?;
            let within = if scanner.eat_word("within") {
                Some(zeros(scanner)?)
            } else {
                None
            };
            Ok(Check::Located { drive, within })
        }
        CheckWord::Within => Ok(Check::Within(zeros(scanner)?)),
        CheckWord::Drive => Ok(Check::Drive(drive::check(scanner)?)),
        CheckWord::Error => {
            let error = error_code(scanner)?;
            required(scanner, &["at"])?;
            scanner.eat_word("drive");
            let drive = one_drive(scanner)?;
            Ok(Check::Error { error, drive })
        }
        CheckWord::Corrected => Ok(Check::Corrected(expression::sum(scanner)?)),
        CheckWord::Named => {
            let kinds = [("damaged", false), ("broken", true)];
            let broken = named(scanner, &kinds, "a fault of a link")?;
            let (ring, link, ends) = step::link(scanner)?;
            Ok(Check::Named {
                ring,
                broken,
                link,
                ends,
            })
        }
        CheckWord::Ended => {
            let ending = named(scanner, &Ending::NAMES, "a result of a job")?;
            Ok(Check::Ended(ending))
        }
        CheckWord::Rules => {
            required(scanner, &["kept"])?;
            Ok(Check::RulesKept(job::which_ring(scanner)?))
        }
        CheckWord::Sent => {
            let bytes = expression::sum(scanner)?;
            required(scanner, &["bytes", "byte"])?;
            let time = if scanner.eat_word("in") {
                Some(times::duration(scanner)?)
            } else {
                None
            };
            Ok(Check::Sent { bytes, time })
        }
        CheckWord::Received => {
            let bytes = expression::sum(scanner)?;
            required(scanner, &["bytes", "byte"])?;
            Ok(Check::Received(bytes))
        }
    }
}

fn zeros(scanner: &mut Scanner<'_>) -> Result<Located, Problem> {
    let zeros = expression::sum(scanner)?;
    required(scanner, &["zeros", "zero"])?;
    Ok(zeros)
}

fn one_drive(scanner: &mut Scanner<'_>) -> Result<DriveRange, Problem> {
    let drives = drives(scanner)?;
    match &drives.to {
        None => Ok(drives),
        Some(to) => Err(Problem::new(
            to.span,
            "several drives are given where one is expected",
            "one drive expected here",
        )),
    }
}

fn error_code(scanner: &mut Scanner<'_>) -> Result<BusError, Problem> {
    let before = scanner.clone();
    let word = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '-');
    let known = word.and_then(|word| {
        let four = Some(word.value).filter(|digits| digits.len() == 4);
        let by_code = four.and_then(|digits| u16::from_str_radix(digits, 16).ok());
        by_code.and_then(BusError::from_code).or_else(|| {
            BusError::ALL.into_iter().find(|error| {
                error.printed_name().eq_ignore_ascii_case(word.value) || error.name() == word.value
            })
        })
    });
    known.ok_or_else(|| {
        *scanner = before;
        scanner
            .unexpected("an error code from 0501 to 0508 (ND21 14.11.14)")
            .help("0501 SCIoverrun, 0502 SCIparity, 0503 SCIframing, 0504 NBsync, 0505 NBcommand, 0506 NBparam, 0507 NBchecksum, 0508 NBtimeout")
    })
}
