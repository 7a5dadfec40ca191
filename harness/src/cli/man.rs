//! `drivebench man`.

use super::exit::Exit;
use super::help::command;
use super::output::Output;
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
        Some(folder) if folder.is_dir() => clap_mangen::generate_to(command, folder)?,
        Some(folder) => {
            output.complain(&format!("{} is not a folder", folder.display()));
            return Ok(Exit::Usage);
        }
    }
    Ok(Exit::Passed)
}
