//! Programs that are run around a run: hooks, and switches for power. Bounded in time and output.

use super::check::Rig;
use rustix::process::{Pid, Signal, kill_process_group};
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// The most bytes that are kept of each of its two streams.
pub const MAX_OUTPUT: u64 = 1 << 16;
/// How often it is looked whether it has ended.
const EVERY: Duration = Duration::from_millis(5);
/// How long its streams may stay open behind its end: it may have left children behind.
const STREAMS: Duration = Duration::from_millis(500);

/// A program that ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    pub status: ExitStatus,
    /// The start of its standard output.
    pub stdout: String,
    /// The start of its standard error.
    pub stderr: String,
}

/// Why a program did not do its work; the bench's fault (exit code 3).
#[derive(Debug, thiserror::Error)]
pub enum HookError {
    /// It could not be started.
    #[error("failed to start `{command}`: {error}")]
    Start {
        /// Program and arguments.
        command: String,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// It was ended because it took too long.
    #[error("`{command}` was ended: it took longer than {} ms{}", .timeout.as_millis(), said(.stderr))]
    TimeOut {
        /// Program and arguments.
        command: String,
        /// How long it might take.
        timeout: Duration,
        /// The start of its standard error.
        stderr: String,
    },
    /// It did not end with exit code 0.
    #[error("`{command}` failed ({}){}", .finished.status, said(&.finished.stderr))]
    Failed {
        /// Program and arguments.
        command: String,
        /// How it ended.
        finished: Finished,
    },
}

fn said(stderr: &str) -> String {
    match stderr.trim().lines().last() {
        Some(line) => format!(": {line}"),
        None => String::new(),
    }
}

/// Runs a hook of a rig: no shell, nothing on its standard input, `DRIVEBENCH_RIG` (the id),
/// `DRIVEBENCH_RIG_FILE` (where the rig comes from) and `DRIVEBENCH_HOOK` (`name`) in its environment.
///
/// # Errors
/// It could not be started, took too long, or did not end with exit code 0.
pub fn run(
    rig: &Rig,
    name: &str,
    command: &[String],
    timeout: Duration,
) -> Result<Finished, HookError> {
    let finished = status(rig, name, command, timeout)?;
    if finished.status.success() {
        return Ok(finished);
    }
    Err(HookError::Failed {
        command: command.join(" "),
        finished,
    })
}

/// The same, whatever its exit code: for a program that answers by it, as `status` of a switch does.
///
/// # Errors
/// It could not be started or took too long.
pub fn status(
    rig: &Rig,
    name: &str,
    command: &[String],
    timeout: Duration,
) -> Result<Finished, HookError> {
    let shown = command.join(" ");
    let start = |error| HookError::Start {
        command: shown.clone(),
        error,
    };
    let Some((program, arguments)) = command.split_first() else {
        return Err(start(std::io::ErrorKind::InvalidInput.into()));
    };
    let mut child = Command::new(program)
        .args(arguments)
        .env("DRIVEBENCH_RIG", rig.id())
        .env("DRIVEBENCH_RIG_FILE", &rig.origin)
        .env("DRIVEBENCH_HOOK", name)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        // A group of its own: its children end with it, and Ctrl-C is for us to handle.
        .process_group(0)
        .spawn()
        .map_err(start)?;
    let streams = [collect(child.stdout.take()), collect(child.stderr.take())];
    let ended = wait(&mut child, timeout).map_err(start)?;
    let deadline = Instant::now() + STREAMS;
    let [stdout, stderr] = streams.map(|stream| {
        let left = deadline.saturating_duration_since(Instant::now());
        let bytes = stream.recv_timeout(left).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    });
    match ended {
        Some(status) => Ok(Finished {
            status,
            stdout,
            stderr,
        }),
        None => Err(HookError::TimeOut {
            command: shown,
            timeout,
            stderr,
        }),
    }
}

/// Keeps the start of a stream and discards the rest, so that its writer does not block.
fn collect(stream: Option<impl Read + Send + 'static>) -> Receiver<Vec<u8>> {
    let (sender, receiver): (Sender<Vec<u8>>, _) = channel();
    if let Some(mut stream) = stream {
        std::thread::spawn(move || {
            let mut kept = Vec::new();
            // What was read before an error is kept. The receiver may be gone already.
            let _cut = stream.by_ref().take(MAX_OUTPUT).read_to_end(&mut kept);
            let full = kept.len() as u64 == MAX_OUTPUT;
            if full {
                let _cut = std::io::copy(&mut stream, &mut std::io::sink());
            }
            let _nobody_waits = sender.send(kept);
        });
    }
    receiver
}

/// Waits for its end, and ends it with its children where it takes too long.
fn wait(child: &mut Child, timeout: Duration) -> std::io::Result<Option<ExitStatus>> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if begun.elapsed() >= timeout {
            if let Some(group) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
                // It may have ended by itself just now.
                let _gone = kill_process_group(group, Signal::KILL);
            }
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(EVERY);
    }
}
