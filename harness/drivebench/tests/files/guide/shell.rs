//! The commands of a page, run in one shell in a folder of their own.

use super::compare::fits;
use super::page::{Mode, Shown, Step};
use crate::debian;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
use std::fmt::Write as _;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A page that hangs is ended; no page is judged by how long it takes.
const PATIENCE: Duration = Duration::from_secs(300);

/// What a page needs whose commands call `python3` with a package: as it is called, and its modules.
const PYTHON: [(&str, &str); 5] = [
    ("python-can", "can"),
    ("cantools", "cantools"),
    ("pyprofibus", "pyprofibus"),
    ("pytest", "drivebench, pytest"),
    ("labgrid", "drivebench, labgrid, pytest"),
];

/// The module of a package that a block needs; `None` for a block that needs none.
fn module(mode: &Mode) -> Option<&'static str> {
    let Mode::Needs(tool) = mode else {
        return None;
    };
    let python = PYTHON.iter().find(|(package, _)| package == tool);
    python.map(|(_, module)| *module)
}

/// Where the two streams of a command go.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Streams {
    /// Into one text, in order.
    Together,
    /// Into one text each.
    Apart,
}

/// What a command printed, and how it ended.
pub(super) struct Printed {
    pub(super) output: Vec<String>,
    /// Empty where the streams are together.
    pub(super) errors: Vec<String>,
    pub(super) code: String,
}

/// Runs the steps and returns the differences from the page.
pub(super) fn differences(steps: &[Step], page: &str) -> String {
    let (commands, mut text) = play(steps, page, Streams::Together);
    for (shown, printed) in commands {
        let right = printed.code == shown.code.to_string();
        if !(right && (shown.output.is_empty() || fits(&shown.output, &printed.output))) {
            text.push_str(&difference(shown, &printed, page));
        }
    }
    text
}

/// Runs the steps and returns what each command printed, and a complaint if they did not end.
pub(super) fn play<'a>(
    steps: &'a [Step],
    page: &str,
    streams: Streams,
) -> (Vec<(&'a Shown, Printed)>, String) {
    let home = tempfile::tempdir().expect("a folder");
    let (work, out) = (home.path().join("work"), home.path().join("out"));
    for folder in [&work, &out, &home.path().join("bin")] {
        std::fs::create_dir(folder).expect("a folder");
    }
    let program = home.path().join("bin/drivebench");
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_drivebench"), program).expect("a link");

    let mut script = "cd work\n".to_owned();
    let mut commands: Vec<&Shown> = Vec::new();
    let python = (steps.iter())
        .find_map(|step| match step {
            Step::Command(mode, _) => module(mode),
            Step::File { .. } => None,
        })
        .and_then(|module| crate::python::with(module, page));
    for (number, step) in steps.iter().enumerate() {
        match step {
            Step::File { name, text } => {
                // Files are there when their turn comes: a later one may have the name of an earlier one.
                let kept = out.join(format!("file{number}"));
                std::fs::write(&kept, text).expect("a file");
                let _written = writeln!(
                    script,
                    "mkdir -p \"$(dirname '{name}')\"; cp ../out/file{number} '{name}'"
                );
            }
            Step::Command(mode, shown) if wanted(mode, page) => {
                script.push_str(&one(&shown.command, commands.len(), streams));
                commands.push(shown);
            }
            Step::Command(..) => {}
        }
    }
    std::fs::write(home.path().join("script"), script).expect("a file");
    let ended = run(home.path(), python.as_deref());
    let mut text = String::new();
    if !ended {
        let _written = writeln!(text, "{page}: did not end in {PATIENCE:?}");
    }
    let read = |name: String| {
        let bytes = std::fs::read(out.join(name)).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let lines = |name: String| read(name).lines().map(str::to_owned).collect();
    let printed = commands.into_iter().enumerate().map(|(number, shown)| {
        let printed = Printed {
            output: lines(number.to_string()),
            errors: lines(format!("{number}.err")),
            code: read(format!("{number}.code")).trim().to_owned(),
        };
        (shown, printed)
    });
    (printed.collect(), text)
}

fn wanted(mode: &Mode, page: &str) -> bool {
    let Mode::Needs(tool) = mode else {
        return *mode == Mode::Run;
    };
    match module(mode) {
        Some(module) => crate::python::with(module, page).is_some(),
        None => debian::has(tool, page),
    }
}

/// One command of the script. One in the background has begun when it has said its first line.
fn one(command: &str, number: usize, streams: Streams) -> String {
    let wait = if command.ends_with('&') {
        format!("while ! [ -s ../out/{number} ] && kill -0 $! 2>/dev/null; do sleep 0.05; done\n")
    } else {
        String::new()
    };
    let errors = match streams {
        Streams::Together => "&1".to_owned(),
        Streams::Apart => format!("\"$OUT/{number}.err\""),
    };
    format!(
        "{{ {command}\n}} >\"$OUT/{number}\" 2>{errors} </dev/null; echo $? >\"$OUT/{number}.code\"\n{}",
        wait.replace("../out", "\"$OUT\"")
    )
}

/// Runs the script in a process group of its own, and ends whatever of it is still there. `false`: it hung.
/// `python3` is that one, where it is given.
fn run(home: &Path, python: Option<&Path>) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folder = python.and_then(Path::parent).map(Path::to_owned);
    let folders =
        (std::iter::once(home.join("bin")).chain(folder)).chain(std::env::split_paths(&path));
    let mut child = Command::new("sh")
        .arg("script")
        .current_dir(home)
        .env_clear()
        .env("PATH", std::env::join_paths(folders).expect("a path"))
        .env("HOME", home)
        .env("OUT", home.join("out"))
        .env("TMPDIR", home)
        .env("DRIVEBENCH_STATE", home.join("state"))
        .env("NO_COLOR", "1")
        .env("LANG", "C.UTF-8")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()
        .expect("a shell");
    let group = Pid::from_child(&child);
    let begun = Instant::now();
    // NOWAIT leaves the shell a zombie, so that its process id is not reused.
    let look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    let ended = loop {
        if waitid(WaitId::Pid(group), look).is_ok_and(|status| status.is_some()) {
            break true;
        }
        if begun.elapsed() > PATIENCE {
            break false;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let _nobody_left = kill_process_group(group, Signal::KILL);
    let _status = child.wait();
    ended
}

fn difference(shown: &Shown, printed: &Printed, page: &str) -> String {
    let Shown { line, command, .. } = shown;
    format!(
        "{page}:{line}: $ {command}\nshown (exit code {}):\n{}\nprinted (exit code {}):\n{}\n\n",
        shown.code,
        shown.output.join("\n"),
        printed.code,
        printed.output.join("\n")
    )
}
