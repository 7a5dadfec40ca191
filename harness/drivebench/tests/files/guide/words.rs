//! The `drivebench` commands in a line of shell, and whether the program's own parser takes them.

use clap::Parser;
use clap::error::ErrorKind;
use harness::cli::Arguments;

/// The words of each `drivebench` command of a text: quotes are taken off, redirections left out.
pub(super) fn commands(text: &str) -> Vec<Vec<String>> {
    let joined = text.replace("\\\n", " ");
    let mut found = Vec::new();
    for line in joined.lines() {
        for words in simple_commands(line) {
            let start = words.iter().position(|word| word == "drivebench");
            // Only settings of the environment and a few words of the shell may stand in front.
            let in_front = [
                "sudo", "time", "if", "then", "else", "do", "!", "{", "(", "6", "7)",
            ];
            if let Some(start) = start
                && words[..start]
                    .iter()
                    .all(|word| word.contains('=') || in_front.contains(&word.as_str()))
            {
                found.push(words[start..].to_vec());
            }
        }
    }
    found
}

/// The words between `|`, `;`, `&` and the ends.
fn simple_commands(line: &str) -> Vec<Vec<String>> {
    let (mut all, mut words) = (Vec::new(), Vec::new());
    let mut word: Option<String> = None;
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '\'' | '"' => {
                let text: String = characters
                    .by_ref()
                    .take_while(|c| *c != character)
                    .collect();
                let text = if text.starts_with('$') { "1" } else { &text };
                word.get_or_insert_default().push_str(text);
            }
            ' ' | '\t' => words.extend(word.take()),
            '#' if word.is_none() => break,
            '|' | ';' | '&' => {
                words.extend(word.take());
                all.push(std::mem::take(&mut words));
            }
            '<' | '>' => {
                // The number in front of it, and where it goes, are no arguments.
                if word.as_ref().is_none_or(|word| word.parse::<u8>().is_err()) {
                    words.extend(word.take());
                }
                word = None;
                while characters
                    .next_if(|c| matches!(c, '>' | '&' | ' '))
                    .is_some()
                {}
                while characters
                    .next_if(|c| !matches!(c, ' ' | '|' | ';' | '&'))
                    .is_some()
                {}
            }
            // A variable of the shell could be anything: a number fits most places.
            '$' => {
                while characters
                    .next_if(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '{' | '}' | '?'))
                    .is_some()
                {}
                word.get_or_insert_default().push('1');
            }
            _ => word.get_or_insert_default().push(character),
        }
    }
    words.extend(word);
    all.push(words);
    all
}

/// Why the program does not take these words; `None` where it does. A mention in a sentence (`strict` false) may leave
/// out what a command needs.
pub(super) fn refused(words: &[String], strict: bool) -> Option<String> {
    let error = Arguments::try_parse_from(words).err()?;
    let fine = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => true,
        ErrorKind::MissingRequiredArgument
        | ErrorKind::MissingSubcommand
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => !strict,
        _ => false,
    };
    (!fine).then(|| error.to_string())
}
