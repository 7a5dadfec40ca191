//! From text to a [`Scenario`](super::syntax::Scenario): the header, then the steps, one line each.

pub(crate) mod header;
pub(crate) mod step;

pub(crate) use crate::buses::novobus::language::parse::header as bus_header;
pub use crate::buses::novobus::language::parse::header::{parse_header, parse_setup};
pub(crate) use crate::buses::novobus::language::parse::value::{bytes, eeprom_place, place, value};
/// The words of the one bus that is read today.
pub(crate) use crate::buses::novobus::language::parse::{check, drive, job, words};
pub use header::{parse, parse_step};
pub(crate) use words::equals;
