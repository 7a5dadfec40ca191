//! The dissector for Wireshark, with its tables made from those of the codec.

use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::words::{STW, WordBit, ZSW};
use harness_proto::nordac::{PARAMETERS, Parameter, PkwError, Task};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::fdl::Function;

/// The dissector, with a place for each table.
const TEMPLATE: &str = include_str!("nordac.lua");

/// The dissector.
#[must_use]
pub(crate) fn dissector() -> String {
    let bits = [("stw", &STW), ("zsw", &ZSW)].map(|(name, bits)| words(name, bits));
    let errors = PkwError::PRINTED.map(|own| entry(own.code().into(), own.about()));
    let services = Service::ALL.map(|own| entry(own.sap().map_or(-1, i32::from), own.name()));
    let functions = Function::ALL.map(|own| entry(own.code().into(), own.name()));
    let tasks = (0..10).map(|ak| entry(ak.into(), Task::of(ak).name()));
    let parameters = PARAMETERS.iter().map(row);
    [
        ("PARAMETERS", lines(parameters)),
        ("BITS", lines(bits)),
        ("ERRORS", lines(errors)),
        ("SERVICES", lines(services)),
        ("FUNCTIONS", lines(functions)),
        ("TASKS", lines(tasks)),
    ]
    .iter()
    .fold(TEMPLATE.to_owned(), |text, (name, table)| {
        text.replace(&format!("@{name}@\n"), table)
    })
}

fn lines(rows: impl IntoIterator<Item = String>) -> String {
    rows.into_iter().map(|row| format!("    {row}\n")).collect()
}

fn entry(number: i32, name: &str) -> String {
    format!("[{number}] = {name:?},")
}

fn words(name: &str, bits: &[WordBit]) -> String {
    let named = bits.iter().filter(|bit| !bit.name.is_empty());
    let named: Vec<_> = named
        .map(|bit| format!("[{}] = {:?}", bit.number, bit.name))
        .collect();
    format!("{name} = {{ {} }},", named.join(", "))
}

fn row(parameter: &Parameter) -> String {
    let unit = parameter.unit;
    let bits = if parameter.has(Flag::Long) { 32 } else { 16 };
    format!(
        "[{}] = {{ {:?}, {}, {}, {:?}, {bits}, {} }},",
        parameter.number,
        parameter.name,
        unit.step,
        unit.places,
        unit.name,
        parameter.is_signed()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_is_in_it() {
        let text = dissector();
        assert!(!text.contains('@'), "a table is missing");
        for parameter in PARAMETERS {
            assert!(text.contains(&row(parameter)), "{}", parameter.number);
        }
        assert!(text.contains("[1202] = { \"Accel. time\", 5, 2, \"s\", 16, false },"));
        assert!(text.contains("[-1] = \"Data_Exchange\","));
        assert!(text.contains("[201] = \"invalid task element\","));
    }
}
