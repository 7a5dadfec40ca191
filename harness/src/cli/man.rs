//! `drivebench completions` and `drivebench man`.

use super::args::Arguments;
use super::exit::Exit;
use super::output::Output;
use clap::CommandFactory;
use clap_complete::Shell;
use std::path::Path;

/// Prints a completion script.
pub(crate) fn completions(shell: Shell, output: &mut Output) -> std::io::Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "drivebench", &mut script);
    output.result(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Passed)
}

/// Prints the man page, or writes one a command into a folder.
pub(crate) fn man(folder: Option<&Path>, output: &mut Output) -> std::io::Result<Exit> {
    let command = Arguments::command();
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
