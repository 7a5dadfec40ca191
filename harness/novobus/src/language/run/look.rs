//! Compares the visible state of drives with what must hold.

use super::Runner;
use crate::language::plan::{CellTest, PlannedCell, PlannedCondition, PlannedDriveCheck, number};
use crate::language::run::bytes::matches;
use crate::language::syntax::{Relation, Showing};
use crate::link::BesideTheBus;
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::quantity::{Quantity, Tolerance, Unit};
use harness_bench::scenario::run::record::{hex, physical};
use harness_proto::line::Received;
use harness_proto::nd21::bits;
use harness_proto::nd21::units::{self, Scale, Value};
use harness_sim::nd21::{Mode, OutputLevels};
use std::ops::RangeInclusive;

/// The difference that two computed numbers may have by rounding alone, as a part of the larger.
const ROUNDING: f64 = 1e-12;

/// Why a check does not hold.
pub(crate) enum Miss {
    /// Something else was found, as a sentence.
    Otherwise(String),
    /// It cannot be seen on this link, as a sentence.
    Unseen(String),
}

/// Whether something holds of drives, and of which of them it does not.
pub(crate) fn look(runner: &Runner<'_>, check: &PlannedDriveCheck) -> Result<(), Miss> {
    look_at_drives(runner, check, check.drives.clone())
}

/// The same, but stops at the first drive for which it does not hold: for frequent checks.
pub(crate) fn glance(runner: &Runner<'_>, check: &PlannedDriveCheck) -> Result<(), Miss> {
    let mut drives = check.drives.clone();
    drives.try_for_each(|drive| look_at_drives(runner, check, drive..=drive))
}

fn look_at_drives(
    runner: &Runner<'_>,
    check: &PlannedDriveCheck,
    drives: RangeInclusive<u8>,
) -> Result<(), Miss> {
    if let PlannedCondition::InError(expected) = check.condition {
        return look_at_errors(runner, check.ring, drives, expected);
    }
    let mut first = None;
    let mut others: u32 = 0;
    for drive in drives {
        match look_at(runner, check, drive) {
            Ok(()) => {}
            // A visible fault takes precedence over a cell that cannot be seen.
            Err(Miss::Otherwise(message)) if first.is_none() => first = Some(message),
            Err(Miss::Otherwise(_)) => others += 1,
            Err(unseen) if first.is_none() => return Err(unseen),
            Err(_) => {}
        }
    }
    match (first, others) {
        (None, _) => Ok(()),
        (Some(message), 0) => Err(Miss::Otherwise(message)),
        (Some(message), 1) => Err(Miss::Otherwise(format!("{message} (and 1 drive more)"))),
        (Some(message), n) => Err(Miss::Otherwise(format!("{message} (and {n} drives more)"))),
    }
}

fn look_at_errors(
    runner: &Runner<'_>,
    ring: usize,
    drives: RangeInclusive<u8>,
    expected: bool,
) -> Result<(), Miss> {
    let mut wrong = Vec::new();
    let mut unseen = Vec::new();
    for drive in drives {
        let answered = || runner.own.answers.contains(&(ring, drive)).then_some(None);
        match super::tapped::shown_error(runner, ring, drive).or_else(answered) {
            None => unseen.push(drive),
            Some(error) if error.is_some() != expected => wrong.push(drive),
            Some(_) => {}
        }
    }
    if !wrong.is_empty() {
        let not = if expected { " not" } else { "" };
        let are = if wrong.len() == 1 { "is" } else { "are" };
        let drives = list(ring, &wrong);
        return Err(Miss::Otherwise(format!(
            "{drives} {are}{not} in the error mode"
        )));
    }
    if !unseen.is_empty() {
        let drives = list(ring, &unseen);
        return Err(Miss::Unseen(format!(
            "this link does not show whether {drives} are in the error mode"
        )));
    }
    Ok(())
}

fn look_at(runner: &Runner<'_>, check: &PlannedDriveCheck, drive: u8) -> Result<(), Miss> {
    let ring = check.ring;
    let label = || list(ring, &[drive]);
    let unseen = |what: &str| Miss::Unseen(format!("{}: this link does not show {what}", label()));
    match &check.condition {
        PlannedCondition::InError(_) => Ok(()),
        PlannedCondition::Memory(address, bytes) => {
            for (cell, expected) in (*address..=u16::MAX).zip(bytes) {
                let found = peek(runner, ring, drive, cell);
                let found = found.ok_or_else(|| unseen(&format!("cell {cell:04X}")))?;
                if !matches(*expected, Received::good(found)) {
                    return Err(Miss::Otherwise(format!(
                        "cell {cell:04X} of {} holds {found:02X}, expected {}",
                        label(),
                        expected
                    )));
                }
            }
            Ok(())
        }
        PlannedCondition::Cell(cell) => {
            let bytes = bytes(runner, ring, drive, cell.address, cell.size);
            let bytes = bytes.ok_or_else(|| unseen(&cell.name))?;
            judge(cell, &bytes, runner.plan.units(ring, drive))
                .map_err(|message| Miss::Otherwise(format!("{}: {message}", label())))
        }
        PlannedCondition::Shows(showing) => {
            let shown = runner.link.shown(ring, drive);
            let shown = shown.ok_or_else(|| unseen("what stands outside the bus"))?;
            shows(*showing, &shown)
                .map_err(|message| Miss::Otherwise(format!("{}: {message}", label())))
        }
    }
}

/// A byte as the link shows it, or as it was read over the bus for this look.
fn peek(runner: &Runner<'_>, ring: usize, drive: u8, address: u16) -> Option<u8> {
    let read = || runner.own.seen.get(&(ring, drive, address)).copied();
    runner.link.peek(ring, drive, address).or_else(read)
}

/// The bytes of a cell; `None` where the link does not show them.
pub(crate) fn bytes(
    runner: &Runner<'_>,
    ring: usize,
    drive: u8,
    address: u16,
    size: usize,
) -> Option<Vec<u8>> {
    (address..=u16::MAX)
        .take(size)
        .map(|address| peek(runner, ring, drive, address))
        .collect()
}

/// `drive 3`, `drives 0, 1`, `drive 2:3`
fn list(ring: usize, drives: &[u8]) -> String {
    let prefix = if ring == 0 { "" } else { "2:" };
    let names: Vec<_> = drives.iter().map(|k| format!("{prefix}{k}")).collect();
    let s = if drives.len() == 1 { "" } else { "s" };
    format!("drive{s} {}", names.join(", "))
}

/// Checks the bytes of a cell; the error is a sentence that says what they are instead.
pub(crate) fn judge(
    cell: &PlannedCell,
    found: &[u8],
    units: units::DriveUnits,
) -> Result<(), String> {
    let name = &cell.name;
    match &cell.test {
        CellTest::Bytes(expected) => {
            let pairs = expected.iter().zip(found);
            let same = pairs
                .into_iter()
                .all(|(expected, found)| matches(*expected, Received::good(*found)));
            if same {
                return Ok(());
            }
            let known: Vec<_> = expected.iter().map(|byte| byte.to_string()).collect();
            let bits = match expected[..] {
                [Expected::Byte(byte)] => with_bits(cell.address, &[byte]),
                _ => known.concat(),
            };
            Err(format!(
                "{name} is {}, expected {bits}",
                with_bits(cell.address, found)
            ))
        }
        CellTest::Masked(mask, expected) => {
            let bits: Vec<_> = found.iter().zip(mask).map(|(f, m)| f & m).collect();
            if bits == *expected {
                return Ok(());
            }
            Err(format!(
                "{name} & {} is {} ({}), expected {}",
                hex(mask),
                hex(&bits),
                with_bits(cell.address, found),
                with_bits(cell.address, expected)
            ))
        }
        CellTest::Raw(relation, expected, signed) => {
            let value = number(found, *signed);
            if relation.holds(value, *expected) {
                return Ok(());
            }
            Err(format!(
                "{name} is {} ({value}), expected {} {expected}",
                hex(found),
                sign(*relation)
            ))
        }
        CellTest::Number {
            scale,
            relation,
            expected,
            tolerance,
        } => {
            let nearest = nearest(*scale, *expected, units);
            if number_holds(*scale, found, (*relation, *expected, *tolerance), units) {
                return Ok(());
            }
            let found = show(*scale, found, units, expected.unit);
            let expected = match (tolerance, nearest) {
                (Some(tolerance), _) => format!("{expected} {tolerance}"),
                (None, Some(raw)) if *relation == Relation::Equal => {
                    format!("{expected} ({})", hex(&raw))
                }
                _ => format!("{} {expected}", sign(*relation)),
            };
            Err(format!("{name} is {found}, expected {expected}"))
        }
    }
}

fn number_holds(
    scale: Scale,
    found: &[u8],
    (relation, expected, tolerance): (Relation, Quantity, Option<Tolerance>),
    units: units::DriveUnits,
) -> bool {
    if relation == Relation::Equal && tolerance.is_none() {
        return nearest(scale, expected, units).is_some_and(|raw| raw == found);
    }
    let Some(value) = physical(scale, found, units) else {
        return false;
    };
    let wanted = expected.value.to_f64();
    match tolerance {
        Some(tolerance) => {
            let rounding = ROUNDING * value.abs().max(wanted.abs());
            (value - wanted).abs() <= tolerance.around(wanted) + rounding
        }
        None => relation.holds(value, wanted),
    }
}

/// The bytes nearest to a number.
fn nearest(scale: Scale, number: Quantity, units: units::DriveUnits) -> Option<Vec<u8>> {
    let raw = scale.encode(Value::Exact(number.value), units)?.ok()?;
    let bytes = raw.to_be_bytes();
    Some(bytes[bytes.len() - usize::from(scale.size())..].to_vec())
}

/// The bytes of a cell as a number in a unit, and as they are.
fn show(scale: Scale, bytes: &[u8], units: units::DriveUnits, unit: &Unit) -> String {
    match (physical(scale, bytes, units), scale.value(bytes, units)) {
        (Some(value), _) => format!("{} ({})", unit.show(value), hex(bytes)),
        (None, Some(Ok(Value::Off))) => format!("off ({})", hex(bytes)),
        _ => format!("{}, to which the manual gives no meaning", hex(bytes)),
    }
}

fn shows(showing: Showing, shown: &OutputLevels) -> Result<(), String> {
    let level = |name: &str, found: bool, expected: bool, [low, high]: [&str; 2]| {
        let word = |level| if level { high } else { low };
        if found == expected {
            return Ok(());
        }
        Err(format!(
            "{name} is {}, expected {}",
            word(found),
            word(expected)
        ))
    };
    match showing {
        Showing::Gpo1(high) => level("GPO1", shown.gpo1, high, ["low", "high"]),
        Showing::Gpo2(high) => level("GPO2", shown.gpo2, high, ["low", "high"]),
        Showing::Ready(closed) => level("ready", shown.ready, closed, ["open", "closed"]),
        Showing::Analogue(millivolts, voltage, tolerance) => {
            let off = tolerance.map_or(0.0, |tolerance| {
                tolerance.around(voltage.value.to_f64()) * 1_000.0
            });
            if f64::from((shown.analogue - millivolts).abs()) <= off + ROUNDING {
                return Ok(());
            }
            let found = voltage.unit.show(f64::from(shown.analogue) / 1_000.0);
            let tolerance = tolerance.map_or(String::new(), |tolerance| format!(" {tolerance}"));
            Err(format!(
                "analogue-output is {found}, expected {voltage}{tolerance}"
            ))
        }
        Showing::Encoder(expected, off) => {
            if shown.encoder.abs_diff(expected) <= off.unsigned_abs() {
                return Ok(());
            }
            let tolerance = if off == 0 {
                String::new()
            } else {
                format!(" +-{off}")
            };
            Err(format!(
                "encoder is {}, expected {expected}{tolerance}",
                shown.encoder
            ))
        }
        Showing::Display(expected) if shown.display == expected => Ok(()),
        Showing::Display(expected) => Err(format!(
            "display is {}, expected {}",
            digits(shown.display),
            digits(expected)
        )),
        Showing::Mode(expected) if shown.mode == expected => Ok(()),
        Showing::Mode(expected) => Err(format!(
            "mode is {}, expected {}",
            mode(shown.mode),
            mode(expected)
        )),
    }
}

fn digits(display: Option<[u8; 3]>) -> String {
    display.map_or("blank".to_owned(), |digits| {
        digits.iter().map(|digit| format!("{digit:X}")).collect()
    })
}

fn mode(mode: Mode) -> &'static str {
    let named = Mode::NAMES.iter().find(|(_, other)| *other == mode);
    named.map_or("", |(name, _)| name)
}

fn sign(relation: Relation) -> &'static str {
    let named = Relation::NAMES.iter().find(|(_, other)| *other == relation);
    named.map_or("", |(sign, _)| sign)
}

/// Bytes as written, and the names of the bits that are set.
fn with_bits(address: u16, bytes: &[u8]) -> String {
    let names: Vec<_> = match bytes {
        [byte] => bits::set_in(address, *byte).collect(),
        _ => Vec::new(),
    };
    if names.is_empty() {
        hex(bytes)
    } else {
        format!("{} ({})", hex(bytes), names.join(", "))
    }
}
