//! `drivebench capture`: listens at taps, sends nothing, and keeps what it hears.

use super::args::{ImportArguments, ReadingArguments, TraceOutput, duration, rate};
use super::exit::Exit;
use super::import::import;
use super::output::Output;
use super::rig_failure::find_any_rig;
use crate::capture::files::{Files, Rotation};
use crate::capture::live::LiveLines;
use crate::counted::counted;
use crate::port::{OpenError, SilentTap, TapState};
use crate::rig::Rig;
use crate::rig::file::{Marks, Transport};
use crate::signals;
use clap::Args;
use harness_proto::line::{Rate, Received};
use harness_proto::time::{Instant as LineInstant, Span};
use harness_sim::record::LineByte;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

/// How often ports that are gone are tried again, and signals looked at.
const TICK: Duration = Duration::from_millis(200);
/// Silence in front of the first byte, without which a conversation may have begun before the capture and is not judged, in nanoseconds.
const SILENCE: u64 = 50_000_000;
/// Bytes that are kept while the trigger is waited for.
const BEFORE_TRIGGER: usize = 20_000;

/// For `capture`.
#[derive(Clone, Debug, Default, Args)]
pub struct CaptureArguments {
    /// A link and the port that listens to it, such as 98->97=/dev/ttyUSB1. May be given several times.
    #[arg(long, value_name = "LINK=PORT", required_unless_present = "rig")]
    pub tap: Vec<TapAt>,
    /// A rig, of which all taps are listened to.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["tap", "line", "in_band"])]
    pub rig: Option<String>,
    /// Bit rate of the line.
    #[arg(long, value_name = "RATE", value_parser = rate, default_value = "38400")]
    pub line: Rate,
    /// Pseudo terminals carry line errors as in-band marks.
    #[arg(long)]
    pub in_band: bool,
    /// The capture. With rotation a number stands behind its name: ring_00001.pcapng.
    #[arg(short, long, value_name = "FILE", default_value = "capture.pcapng")]
    pub output: PathBuf,
    /// Begin a new file after this many bytes.
    #[arg(long, value_name = "BYTES", value_parser = clap::value_parser!(u64).range(1_000..))]
    pub size: Option<u64>,
    /// Begin a new file after this time, such as 60s; SIGHUP begins one at any time.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub every: Option<Duration>,
    /// Keep this many files and remove older ones.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..))]
    pub files: Option<u32>,
    /// End after this time, such as 10s; by default Ctrl-C ends the capture.
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    pub duration: Option<Duration>,
    /// End at the first line of text that contains this, such as parity or "88 FE".
    #[arg(long, value_name = "TEXT")]
    pub until: Option<String>,
    /// Keep only what comes after the first line of text that contains this, and the 20000 bytes before it.
    #[arg(long, value_name = "TEXT")]
    pub trigger: Option<String>,
    /// Print no line of text for what is heard.
    #[arg(long)]
    pub quiet: bool,
}

/// The taps of a rig, their rate, and whether they carry in-band marks.
///
/// # Errors
/// A tap has no port that can be listened to, in a sentence.
pub(crate) fn taps_of(rig: &Rig) -> Result<(Vec<TapAt>, Rate, bool), String> {
    let file = &rig.file;
    let mut taps = Vec::new();
    for tap in &file.tap {
        let ring = if tap.ring == 1 { "" } else { "2:" };
        let link = format!("{ring}{}", tap.link);
        let listens = matches!(tap.endpoint.transport, Transport::Serial | Transport::Pty);
        let port = tap.endpoint.port.as_ref().filter(|_| listens);
        let port = port.ok_or_else(|| {
            format!("the tap at {link} has no `port` of the transport serial or pty, at which nothing can be sent by opening it")
        })?;
        taps.push(TapAt {
            link,
            port: port.into(),
        });
    }
    let Some(first) = file.tap.first() else {
        return Err(
            "the rig has no [[tap]]; give the taps, as in `--tap '98->97=/dev/ttyUSB1'`".to_owned(),
        );
    };
    let marks = first.endpoint.marks == Marks::InBand;
    let rate = Rate::from_bits_per_second(first.endpoint.line.baud());
    Ok((taps, rate.unwrap_or_default(), marks))
}

/// Listens until the reader of a pipe closes it or a signal comes, and writes what is heard into the pipe.
///
/// # Errors
/// A port cannot be opened, or the pipe cannot be written, in a sentence.
pub(crate) fn listen_into(
    pipe: &Path,
    taps: Vec<TapAt>,
    line: Rate,
    in_band: bool,
) -> Result<(), String> {
    let (stop, _) = signals::stop_and_rotate_flags();
    let arguments = CaptureArguments {
        tap: taps,
        line,
        in_band,
        output: pipe.to_owned(),
        ..CaptureArguments::default()
    };
    let mut session = Session::begin(&arguments)?;
    while !stop.load(Ordering::Relaxed) {
        match session.step(false) {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => break,
            Err(error) => return Err(format!("failed to write to {}: {error}", pipe.display())),
        }
    }
    Ok(())
}

/// A link and the port that listens to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TapAt {
    link: String,
    port: PathBuf,
}

impl FromStr for TapAt {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("`{text}` is no tap; a link and a port are expected, as in 98->97=/dev/ttyUSB1")
        };
        let (link, port) = text.split_once('=').ok_or_else(wrong)?;
        let known = crate::capture::ends(link).is_some() && !port.is_empty();
        known.then_some(()).ok_or_else(wrong)?;
        Ok(Self {
            link: link.to_owned(),
            port: port.into(),
        })
    }
}

/// A tap in use; `None` while its adapter is away.
struct Listening {
    at: TapAt,
    tap: Option<SilentTap>,
    /// What the kernel had sent at the port before.
    sent_before: Option<u64>,
    last: u64,
    bytes: u64,
    damaged: u64,
}

/// A capture that goes on.
struct Session<'a> {
    arguments: &'a CaptureArguments,
    taps: Vec<Listening>,
    files: Files,
    lines: LiveLines,
    /// Bytes before the trigger; `None` behind it.
    waiting: Option<VecDeque<(usize, LineByte)>>,
    began: (Instant, u64),
    /// When the first byte was heard.
    first: Option<u64>,
    /// A line that ends the capture was seen.
    found: bool,
}

/// Listens, and judges what was heard.
pub(crate) fn capture(arguments: &CaptureArguments, output: &mut Output) -> io::Result<Exit> {
    let mut arguments = arguments.clone();
    if let Some(name) = &arguments.rig {
        let Some(rig) = find_any_rig(name, output) else {
            return Ok(Exit::Usage);
        };
        match taps_of(&rig) {
            Ok((taps, line, marks)) => {
                (arguments.tap, arguments.line, arguments.in_band) = (taps, line, marks);
            }
            Err(what) => {
                output.complain(&format!("rig {name}: {what}"));
                return Ok(Exit::Usage);
            }
        }
    }
    let arguments = &arguments;
    let (stop, new_file) = signals::stop_and_rotate_flags();
    let mut session = match Session::begin(arguments) {
        Ok(session) => session,
        Err(what) => {
            output.complain(&what);
            return Ok(Exit::RigError);
        }
    };
    output.say(&format!(
        "listening at {}; the program sends nothing. DTR and RTS rise when a port is opened: leave TX and RTS unwired\n",
        counted(session.taps.len(), "tap")
    ));
    while !stop.load(Ordering::Relaxed) && !session.is_over() {
        let heard = match session.step(new_file.swap(false, Ordering::Relaxed)) {
            Ok(lines) => lines,
            Err(error) => {
                let path = arguments.output.display();
                output.complain(&format!(
                    "failed to write {path}: {error}; what was written before is kept"
                ));
                return Ok(Exit::RigError);
            }
        };
        if !arguments.quiet {
            let text: String = heard.iter().map(|line| format!("{line}\n")).collect();
            output.result(&text)?;
        }
    }
    session.end(output)
}

impl<'a> Session<'a> {
    fn begin(arguments: &'a CaptureArguments) -> Result<Self, String> {
        let mut taps = Vec::new();
        for at in &arguments.tap {
            let tap = open(at, arguments).map_err(|error| format!("{}: {error}", at.link))?;
            taps.push(Listening {
                at: at.clone(),
                sent_before: tap.transmitted(),
                tap: Some(tap),
                last: 0,
                bytes: 0,
                damaged: 0,
            });
        }
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let wall = wall.unwrap_or_default().as_nanos();
        let wall = u64::try_from(wall).unwrap_or(0);
        let links: Vec<String> = arguments.tap.iter().map(|own| own.link.clone()).collect();
        let nanos = |own: Duration| u64::try_from(own.as_nanos()).unwrap_or(u64::MAX);
        let rotation = Rotation {
            size: arguments.size,
            every: arguments.every.map(nanos),
            files: arguments.files.and_then(|own| usize::try_from(own).ok()),
        };
        let path = &arguments.output;
        let files = Files::begin(path, &links, arguments.line, rotation, wall)
            .map_err(|error| format!("failed to write {}: {error}", path.display()))?;
        Ok(Self {
            arguments,
            taps,
            files,
            lines: LiveLines::new(links, arguments.line, wall),
            waiting: arguments.trigger.is_some().then(VecDeque::new),
            began: (Instant::now(), wall),
            first: None,
            found: false,
        })
    }

    /// Nanoseconds since 1970, by a clock that never jumps.
    fn now(&self) -> u64 {
        let since = u64::try_from(self.began.0.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.began.1.saturating_add(since)
    }

    fn is_over(&self) -> bool {
        let all = self.arguments.duration;
        self.found || all.is_some_and(|all| self.began.0.elapsed() >= all)
    }

    /// Waits for bytes, keeps them, and gives the lines of text that they completed.
    fn step(&mut self, new_file: bool) -> io::Result<Vec<String>> {
        if new_file {
            self.files.rotate(self.now())?;
        }
        let left = self
            .arguments
            .duration
            .map(|all| all.saturating_sub(self.began.0.elapsed()));
        let wait = left.unwrap_or(TICK).min(TICK);
        let mut ports: Vec<_> = self
            .taps
            .iter()
            .filter_map(|own| own.tap.as_ref())
            .map(|tap| PollFd::new(tap, PollFlags::IN))
            .collect();
        let timeout = Timespec::try_from(wait).ok();
        match poll(&mut ports, timeout.as_ref()) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        drop(ports);
        let mut lines = Vec::new();
        for link in 0..self.taps.len() {
            self.listen(link, &mut lines)?;
        }
        let now = self.now();
        lines.extend(self.lines.idle(now));
        for line in &lines {
            let has = |own: &Option<String>| own.as_ref().is_some_and(|own| line.contains(own));
            self.found |= has(&self.arguments.until);
            if self.waiting.is_some() && has(&self.arguments.trigger) {
                for (link, byte) in self.waiting.take().into_iter().flatten() {
                    self.files.recorder().byte(link, &byte)?;
                }
            }
        }
        self.files.flush(now)?;
        Ok(lines)
    }

    /// Reads one tap.
    fn listen(&mut self, link: usize, lines: &mut Vec<String>) -> io::Result<()> {
        let now = self.now();
        let Some(own) = self.taps.get_mut(link) else {
            return Ok(());
        };
        let Some(tap) = &mut own.tap else {
            // It is taken up again when it comes back.
            if let Ok(tap) = open(&own.at, self.arguments) {
                own.tap = Some(tap);
                self.files
                    .recorder()
                    .event(link, now, "the adapter is back")?;
                lines.push(format!("{} the adapter is back", own.at.link));
            }
            return Ok(());
        };
        let mut heard = Vec::new();
        let state = tap.read(&mut heard)?;
        // The last byte has just arrived; those before it came one behind the other.
        let byte_time = self.arguments.line.byte_time().as_nanos();
        let count = heard.len() as u64;
        for (received, place) in heard.into_iter().zip(1..) {
            let behind = byte_time.saturating_mul(count - place);
            let nanos = now.saturating_sub(behind).max(own.last);
            own.last = nanos;
            self.first = self.first.or(Some(nanos));
            own.bytes += 1;
            own.damaged += u64::from(received.error.is_some());
            let byte = line_byte(nanos, received);
            lines.extend(self.lines.byte(link, nanos, received));
            match &mut self.waiting {
                Some(waiting) => {
                    waiting.push_back((link, byte));
                    if waiting.len() > BEFORE_TRIGGER {
                        waiting.pop_front();
                    }
                }
                None => self.files.recorder().byte(link, &byte)?,
            }
        }
        if state == TapState::Gone {
            own.tap = None;
            self.files
                .recorder()
                .event(link, now, "the adapter was pulled out")?;
            lines.push(format!("{} the adapter was pulled out", own.at.link));
        }
        Ok(())
    }

    /// Says what was heard, whether the kernel sent anything, and judges the capture.
    fn end(mut self, output: &mut Output) -> io::Result<Exit> {
        let now = self.now();
        self.files.flush(now)?;
        let mut spoke = false;
        for own in &self.taps {
            let sent_now = own.tap.as_ref().and_then(SilentTap::transmitted);
            let sent = match own.sent_before.zip(sent_now) {
                None => "not counted by the driver".to_owned(),
                Some((before, now)) => {
                    spoke |= now != before;
                    now.saturating_sub(before).to_string()
                }
            };
            output.say(&format!(
                "  {} at {}: {} bytes, {} damaged; bytes sent: {sent}\n",
                own.at.link,
                own.at.port.display(),
                own.bytes,
                own.damaged
            ));
        }
        if spoke {
            output.complain("the kernel sent bytes at a tap although the program sent none: another program uses the port");
            return Ok(Exit::RigError);
        }
        let why = self.unjudged();
        let paths: Vec<PathBuf> = self.files.paths().map(PathBuf::from).collect();
        if let (None, [path]) = (why, paths.as_slice()) {
            return judge(path, self.arguments.line, output);
        }
        let names: Vec<_> = paths.iter().map(|own| own.display().to_string()).collect();
        let why = why.unwrap_or("it is in several files");
        output.say(&format!(
            "  not judged: {why}; `drivebench import` reads {}\n",
            names.join(", ")
        ));
        Ok(Exit::Incomplete)
    }

    /// Why the capture cannot be judged, where it cannot.
    fn unjudged(&self) -> Option<&'static str> {
        let Some(first) = self.first else {
            return Some("nothing was heard");
        };
        if self.arguments.trigger.is_some() {
            return Some("it begins at the trigger, in the middle of a conversation");
        }
        let sends = |own: &Listening| {
            let ends = crate::capture::ends(&own.at.link);
            ends.is_some_and(|(_, from, _)| from.is_none())
        };
        if !self.taps.iter().any(sends) {
            return Some("no tap is on the master's outgoing link, so what was sent is not known");
        }
        let early = first.saturating_sub(self.began.1) < SILENCE;
        early.then_some("the conversation had begun before the capture")
    }
}

fn open(at: &TapAt, arguments: &CaptureArguments) -> Result<SilentTap, OpenError> {
    SilentTap::open(&at.port, arguments.line, arguments.in_band)
}

fn line_byte(nanos: u64, own: Received) -> LineByte {
    let at = LineInstant::START + Span::from_nanos(nanos);
    LineByte::seen(at, Some(own.byte), Some(own.byte), own.error)
}

/// Judges a capture as `import` does.
fn judge(path: &Path, line: Rate, output: &mut Output) -> io::Result<Exit> {
    let arguments = ImportArguments {
        file: path.to_owned(),
        format: None,
        scenario: false,
        setup: None,
        // A real clock, and ports that give several bytes at a time.
        tolerance: Some(Duration::from_millis(50)),
        reading: ReadingArguments {
            line: Some(line),
            ..ReadingArguments::default()
        },
        showing: TraceOutput::default(),
    };
    import(&arguments, output)
}
