//! `drivebench shell` for people: lines of an editor with history and completion, or of a pipe, as requests of a session.

use super::inbox::{LineWriter, RequestReader};
use super::request::{DriveWords, SessionRequest};
use super::session::{COMMANDS, SETTLED};
use crate::cli::complete::fitting;
use crate::cli::help::command;
use crate::command::args::duration;
use crate::counted::counted;
use crate::scenario::problem::nearest;
use clap::{Arg, Command};
use rustyline::completion::{Completer, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::DefaultHistory;
use rustyline::validate::Validator;
use rustyline::{CompletionType, Config, Context, Editor, ExternalPrinter, Helper};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::{BufRead, Write};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::spawn;

/// Words of the shell alone, with what they do.
const OWN: [(&str, &str, &str); 8] = [
    (
        "wait",
        "wait TIME",
        "Let time pass, such as `wait 500ms`; simulated time passes in commands only",
    ),
    (
        "run",
        "run SCENARIO",
        "Play a scenario: a file, a folder, or a built-in one by its name",
    ),
    (
        "fault",
        "fault LINE",
        "Inject a fault into a simulated ring: `fault 2->1 byte 10: flip 0`",
    ),
    (
        "recover",
        "recover",
        "Bring rings out of the error mode and count their drives",
    ),
    (
        "capture",
        "capture FILE",
        "Capture what is exchanged from now on; the file is in pcapng",
    ),
    (
        "capture-end",
        "capture-end",
        "End the capture and write its file; so does the end of the shell",
    ),
    ("help", "help [COMMAND]", "List the commands, or show one"),
    (
        "exit",
        "exit",
        "End the shell in the safe state; so does Ctrl-D",
    ),
];

/// Whether a request was typed, so that its person waits for the prompt. Its `id` is the number of its line.
pub(super) fn is_typed(id: &Value) -> bool {
    id.is_number()
}

/// A prompt each time when a line is done; the next line is read then.
pub(super) type Turn = SyncSender<String>;

/// An editor on the terminal, and what prints above its line.
pub(super) struct LineEditor {
    editor: Editor<Words, DefaultHistory>,
}

impl LineEditor {
    /// An editor with its printer.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub(super) fn new(rig: &str) -> rustyline::Result<(Self, impl Write + Send + use<>)> {
        let settings = Config::builder()
            .auto_add_history(true)
            .completion_type(CompletionType::List)
            .build();
        let mut editor = Editor::with_config(settings)?;
        editor.set_helper(Some(Words {
            rig: rig.to_owned(),
        }));
        let printer = AbovePrompt {
            printer: editor.create_external_printer()?,
            begun: Vec::new(),
        };
        Ok((Self { editor }, printer))
    }

    /// Reads lines in a thread of its own.
    pub(super) fn read(mut self, inbox: RequestReader, out: LineWriter) -> Turn {
        let (turn, prompts) = sync_channel(1);
        spawn(move || {
            let next = |prompt: &str| match self.editor.readline(prompt) {
                Ok(line) => InputLine::Line(line),
                Err(ReadlineError::Interrupted) => InputLine::Stop,
                // Ctrl-D, a lost terminal, or one that cannot be read.
                Err(_) => InputLine::End,
            };
            take_lines(next, &prompts, &inbox, &out);
        });
        turn
    }
}

/// Reads the lines of a pipe or a file in a thread of its own, without prompts.
pub(super) fn read_pipe(
    mut input: impl BufRead + Send + 'static,
    inbox: RequestReader,
    out: LineWriter,
) -> Turn {
    let (turn, prompts) = sync_channel(1);
    spawn(move || {
        let next = |_: &str| match super::inbox::next_line(&mut input) {
            Ok(Some(Some(line))) => InputLine::Line(String::from_utf8_lossy(&line).into_owned()),
            Ok(Some(None)) => InputLine::TooLong,
            Ok(None) | Err(_) => InputLine::End,
        };
        take_lines(next, &prompts, &inbox, &out);
    });
    turn
}

enum InputLine {
    Line(String),
    /// A line of a pipe that is longer than any command.
    TooLong,
    /// Ctrl-C in the editor.
    Stop,
    End,
}

fn take_lines(
    mut next: impl FnMut(&str) -> InputLine,
    prompts: &Receiver<String>,
    inbox: &RequestReader,
    out: &LineWriter,
) {
    let mut line = 0_u64;
    while let Ok(prompt) = prompts.recv() {
        loop {
            line += 1;
            let request = match next(&prompt) {
                InputLine::End => return inbox.push_end(),
                InputLine::Stop => Ok(Some(SessionRequest::Stop { drive: None })),
                InputLine::TooLong => Err("the line is too long".to_owned()),
                InputLine::Line(text) => read_line(&text),
            };
            match request {
                Ok(Some(SessionRequest::End {})) => return inbox.push_end(),
                Ok(Some(request)) => {
                    inbox.push(json!(line), request);
                    break;
                }
                Ok(None) => {}
                Err(what) => {
                    inbox.push(json!(line), SessionRequest::Wrong { what });
                    break;
                }
            }
        }
        out.wait();
    }
}

/// Reads a line; `None` for an empty one or a comment.
///
/// # Errors
/// What is wrong with it.
pub(super) fn read_line(line: &str) -> Result<Option<SessionRequest>, String> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    if line.starts_with('!') {
        let line = line.to_owned();
        return Ok(Some(SessionRequest::Fault { line }));
    }
    let words = shlex::split(line).ok_or("a quotation mark without its end")?;
    let (name, rest) = words.split_first().ok_or("no command")?;
    let one = |what: &str| match rest {
        [word] => Ok(word.clone()),
        _ => Err(format!("{name}: {what} expected")),
    };
    Ok(Some(match name.as_str() {
        "exit" | "quit" | "end" => SessionRequest::End {},
        "recover" => SessionRequest::Recover {},
        "help" | "?" => SessionRequest::Help {
            command: rest.first().cloned(),
        },
        "stop" if rest.is_empty() => SessionRequest::Stop { drive: None },
        "stop" => SessionRequest::Stop {
            drive: Some(DriveWords::Text(one("drives, such as 0, 0..2 or all,")?)),
        },
        "wait" => {
            let time = duration(&one("a time, such as 500ms,")?);
            let time = time.map_err(|error| format!("wait: {error}"))?;
            let ms = u32::try_from(time.as_millis()).unwrap_or(u32::MAX);
            SessionRequest::Wait { ms }
        }
        "run" => SessionRequest::Run {
            scenario: None,
            path: Some(one("one scenario, file or folder")?),
        },
        "fault" => {
            let line = line.trim_start_matches("fault").trim().to_owned();
            SessionRequest::Fault { line }
        }
        "capture" => SessionRequest::Capture {
            path: one("one file in pcapng, such as ring.pcapng,")?,
        },
        "capture-end" => SessionRequest::CaptureEnd {},
        name if COMMANDS.contains(&name) => SessionRequest::Command { words },
        other => return Err(unknown(other)),
    }))
}

fn unknown(word: &str) -> String {
    let known: Vec<_> = names().collect();
    let near = nearest(word, &known).map(|near| format!("did you mean `{near}`? "));
    let near = near.unwrap_or_default();
    format!("`{word}` is no command of the shell; {near}`help` lists them")
}

fn names() -> impl Iterator<Item = &'static str> {
    let own = OWN.iter().map(|(name, ..)| *name);
    COMMANDS.into_iter().chain(own)
}

/// The commands, or how one is used.
///
/// # Errors
/// There is no such command.
pub(super) fn help(name: Option<&str>) -> Result<String, String> {
    let program = command();
    let Some(name) = name else {
        let about = |name: &str| {
            let found = program.find_subcommand(name).and_then(Command::get_about);
            (
                name.to_owned(),
                found.map(ToString::to_string).unwrap_or_default(),
            )
        };
        let all = COMMANDS.into_iter().map(about);
        let own = OWN.map(|(_, usage, about)| (usage.to_owned(), about.to_owned()));
        let mut text = String::new();
        for (name, about) in all.chain(own) {
            // Writing to a String cannot fail.
            let _infallible = writeln!(text, "{name:15}{about}");
        }
        text.push_str("Drives are numbers: 0, 0..2, all. Ctrl-C stops what moves, Ctrl-D ends the shell in the safe state.\n");
        return Ok(text);
    };
    if let Some((_, usage, about)) = OWN.iter().find(|(word, ..)| *word == name) {
        return Ok(format!("{usage}: {about}\n"));
    }
    let known = COMMANDS.contains(&name);
    let found = program.find_subcommand(name).filter(|_| known);
    let found = found.ok_or_else(|| unknown(name))?.clone();
    // Options that the shell has settled, and those of the program, are no choice here.
    let settled = |argument: &Arg| {
        let long = argument.get_long().unwrap_or_default();
        SETTLED
            .iter()
            .any(|option| option.strip_prefix("--") == Some(long))
            || argument.is_global_set()
    };
    let mut found = found.mut_args(|argument| {
        let hide = settled(&argument);
        argument.hide(hide)
    });
    let text = found.render_help().to_string();
    Ok(text.replace("Usage: drivebench ", "Usage: "))
}

/// What came of a request, where its command has not printed it.
pub(super) fn text(result: &Value) -> String {
    let word = |object: &Value, key: &str| object[key].as_str().unwrap_or_default().to_owned();
    let mut text = word(result, "found");
    if let Some(packets) = result["packets"].as_u64() {
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "{} in {}",
            counted(packets, "packet"),
            word(result, "path")
        );
    }
    let Some(scenarios) = result["scenarios"].as_array() else {
        return text;
    };
    for scenario in scenarios {
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "{} {}  {:.3} ms  {}",
            word(scenario, "verdict"),
            word(scenario, "name"),
            scenario["took_ms"].as_f64().unwrap_or_default(),
            word(scenario, "title")
        );
        let finding = &scenario["finding"];
        if !finding.is_null() {
            let _infallible = writeln!(
                text,
                "  line {}: {}",
                finding["line"],
                word(finding, "what")
            );
        }
        let notes = scenario["notes"].as_array().into_iter().flatten();
        for note in notes.filter_map(Value::as_str) {
            let _infallible = writeln!(text, "  note: {note}");
        }
    }
    text
}

/// Completes words as the scripts for shells do.
struct Words {
    rig: String,
}

impl Completer for Words {
    type Candidate = Pair;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &Context<'_>,
    ) -> rustyline::Result<(usize, Vec<Pair>)> {
        let front = line.get(..at).unwrap_or(line);
        let start = front
            .rfind(char::is_whitespace)
            .map_or(0, |space| space + 1);
        Ok((start, completions(&self.rig, front, start)))
    }
}

/// What can stand behind `front` in place of its last word, which begins at `start`.
fn completions(rig: &str, front: &str, start: usize) -> Vec<Pair> {
    let pair = |word: &str| Pair {
        display: word.to_owned(),
        replacement: word.to_owned(),
    };
    let mut words: Vec<String> = front[..start]
        .split_whitespace()
        .map(str::to_owned)
        .collect();
    let current = &front[start..];
    let Some(name) = words.first().cloned() else {
        let fits = names().filter(|name| name.starts_with(current));
        return fits.map(pair).collect();
    };
    if name == "help" {
        let fits = names().filter(|name| name.starts_with(current));
        return fits.map(pair).collect();
    }
    let is_own = OWN.iter().any(|(word, ..)| *word == name);
    // The program's commands of these names take something else, but for the scenario of `run`.
    if is_own && (name != "run" || words.len() > 1) {
        return Vec::new();
    }
    // What the rig is decides which cells there are.
    words.splice(1..1, ["--rig".to_owned(), rig.to_owned()]);
    words.push(current.to_owned());
    let fits = fitting(&command(), &words).words;
    let is_settled = |word: &str| is_own && word.starts_with('-') || SETTLED.contains(&word);
    let fits = fits.iter().filter(|word| !is_settled(word));
    fits.map(|word| pair(word)).collect()
}

impl Hinter for Words {
    type Hint = String;
}
impl Highlighter for Words {}
impl Validator for Words {}
impl Helper for Words {}

/// Prints whole lines above the line that is being typed.
struct AbovePrompt<P> {
    printer: P,
    begun: Vec<u8>,
}

impl<P: ExternalPrinter> Write for AbovePrompt<P> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.begun.extend_from_slice(bytes);
        let whole = self.begun.iter().rposition(|byte| *byte == b'\n');
        if let Some(end) = whole {
            let lines: Vec<u8> = self.begun.drain(..=end).collect();
            let lines = String::from_utf8_lossy(&lines).into_owned();
            self.printer.print(lines).map_err(std::io::Error::other)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus_name::BusName;

    fn line(text: &str) -> String {
        match read_line(text) {
            Ok(None) => "nothing".to_owned(),
            Ok(Some(request)) => serde_json::to_string(&request).expect("JSON"),
            Err(what) => what,
        }
    }

    #[test]
    fn lines_are_requests() {
        for (typed, request) in [
            ("", "nothing"),
            ("  # a remark", "nothing"),
            (
                "read 0 nist",
                r#"{"do":"command","words":["read","0","nist"]}"#,
            ),
            (
                "write 8 \"Accel. time\"=5s",
                r#"{"do":"command","words":["write","8","Accel. time=5s"]}"#,
            ),
            ("stop", r#"{"do":"stop","drive":null}"#),
            ("stop 0..2", r#"{"do":"stop","drive":"0..2"}"#),
            ("wait 1.5s", r#"{"do":"wait","ms":1500}"#),
            (
                "run 9.7-parity-error",
                r#"{"do":"run","scenario":null,"path":"9.7-parity-error"}"#,
            ),
            (
                "fault 2->1 byte 10: flip 0",
                r#"{"do":"fault","line":"2->1 byte 10: flip 0"}"#,
            ),
            ("! 2->1: cut", r#"{"do":"fault","line":"! 2->1: cut"}"#),
            (
                "capture ring.pcapng",
                r#"{"do":"capture","path":"ring.pcapng"}"#,
            ),
            ("capture-end", r#"{"do":"capture-end"}"#),
            ("exit", r#"{"do":"end"}"#),
            ("wait", "wait: a time, such as 500ms, expected"),
            (
                "raed 0 nist",
                "`raed` is no command of the shell; did you mean `read`? `help` lists them",
            ),
            ("read \"0", "a quotation mark without its end"),
        ] {
            assert_eq!(line(typed), request, "{typed}");
        }
    }

    #[test]
    fn words_are_completed() {
        let offered = |rig: &str, front: &str| {
            let start = front.rfind(' ').map_or(0, |space| space + 1);
            let all = completions(rig, front, start);
            all.into_iter()
                .map(|pair| pair.replacement)
                .collect::<Vec<_>>()
        };
        // The first bus behind the default one.
        let other = format!("sim:{}:1", BusName::NAMES[1].0);
        assert_eq!(offered("sim:3", "pos"), ["position"]);
        assert_eq!(offered("sim:3", "read 0 nsollr"), ["nsollrampe"]);
        assert_eq!(offered(&other, "read 1 SPEED_ACTUAL_"), ["SPEED_ACTUAL_"]);
        assert!(
            offered("sim:3", "run 9.7-parity-error-").contains(&"9.7-parity-error-idle".to_owned())
        );
        assert_eq!(offered("sim:3", "help wa"), ["watch", "wait"]);
        // The shell's own commands are not those of the program, and take no options.
        for (name, ..) in OWN {
            assert_eq!(offered("sim:3", &format!("{name} --")), [""; 0], "{name}");
        }
        for front in ["capture ", "wait ", "run 9.7-parity-error 9"] {
            assert_eq!(offered("sim:3", front), [""; 0], "{front}");
        }
        let options = offered("sim:3", "watch 0 nist --");
        assert!(options.contains(&"--every".to_owned()), "{options:?}");
        assert!(!options.contains(&"--rig".to_owned()), "{options:?}");
    }

    #[test]
    fn help_knows_every_command() {
        let all = help(None).expect("a list");
        for name in names() {
            assert!(
                all.lines().any(|line| line.split(' ').next() == Some(name)),
                "{name}"
            );
            assert!(!help(Some(name)).expect(name).is_empty());
        }
        assert!(help(Some("fuzz")).is_err());
        let read = help(Some("read")).expect("a command");
        assert!(
            read.contains("Usage: read") && !read.contains("--rig"),
            "{read}"
        );
    }
}
