//! `drivebench capture`: listens at taps, sends nothing, and keeps what it hears.

mod place;
mod session;
mod tap;

pub(crate) use place::TapAt;
pub(crate) use place::taps_of;

use super::args::{ImportArguments, ReadingArguments, TraceOutput, rate};
use super::import::import;
use crate::buses::find_any_rig;
use crate::capture::NamedLink;
use crate::command::args::duration;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::signals;
use clap::Args;
use harness_proto::line::Rate;
use session::Session;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// For `capture`.
#[derive(Clone, Debug, Default, Args)]
pub struct CaptureArguments {
    /// A link of a ring and the port that listens to it, 98->97=/dev/ttyUSB1; a serial line that stations share, bus=/dev/ttyUSB2@500; a CAN
    /// adapter, can0=slcan:/dev/ttyACM0@250, with the rate in kbit/s. May be given several times.
    #[arg(long, value_name = "NAME=PORT", required_unless_present = "rig")]
    pub tap: Vec<TapAt>,
    /// A rig, of which all taps are listened to.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["tap", "line", "in_band"])]
    pub rig: Option<String>,
    /// Bit rate of the ring.
    #[arg(long, value_name = "RATE", value_parser = rate, default_value = "38400")]
    pub line: Rate,
    /// Pseudo terminals carry line errors as in-band marks.
    #[arg(long)]
    pub in_band: bool,
    /// Listen also with CAN adapters that may acknowledge frames, since whether they listen only cannot be read back.
    #[arg(long)]
    pub may_acknowledge: bool,
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
    /// End at the first line of text that contains this, such as parity, located or "88 FE".
    #[arg(long, value_name = "TEXT")]
    pub until: Option<String>,
    /// Keep only what comes after the first line of text that contains this, and the 20000 bytes before it.
    #[arg(long, value_name = "TEXT")]
    pub trigger: Option<String>,
    /// Judge these slaves or drives of shared lines and no others, such as 8,9; by default those that are no other device's.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub judge: Vec<u8>,
    /// Print no line of text for what is heard.
    #[arg(long)]
    pub quiet: bool,
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
    let mut session = Session::begin(&arguments, &stop).map_err(|(_, what)| what)?;
    while !stop.load(Ordering::Relaxed) {
        match session.step(false) {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => break,
            Err(error) => return Err(format!("failed to write to {}: {error}", pipe.display())),
        }
    }
    Ok(())
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
    let mut session = match Session::begin(arguments, &stop) {
        Ok(session) => session,
        Err((exit, what)) => {
            output.complain(&what);
            return Ok(exit);
        }
    };
    let serial = arguments.tap.iter().any(TapAt::is_serial);
    output.say(&format!(
        "listening at {}; the program sends nothing{}\n",
        counted(arguments.tap.len(), "tap"),
        if serial {
            ". DTR and RTS rise when a port is opened: leave TX and RTS unwired"
        } else {
            ""
        }
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

/// Judges a part of a capture as `import` does.
fn judge(
    files: &[PathBuf],
    capture: &CaptureArguments,
    part: NamedLink,
    output: &mut Output,
) -> io::Result<Exit> {
    // All drives of a ring are judged.
    let named = part.channel.is_some().then(|| capture.judge.clone());
    let arguments = ImportArguments {
        files: files.to_vec(),
        format: None,
        scenario: false,
        setup: None,
        judge: named.unwrap_or_default(),
        // A real clock, and ports that give several bytes at a time.
        tolerance: Some(Duration::from_millis(50)),
        reading: ReadingArguments {
            line: Some(capture.line),
            link: vec![part],
            ..ReadingArguments::default()
        },
        showing: TraceOutput::default(),
    };
    import(&arguments, output)
}
