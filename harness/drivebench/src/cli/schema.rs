//! `drivebench schema`: the JSON schemas of what the program reads and writes.

use super::args::SchemaName;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::evidence;
use crate::rig;

/// Prints a schema.
pub(crate) fn schema(name: SchemaName, output: &mut Output) -> std::io::Result<Exit> {
    let schema = match name {
        SchemaName::Record => evidence::schema(),
        SchemaName::Rig => rig::schema(),
        SchemaName::Session => super::shell::schema(),
    };
    output.result(&format!("{schema:#}\n"))?;
    Ok(Exit::Passed)
}
