//! `drivebench man`.

use super::help::command;
use crate::command::exit::Exit;
use crate::command::output::Output;
use clap::Command;
use std::path::Path;

/// Prints the man page, or writes one a command into a folder.
pub(crate) fn man(folder: Option<&Path>, output: &mut Output) -> std::io::Result<Exit> {
    let command = command();
    match folder {
        None => {
            let mut page = Vec::new();
            clap_mangen::Man::new(command).render(&mut page)?;
            output.result(&String::from_utf8_lossy(&page))?;
        }
        Some(folder) if folder.is_dir() => {
            clap_mangen::generate_to(without_help(command), folder)?;
        }
        Some(folder) => {
            output.complain(&format!(
                "{} is not a folder; make it first",
                folder.display()
            ));
            return Ok(Exit::Usage);
        }
    }
    Ok(Exit::Passed)
}

/// Hides the commands `help`: clap would make a page of each command once more below them.
fn without_help(command: Command) -> Command {
    command.mut_subcommands(|subcommand| match subcommand.get_name() {
        "help" => subcommand.hide(true),
        _ => without_help(subcommand),
    })
}
