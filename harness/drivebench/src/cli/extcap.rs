//! `drivebench extcap`: a source of packets for Wireshark and tshark (extcap), and its installation.
//!
//! Wireshark starts the programs of a folder without a subcommand, so a link named `drivebench-extcap` stands there. It asks for interfaces at
//! every start: they are listed from rig files alone, without a port or a lock. A capture writes pcapng into the pipe until Wireshark
//! closes it or sends SIGTERM. Messages on standard error appear in Wireshark where the exit code is not 0.

use super::capture::{listen_into, taps_of};
use crate::bus::Bus;
use crate::bus_name::BusName;
use crate::buses::BUSES;
use crate::buses::RIG_BUSES;
use crate::capture::Carries;
use crate::capture::{LiveRecorder, Tape};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::play::play_entry;
use crate::library::Entry;
use crate::report::pcapng::LINK_TYPE;
use crate::report::pcapng_frames;
use crate::rig::find::{self, find};
use crate::rig::rings::ring_size;
use crate::scenario::files::sources;
use crate::scenario::run::AtMismatch;
use crate::signals;
use clap::{Args, Subcommand};
use harness_proto::time::Span;
use std::fmt::Write as _;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

/// The name of the link to this program in Wireshark's folder.
pub(crate) const PROGRAM: &str = "drivebench-extcap";
/// The interface of a simulated ring, in front of the name of another bus, and what stands in front of a rig's name.
const SIMULATED: &str = "drivebench-sim";
const RIG: &str = "drivebench-rig-";
/// The usual simulated ring.
const RING: &str = "sim:3";
/// The pause behind a scenario.
const PAUSE: Duration = Duration::from_secs(1);
/// How often what has happened is written.
const TICK: Duration = Duration::from_millis(5);

/// For `extcap`: the arguments that Wireshark gives.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct ExtcapArguments {
    #[command(subcommand)]
    command: Option<ExtcapCommand>,
    /// List the interfaces.
    #[arg(long)]
    extcap_interfaces: bool,
    /// The version of Wireshark.
    #[arg(long, value_name = "VERSION")]
    extcap_version: Option<String>,
    /// The interface that the other arguments are about.
    #[arg(long, value_name = "NAME")]
    extcap_interface: Option<String>,
    /// List the link types of the interface.
    #[arg(long)]
    extcap_dlts: bool,
    /// List the options of the interface.
    #[arg(long)]
    extcap_config: bool,
    /// Capture into the pipe.
    #[arg(long)]
    capture: bool,
    /// A capture filter, which is not applied.
    #[arg(long, value_name = "FILTER")]
    extcap_capture_filter: Option<String>,
    /// The pipe.
    #[arg(long, value_name = "PATH")]
    fifo: Option<PathBuf>,
    /// The simulated ring: sim:N for N drives; sim:3 by default.
    #[arg(long)]
    rig: Option<String>,
    /// What it plays, again and again: a scenario's name or file; by default one that shows the bus at work.
    #[arg(long)]
    scenario: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum ExtcapCommand {
    /// Put a link to this program into Wireshark's folder.
    Install {
        /// The folder; by default the personal one that `tshark -G folders` names.
        #[arg(long)]
        folder: Option<PathBuf>,
    },
}

/// Answers Wireshark.
pub(crate) fn extcap(arguments: &ExtcapArguments, output: &mut Output) -> io::Result<Exit> {
    if let Some(ExtcapCommand::Install { folder }) = &arguments.command {
        return install(folder.as_deref(), output);
    }
    let interface = arguments.extcap_interface.as_deref();
    let known = |name: &str| simulated_bus(name).is_some() || name.starts_with(RIG);
    match interface {
        _ if arguments.extcap_interfaces => output.result(&interfaces())?,
        Some(name) if !known(name) => {
            output.complain(&format!(
                "there is no interface `{name}`; `drivebench extcap --extcap-interfaces` lists them"
            ));
            return Ok(Exit::Usage);
        }
        Some(name) if arguments.extcap_dlts => output.result(&link_types(name))?,
        Some(name) if arguments.extcap_config => output.result(&config(name))?,
        Some(name) if arguments.capture => return capture(name, arguments, output),
        _ => {
            output.complain(
                "Wireshark starts this command; `drivebench extcap install` installs it, and `--extcap-interfaces` lists interfaces",
            );
            return Ok(Exit::Usage);
        }
    }
    Ok(Exit::Passed)
}

/// A text as the value of a field.
fn field(text: &str) -> String {
    text.chars()
        .filter(|letter| !"{}\n\r".contains(*letter))
        .collect()
}

/// The interface of a simulated bench.
fn simulated_interface(bus: BusName) -> String {
    match bus == BusName::DEFAULT {
        true => SIMULATED.to_owned(),
        false => format!("{SIMULATED}-{}", bus.name()),
    }
}

/// The bus of a simulated interface.
fn simulated_bus(interface: &str) -> Option<&'static Bus> {
    let mut all = BUSES.iter().copied();
    all.find(|bus| simulated_interface(bus.name) == interface)
}

/// The interfaces: a simulated bench a bus, and each rig with taps. A rig's file with mistakes is left out; `drivebench rig list` shows them.
fn interfaces() -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut text = format!("extcap {{version={version}}}{{display=drivebench}}\n");
    for bus in BUSES {
        let value = simulated_interface(bus.name);
        let what = match bus.shared {
            None => "simulated ring".to_owned(),
            Some(_) => format!("simulated {}", bus.name.name()),
        };
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "interface {{value={value}}}{{display=drivebench: {what}}}"
        );
    }
    for (name, place) in find::all(&find::folder()) {
        let rig = place
            .source()
            .ok()
            .and_then(|source| find::read(&source, &RIG_BUSES).ok());
        if rig.is_some_and(|rig| taps_of(&rig).is_ok()) {
            let name = field(&name);
            let _infallible = writeln!(
                text,
                "interface {{value={RIG}{name}}}{{display=drivebench: taps of {name}}}"
            );
        }
    }
    text
}

/// The link type of an interface: that of frames, where a bus has frames or a rig has a CAN adapter.
fn link_types(interface: &str) -> String {
    let rig = interface.strip_prefix(RIG);
    let rig = rig.and_then(|name| find(name, &find::folder(), &RIG_BUSES).ok());
    let adapter = rig.is_some_and(|rig| rig.port().is_some_and(|rig| rig.can_adapter().is_some()));
    let frames =
        adapter || simulated_bus(interface).is_some_and(|bus| bus.carries == Carries::Frames);
    let (number, name, display) = match frames {
        true => (pcapng_frames::LINK_TYPE, "CAN_SOCKETCAN", "CAN frames"),
        false => (LINK_TYPE, "RTAC_SERIAL", "Serial lines"),
    };
    format!("dlt {{number={number}}}{{name={name}}}{{display={display}}}\n")
}

/// The options of an interface.
fn config(interface: &str) -> String {
    let Some(bus) = simulated_bus(interface) else {
        return String::new();
    };
    let rig = "arg {number=0}{call=--rig}{display=Rig}{type=string}{default=sim:3}{tooltip=sim:N is a ring of N drives}\n";
    let rig = if bus.shared.is_none() { rig } else { "" };
    format!(
        "{rig}arg {{number=1}}{{call=--scenario}}{{display=Scenario}}{{type=string}}{{default={}}}{{tooltip=drivebench list names them}}\n",
        bus.example
    )
}

/// Writes what an interface carries into the pipe.
fn capture(interface: &str, arguments: &ExtcapArguments, output: &mut Output) -> io::Result<Exit> {
    let Some(fifo) = &arguments.fifo else {
        output.complain("--capture needs --fifo");
        return Ok(Exit::Usage);
    };
    // The reader waits until the pipe is opened and closed again, and shows the message only then.
    let pipe = match File::create(fifo) {
        Ok(pipe) => pipe,
        Err(error) => {
            output.complain(&format!("failed to open {}: {error}", fifo.display()));
            return Ok(Exit::RigError);
        }
    };
    let done = match interface.strip_prefix(RIG) {
        Some(name) => find(name, &find::folder(), &RIG_BUSES)
            .map_err(|error| error.to_string())
            .and_then(|rig| taps_of(&rig))
            .and_then(|(taps, line, in_band)| listen_into(fifo, taps, line, in_band)),
        None => simulated(interface, arguments).and_then(|tape| play_into(&pipe, &tape)),
    };
    match done {
        Ok(()) => Ok(Exit::Passed),
        Err(what) => {
            output.complain(&what);
            Ok(Exit::RigError)
        }
    }
}

/// What a simulated bench carries.
fn simulated(interface: &str, arguments: &ExtcapArguments) -> Result<Tape, String> {
    let bus = simulated_bus(interface).unwrap_or(BUSES[0]);
    let scenario = arguments.scenario.clone();
    let scenario = scenario.unwrap_or_else(|| PathBuf::from(bus.example));
    let name = scenario.display();
    let found = sources(std::slice::from_ref(&scenario)).map_err(|error| error.to_string())?;
    let [source] =
        <[_; 1]>::try_from(found).map_err(|_| format!("{name}: one scenario is expected"))?;
    let drives = match &arguments.rig {
        Some(rig) if bus.shared.is_some() => {
            return Err(format!(
                "--rig {rig}: a scenario of {} says which drives it has; leave --rig out",
                bus.name.name()
            ));
        }
        rig => bus
            .shared
            .is_none()
            .then(|| ring(rig.as_deref().unwrap_or(RING))),
    };
    let drives = drives.transpose()?;
    let entry = Entry::fitting(source, drives).map_err(|problems| problems.to_string())?;
    if entry.scenario.bus != bus.name {
        return Err(format!(
            "{name}: it is a scenario of {}; the interface of that bus is {}",
            entry.scenario.bus.name(),
            simulated_interface(entry.scenario.bus)
        ));
    }
    let played = play_entry(&entry, AtMismatch::GoOn);
    Ok(Tape::of(&played.traces, entry.rate()))
}

/// The number of drives of a simulated ring.
fn ring(rig: &str) -> Result<u8, String> {
    let drives = rig.strip_prefix("sim:").ok_or_else(|| {
        format!("`{rig}` is no simulated ring: sim:N is expected; rigs with taps are interfaces of their own")
    })?;
    ring_size(drives).map_err(|error| format!("`{rig}` is no simulated ring: {error}"))
}

/// Writes a tape into a pipe at the pace of its times, again and again, until the reader closes it or a signal comes.
fn play_into(pipe: &File, tape: &Tape) -> Result<(), String> {
    let stop = signals::interrupt_flag();
    let failed = |error: &io::Error| format!("failed to write to the pipe: {error}");
    let mut recorder = match LiveRecorder::start(pipe, &tape.places) {
        Ok(recorder) => recorder,
        Err(error) => return closed(&error).ok_or_else(|| failed(&error)),
    };
    while !stop.load(Ordering::Relaxed) {
        if let Err(error) = once(&mut recorder, tape, &stop) {
            return closed(&error).ok_or_else(|| failed(&error));
        }
        wait(PAUSE, &stop);
    }
    Ok(())
}

/// Done, where the reader has closed the pipe.
fn closed(error: &io::Error) -> Option<()> {
    (error.kind() == io::ErrorKind::BrokenPipe).then_some(())
}

fn wait(time: Duration, stop: &AtomicBool) {
    let until = Instant::now() + time;
    while Instant::now() < until && !stop.load(Ordering::Relaxed) {
        std::thread::sleep(TICK.min(until.saturating_duration_since(Instant::now())));
    }
}

/// Writes a tape once, at its pace.
fn once(recorder: &mut LiveRecorder<&File>, tape: &Tape, stop: &AtomicBool) -> io::Result<()> {
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let wall = u64::try_from(wall.unwrap_or_default().as_nanos()).unwrap_or(0);
    let began = Instant::now();
    for (at, place, piece) in &tape.pieces {
        let due = Duration::from_nanos(at.since_start().as_nanos());
        if due > began.elapsed() {
            recorder.flush()?;
            wait(due.saturating_sub(began.elapsed()), stop);
        }
        if stop.load(Ordering::Relaxed) {
            break;
        }
        recorder.piece(*place, &piece.later(Span::from_nanos(wall)))?;
    }
    recorder.flush()
}

/// Puts a link to this program where Wireshark finds it.
fn install(folder: Option<&Path>, output: &mut Output) -> io::Result<Exit> {
    let found = match folder {
        Some(folder) => Ok(folder.to_owned()),
        None => folders(),
    };
    let done = found.and_then(|folder| link(&folder));
    match done {
        Ok(path) => {
            output.result(&format!("{}\n", path.display()))?;
            output.say("Wireshark lists its interfaces at the next start; tshark -D shows them\n");
            Ok(Exit::Passed)
        }
        Err(what) => {
            output.complain(&what);
            Ok(Exit::RigError)
        }
    }
}

/// The personal folder for extcap programs, from `tshark -G folders`.
fn folders() -> Result<PathBuf, String> {
    let remedy = "give the folder that Help, About, Folders of Wireshark shows, as in `--folder ~/.local/lib/wireshark/extcap`";
    let listed = Command::new("tshark").args(["-G", "folders"]).output();
    let listed = listed.map_err(|error| format!("failed to start tshark: {error}; {remedy}"))?;
    let text = String::from_utf8_lossy(&listed.stdout);
    folder_of(&text).ok_or_else(|| format!("tshark names no folder for extcap programs; {remedy}"))
}

/// The personal folder in the answer of tshark: named as such from 4.2 on, and in the folder of the configuration before.
fn folder_of(text: &str) -> Option<PathBuf> {
    let value = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        line.map(|folder| PathBuf::from(folder.trim()))
    };
    let folder = value("Personal Extcap path:");
    folder.or_else(|| value("Personal configuration:").map(|folder| folder.join("extcap")))
}

fn link(folder: &Path) -> Result<PathBuf, String> {
    let failed = |error: io::Error| format!("failed to install in {}: {error}", folder.display());
    let program = std::env::current_exe().map_err(failed)?;
    std::fs::create_dir_all(folder).map_err(failed)?;
    let path = folder.join(PROGRAM);
    match path.symlink_metadata() {
        Ok(metadata) if metadata.is_symlink() => std::fs::remove_file(&path).map_err(failed)?,
        Ok(_) => {
            return Err(format!(
                "{} is there already and is no link; remove it first",
                path.display()
            ));
        }
        Err(_) => {}
    }
    std::os::unix::fs::symlink(program, &path).map_err(failed)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The answers of tshark 4.0 and 4.4.
    #[test]
    fn folders_of_versions() {
        let old = "Temp:                \t/tmp\nPersonal configuration:\t/root/.config/wireshark\nExtcap path:         \t/usr/lib/wireshark/extcap\n";
        let expected = Path::new("/root/.config/wireshark/extcap");
        assert_eq!(folder_of(old).as_deref(), Some(expected));
        let new = format!("{old}Personal Extcap path:\t/root/.local/lib/wireshark/extcap\n");
        let expected = Path::new("/root/.local/lib/wireshark/extcap");
        assert_eq!(folder_of(&new).as_deref(), Some(expected));
        assert_eq!(folder_of("Temp: /tmp"), None);
    }

    #[test]
    fn a_link_is_replaced_and_a_file_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("a/extcap");
        let path = link(&inner).expect("a link");
        assert_eq!(link(&inner), Ok(path.clone()));
        std::fs::remove_file(&path).expect("removed");
        std::fs::write(&path, "mine").expect("written");
        assert!(link(&inner).expect_err("a file").contains("is no link"));
    }
}
