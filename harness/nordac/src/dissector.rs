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
use harness_proto::profibus::fdl::{Function, Reason, Status};
use std::fmt::Display;

/// The dissector, with a place for each table.
const TEMPLATE: &str = include_str!("nordac.lua");

/// Why bytes are no telegram, as the dissector calls it.
const REASONS: [(&str, Reason); 10] = [
    ("start", Reason::Start),
    ("length", Reason::Length),
    ("length_repeated", Reason::LengthRepeated),
    ("start_repeated", Reason::StartRepeated),
    ("source", Reason::Source),
    ("control", Reason::Control),
    ("sap", Reason::Sap),
    ("sap_missing", Reason::SapMissing),
    ("check_sum", Reason::CheckSum),
    ("finish", Reason::End),
];

#[must_use]
pub(crate) fn dissector() -> String {
    let tables = [
        ("SERVICES", rows(Service::ALL.iter().map(service))),
        ("FUNCTIONS", rows(Function::ALL.iter().map(function))),
        (
            "STATUS",
            rows(
                Status::ALL
                    .iter()
                    .map(|own| format!("[{}] = {:?}", own.code(), own.name())),
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
                    .map(|own| format!("[{}] = {:?}", own.code(), own.about())),
            ),
        ),
        ("PARAMETERS", rows(PARAMETERS.iter().map(parameter))),
        (
            "REASONS",
            rows(
                REASONS
                    .iter()
                    .map(|(name, own)| format!("{name} = {:?}", own.about())),
            ),
        ),
        (
            "LINE_ERRORS",
            rows(
                ERRORS
                    .iter()
                    .map(|(own, event)| format!("[0x{event:02X}] = {:?}", own.name())),
            ),
        ),
    ];
    tables
        .iter()
        .fold(TEMPLATE.to_owned(), |text, (name, rows)| {
            text.replace(&format!("@{name}@\n"), rows)
        })
}

/// Rows of a table.
fn rows(rows: impl Iterator<Item = impl Display>) -> String {
    rows.map(|row| format!("    {row},\n")).collect()
}

fn service(own: &Service) -> String {
    match own.sap() {
        Some(sap) => format!("[{sap}] = {:?}", own.name()),
        None => format!("none = {:?}", own.name()),
    }
}

fn function(own: &Function) -> String {
    let kind = match own {
        own if own.is_srd() => "srd",
        own if own.is_sdn() => "sdn",
        _ => "other",
    };
    format!("[{}] = {{ {:?}, {kind:?} }}", own.code(), own.name())
}

fn mask((mask, name): &(u8, &str)) -> String {
    format!("{{ 0x{mask:02X}, {name:?} }}")
}

fn bit(own: &WordBit) -> String {
    format!("[{}] = {:?}", own.number, own.name)
}

fn state(own: State) -> String {
    let shared = State::ALL
        .iter()
        .any(|other| *other != own && other.bits() == own.bits());
    let quick = match shared {
        true => format!(", {}", own == State::QuickStop),
        false => String::new(),
    };
    format!("{{ {:?}, 0x{:02X}{quick} }}", own.short(), own.bits())
}

fn ppo(own: PpoType) -> String {
    let cfg = Buffer::of(own.cfg()).unwrap_or_default();
    let (number, bytes, pkw) = (own.number(), own.octets(), own.has_pkw());
    format!("{{ {number}, \"{cfg}\", {bytes}, {pkw} }}")
}

fn task(ak: u8) -> String {
    let own = Task::of(ak);
    format!("[{ak}] = {{ {:?}, {} }}", own.name(), own.is_change())
}

fn unit(own: Unit) -> String {
    format!("{{ {}, {}, {:?} }}", own.step, own.places, own.name)
}

fn parameter(own: &Parameter) -> String {
    let other = (0..u16::from(own.count)).filter(|element| own.unit_of(*element) != own.unit);
    let other: Vec<_> = other
        .map(|element| format!("[{element}] = {}", unit(own.unit_of(element))))
        .collect();
    let elements = match other.is_empty() {
        true => String::new(),
        false => format!(", {{ {} }}", other.join(", ")),
    };
    let (long, signed) = (own.has(Flag::Long), own.is_signed());
    format!(
        "[{}] = {{ {:?}, {long}, {signed}, {}{elements} }}",
        own.number,
        own.name,
        unit(own.unit)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_is_in_it() {
        let text = dissector();
        assert!(!text.contains('@'), "a table is missing");
        for own in &PARAMETERS {
            assert!(text.contains(&parameter(own)), "{}", own.number);
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
