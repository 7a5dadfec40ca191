//! `drivebench cells --bus nordac`: the parameters of the inverter (NORDAC 4.1.3, 5).

use crate::value::ReplyWord;
use harness_bench::command::args::CellsArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::output::Output;
use harness_proto::nordac::parameter::{Flag, Limit};
use harness_proto::nordac::{PARAMETERS, Parameter};

/// Shows the parameters that have the filter in their number, name, unit or section.
pub(crate) fn cells(arguments: &CellsArguments, output: &mut Output) -> std::io::Result<Exit> {
    let kept = "a NORDAC inverter keeps every parameter that can be written in its EEPROM";
    let lines = PARAMETERS.iter().map(line);
    arguments.show(lines, ("parameter", Some(kept)), output)
}

/// The numbers of all parameters, and the words of a reply: names with spaces need quotes, which a shell does not add.
pub(crate) fn names() -> impl Iterator<Item = String> {
    let words = ReplyWord::ALL.map(|(name, _)| name.to_owned());
    let numbers = PARAMETERS.iter().map(|row| row.number.to_string());
    words.into_iter().chain(numbers)
}

/// Number, flags, name, section, limits and factory setting, and what after its number selects a set or an element.
fn line(parameter: &Parameter) -> String {
    let limit = |limit: Limit| match limit {
        Limit::Raw(raw) => parameter.show(0, raw.into()).to_string(),
        other => other.to_string(),
    };
    let number = parameter.number;
    let mut line = format!(
        "{number} {number:03X} {:4} {:34} {:5} {} to {}, factory setting {}",
        parameter.flags,
        parameter.name,
        parameter.section,
        limit(parameter.least),
        limit(parameter.most),
        parameter.show(0, parameter.default.into())
    );
    let last = parameter.count.saturating_sub(1);
    match (parameter.is_array(), parameter.has(Flag::Set)) {
        (true, true) => line.push_str(&format!(
            "; {number}.ELEMENT.SET, elements 0 to {last}, sets 1 to 4"
        )),
        (true, false) if last > 0 => {
            line.push_str(&format!("; sub-indices {number}.0 to {number}.{last}"));
        }
        (false, true) => line.push_str(&format!("; sets {number}.1 to {number}.4")),
        _ => {}
    }
    line
}
