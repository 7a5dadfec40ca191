//! The command line of `drivebench`: standard output is for results, standard error for people.

mod args;
mod campaign;
mod capture;
mod check;
mod complete;
mod deviations;
mod extcap;
mod fuzz;
mod help;
mod import;
#[cfg(test)]
mod interrupt_tests;
mod junit;
mod list;
#[cfg(test)]
mod live_tests;
mod man;
mod manual;
mod merge;
mod merge_counts;
mod page;
mod plot;
mod promote;
mod qualify;
mod report;
mod rig;
mod run;
mod run_rig;
mod schema;
mod shell;
mod shrink;
mod tally;
#[cfg(test)]
mod toy_tests;
mod trace;
mod verify;

pub use crate::buses::named;
use crate::capture::Carries;
use crate::command::exit::Exit;
pub use args::Arguments;
pub use promote::played;

use crate::command::args::{ColourWhen, ShowProgress};
use crate::command::output::{self, Output};
use args::{ProgramCommand, RunArguments};
use std::io::Write as _;
use std::process::ExitCode;

/// Runs the program with the arguments of the process.
#[must_use]
pub fn main() -> ExitCode {
    crate::signals::fail_beyond_file_size_limit();
    let arguments = match help::parse() {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => {
            // The exit code tells it as well.
            let _unwritable = error.print();
            return Exit::Usage.into();
        }
        // What `--help` and `--version` print is a result.
        Err(help) => {
            let printed = help.print().and_then(|()| std::io::stdout().flush());
            return match output::unless_closed(printed) {
                Ok(()) => Exit::Passed.into(),
                Err(error) => Output::new(ColourWhen::Auto, ShowProgress::None)
                    .unwritable(&error)
                    .into(),
            };
        }
    };
    let mut output = Output::new(arguments.color, arguments.progress);
    let command = arguments
        .command
        .unwrap_or_else(|| ProgramCommand::Run(RunArguments::default()));
    match dispatch(command, &mut output) {
        Ok(exit) => exit.into(),
        Err(error) => output.unwritable(&error).into(),
    }
}

fn dispatch(command: ProgramCommand, output: &mut Output) -> std::io::Result<Exit> {
    match command {
        ProgramCommand::Run(arguments) => run::run(&arguments, output),
        ProgramCommand::List(selection) => list::list(&selection, output),
        ProgramCommand::Check(arguments) => check::check(&arguments, output),
        ProgramCommand::Trace(arguments) => trace::trace(&arguments, output),
        ProgramCommand::Import(arguments) => import::import(&arguments, output),
        ProgramCommand::Capture(arguments) => capture::capture(&arguments, output),
        ProgramCommand::Extcap(arguments) => extcap::extcap(&arguments, output),
        ProgramCommand::Plot(arguments) => plot::plot(&arguments, output),
        ProgramCommand::Diff(arguments) => import::diff(&arguments, output),
        ProgramCommand::Dissector { bus } => import::dissector(bus, output),
        ProgramCommand::Dbc { drives } => import::description(Carries::Frames, drives, output),
        ProgramCommand::Gsd => import::description(Carries::Line, 1, output),
        ProgramCommand::Manual(arguments) => manual::manual(&arguments, output),
        ProgramCommand::Cells(arguments) => (named(arguments.bus).cells)(&arguments, output),
        ProgramCommand::Qualify(arguments) => qualify::qualify(&arguments, output),
        ProgramCommand::Verify(arguments) => verify::verify(&arguments, output),
        ProgramCommand::Merge(arguments) => merge::merge(&arguments, output),
        ProgramCommand::Report(arguments) => report::report(&arguments, output),
        ProgramCommand::Schema { of } => schema::schema(of, output),
        ProgramCommand::Shell(arguments) => shell::shell(&arguments, output),
        ProgramCommand::Fuzz { command } => fuzz::fuzz(&command, output),
        ProgramCommand::Shrink(arguments) => shrink::shrink(&arguments, output),
        ProgramCommand::Promote(arguments) => promote::promote(&arguments, output),
        ProgramCommand::Rig { command } => rig::rig(&command, output),
        ProgramCommand::Campaign(arguments) => campaign::campaign(&arguments, output),
        ProgramCommand::Deviations(arguments) => deviations::deviations(&arguments, output),
        ProgramCommand::Drive(command) => crate::buses::drive(*command, output),
        ProgramCommand::Completions { shell } => complete::completions(shell, output),
        ProgramCommand::Complete { words } => complete::complete(&words, output),
        ProgramCommand::Man { folder } => man::man(folder.as_deref(), output),
    }
}
