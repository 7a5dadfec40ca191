//! The dissector for Wireshark, with its tables made from those of the protocol.

use super::report::{CONTROL, PRM};
use harness_bench::report::pcapng::ERRORS;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::PkwError;
use harness_proto::nordac::units::Unit;
use harness_proto::nordac::words::{STW, State, WordBit, ZSW};
use harness_proto::nordac::{PARAMETERS, Parameter, PpoType, Task};
use harness_proto::profibus::Buffer;
use harness_proto::profibus::dp::{DIAGNOSIS_BITS, Service};
use harness_proto::profibus::fdl::{FcFunction, FcStatus, Malformed};
use std::fmt::Display;

/// The dissector, with a place for each table.
const TEMPLATE: &str = include_str!("nordac.lua");

/// Why bytes are no telegram, as the dissector calls it.
const REASONS: [(&str, Malformed); 10] = [
    ("start", Malformed::Start),
    ("length", Malformed::Length),
    ("length_repeated", Malformed::LengthRepeated),
    ("start_repeated", Malformed::StartRepeated),
    ("source", Malformed::Source),
    ("control", Malformed::Control),
    ("sap", Malformed::Sap),
    ("sap_missing", Malformed::SapMissing),
    ("check_sum", Malformed::CheckSum),
    ("finish", Malformed::End),
];

#[must_use]
pub(crate) fn dissector() -> String {
    let tables = [
        ("SERVICES", rows(Service::ALL.iter().map(service))),
        ("FUNCTIONS", rows(FcFunction::ALL.iter().map(function))),
        (
            "STATUS",
            rows(
                FcStatus::ALL
                    .iter()
                    .map(|status| format!("[{}] = {:?}", status.code(), status.name())),
            ),
        ),
        (
            "DIAGNOSIS",
            rows(
                DIAGNOSIS_BITS
                    .iter()
                    .map(|(byte, bit, name)| format!("{{ {byte}, {bit}, {name:?} }}")),
            ),
        ),
        ("PRM", rows(PRM.iter().map(mask))),
        ("CONTROL", rows(CONTROL.iter().map(mask))),
        ("STW", rows(STW.iter().map(bit))),
        ("ZSW", rows(ZSW.iter().map(bit))),
        ("STATES", rows(State::ALL.into_iter().map(state))),
        ("PPO", rows(PpoType::ALL.into_iter().map(ppo))),
        ("TASKS", rows((0..16).map(task))),
        (
            "ERRORS",
            rows(
                PkwError::PRINTED
                    .iter()
                    .map(|error| format!("[{}] = {:?}", error.code(), error.about())),
            ),
        ),
        ("PARAMETERS", rows(PARAMETERS.iter().map(parameter))),
        (
            "REASONS",
            rows(
                REASONS
                    .iter()
                    .map(|(name, reason)| format!("{name} = {:?}", reason.about())),
            ),
        ),
        (
            "LINE_ERRORS",
            rows(
                ERRORS
                    .iter()
                    .map(|(error, event)| format!("[0x{event:02X}] = {:?}", error.name())),
            ),
        ),
    ];
    tables
        .iter()
        .fold(TEMPLATE.to_owned(), |text, (name, rows)| {
            text.replace(&format!("@{name}@\n"), rows)
        })
}

fn rows(rows: impl Iterator<Item = impl Display>) -> String {
    rows.map(|row| format!("    {row},\n")).collect()
}

fn service(service: &Service) -> String {
    match service.sap() {
        Some(sap) => format!("[{sap}] = {:?}", service.name()),
        None => format!("none = {:?}", service.name()),
    }
}

fn function(function: &FcFunction) -> String {
    let kind = match (function.is_srd(), function.is_sdn()) {
        (true, _) => "srd",
        (_, true) => "sdn",
        _ => "other",
    };
    let (code, name) = (function.code(), function.name());
    format!("[{code}] = {{ {name:?}, {kind:?} }}")
}

fn mask((mask, name): &(u8, &str)) -> String {
    format!("{{ 0x{mask:02X}, {name:?} }}")
}

fn bit(bit: &WordBit) -> String {
    format!("[{}] = {:?}", bit.number, bit.name)
}

fn state(state: State) -> String {
    let shared = State::ALL
        .iter()
        .any(|other| *other != state && other.bits() == state.bits());
    let quick = match shared {
        true => format!(", {}", state == State::QuickStop),
        false => String::new(),
    };
    format!("{{ {:?}, 0x{:02X}{quick} }}", state.short(), state.bits())
}

fn ppo(ppo: PpoType) -> String {
    let cfg = Buffer::of(ppo.cfg()).unwrap_or_default();
    let (number, bytes, pkw) = (ppo.number(), ppo.octets(), ppo.has_pkw());
    format!("{{ {number}, \"{cfg}\", {bytes}, {pkw} }}")
}

fn task(ak: u8) -> String {
    let task = Task::of(ak);
    format!("[{ak}] = {{ {:?}, {} }}", task.name(), task.is_change())
}

fn unit(unit: Unit) -> String {
    format!("{{ {}, {}, {:?} }}", unit.step, unit.places, unit.name)
}

fn parameter(parameter: &Parameter) -> String {
    let elements = 0..u16::from(parameter.count);
    let other = elements.filter(|element| parameter.unit_of(*element) != parameter.unit);
    let other: Vec<_> = other
        .map(|element| format!("[{element}] = {}", unit(parameter.unit_of(element))))
        .collect();
    let elements = match other.is_empty() {
        true => String::new(),
        false => format!(", {{ {} }}", other.join(", ")),
    };
    let (long, signed) = (parameter.has(Flag::Long), parameter.is_signed());
    format!(
        "[{}] = {{ {:?}, {long}, {signed}, {}{elements} }}",
        parameter.number,
        parameter.name,
        unit(parameter.unit)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_is_in_it() {
        let text = dissector();
        assert!(!text.contains('@'), "a table is missing");
        for row in &PARAMETERS {
            assert!(text.contains(&parameter(row)), "{}", row.number);
        }
        let rows = [
            "[1202] = { \"Accel. time\", false, false, { 5, 2, \"s\" } },",
            "[1813] = { \"Frequency\", false, false, { 1, 1, \"Hz\" }, { [1] = { 1, 1, \"A\" }, [2] = { 1, 1, \"A\" } } },",
            "{ 4, \"F5\", 12, false },",
            "[60] = \"Slave_Diag\",",
            "[12] = { \"SRD low\", \"srd\" },",
            "[202] = \"internal reply identifier cannot be shown\",",
            "{ \"OE\", 0x07, false },",
            "{ \"QS\", 0x07, true },",
            "[0x08] = \"parity\",",
        ];
        for row in rows {
            assert!(text.contains(row), "{row}");
        }
    }
}
