//! `drivebench rig`: benches, their files and their locks.

use crate::buses::RIG_BUSES;
use crate::buses::{check_rig, find_any_rig};
use crate::command::args::ListFormat;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::alarm;
use crate::rig::file::Quarantine;
use crate::rig::find::{self, FindError, RigPlace};
use crate::rig::lock::{self, LockError, Standing};
use crate::rig::state::{self, Holder};
use crate::rig::{Rig, UseOptions, scan, schema};
use crate::signals::interrupt_flag;
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The commands on benches.
#[derive(Debug, Subcommand)]
pub enum RigCommand {
    /// List rigs and whether each is free, held, reserved, quarantined or has mistakes.
    List {
        /// Output format.
        #[arg(long, value_enum, default_value_t = ListFormat::Text)]
        format: ListFormat,
    },
    /// Print a rig's file with every default filled in.
    Show {
        /// The rig: a name, a file, or sim:N.
        rig: String,
    },
    /// Print the JSON schema of rig files.
    Schema,
    /// Open a rig, count and read its drives, and test its line.
    ///
    /// Measures how long a byte takes round the ring. The drives stay as they are. The exit code is 3 if something differs from the
    /// rig's file.
    Check(CheckRigArguments),
    /// Print a block for a rig's file for each serial port and CAN interface; opens none.
    Scan,
    /// Reserve a rig until `rig unlock`; other users get exit code 75.
    Lock {
        /// The rig: a name, a file, or sim:N.
        rig: String,
        /// The purpose, which other users see.
        #[arg(long, value_name = "TEXT")]
        purpose: String,
    },
    /// End the reservation of a rig.
    Unlock {
        /// The rig: a name, a file, or sim:N.
        rig: String,
        /// Also end the reservation of another user. A running process is not disturbed.
        #[arg(long)]
        force: bool,
    },
    /// Forbid the use of a rig (exit code 3), or lift the ban.
    Quarantine {
        /// The rig: a name, a file, or sim:N.
        rig: String,
        /// The reason, which other users see.
        #[arg(long, value_name = "TEXT", required_unless_present = "lift")]
        reason: Option<String>,
        /// Allow the use again.
        #[arg(long, conflicts_with = "reason")]
        lift: bool,
    },
}

/// For `rig check`.
#[derive(Debug, Args)]
pub struct CheckRigArguments {
    /// The rig: a name, a file, or sim:N.
    rig: String,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, value_name = "TIME", value_parser = crate::command::args::duration)]
    wait: Option<Duration>,
    /// Output format.
    #[arg(long, value_enum, default_value_t = ListFormat::Text)]
    format: ListFormat,
}

impl CheckRigArguments {
    /// How the bench is used.
    fn options(&self) -> UseOptions {
        UseOptions {
            purpose: "rig check".to_owned(),
            wait: self.wait.unwrap_or_default(),
            keeps_lines: true,
            interrupt: interrupt_flag(),
            alarm: alarm(),
            ..UseOptions::default()
        }
    }
}

/// Runs `rig check`.
fn check(arguments: &CheckRigArguments, output: &mut Output) -> std::io::Result<Exit> {
    match find_any_rig(&arguments.rig, output) {
        Some(rig) => {
            let for_tools = arguments.format == ListFormat::Json;
            check_rig(&rig, &arguments.options(), for_tools, output)
        }
        None => Ok(Exit::Usage),
    }
}

/// Why a command on a bench came to no good end.
enum Failure {
    Find(FindError),
    Lock(LockError),
    Said(Exit, String),
    Output(std::io::Error),
}

impl Failure {
    fn state(error: &std::io::Error) -> Self {
        Self::Said(
            Exit::RigError,
            format!("failed to use the folder of locks: {error}; set DRIVEBENCH_STATE to another"),
        )
    }
}

/// Does what is asked.
pub(crate) fn rig(command: &RigCommand, output: &mut Output) -> std::io::Result<Exit> {
    match command_on(command, output) {
        Ok(exit) => Ok(exit),
        Err(Failure::Output(error)) => Err(error),
        Err(Failure::Find(FindError::Mistakes(problems))) => {
            output.mistakes(&problems);
            Ok(Exit::Usage)
        }
        Err(Failure::Find(error)) => {
            output.complain(&error.to_string());
            Ok(Exit::Usage)
        }
        Err(Failure::Lock(error)) => {
            output.complain(&error.to_string());
            Ok(match error {
                LockError::Busy { .. } => Exit::Busy,
                LockError::Io { .. } => Exit::RigError,
            })
        }
        Err(Failure::Said(exit, text)) => {
            output.complain(&text);
            Ok(exit)
        }
    }
}

fn command_on(command: &RigCommand, output: &mut Output) -> Result<Exit, Failure> {
    let find = |name: &str| find::find(name, &find::folder(), &RIG_BUSES).map_err(Failure::Find);
    let folder = || state::folder().map_err(|error| Failure::state(&error));
    let text = match command {
        RigCommand::List { format } => list(*format, &folder()?),
        RigCommand::Show { rig } => show(&find(rig)?)?,
        RigCommand::Check(arguments) => {
            return check(arguments, output).map_err(Failure::Output);
        }
        RigCommand::Schema => format!("{:#}\n", schema()),
        RigCommand::Scan => {
            let ports = scan::scan(Path::new("/"));
            let interfaces = scan::interfaces(Path::new("/"));
            if ports.is_empty() && interfaces.is_empty() {
                let message = "this machine has no serial port and no CAN interface; plug the adapter in and try again";
                return Err(Failure::Said(Exit::NothingSelected, message.to_owned()));
            }
            let between = if ports.is_empty() { "" } else { "\n" };
            let interfaces = scan::propose_interfaces(&interfaces, &RIG_BUSES);
            scan::propose(&ports, &RIG_BUSES) + between + &interfaces
        }
        RigCommand::Lock { rig, purpose } => {
            let rig = find(rig)?;
            let me = Holder::me(purpose);
            usable(&rig, &folder()?)?;
            lock::reserve(&folder()?, rig.id(), &me).map_err(Failure::Lock)?;
            format!("rig {} is reserved by {me}\n", rig.id())
        }
        RigCommand::Unlock { rig, force } => {
            let rig = find(rig)?;
            let before = lock::unreserve(&folder()?, rig.id(), &Holder::me("unlock"), *force);
            match before.map_err(Failure::Lock)? {
                Some(holder) => format!("rig {} is free; it was reserved by {holder}\n", rig.id()),
                None => format!("rig {} was free\n", rig.id()),
            }
        }
        RigCommand::Quarantine { rig, reason, .. } => {
            let rig = find(rig)?;
            if rig.is_simulated() {
                let message = format!(
                    "rig {} is simulated: everybody has one of their own, and nothing of it can be put into quarantine",
                    rig.id()
                );
                return Err(Failure::Said(Exit::Usage, message));
            }
            state::set_quarantine(&folder()?, rig.id(), reason.as_deref())
                .map_err(|error| Failure::state(&error))?;
            match (reason, &rig.file.quarantine) {
                (Some(reason), _) => format!("rig {} must not be used: {reason}\n", rig.id()),
                (None, Some(_)) => {
                    let message = format!(
                        "the file of rig {} itself has a table [quarantine]: {}",
                        rig.id(),
                        rig.origin
                    );
                    return Err(Failure::Said(Exit::RigError, message));
                }
                (None, None) => format!("rig {} may be used\n", rig.id()),
            }
        }
    };
    output.result(&text).map_err(Failure::Output)?;
    Ok(Exit::Passed)
}

/// Refuses a rig that must not be used.
fn usable(rig: &Rig, folder: &Path) -> Result<(), Failure> {
    let quarantine = rig
        .quarantine(folder)
        .map_err(|error| Failure::state(&error))?;
    quarantine.map_or(Ok(()), |Quarantine { since, reason }| {
        let message = format!(
            "rig {} must not be used since {since}: {reason}; `drivebench rig quarantine {} --lift` ends it",
            rig.id(),
            rig.id()
        );
        Err(Failure::Said(Exit::RigError, message))
    })
}

fn show(rig: &Rig) -> Result<String, Failure> {
    let text = toml::to_string(&rig.file);
    let text = text.map_err(|error| {
        Failure::Said(Exit::RigError, format!("failed to print the rig: {error}"))
    })?;
    Ok(format!("# {}\n{text}", rig.origin))
}

fn list(format: ListFormat, folder: &Path) -> String {
    let rows: Vec<_> = find::all(&find::folder())
        .into_iter()
        .map(|(name, place)| row(&name, &place, folder))
        .collect();
    match format {
        ListFormat::Json => format!("{:#}\n", Value::Array(rows)),
        ListFormat::Text => rows.iter().fold(String::new(), |mut text, row| {
            let word = |key: &str| row[key].as_str().unwrap_or_default();
            // Writing to a String cannot fail.
            let _infallible = writeln!(
                text,
                "{:20} {:12} {}",
                word("name"),
                word("state"),
                word("about")
            );
            text
        }),
    }
}

/// What is known of a bench: `name`, `state`, `about` in words, and where it has mistakes nothing else.
fn row(name: &str, place: &RigPlace, folder: &Path) -> Value {
    let source = match place {
        RigPlace::File(path) => path.clone(),
        RigPlace::BuiltIn(name) => PathBuf::from(format!("built in: {name}")),
    };
    let rig = place
        .source()
        .map_err(FindError::from)
        .and_then(|source| find::read(&source, &RIG_BUSES));
    let rig = match rig {
        Ok(rig) => rig,
        Err(error) => {
            return json!({ "name": name, "state": "bad", "file": source, "about": error.to_string() });
        }
    };
    let title = rig.file.rig.title.clone().unwrap_or_default();
    let known = rig
        .quarantine(folder)
        .and_then(|quarantine| Ok((quarantine, lock::standing(folder, rig.id())?)));
    let (state, about, holder) = match known {
        Err(error) => ("bad", error.to_string(), None),
        Ok((Some(Quarantine { since, reason }), _)) => {
            ("quarantined", format!("since {since}: {reason}"), None)
        }
        Ok((None, Standing::Free)) => ("free", title, None),
        Ok((None, Standing::Reserved(holder))) => {
            ("reserved", format!("by {holder}"), Some(holder))
        }
        Ok((None, Standing::Held(holder))) => {
            let who = holder
                .as_ref()
                .map_or("another user".to_owned(), Holder::to_string);
            ("held", format!("by {who}"), holder)
        }
    };
    let rings = rig.rings().map(|(_, ring)| usize::from(ring.drives));
    let port = rig.port().map(|port| port.drives.len());
    let drives: Vec<_> = rings.chain(port).collect();
    json!({
        "name": name, "id": rig.id(), "state": state, "about": about, "holder": holder, "file": source,
        "drives": drives, "labels": rig.file.rig.labels,
    })
}
