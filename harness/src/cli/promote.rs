//! `drivebench promote`: a finding that is kept.

use crate::buses::line_fuzz;
use crate::buses::novobus::explore::Case;
use crate::command::exit::Exit;
use crate::command::fuzz::promote::{PromoteArguments, keep};
use crate::command::output::Output;
use crate::explore::bus_of;

/// Keeps a finding, whatever its bus.
pub(crate) fn promote(arguments: &PromoteArguments, output: &mut Output) -> std::io::Result<Exit> {
    match bus_of(&arguments.finding).and_then(line_fuzz) {
        Some(own) => (own.promote)(arguments, output),
        None => keep::<Case>(arguments, output),
    }
}
