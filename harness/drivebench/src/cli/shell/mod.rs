//! `drivebench shell`: a session that holds a bench. People type commands with an editor, or write them into a pipe; with `--json` programs
//! send one request a line on standard input and get one answer a line on standard output.

mod answer;
mod capture;
mod inbox;
mod people;
mod request;
mod session;

pub(crate) use request::schema;

use crate::buses::bus_of;
use crate::buses::find_any_rig;
use crate::buses::hold;
use crate::command::args::{ColourWhen, ShowProgress, duration};
use crate::command::exit::Exit;
use crate::command::output::{Output, Stream};
use crate::command::rig_failure::{alarm, tell_end};
use crate::rig::UseOptions;
use crate::signals::{at_ctrl_c, interrupt_flag, interrupt_flag_without_ctrl_c};
use clap::Args;
use inbox::{LineWriter, RequestReader};
use people::{LineEditor, read_pipe};
use request::{SCHEMA, SessionEvent, SessionLine, SessionRequest};
use serde_json::Value;
use session::{Asker, HeldSession};
use std::fs::File;
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// For `shell`.
#[derive(Clone, Debug, Args)]
pub struct ShellArguments {
    /// The rig: sim:N, sim:unitek:N, sim:nordac:N, a file, or a name that `rig list` shows.
    #[arg(long, value_name = "RIG", default_value = "sim:3")]
    pub rig: String,
    /// For programs: read JSON requests, one a line, and write JSON answers; `schema session` describes both.
    #[arg(long)]
    pub json: bool,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long = "wait-for-rig", value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
}

/// Holds a bench until the input ends.
pub(crate) fn shell(arguments: &ShellArguments, output: &mut Output) -> std::io::Result<Exit> {
    match arguments.json {
        true => for_program(arguments, output),
        false => for_people(arguments),
    }
}

fn for_program(arguments: &ShellArguments, output: &mut Output) -> std::io::Result<Exit> {
    // Nothing else may write to standard output from now on: it becomes standard error for the rest of the program.
    let lines = File::from(rustix::io::dup(rustix::stdio::stdout())?);
    rustix::stdio::dup2_stdout(rustix::stdio::stderr())?;
    let [ended, interrupt] = [interrupt_flag(), interrupt_flag()];
    let watched = lines.try_clone()?;
    let (out, writer) = LineWriter::write(lines, Arc::clone(&interrupt));
    out.watch(watched);
    out.put(&SessionLine::Event(SessionEvent::Hello {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        rig: arguments.rig.clone(),
    }));
    let mut told = Output::collecting();
    let exit = serve(arguments, &out, &mut told, [ended, interrupt], |inbox| {
        inbox.read(std::io::stdin(), out.clone());
        Asker::Program
    });
    let [_, what] = told.take_collected();
    output.say(&what);
    let what = what.trim_end().to_owned();
    out.put(&SessionLine::Event(SessionEvent::End {
        code: exit as u8,
        what,
    }));
    finish(out, &writer);
    Ok(exit)
}

fn for_people(arguments: &ShellArguments) -> std::io::Result<Exit> {
    let input = std::io::stdin();
    // The editor's thread may hold the terminal in its own mode when the session ends.
    let mode = rustix::termios::tcgetattr(&input).ok();
    let editor = match input.is_terminal() && std::io::stdout().is_terminal() {
        true => Some(LineEditor::new(&arguments.rig).map_err(std::io::Error::other)?),
        false => None,
    };
    let [ended, interrupt] = [
        interrupt_flag_without_ctrl_c(),
        interrupt_flag_without_ctrl_c(),
    ];
    let interrupted = Arc::clone(&interrupt);
    let ((out, writer), editor) = match editor {
        Some((editor, printer)) => (LineWriter::write(printer, interrupted), Some(editor)),
        None => (LineWriter::write(std::io::stdout(), interrupted), None),
    };
    let piped = editor.is_none();
    let mut told = people_output(&out, piped);
    let exit = serve(arguments, &out, &mut told, [ended, interrupt], |inbox| {
        Asker::People {
            turn: match editor {
                Some(editor) => editor.read(inbox.clone(), out.clone()),
                None => read_pipe(std::io::BufReader::new(input), inbox.clone(), out.clone()),
            },
            piped,
            awaited: true,
        }
    });
    drop(told);
    finish(out, &writer);
    if let Some(mode) = mode {
        let input = std::io::stdin();
        let _lost = rustix::termios::tcsetattr(input, rustix::termios::OptionalActions::Now, &mode);
    }
    Ok(exit)
}

/// What people read, in the colours of their terminal. Behind a pipe, messages go to standard error.
fn people_output(out: &LineWriter, piped: bool) -> Output {
    let out = out.clone();
    Output::new(ColourWhen::Auto, ShowProgress::None).given_to(move |stream, text| {
        if piped && stream == Stream::Message {
            let _nobody_reads = std::io::stderr().lock().write_all(text.as_bytes());
        } else {
            out.text(text);
        }
    })
}

/// Waits until all is written.
fn finish(out: LineWriter, writer: &std::thread::JoinHandle<()>) {
    if out.is_stuck() {
        return;
    }
    out.wait();
    drop(out);
    // A client that reads nothing any more must not keep the program.
    let mut naps = 0;
    while !writer.is_finished() && naps < 100 {
        std::thread::sleep(Duration::from_millis(10));
        naps += 1;
    }
}

/// Opens the bench and does requests. The first flag is set by every signal that ends the program, the second one by what ends a request too.
fn serve(
    arguments: &ShellArguments,
    out: &LineWriter,
    told: &mut Output,
    [ended, interrupt]: [Arc<AtomicBool>; 2],
    listen: impl FnOnce(&RequestReader) -> Asker,
) -> Exit {
    let Some(rig) = find_any_rig(&arguments.rig, told) else {
        return Exit::Usage;
    };
    let inbox = RequestReader::new(Arc::clone(&interrupt));
    // The opening ends like a request.
    inbox.begin();
    if !arguments.json {
        let signalled = inbox.clone();
        // Where the signal cannot be caught, its default action stays.
        let _as_before = at_ctrl_c(move || {
            let _overtakes = signalled.push(Value::Null, SessionRequest::Stop { drive: None });
        });
    }
    let options = UseOptions {
        purpose: "shell".to_owned(),
        wait: arguments.wait.unwrap_or_default(),
        allow_motion: arguments.leave,
        keeps_lines: true,
        tries_line_errors: false,
        interrupt: Arc::clone(&interrupt),
        alarm: alarm(),
        ..UseOptions::default()
    };
    let bench = match hold(&rig, &options, told) {
        Ok(bench) => bench,
        Err(failure) => return failure.tell(told),
    };
    let opened = !inbox.done();
    let bus = bus_of(&rig).name;
    let ready = SessionEvent::Ready {
        bus: bus.name(),
        drives: bench.drives(),
        simulated: rig.is_simulated(),
        motion: arguments.leave,
    };
    let mut session = HeldSession {
        asker: listen(&inbox),
        inbox,
        name: arguments.rig.clone(),
        rig,
        bus,
        bench,
        out: out.clone(),
        motion: arguments.leave,
        struck: false,
        capture: None,
        ended,
        interrupt,
    };
    session.bench.record_from_now(None);
    session.happened(ready);
    let exit = match opened {
        true => session.work(told),
        false => Exit::Interrupted,
    };
    let exit = match session.end_capture() {
        Some(Err(failure)) => failure.tell(told).max(exit),
        _ => exit,
    };
    let end = session
        .bench
        .end(matches!(exit, Exit::RigError | Exit::Interlock));
    tell_end(&end, exit, told)
}
