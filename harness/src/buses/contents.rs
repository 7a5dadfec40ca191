//! What the drives of a bus hold, for lists and completions, and how they can deviate.

use super::find_rig_in;
use super::{nordac, novobus, unitek};
use crate::bus::BusName;
use crate::command::args::CellsArguments;
use crate::command::deviations::DeviationRow;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::rig::find::folder;

/// The names of what drives hold, for completions: of the drives of a rig, or of the default bus where there is no such rig.
pub(crate) fn cell_names(rig: Option<&str>) -> Vec<String> {
    let found = rig.and_then(|name| find_rig_in(name, &folder()).ok());
    let bus = found.and_then(|rig| Some(rig.port()?.bus.bus()));
    match bus.unwrap_or(BusName::DEFAULT) {
        BusName::Novobus => novobus::cli::cells::names().map(str::to_owned).collect(),
        BusName::Unitek => unitek::cli::cells::names().map(str::to_owned).collect(),
        BusName::Nordac => nordac::cli::cells::names().collect(),
    }
}

/// Lists what the drives of a bus hold.
pub(crate) fn cells(arguments: &CellsArguments, output: &mut Output) -> std::io::Result<Exit> {
    match arguments.bus {
        BusName::Novobus => novobus::cli::cells::cells(arguments, output),
        BusName::Unitek if arguments.eeprom => {
            output.complain("--eeprom is for the bus novobus; a UNITEK drive keeps its RW registers in its EEPROM");
            Ok(Exit::Usage)
        }
        BusName::Unitek => {
            let filter = arguments.filter.as_deref();
            unitek::cli::cells::cells(filter.unwrap_or_default(), output)
        }
        BusName::Nordac if arguments.eeprom => {
            output.complain("--eeprom is for the bus novobus; a NORDAC inverter keeps every parameter that can be written in its EEPROM");
            Ok(Exit::Usage)
        }
        BusName::Nordac => {
            let filter = arguments.filter.as_deref();
            nordac::cli::cells::cells(filter.unwrap_or_default(), output)
        }
    }
}

/// The deviations of the drives of a bus, and those of its master; none for a bus that is not built.
pub(crate) fn deviations(bus: BusName) -> [Vec<DeviationRow>; 2] {
    match bus {
        BusName::Novobus => novobus::cli::deviations::rows(),
        BusName::Unitek => unitek::cli::deviations::rows(),
        BusName::Nordac => nordac::deviations::rows(),
    }
}
