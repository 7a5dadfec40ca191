//! The commands as `--help` shows them, in groups, and what to suggest for a command that does not exist.

use super::args::Arguments;
use crate::scenario::files;
use crate::scenario::problem::nearest;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::Path;

/// The groups of commands in the order of `--help`; every command is in one of them.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Play", &["run", "check", "qualify", "verify", "merge"]),
    ("Look", &["list", "trace", "manual", "cells", "deviations"]),
    (
        "Drives",
        &[
            "info",
            "read",
            "write",
            "watch",
            "top",
            "params",
            "scope",
            "plot",
            "position",
            "go",
            "stop",
            "block",
            "start",
            "exchange",
            "on",
            "off",
            "quick-stop",
            "acknowledge",
            "reset",
            "delete-error",
            "recover",
        ],
    ),
    ("Benches", &["rig", "sim", "shell"]),
    ("Find", &["fuzz", "shrink", "promote", "campaign"]),
    (
        "Exchange",
        &[
            "import",
            "diff",
            "report",
            "dissector",
            "dbc",
            "gsd",
            "capture",
            "extcap",
            "schema",
        ],
    ),
    ("More", &["completions", "man", "help"]),
];

/// The command line with its commands in groups.
pub(crate) fn command() -> Command {
    let mut command = Arguments::command();
    command.build();
    let template = template(&command);
    command.help_template(template)
}

fn template(command: &Command) -> StyledStr {
    let header = command.get_styles().get_header();
    let name = command.get_styles().get_literal();
    let names = command.get_subcommands().map(Command::get_name);
    let width = names.map(str::len).max().unwrap_or_default();
    let mut text = String::from("{about-with-newline}\n{usage-heading} {usage}\n");
    for (group, names) in GROUPS {
        // Writing to a String cannot fail.
        let _infallible = write!(text, "\n{header}{group}:{header:#}\n");
        for subcommand in names
            .iter()
            .filter_map(|name| command.find_subcommand(name))
        {
            let about = subcommand.get_about().map(ToString::to_string);
            let _infallible = writeln!(
                text,
                "  {name}{:width$}{name:#}  {}",
                subcommand.get_name(),
                about.unwrap_or_default()
            );
        }
    }
    let _infallible = write!(
        text,
        "\n{header}Options:{header:#}\n{{options}}{{after-help}}"
    );
    text.into()
}

/// Reads the arguments of the process.
///
/// # Errors
/// They are wrong, or ask for help or the version; a command that does not exist comes with a suggestion.
pub(crate) fn parse() -> Result<Arguments, clap::Error> {
    let mut given: Vec<OsString> = std::env::args_os().collect();
    // Wireshark starts the program by the name of its link, without a command.
    let name = given.first().and_then(|path| Path::new(path).file_name());
    if name.is_some_and(|name| name == super::extcap::PROGRAM) {
        given.insert(1, "extcap".into());
    }
    let command = command().color(crate::command::output::colour_of_usage());
    let matches = command.clone().try_get_matches_from(&given);
    matches
        .and_then(|matches| Arguments::from_arg_matches(&matches))
        .map_err(|error| with_suggestion(error, &command, &given))
}

/// Adds the command that was probably meant, or how to play the scenario that was named in place of a command.
fn with_suggestion(mut error: clap::Error, command: &Command, given: &[OsString]) -> clap::Error {
    let known = error.get(ContextKind::SuggestedSubcommand).is_some();
    let word = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) if error.kind() == ErrorKind::InvalidSubcommand => {
            word.clone()
        }
        _ => return error,
    };
    if known {
        return error;
    }
    let mut level = command;
    let front = given.iter().skip(1);
    for argument in front.take_while(|argument| **argument != *word) {
        level = level.find_subcommand(argument).unwrap_or(level);
    }
    let names: Vec<_> = level.get_subcommands().map(Command::get_name).collect();
    if let Some(near) = nearest(&word, &names) {
        let near = ContextValue::Strings(vec![near.to_owned()]);
        error.insert(ContextKind::SuggestedSubcommand, near);
    } else if level.get_name() == command.get_name() && is_scenario(&word) {
        let tip = format!("scenarios are played with `drivebench run {word}`");
        let tip = ContextValue::StyledStrs(vec![tip.into()]);
        error.insert(ContextKind::Suggested, tip);
    }
    error
}

fn is_scenario(word: &str) -> bool {
    Path::new(word).exists() || files::names().iter().any(|name| name == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let command = command();
        let mut grouped: Vec<_> = GROUPS.iter().flat_map(|(_, names)| *names).collect();
        let mut known: Vec<_> = command
            .get_subcommands()
            .filter(|command| !command.is_hide_set())
            .map(Command::get_name)
            .collect();
        grouped.sort();
        known.sort_unstable();
        assert_eq!(grouped.into_iter().copied().collect::<Vec<_>>(), known);
    }

    /// A line of the list fits a terminal of 100 columns.
    #[test]
    fn what_a_command_does_is_said_in_a_line() {
        for command in command().get_subcommands() {
            let about = command
                .get_about()
                .map_or(String::new(), ToString::to_string);
            assert!(
                (1..=84).contains(&about.len()),
                "{}: {about}",
                command.get_name()
            );
        }
    }
}
