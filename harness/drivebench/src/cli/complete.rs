//! `drivebench completions`: scripts for shells. A script asks the program itself (`drivebench complete`) for the words that can stand
//! at the cursor, so new rigs and commands show up without a new script.

use super::args::Shell;
use super::help::command;
use crate::buses::{self, BUSES, find_rig_in};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::rig::find;
use crate::scenario::files;
use clap::{Arg, Command};
use std::fmt::Write as _;

/// Prints the script for a shell.
pub(crate) fn completions(shell: Shell, output: &mut Output) -> std::io::Result<Exit> {
    output.result(match shell {
        Shell::Bash => include_str!("completions/drivebench.bash"),
        Shell::Zsh => include_str!("completions/drivebench.zsh"),
        Shell::Fish => include_str!("completions/drivebench.fish"),
    })?;
    Ok(Exit::Passed)
}

/// Prints what can stand in place of the last of these words: in the first line `files` if file names can, else `words`; then a word a
/// line.
pub(crate) fn complete(words: &[String], output: &mut Output) -> std::io::Result<Exit> {
    let fitting = fitting(&command(), words);
    let mut text = match fitting.files {
        true => "files\n".to_owned(),
        false => "words\n".to_owned(),
    };
    for word in fitting.words {
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "{word}");
    }
    output.result(&text)?;
    Ok(Exit::Passed)
}

/// What can stand at the cursor.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Fitting {
    pub(crate) words: Vec<String>,
    /// File names can.
    files: bool,
}

/// What fits in place of the last word.
pub(crate) fn fitting(command: &Command, words: &[String]) -> Fitting {
    let Some((current, before)) = words.split_last() else {
        return Fitting::default();
    };
    let mut level = command;
    let mut positionals = 0;
    let mut waiting = None;
    for word in before {
        if waiting.take().is_some() {
            continue;
        }
        if let Some(option) = word.strip_prefix('-') {
            let mut arguments = level.get_arguments();
            let found = arguments.find(|argument| is_named(argument, option));
            waiting = found.filter(|argument| argument.get_action().takes_values());
        } else if let Some(inner) = level.find_subcommand(word) {
            (level, positionals) = (inner, 0);
        } else {
            positionals += 1;
        }
    }
    let mut fitting = if let Some(option) = waiting {
        values(option, current, rig(before))
    } else if current.starts_with('-') {
        let options = level.get_arguments().filter(|option| !option.is_hide_set());
        Fitting {
            words: options
                .filter_map(|argument| argument.get_long())
                .map(|name| format!("--{name}"))
                .collect(),
            files: false,
        }
    } else if level.has_subcommands() {
        let inner = level.get_subcommands();
        let inner = inner.filter(|command| !command.is_hide_set());
        Fitting {
            words: inner.map(|command| command.get_name().to_owned()).collect(),
            files: false,
        }
    } else {
        // The last positional may repeat.
        let positional = level.get_positionals().take(positionals + 1).last();
        positional.map_or_else(Fitting::default, |last| values(last, current, rig(before)))
    };
    fitting
        .words
        .retain(|word| word.starts_with(current.as_str()));
    fitting
}

/// The rig that is named in front of the cursor.
fn rig(before: &[String]) -> Option<&str> {
    let pairs = before.windows(2).rev();
    let apart = pairs
        .filter(|pair| pair[0] == "--rig")
        .map(|pair| &*pair[1]);
    let joined = before
        .iter()
        .rev()
        .filter_map(|word| word.strip_prefix("--rig="));
    apart.chain(joined).next()
}

/// Whether an argument is the option `-x` or `--name`, given what stands behind the first hyphen.
fn is_named(argument: &Arg, option: &str) -> bool {
    match option.strip_prefix('-') {
        Some(long) => {
            let names = argument.get_long_and_visible_aliases();
            names.is_some_and(|names| names.contains(&long))
        }
        None => {
            let mut letters = option.chars();
            argument.get_short().is_some() && letters.next() == argument.get_short()
        }
    }
}

/// What an argument takes: its fixed values, or by the name of its value the names that the program knows.
fn values(argument: &Arg, current: &str, rig: Option<&str>) -> Fitting {
    let fixed = argument.get_possible_values();
    if !fixed.is_empty() {
        return Fitting {
            words: fixed.iter().map(|fit| fit.get_name().to_owned()).collect(),
            files: false,
        };
    }
    let name = argument.get_value_names().and_then(<[_]>::first);
    let name = name.map_or("", |name| name.as_str());
    Fitting {
        words: match name {
            "SCENARIO" => files::names(),
            "CAMPAIGN" => super::campaign::names(),
            "RIG" => {
                let rigs = find::all(&find::folder()).into_iter();
                let rigs = rigs.map(|(name, _)| name);
                rigs.chain(["sim:1", "sim:3", "sim:2,3"].map(str::to_owned))
                    .collect()
            }
            "DRIVE" => vec!["all".to_owned()],
            "PART" => ["slice:1/", "hash:1/"].map(str::to_owned).to_vec(),
            "KEPT" => ["all", "failed"].map(str::to_owned).to_vec(),
            "CELL" | "SIGNAL" => cell_names(rig),
            "CELL=VALUE" => cell_names(rig)
                .iter()
                .map(|name| format!("{name}="))
                .collect(),
            "WORDS" => ["STW=", "HSW=", "PZD3=", "PZD4=", "then"]
                .map(str::to_owned)
                .to_vec(),
            "DRIVE=NAME" => {
                let drive = current.split_once('=').map_or("0", |(drive, _)| drive);
                let [drives, _] = (BUSES[0].deviations)();
                let names = drives.iter().map(|deviation| deviation.name);
                names.map(|name| format!("{drive}={name}")).collect()
            }
            _ => Vec::new(),
        },
        files: matches!(
            name,
            "SCENARIO" | "CAMPAIGN" | "RIG" | "FILE" | "FOLDER" | "FINDING" | "KEY" | "A" | "B"
        ),
    }
}

/// The names of what drives hold: of the drives of a rig, or of the default bus where there is no such rig.
fn cell_names(rig: Option<&str>) -> Vec<String> {
    let found = rig.and_then(|name| find_rig_in(name, &find::folder()).ok());
    let bus = found.as_ref().map_or(BUSES[0], buses::bus_of);
    (bus.cell_names)()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(line: &str) -> Fitting {
        let words: Vec<_> = line.split(' ').map(str::to_owned).collect();
        fitting(&command(), &words)
    }

    #[track_caller]
    fn offers(line: &str, word: &str) {
        let fitting = of(line);
        let has = fitting.words.iter().any(|fit| fit == word);
        assert!(has, "{line}: {fitting:?}");
    }

    #[test]
    fn commands_options_and_values() {
        assert_eq!(of("pos").words, ["position"]);
        assert_eq!(of("fuzz r").words, ["run", "replay"]);
        assert_eq!(of("run --juni").words, ["--junit"]);
        assert_eq!(of("run --color a").words, ["auto", "always"]);
        assert_eq!(of("trace x.scn --format p").words, ["pcapng"]);
        assert_eq!(of("completions ").words, ["bash", "zsh", "fish"]);
        assert!(of("run --filter 9").words.is_empty());
        assert!(!of("run --filter 9").files);
        // A value is not a command, and a global option may stand in front of one.
        assert_eq!(of("--color never ver").words, ["verify"]);
        assert_eq!(of("run --filter list --evid").words, ["--evidence"]);
        assert_eq!(
            of(""),
            Fitting {
                words: command()
                    .get_subcommands()
                    .filter(|command| !command.is_hide_set())
                    .map(|command| command.get_name().to_owned())
                    .collect(),
                files: false,
            }
        );
    }

    #[test]
    fn names_of_scenarios_rigs_cells_and_deviations() {
        for line in [
            "run 9.7-pa",
            "run my.scn 9.7-pa",
            "trace --rows 1..3 9.7-pa",
            "check 9.7-pa",
        ] {
            offers(line, "9.7-parity-error");
            assert!(of(line).files, "{line}");
        }
        offers("campaign 9.7-s", "9.7-single-bits");
        for line in [
            "run --rig sim",
            "info --rig sim",
            "rig show sim",
            "qualify --rig sim",
        ] {
            offers(line, "sim-two-rings");
            offers(line, "sim:3");
        }
        offers("read a", "all");
        for line in [
            "read 0 nis",
            "read 0 nsoll nis",
            "scope 0 nis",
            "watch all nis",
        ] {
            offers(line, "nist");
        }
        offers("read 0 EE_p", "EE_pole");
        offers("write 0 nsol", "nsoll=");
        offers("exchange 8 STW=047E t", "then");
        offers("fuzz run --deviates 2=wri", "2=writes-ignored");
    }

    /// Every kind of name that an argument takes is offered, or is known to be free text.
    #[test]
    fn every_value_is_of_a_known_kind() {
        const FREE: [&str; 27] = [
            "TEXT",
            "TIME",
            "NUMBER",
            "NUMBERS",
            "DRIVES",
            "RATE",
            "ID",
            "NAME",
            "TABLE",
            "CASE",
            "FIRST..LAST",
            "VALUE",
            "POSITION",
            "PATH",
            "SPEED",
            "ADDRESS",
            "-|ADDRESS",
            "LINK=PLACE",
            "LINK=CHANNEL",
            "NAME=PORT",
            "BYTES",
            "VERSION",
            "FORMAT",
            "K/N",
            "FILTER",
            "WORDS",
            "COMMAND",
        ];
        let mut open = vec![command()];
        while let Some(level) = open.pop() {
            open.extend(level.get_subcommands().cloned());
            for argument in level
                .get_arguments()
                .filter(|argument| argument.get_action().takes_values())
            {
                let known = values(argument, "", None) != Fitting::default();
                let name = argument.get_value_names().and_then(<[_]>::first);
                let name = name.map_or("", |name| name.as_str());
                assert!(
                    known || FREE.contains(&name),
                    "{} {}: {name}",
                    level.get_name(),
                    argument.get_id()
                );
            }
        }
    }
}
