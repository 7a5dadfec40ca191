//! `drivebench shrink`: a finding made small.

use crate::buses::{RIG_BUSES, line_fuzz, shrink_rings};
use crate::command::exit::Exit;
use crate::command::fuzz::shrink::ShrinkArguments;
use crate::command::output::Output;
use crate::explore::bus_of;

/// Makes a finding small, and writes what came of it beside it.
pub(crate) fn shrink(arguments: &ShrinkArguments, output: &mut Output) -> std::io::Result<Exit> {
    match bus_of(&arguments.finding).and_then(line_fuzz) {
        Some(own) => (own.shrink)(arguments, &RIG_BUSES, output),
        None => shrink_rings(arguments, &RIG_BUSES, output),
    }
}
