//! From text to a [`Scenario`](super::syntax::Scenario): the header, then the steps, one line each.

mod check;
mod drive;
mod header;
mod job;
mod master;
mod step;
mod value;
mod words;

pub use header::{parse, parse_header, parse_setup, parse_step};
pub(super) use value::{bytes, eeprom_place, place, value};
pub(super) use words::equals;
