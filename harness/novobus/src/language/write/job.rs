//! Jobs of the master.

use super::{cell, drives, which_ring};
use crate::language::parse::job::FORMS;
use crate::language::syntax::{
    CellPlace, DriveRange, JobKind, JobStep, MasterCall, Written, WrittenTarget,
};
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::quantity::Tolerance;

/// `read-byte 95 FE13 = 88`, `recover`, `master reference 1`
pub(crate) fn job(job: &JobStep) -> String {
    match job {
        JobStep::Recover(ring) => format!("recover{}", which_ring(*ring)),
        JobStep::Exchange {
            drive,
            send,
            receive,
        } => format!("exchange {}", exchange(drive, send, receive.as_ref())),
        JobStep::Command {
            kind,
            drive,
            place,
            data,
            tolerance,
        } => {
            let (place, data) = (place.as_ref(), data.as_ref());
            command(*kind, drive, place, data, tolerance.as_ref())
        }
        JobStep::Master { calls, once } => {
            let calls = calls.iter().map(|(drive, asked)| call(drive, asked));
            let calls: Vec<_> = calls.collect();
            let once = if *once { "once " } else { "" };
            format!("master {once}{}", calls.join("; "))
        }
        JobStep::Count(ring, number) => format!("master count{} = {number}", which_ring(*ring)),
    }
}

fn exchange(drive: &DriveRange, send: &Pattern, receive: Option<&Pattern>) -> String {
    let answer = receive.map(|pattern| format!(" = {pattern}"));
    format!("{} {send}{}", drives(drive), answer.unwrap_or_default())
}

fn command(
    kind: JobKind,
    drive: &DriveRange,
    place: Option<&CellPlace>,
    data: Option<&Written>,
    tolerance: Option<&Tolerance>,
) -> String {
    let form = FORMS.iter().find(|form| form.kind == kind);
    let name = form.map_or("", |form| form.name);
    let place = place.map(|place| format!(" {}", cell::place(place)));
    let data = data.map(|data| format!(" = {}", cell::value(data)));
    let text = format!(
        "{name} {}{}{}",
        drives(drive),
        place.unwrap_or_default(),
        data.unwrap_or_default()
    );
    cell::tolerated(text, tolerance)
}

fn call(drive: &DriveRange, call: &MasterCall) -> String {
    let simple = |name: &str| format!("{name} {}", drives(drive));
    let eeprom = |name: &str, place: &CellPlace, data: Option<&Pattern>| {
        let data = data.map(|data| format!(" = {data}"));
        let place = cell::place(place);
        format!(
            "{name} {} {place}{}",
            drives(drive),
            data.unwrap_or_default()
        )
    };
    match call {
        MasterCall::Command(kind, place, data) => {
            command(*kind, drive, place.as_ref(), data.as_ref(), None)
        }
        MasterCall::ReadEeprom(place, data) => eeprom("read-eeprom", place, data.as_ref()),
        MasterCall::WriteEeprom(place, data) => eeprom("write-eeprom", place, Some(data)),
        MasterCall::RamToEeprom => simple("ram-to-eeprom"),
        MasterCall::Reference => simple("reference"),
        MasterCall::SetActualValue(position) => {
            format!("{} = {}", simple("set-actual-value"), target(position))
        }
        MasterCall::InitPs => simple("init-ps"),
        MasterCall::WritePs(position) => format!("{} = {}", simple("write-ps"), target(position)),
        MasterCall::Exchange(send, receive) => {
            format!("exchange {}", exchange(drive, send, receive.as_ref()))
        }
        MasterCall::StartPs => simple("start-ps"),
        MasterCall::WaitForEnd => simple("wait-for-end"),
    }
}

fn target(target: &WrittenTarget) -> String {
    match target {
        WrittenTarget::Bytes(bytes) => bytes.to_string(),
        WrittenTarget::At(turns) => turns.written(),
        WrittenTarget::By(turns) => format!("by {}", turns.written()),
    }
}
