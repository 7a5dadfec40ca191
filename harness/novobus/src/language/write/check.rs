//! What must hold.

use super::{cell, drives, link, named, which_ring};
use crate::language::syntax::{CellRecording, Check, Condition, DriveCheck, Looks, Showing};
use harness_sim::nd21::Mode;

/// What follows `?`.
pub(crate) fn check(check: &Check) -> String {
    match check {
        Check::Located { drive, within } => {
            let within = within.as_ref().map(|most| format!(" within {most} zeros"));
            format!("located {}{}", drives(drive), within.unwrap_or_default())
        }
        Check::Within(zeros) => format!("within {zeros} zeros"),
        Check::Drive(check) => drive_check(check),
        Check::Error { error, drive } => format!("error {:04X} at {}", error.code(), drives(drive)),
        Check::Corrected(times) => format!("corrected {times}"),
        Check::Named {
            ring, broken, ends, ..
        } => {
            let what = if *broken { "broken" } else { "damaged" };
            format!("named {what} {}", link(*ring, ends))
        }
        Check::Ended(ending) => format!("ended {}", ending.name()),
        Check::RulesKept(ring) => format!("rules kept{}", which_ring(*ring)),
        Check::Sent { bytes, time } => {
            let time = time.map(|time| format!(" in {time}"));
            format!("sent {bytes} bytes{}", time.unwrap_or_default())
        }
        Check::Received(bytes) => format!("received {bytes} bytes"),
    }
}

/// `record drive 0 nist every 10ms`
pub(crate) fn record(recording: &CellRecording) -> String {
    let looks = match recording.looks {
        Looks::Every(time) => format!("every {time}"),
        Looks::Changes => "changes".to_owned(),
        Looks::Off => "off".to_owned(),
    };
    let (drives, place) = (drives(&recording.drives), cell::place(&recording.place));
    format!("record drive {drives} {place} {looks}")
}

/// `drive 3 memory FF08 = 1234`
pub(crate) fn drive_check(check: &DriveCheck) -> String {
    let condition = match &check.condition {
        Condition::InError(true) => "in error".to_owned(),
        Condition::InError(false) => "normal".to_owned(),
        Condition::Memory(place, bytes) => format!("memory {} = {bytes}", cell::place(place)),
        // A cell by its address stands behind `memory`; behind it a name is read as well.
        Condition::Cell(check) if check.mask.is_some() => format!("memory {}", cell::check(check)),
        Condition::Cell(check) => cell::check(check),
        Condition::Shows(showing) => shows(showing),
    };
    format!("drive {} {condition}", drives(&check.drives))
}

fn shows(showing: &Showing) -> String {
    let level = |high: bool| if high { "high" } else { "low" };
    match showing {
        Showing::Gpo1(high) => format!("GPO1 {}", level(*high)),
        Showing::Gpo2(high) => format!("GPO2 {}", level(*high)),
        Showing::Ready(closed) => format!("ready {}", if *closed { "closed" } else { "open" }),
        Showing::Analogue(_, voltage, tolerance) => cell::tolerated(
            format!("analogue-output = {}", voltage.written()),
            tolerance.as_ref(),
        ),
        Showing::Encoder(count, 0) => format!("encoder = {count}"),
        Showing::Encoder(count, off) => format!("encoder = {count} +-{off}"),
        Showing::Display(None) => "display blank".to_owned(),
        Showing::Display(Some([a, b, c])) => format!("display {a:X}{b:X}{c:X}"),
        Showing::Mode(mode) => format!("mode {}", named(&Mode::NAMES, *mode)),
    }
}
