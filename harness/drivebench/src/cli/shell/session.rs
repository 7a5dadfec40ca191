//! A session on an open bench: requests are done and answered one by one, and the bus is kept at work between them.

use super::answer::{data, object, values};
use super::capture::SessionCapture;
use super::inbox::{LineWriter, RequestReader, SessionItem};
use super::people::{self, Turn};
use super::people_output;
use super::request::{self, SessionEvent, SessionLine, SessionRequest};
use crate::bus_name::BusName;
use crate::buses::is_bare;
use crate::cli::args::{Arguments, ProgramCommand};
use crate::cli::help::command;
use crate::command::exit::Exit;
use crate::command::failure::{Failure, exit_of_trouble};
use crate::command::held::HeldBench;
use crate::command::output::Output;
use crate::command::play::play_entry_until;
use crate::guard::OVERDUE;
use crate::library::Entry;
use crate::link::Trouble;
use crate::rig::Rig;
use crate::scenario::files::sources;
use crate::scenario::run::{AtMismatch, Outcome};
use crate::scenario::source::Source;
use clap::FromArgMatches;
use harness_proto::time::Span;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The commands of a session.
pub(super) const COMMANDS: [&str; 17] = [
    "info",
    "read",
    "write",
    "watch",
    "params",
    "scope",
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
    "delete-error",
];

/// Options that a session has settled already.
pub(super) const SETTLED: [&str; 4] = ["--rig", "--setup", "--wait-for-rig", "--hold"];

/// How long the bus is kept between two looks at the requests, in real time.
const KEPT: Span = Span::from_micros(500);

/// How often a session in virtual time looks for a signal.
const LOOK: Duration = Duration::from_millis(50);

/// The most drives that are asked for their speeds before each prompt.
const MOST_IN_PROMPT: usize = 8;

/// A drive that turns no faster than this stands, in the unit of its speed.
const STANDS: f64 = 0.5;

/// The longest part of a wait that is captured on simulated drives, in milliseconds.
const PART: u32 = 1_000;

/// The longest wait that a request may ask for, in milliseconds.
const LONGEST_WAIT: u32 = 60_000;

/// Who asks, and how answers are written.
pub(super) enum Asker {
    /// A program: JSON.
    Program,
    /// People: text.
    People {
        /// Gives the prompt to who reads lines.
        turn: Turn,
        /// The lines come from a pipe or a file: the first that fails ends the session.
        piped: bool,
        /// A line is done, and the next is not read before the prompt.
        awaited: bool,
    },
}

pub(super) struct HeldSession {
    pub(super) asker: Asker,
    pub(super) inbox: RequestReader,
    /// The rig as it was named.
    pub(super) name: String,
    pub(super) rig: Rig,
    pub(super) bus: BusName,
    pub(super) bench: Box<dyn HeldBench>,
    pub(super) out: LineWriter,
    pub(super) motion: bool,
    /// A fault was injected. A scenario starts without it and would pass in spite of it.
    pub(super) struck: bool,
    pub(super) capture: Option<SessionCapture>,
    pub(super) ended: Arc<AtomicBool>,
    pub(super) interrupt: Arc<AtomicBool>,
}

impl HeldSession {
    /// Does requests until the session ends; returns why as an exit code.
    pub(super) fn work(&mut self, told: &mut Output) -> Exit {
        let patience = match self.rig.is_simulated() {
            true => LOOK,
            false => Duration::ZERO,
        };
        loop {
            self.prompt();
            if self.ended.load(Ordering::Relaxed) {
                return Exit::Interrupted;
            }
            if self.out.is_stuck() {
                told.complain("the client reads no answers any more");
                return Exit::RigError;
            }
            if self.bench.overdue() {
                told.complain(OVERDUE);
                return Exit::Interlock;
            }
            match self.inbox.next(patience) {
                Some(SessionItem::End) => return Exit::Passed,
                Some(SessionItem::Cancelled(id)) => self.cancelled(id),
                Some(SessionItem::Ask(id, SessionRequest::End {})) => {
                    self.out.put(&SessionLine::Result {
                        id,
                        result: json!({}),
                    });
                    return Exit::Passed;
                }
                Some(SessionItem::Ask(id, request)) => {
                    if let Some(exit) = self.ask(id, &request) {
                        return exit;
                    }
                }
                None if self.rig.is_simulated() => {}
                None => {
                    if let Err(failure) = self.bench.pass(KEPT)
                        && self.bench.trouble().is_none()
                    {
                        let mut collected = Output::collecting();
                        failure.tell(&mut collected);
                        let [_, what] = collected.take_collected();
                        self.happened(SessionEvent::Bus {
                            what: what.trim_end().to_owned(),
                        });
                        if let Err(failure) = self.resume() {
                            return failure.tell(told);
                        }
                    }
                }
            }
            self.write_capture();
            for what in self.bench.events() {
                self.happened(SessionEvent::Bus { what });
            }
            if let Some(exit) = self.in_trouble(told) {
                return exit;
            }
        }
    }

    /// A signal has ended the session, or the loss of its client.
    fn is_over(&self) -> bool {
        self.ended.load(Ordering::Relaxed) || self.out.is_stuck()
    }

    /// Ends the session where its link is lost; after a denial it goes on.
    fn in_trouble(&mut self, told: &mut Output) -> Option<Exit> {
        match self.bench.trouble()? {
            // Answered already, or the loop ends by itself.
            Trouble::Interrupted if self.is_over() => return None,
            Trouble::Interrupted | Trouble::Denied(_) => {}
            trouble => {
                told.complain(&trouble.to_string());
                return Some(exit_of_trouble(&trouble));
            }
        }
        match self.resume() {
            Ok(()) => None,
            Err(failure) => Some(failure.tell(told)),
        }
    }

    /// Makes the link of use again. It may restart its record.
    fn resume(&mut self) -> Result<(), Failure> {
        let Some(capture) = &mut self.capture else {
            return self.bench.resume();
        };
        capture.collect(&mut *self.bench)?;
        self.bench.resume()?;
        capture.goes_on(self.bench.record()?.now);
        Ok(())
    }

    /// Writes what a capture of simulated drives has recorded: their record grows fast. That of a port has a bound, and can end in the
    /// middle of a telegram.
    fn write_capture(&mut self) {
        let Some(capture) = self.capture.as_mut().filter(|capture| !capture.is_broken()) else {
            return;
        };
        if !self.rig.is_simulated() || !self.bench.is_between_telegrams() {
            return;
        }
        if let Err(failure) = capture.collect(&mut *self.bench) {
            let mut collected = Output::collecting();
            failure.tell(&mut collected);
            let [_, what] = collected.take_collected();
            self.bench.record_from_now(None);
            let what = format!("the capture takes nothing more: {}", what.trim_end());
            self.happened(SessionEvent::Bus { what });
        }
    }

    /// Ends the capture, if there is one.
    pub(super) fn end_capture(&mut self) -> Option<Result<Value, Failure>> {
        let mut capture = self.capture.take()?;
        let collected = capture.collect(&mut *self.bench);
        self.bench.record_from_now(None);
        Some(collected.and_then(|()| capture.end()))
    }

    /// Lets time pass. While simulated drives are captured it passes in parts, which are written one by one.
    fn pass(&mut self, ms: u32) -> Result<(), Failure> {
        let part = match self.capture.is_some() && self.rig.is_simulated() {
            true => PART,
            false => LONGEST_WAIT,
        };
        let mut left = ms;
        while left > 0 {
            let now = left.min(part);
            self.bench.pass(Span::from_millis(u64::from(now)))?;
            self.write_capture();
            left -= now;
        }
        Ok(())
    }

    /// Reports what no request asked for.
    pub(super) fn happened(&self, event: SessionEvent) {
        match (&self.asker, event) {
            (Asker::Program, event) => self.out.put(&SessionLine::Event(event)),
            (Asker::People { .. }, SessionEvent::Bus { what }) => {
                self.out.text(format!("bus: {what}\n"));
            }
            (Asker::People { piped: false, .. }, SessionEvent::Ready { drives, .. }) => {
                let drives = drives.join(", ");
                let motion = match self.motion {
                    true => "motors may turn as far as the rig's file permits",
                    false => "motors stay off; `shell --move` lets them turn",
                };
                let text = format!(
                    "{}: drives {drives}; {motion}. `help` lists the commands, Ctrl-C stops what moves, Ctrl-D ends in the safe state.\n",
                    self.name
                );
                self.out.text(text);
            }
            (Asker::People { .. }, _) => {}
        }
    }

    /// Gives the prompt to who waits for it, with the drives that move.
    fn prompt(&mut self) {
        let awaited = matches!(&self.asker, Asker::People { awaited: true, .. });
        if !awaited || !self.inbox.is_empty() || self.bench.trouble().is_some() {
            return;
        }
        let moving = match &self.asker {
            Asker::People { piped: false, .. } if self.motion => self.moving(),
            _ => String::new(),
        };
        let text = format!("{}{moving}> ", self.name);
        match self.rig.is_simulated() {
            true => self.out.wait(),
            // Trouble is seen behind the prompt.
            false => self.out.wait_while(|| {
                let _seen_later = self.bench.pass(KEPT);
            }),
        }
        if let Asker::People { turn, awaited, .. } = &mut self.asker {
            *awaited = false;
            let _reader_has_ended = turn.send(text);
        }
    }

    /// The drives that turn, with their speeds. A bench of many drives is not asked for a prompt.
    fn moving(&mut self) -> String {
        if self.bench.drives().len() > MOST_IN_PROMPT {
            return String::new();
        }
        let request = SessionRequest::Read {
            drive: request::DriveWords::Text("all".to_owned()),
            cells: vec![self.bench.speed().to_owned()],
        };
        let mut output = Output::collecting();
        let words = request.words().unwrap_or_default();
        if self.command(&words, &mut output).is_err() {
            return String::new();
        }
        let turning = values(output.collected_result()).into_iter();
        let turning: Vec<_> = turning
            .filter_map(|value| {
                let speed = value["value"].as_f64();
                let speed = speed.filter(|speed| speed.abs() >= STANDS)?;
                let unit = value["unit"].as_str().unwrap_or_default();
                Some(format!("{}: {speed:.1} {unit}", value["drive"].as_str()?))
            })
            .collect();
        match turning.is_empty() {
            true => String::new(),
            false => format!(" ({})", turning.join(", ")),
        }
    }

    /// A request was taken back before it began.
    fn cancelled(&mut self, id: Value) {
        match &mut self.asker {
            Asker::Program => {
                self.out
                    .error(id, Exit::Interrupted, "cancelled before it began");
            }
            Asker::People { awaited, .. } => *awaited |= people::is_typed(&id),
        }
    }

    /// Does a request and answers it; returns the exit code of one that ends the session.
    fn ask(&mut self, id: Value, request: &SessionRequest) -> Option<Exit> {
        match self.asker {
            Asker::Program => {
                self.answer(id, request);
                None
            }
            Asker::People { piped, .. } => {
                let mut output = people_output(&self.out, piped);
                let exit = self.tell(request, &mut output);
                if let Asker::People { awaited, .. } = &mut self.asker {
                    *awaited |= people::is_typed(&id);
                }
                let failed = piped && exit != Exit::Passed;
                if failed {
                    output.say(&format!(
                        "line {id} ends the session: the lines behind it were not done\n"
                    ));
                }
                failed.then_some(exit)
            }
        }
    }

    /// Does a request and tells people what came of it.
    fn tell(&mut self, request: &SessionRequest, output: &mut Output) -> Exit {
        let done = self.perform(request, output);
        let cancelled = self.inbox.done() && !self.is_over();
        if cancelled {
            self.interrupt.store(false, Ordering::Relaxed);
        }
        match done {
            Ok((exit, result)) => {
                self.out.text(people::text(&result));
                exit
            }
            // Ctrl-C has ended it: what the link says of that is no news.
            Err(_) if cancelled => Exit::Interrupted,
            Err(failure) => failure.tell(output),
        }
    }

    /// Does a request and answers it in JSON.
    fn answer(&mut self, id: Value, request: &SessionRequest) {
        let mut output = Output::collecting();
        let done = self.perform(request, &mut output);
        let cancelled = self.inbox.done() && !self.is_over();
        if cancelled {
            self.interrupt.store(false, Ordering::Relaxed);
        }
        let (exit, result) = match done {
            Ok((exit, result)) => (exit, result),
            Err(failure) => (failure.tell(&mut output), Value::Null),
        };
        let [text, notes] = output.take_collected();
        let reading = matches!(request, SessionRequest::Run { .. });
        if exit == Exit::Passed || reading && !result.is_null() {
            let mut result = result;
            if let Value::Object(object) = &mut result {
                let has = |key| object.contains_key(key);
                if !text.is_empty() && !has("values") && !has("data") {
                    object.insert("text".to_owned(), json!(text));
                }
                if !notes.is_empty() {
                    object.insert("notes".to_owned(), json!(notes));
                }
            }
            return self.out.put(&SessionLine::Result { id, result });
        }
        let exit = if cancelled { Exit::Interrupted } else { exit };
        let what = notes.trim_end();
        let what = what.strip_prefix("error: ").unwrap_or(what);
        self.out.error(id, exit, format!("{text}{what}"));
    }

    fn perform(
        &mut self,
        request: &SessionRequest,
        output: &mut Output,
    ) -> Result<(Exit, Value), Failure> {
        let done = match request {
            SessionRequest::Info {} => json!({
                "rig": self.rig.id(), "bus": self.bus.name(), "drives": self.bench.drives(), "simulated": self.rig.is_simulated(),
                "motion": self.motion, "commands": COMMANDS,
            }),
            SessionRequest::Wait { ms } if *ms > LONGEST_WAIT => {
                return Err(Failure::refused(format!(
                    "`ms`: 0 to {LONGEST_WAIT} expected"
                )));
            }
            SessionRequest::Wait { ms } => {
                self.pass(*ms)?;
                json!({})
            }
            SessionRequest::Fault { line } => {
                let written = line.trim_start();
                let bare = ["!", "drive", "slave", "?"]
                    .iter()
                    .any(|mark| written.starts_with(mark));
                let line = if bare {
                    line.clone()
                } else {
                    format!("! {written}")
                };
                self.bench.strike(&line)?;
                self.struck = true;
                json!({})
            }
            SessionRequest::Help { command } => {
                let text = people::help(command.as_deref()).map_err(Failure::refused)?;
                output.result(&text)?;
                Value::Null
            }
            SessionRequest::Wrong { what } => return Err(Failure::refused(what.clone())),
            SessionRequest::Recover {} => json!({"found": self.bench.recover()?}),
            SessionRequest::Capture { .. } if self.capture.is_some() => {
                return Err(Failure::refused(
                    "a capture is under way: `capture-end` writes it",
                ));
            }
            SessionRequest::Capture { path } => {
                let simulated = self.rig.is_simulated();
                self.capture = Some(SessionCapture::begin(path, &mut *self.bench, simulated)?);
                json!({})
            }
            SessionRequest::CaptureEnd {} => {
                let none = "no capture is under way: `capture` begins one";
                let kept = self.end_capture().ok_or_else(|| Failure::refused(none))?;
                kept?
            }
            // What they break off has been broken off.
            SessionRequest::Cancel { .. } | SessionRequest::End {} => json!({}),
            SessionRequest::Run { scenario, path } => {
                return self.run(scenario.as_deref(), path.as_deref());
            }
            _ => {
                let words = request.words().unwrap_or_default();
                let exit = self.command(&words, output)?;
                return Ok((exit, data(request, output)));
            }
        };
        Ok((Exit::Passed, done))
    }

    /// Runs a command by its words.
    fn command(&mut self, words: &[String], output: &mut Output) -> Result<Exit, Failure> {
        let name = words.first().map_or("", String::as_str);
        if !COMMANDS.contains(&name) {
            return Err(Failure::refused(format!(
                "`{name}` is no command of a session: {} expected",
                COMMANDS.join(", ")
            )));
        }
        let is = |word: &String, option: &str| {
            word == option
                || word
                    .strip_prefix(option)
                    .is_some_and(|rest| rest.starts_with('='))
        };
        if let Some(word) = words
            .iter()
            .find(|word| SETTLED.iter().any(|option| is(word, option)))
        {
            return Err(Failure::refused(format!(
                "{word}: the session has settled it; leave it out"
            )));
        }
        let moves = |word: &String| word == "--move" || word == "--allow-motion";
        if !self.motion && words.iter().any(moves) {
            return Err(Failure::refused(
                "this session was opened without --move: open it with --move to let motors turn",
            ));
        }
        let program = command();
        let found = program.find_subcommand(name);
        let has = |long: &str| {
            found.is_some_and(|command| {
                command
                    .get_arguments()
                    .any(|argument| argument.get_long() == Some(long))
            })
        };
        let mut line = vec!["drivebench".to_owned(), name.to_owned()];
        if self.motion && has("move") && !words.iter().any(moves) {
            line.push("--move".to_owned());
        }
        // `--hold` of the cyclic commands waits for Ctrl-C.
        if has("hold") && !has("for") {
            line.push("--hold".to_owned());
        }
        line.extend(words.iter().skip(1).cloned());
        let wrong = |error: clap::Error| {
            let text = error.render().to_string();
            let text = text
                .trim_start_matches("error: ")
                .split("\n\n")
                .next()
                .unwrap_or_default()
                .to_owned();
            Failure::refused(text)
        };
        let matches = program.try_get_matches_from(&line).map_err(wrong)?;
        match Arguments::from_arg_matches(&matches)
            .map_err(wrong)?
            .command
        {
            Some(ProgramCommand::Drive(command)) => self.bench.perform(*command, output),
            _ => Err(Failure::refused("no command on drives")),
        }
    }

    /// Plays scenarios.
    fn run(&mut self, text: Option<&str>, path: Option<&str>) -> Result<(Exit, Value), Failure> {
        let sources = match (text, path) {
            (Some(text), None) => {
                let source = Source::from_bytes("scenario".to_owned(), text.as_bytes().to_vec());
                vec![source.map_err(|error| Failure::refused(error.to_string()))?]
            }
            (None, Some(path)) => sources(&[PathBuf::from(path)])?,
            _ => {
                return Err(Failure::refused(
                    "`scenario` (a text) or `path` expected, one of them",
                ));
            }
        };
        let size = Some(self.rig.ring_size()).filter(|size| *size > 0);
        let mut entries = Vec::new();
        for source in sources {
            let entry = Entry::fitting(source, size);
            entries.push(entry.map_err(|problems| Failure::refused(problems.lines()))?);
        }
        let mut verdicts = Vec::new();
        let mut all = Vec::new();
        for entry in &entries {
            let outcome = self.play(entry)?;
            verdicts.push(outcome.verdict);
            all.push(object(entry, &outcome));
            if self.bench.trouble().is_some() || self.interrupt.load(Ordering::Relaxed) {
                break;
            }
        }
        let mut counts = BTreeMap::<&str, usize>::new();
        for verdict in &verdicts {
            *counts.entry(verdict.name()).or_default() += 1;
        }
        let exit = match all.len() == entries.len() {
            true => Exit::of(&verdicts, false),
            false => Exit::of(&verdicts, false).max(Exit::Incomplete),
        };
        let worst = verdicts.iter().max().map_or("", |verdict| verdict.name());
        let result = json!({
            "code": exit as u8, "verdict": worst, "counts": counts, "scenarios": all, "not_played": entries.len() - all.len(),
        });
        Ok((exit, result))
    }

    fn play(&mut self, entry: &Entry) -> Result<Outcome, Failure> {
        if self.struck {
            return Err(Failure::refused(
                "a scenario does not meet the faults of this session: write them into the scenario",
            ));
        }
        if is_bare(&self.rig) {
            // Drives of its own.
            let played = play_entry_until(entry, AtMismatch::Stop, &self.interrupt);
            return Ok(played.outcome);
        }
        // What is judged is recorded whole.
        let Some(capture) = &mut self.capture else {
            self.bench.record_from_now(Some(u64::MAX));
            let played = self.bench.play(&entry.source);
            self.bench.record_from_now(None);
            return Ok(played?.outcome);
        };
        capture.collect(&mut *self.bench)?;
        self.bench.record_from_now(Some(u64::MAX));
        let played = self.bench.play(&entry.source);
        // The link begins anew, perhaps several times.
        capture.leave_out(
            &format!("scenario {}", entry.short_name()),
            &mut *self.bench,
        )?;
        Ok(played?.outcome)
    }
}
