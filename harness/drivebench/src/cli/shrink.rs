//! `drivebench shrink`: a finding made small.

use crate::bus_name::BusName;
use crate::buses::{RIG_BUSES, fuzz_of};
use crate::command::exit::Exit;
use crate::command::fuzz::shrink::ShrinkArguments;
use crate::command::output::Output;
use crate::explore::bus_of;

/// Makes a finding small, and writes what came of it beside it.
pub(crate) fn shrink(arguments: &ShrinkArguments, output: &mut Output) -> std::io::Result<Exit> {
    match fuzz_of(bus_of(&arguments.finding).unwrap_or(BusName::DEFAULT)) {
        Some(fuzz) => (fuzz.shrink)(arguments, &RIG_BUSES, output),
        None => Ok(Exit::Usage),
    }
}
