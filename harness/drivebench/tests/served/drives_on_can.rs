//! The commands on UNITEK drives that another process serves: over SLCAN on a socket and a pseudo terminal, and over socketcand.

use crate::program::{ended, said};
use crate::serve::{Sim, connect};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A served segment of two drives, and a folder with a rig file for it.
pub(crate) struct Desk {
    sim: Sim,
    folder: tempfile::TempDir,
    /// The address of SLCAN on a socket.
    slcan: String,
}

pub(crate) const SAFE: &str = "safe state: every drive is locked and stands, with commands 0";

const MOTION: &str = "allow_motion = true\n";

impl Desk {
    /// A rig at one of the ways in: `slcan`, `pty` or `socketcand`.
    pub(crate) fn new(way: &str, limits: &str) -> Self {
        Self::of(way, limits, "")
    }

    /// The same with drives of these header lines.
    pub(crate) fn of(way: &str, limits: &str, setup: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let terminal = folder.path().join("terminal");
        let header = folder.path().join("setup.scn");
        std::fs::write(&header, setup).expect("room");
        let mut sim = Sim::start(&[
            "--bus",
            "unitek",
            "--drives",
            "2",
            "--slcan",
            "127.0.0.1:0",
            "--socketcand",
            "127.0.0.1:0",
            "--slcan-pty",
            terminal.to_str().expect("text"),
            "--setup",
            header.to_str().expect("text"),
        ]);
        let (slcan, socketcand, terminal) = (sim.address(), sim.address(), sim.address());
        let port = match way {
            "slcan" => format!("slcan = \"{slcan}\""),
            "pty" => format!("slcan = \"{terminal}\""),
            _ => format!("socketcand = \"{socketcand}\""),
        };
        let text = format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"unitek\"\n{port}\npatience = \"2s\"\n\
             drives = [{{ node = 1 }}, {{ node = 2 }}]\n[limits]\n{limits}"
        );
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { sim, folder, slcan }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn command(&self, line: &str) -> Command {
        self.started_by(Command::new(env!("CARGO_BIN_EXE_drivebench")), line)
    }

    /// The same, ended by SIGHUP too, which `nohup` around the tests would have it ignore.
    pub(crate) fn heeding(&self, line: &str) -> Command {
        let mut command = Command::new("env");
        let program = env!("CARGO_BIN_EXE_drivebench");
        command.args(["--default-signal=HUP", program]);
        self.started_by(command, line)
    }

    pub(crate) fn started_by(&self, mut command: Command, line: &str) -> Command {
        command
            .args(line.split(' '))
            .current_dir(self.folder.path())
            .env("DRIVEBENCH_STATE", self.path("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    pub(crate) fn run(&self, line: &str) -> Output {
        let mut command = self.command(line);
        command.args(["--rig", "desk.toml"]);
        command.output().expect("the program")
    }

    #[track_caller]
    pub(crate) fn shows(&self, line: &str, words: &str) {
        ended(&self.run(line), 0, words);
    }

    /// Starts a move that lasts for minutes, and waits until the motor turns.
    pub(crate) fn moving(&self) -> (Child, BufReader<std::process::ChildStderr>) {
        let mut command = self.heeding("position 1 --to 30000turns --move --rig desk.toml");
        let mut child = command.spawn().expect("the program");
        let mut said = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut line = String::new();
        said.read_line(&mut line).expect("a line");
        assert!(line.contains("its motor turns"), "{line}");
        (child, said)
    }
}

/// What only looks leaves drives as they are; what changes them ends in the safe state.
#[test]
fn every_command_over_socketcand() {
    every_command_over(&["socketcand"]);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn every_command_over_other_ways_in() {
    every_command_over(&["slcan", "pty"]);
}

fn every_command_over(ways: &[&str]) {
    for way in ways {
        let desk = Desk::new(way, MOTION);
        desk.shows("read all SPEED_ACTUAL STATUS", "Ena N-I");
        assert!(!said(&desk.run("read 1 MODE")).contains("safe state"));
        desk.shows("info", "ERR_BITMAP1");
        desk.shows("watch 2 SPEED_ACTUAL --for 20ms --every 10ms", "0.0%");
        desk.shows("write 1 SPEED_CMD=10% --move", "0CCD 10.0% (360.0 rpm)");
        desk.shows("read 1 MODE", "0004");
        ended(&desk.run("go 1"), 2, "add --move");
        desk.shows("go 1 --move", "drive 1: released; ready");
        desk.shows("go 1 --move", SAFE);
        let kept = desk.run("go all --move --hold");
        ended(&kept, 0, "drive 2: released");
        assert!(!said(&kept).contains("safe state"), "{}", said(&kept));
        desk.shows("read 1 STATUS", "Ena");
        desk.shows("position 1 --by 1turns --move", "drive 1: arrived at");
        desk.shows("stop all", "drive 2: its speed command is 0");
        desk.shows("block all", "drive 1: locked, with commands 0");
        desk.shows("params save 1 saved.toml", "118 parameters");
        desk.shows("params diff 1 saved.toml", "");
        ended(&desk.run("params diff 2 saved.toml"), 1, "CAN_ID_RX");
        let load = desk.run("params load 2 saved.toml --yes");
        ended(&load, 1, "2 of them identify the device");
        let check = desk.command("rig check desk.toml").output();
        ended(
            &check.expect("the program"),
            0,
            "drive 2 (202, 182): firmware 472",
        );
        ended(&desk.run("read 3 MODE"), 2, "the rig has no drive 3");
        ended(&desk.run("read 1 SPED_CMD"), 2, "did you mean `SPEED_CMD`?");
        // Where the computer stands still, conversations are flaky or inconclusive.
        let qualified = desk.run("qualify --filter unitek-5.1-too-short");
        let text = said(&qualified);
        let right = matches!(qualified.status.code(), Some(0 | 5)) && text.contains(SAFE);
        assert!(right && !text.contains("failed qualify"), "{text}");
    }
}

/// All that needs no permission is played over each way in, no correct drive is accused, and a changed frame of the record is found.
#[test]
fn scenarios_over_a_pty() {
    scenarios_over(&["pty"]);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn scenarios_over_other_ways_in() {
    scenarios_over(&["slcan", "socketcand"]);
}

fn scenarios_over(ways: &[&str]) {
    for way in ways {
        let desk = Desk::new(way, "");
        let played = desk.run("run --filter unitek --evidence kept");
        let code = played.status.code();
        assert!(matches!(code, Some(0 | 5)), "{way}: {}", said(&played));
        assert!(said(&played).contains(SAFE), "{way}: {}", said(&played));
        let passed = String::from_utf8_lossy(&played.stdout).into_owned();
        let passed = passed.lines().filter(|row| row.starts_with("passed "));
        assert!(passed.count() >= 4, "{way}: {}", said(&played));
        let verify = || desk.command("verify kept").output().expect("the program");
        ended(&verify(), 0, " 0 things wrong");
        let record = desk.path("kept/run.jsonl");
        let text = std::fs::read_to_string(&record).expect("a record");
        let edited = text.replacen("181#1BD80100", "181#1BD90100", 1);
        assert_ne!(text, edited);
        std::fs::write(&record, edited).expect("room");
        crate::edits::fit(&desk.path("kept"));
        assert_ne!(verify().status.code(), Some(0), "{way}");
    }
}

/// Right drives behind an adapter pass all that is played: nothing is inconclusive because frames are late.
#[test]
#[ignore = "takes two minutes; .ci/nightly runs it"]
fn right_drives_pass_a_full_qualification() {
    let limits = "allow_eeprom = true\nallow_bus_settings = true\nallow_other_identifiers = true\n";
    let desk = Desk::new("pty", &format!("{MOTION}{limits}"));
    let output = desk.run("qualify --allow-motion --evidence kept");
    ended(&output, 0, "deviations: none;");
    ended(&output, 0, " 0 failed, 0 inconclusive;");
    let verify = desk.command("verify kept").output().expect("the program");
    ended(&verify, 0, " 0 things wrong");
}

/// An adapter in front of another one that says of itself that it has lost frames; returns its address.
fn losing(adapter: &str) -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let adapter = connect(adapter);
    std::thread::spawn(move || {
        let (client, _) = listener.accept().expect("a client");
        for socket in [&client, &adapter] {
            socket.set_nodelay(true).expect("a socket");
        }
        let (mut to, mut from) = (
            adapter.try_clone().expect("one"),
            client.try_clone().expect("one"),
        );
        std::thread::spawn(move || std::io::copy(&mut from, &mut to));
        let (mut client, lines) = (client, BufReader::new(adapter).split(b'\r'));
        for mut line in lines.map_while(Result::ok) {
            line.push(b'\r');
            if line.starts_with(b"t") {
                line.extend(b"F08\r");
            }
            if client.write_all(&line).is_err() {
                return;
            }
        }
    });
    address
}

/// Frames that an adapter has lost may be replies: neither a pass nor a failure is proven, and the record says so too.
#[test]
#[ignore = "takes some seconds; .ci/nightly runs it"]
fn an_adapter_that_loses_frames_proves_nothing() {
    let desk = Desk::new("slcan", "");
    let rig = desk.path("desk.toml");
    let text = std::fs::read_to_string(&rig).expect("a rig");
    let text = text.replace(&desk.slcan, &losing(&desk.slcan));
    let text = text.replace("patience = \"2s\"", "patience = \"200ms\"");
    std::fs::write(&rig, text).expect("room");
    let played = desk.run("run --filter unitek-app-2-replies --evidence kept");
    ended(&played, 5, "reported without a place");
    let verify = desk.command("verify kept").output().expect("the program");
    ended(&verify, 0, " 0 things wrong");
}

/// What the rig's file does not permit is refused before the first frame of the command, and a speed above the highest too.
#[test]
fn limits_are_kept_before_anything_is_sent() {
    let desk = Desk::new("slcan", "max_speed = \"20%\"\n");
    let line = "write 1 STATUS_MASK=0C SPEED_CMD=10% --move";
    ended(&desk.run(line), 2, "nothing was written: 201#31CD0C");
    desk.shows("read 1 STATUS_MASK", "3000");
    ended(&desk.run("go 1 --move"), 2, "needs `allow_motion`");
    desk.shows("stop 1", "it is locked and coasts");
    ended(
        &desk.run("write 1 CAN_ID_RX=210"),
        2,
        "needs `allow_bus_settings`",
    );
    let desk = Desk::new(
        "socketcand",
        "allow_motion = true\nmax_speed = \"360rpm\"\n",
    );
    ended(
        &desk.run("write 1 SPEED_CMD=11% --move"),
        2,
        "above `max_speed`",
    );
    desk.shows("write 1 SPEED_CMD=10% --move", SAFE);
    ended(
        &desk.run("write 1 TORQUE_SETPOI=10% --move"),
        2,
        "SPEED_LIMIT",
    );
    desk.shows("write 1 SPEED_LIMIT=10% TORQUE_SETPOI=10% --move", SAFE);
}

/// Every signal that ends the program ends a motion in the safe state.
#[test]
fn a_signal_ends_a_motion_in_the_safe_state() {
    let desk = Desk::new("slcan", MOTION);
    for signal in ["-INT", "-TERM", "-HUP", "-QUIT"] {
        let (child, mut rest) = desk.moving();
        let id = child.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status();
        assert!(sent.expect("kill").success());
        let output = child.wait_with_output().expect("its end");
        let mut said = String::new();
        std::io::Read::read_to_string(&mut rest, &mut said).expect("text");
        assert_eq!(output.status.code(), Some(130), "{signal}: {said}");
        assert!(said.contains(SAFE), "{signal}: {said}");
        desk.shows("read 1 MODE", "0004");
    }
}

/// Where the bus is gone, nothing confirms the safe state.
#[test]
fn a_lost_adapter_is_not_safe() {
    let mut desk = Desk::new("slcan", MOTION);
    let (child, mut rest) = desk.moving();
    desk.sim.signal("-KILL");
    desk.sim.code();
    let output = child.wait_with_output().expect("its end");
    let mut said = String::new();
    std::io::Read::read_to_string(&mut rest, &mut said).expect("text");
    assert_eq!(output.status.code(), Some(7), "{said}");
    assert!(said.contains("use the emergency stop"), "{said}");
    ended(&desk.run("read 1 MODE"), 3, "rig desk: ");
}

/// A bench does not send where another master does; one that only listens sends nothing at all.
#[test]
fn another_master_is_left_alone() {
    let desk = Desk::new("socketcand", MOTION);
    let mut other = connect(&desk.slcan);
    other.write_all(b"S6\rO\r").expect("sent");
    let (end, ended_here) = std::sync::mpsc::channel::<()>();
    let talking = std::thread::spawn(move || {
        use std::sync::mpsc::RecvTimeoutError::Timeout;
        let pause = std::time::Duration::from_millis(5);
        while ended_here.recv_timeout(pause) == Err(Timeout) {
            other.write_all(b"t20133D1B00\r").expect("sent");
        }
    });
    ended(
        &desk.run("read 1 MODE"),
        3,
        "another master sends to drive 1 (201#3D1B00)",
    );
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    let text = text.replace("[limits]", "listen_only = true\n[limits]");
    std::fs::write(&path, text).expect("room");
    ended(&desk.run("read 1 MODE"), 2, "listen_only");
    let check = desk.command("rig check desk.toml").output();
    ended(
        &check.expect("the program"),
        0,
        "not asked: the bench only listens",
    );
    drop(end);
    talking.join().expect("the other master");
}

/// The watchdog locks the drives when the program hangs (its output is not read, as when a terminal is held).
#[test]
fn a_program_that_hangs_is_watched() {
    let desk = Desk::new("slcan", MOTION);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig") + "[safe_state]\nwatchdog = \"2s\"\n";
    std::fs::write(&path, text).expect("room");
    desk.shows("write 1 SPEED_CMD=10% --move --hold", "0CCD");
    let line = "watch all all --every 1ms --for 500s --rig desk.toml";
    let mut child = desk.command(line).spawn().expect("the program");
    // Its output is not read, so that the pipe is full soon, if it is not by now.
    let pipe = child.stdout.as_ref().expect("its output");
    let _fuller = rustix::pipe::fcntl_setpipe_size(pipe, 4_096);
    let mut said = String::new();
    let mut err = child.stderr.take().expect("a pipe");
    std::io::Read::read_to_string(&mut err, &mut said).expect("text");
    assert_eq!(child.wait().expect("its end").code(), Some(7), "{said}");
    assert!(said.contains("no sign of life"), "{said}");
    desk.shows("read 1 MODE SPEED_CMD", "0004");
    let commands = desk.run("read 1 SPEED_CMD");
    ended(&commands, 0, "31   SPEED_CMD  0000");
}

/// A signal while drives are asked for the first time ends the program: a motor that was left turning stops, and the drive that does not
/// answer is named.
#[test]
fn a_signal_while_the_bench_is_opened() {
    let desk = Desk::new("slcan", MOTION);
    desk.shows("go 1 --move --hold", "drive 1: released");
    desk.shows("write 1 SPEED_CMD=10% --move --hold", "0CCD");
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    let other = text
        .replace("{ node = 2 }", "{ node = 9 }")
        .replace("2s", "5s");
    std::fs::write(&path, other).expect("room");
    let mut other = connect(&desk.slcan);
    other.write_all(b"S6\rO\r").expect("sent");
    let mut heard = BufReader::new(other.try_clone().expect("a socket"));
    let child = desk
        .heeding("read 1 MODE --rig desk.toml")
        .spawn()
        .expect("the program");
    // The request to the drive that is not there.
    let mut frame = Vec::new();
    while !String::from_utf8_lossy(&frame).contains("t2093") {
        frame.clear();
        heard.read_until(b'\r', &mut frame).expect("a frame");
    }
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-HUP", &id]).status();
    assert!(sent.expect("kill").success());
    let output = child.wait_with_output().expect("its end");
    ended(&output, 7, "interrupted; ");
    ended(&output, 7, "the safe state is NOT confirmed");
    ended(&output, 7, "drive 9");
    std::fs::write(&path, text).expect("room");
    desk.shows("read 1 MODE", "0004");
}

/// Drives behind an adapter are explored: right ones are not accused, whatever the manual leaves open; a wrong one is found.
#[test]
fn drives_behind_an_adapter_are_explored() {
    let run = |desk: &Desk, more: &str| {
        let line = format!("fuzz run --wire-time 6s --allow-motion --out run {more}");
        desk.run(line.trim_end())
    };
    let other = "drive 1 profile fw472\ndrive 2 property cyclic-first = at-once\ndrive 2 property unknown-register = silent\n\
                 drive 2 property stuff = A5\ndrive 2 property reply-delay = 3ms\n";
    let desk = Desk::of("slcan", MOTION, other);
    let right = run(&desk, "--seed 3");
    ended(&right, 0, "0 found, 0 flaky");
    assert!(said(&right).contains(SAFE), "{}", said(&right));
    desk.shows("read 1 VAR1", "0000003E");
    ended(
        &run(&desk, "--deviates 1=no-lock"),
        2,
        "--deviates is for simulated drives",
    );
    let desk = Desk::of(
        "socketcand",
        "",
        "drive 1\ndrive 2 deviates always-four-bytes\n",
    );
    let wrong = run(&desk, "--findings 1");
    ended(&wrong, 1, "1 found, 0 flaky");
    ended(&wrong, 1, "drive 2: ");
    ended(
        &desk.command("verify run").output().expect("the program"),
        5,
        "unconfirmed",
    );
}

/// A run ends after an attempt whose drives are not seen in their safe state: that no further attempt follows is nothing wrong with its evidence.
#[test]
fn evidence_of_a_run_that_ended_without_a_safe_state() {
    let limits = format!("{MOTION}[retry]\nattempts = 3\n");
    let desk = Desk::of("slcan", &limits, "drive 1 deviates no-lock\ndrive 2\n");
    let line = "run unitek-ex-2-lock-stops --rig desk.toml --allow-motion --evidence kept";
    let output = desk.command(line).output().expect("the program");
    ended(&output, 7, "the safe state is NOT confirmed");
    let verify = desk.command("verify kept").output().expect("the program");
    ended(&verify, 0, "1 attempt judged again, 0 things wrong");
}
