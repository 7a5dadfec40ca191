//! Every way out of a command on a rig: signals, a bench that is still being opened, and output that cannot be written.

use super::commands::{SAFE, desk, shows};
use super::{CHECK, Desk, finish, playing, signal};
use crate::program::{ended, said};
use crate::ring::Served;
use harness::port::PortAddress;
use std::io::{BufRead as _, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Turns the motor of drive 0 and leaves it turning.
fn turn(desk: &Desk) {
    shows(desk, "delete-error all --move", "drive 0 is in");
    shows(desk, "go 0 --move --hold", "drive 0 is in go");
    shows(desk, "write 0 nsoll=500rpm --move --hold", "499.88 rpm");
}

/// Changes the rig's file.
fn edit(desk: &Desk, from: &str, to: &str) {
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    assert!(text.contains(from), "{text}");
    std::fs::write(path, text.replace(from, to)).expect("room");
}

/// The program with SIGHUP not ignored, whatever the parent of the tests does.
fn heeding(desk: &Desk, arguments: &[&str]) -> Command {
    let program = desk.command(arguments);
    let mut command = Command::new("env");
    command.arg("--default-signal=HUP");
    command.arg(program.get_program()).args(program.get_args());
    command.env("DRIVEBENCH_STATE", desk.path("state"));
    command.stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Waits until a program handles SIGHUP, so that the signal does not end it.
fn handles_signals(child: &Child) {
    let path = format!("/proc/{}/status", child.id());
    let end = Instant::now() + Duration::from_secs(240);
    loop {
        let text = std::fs::read_to_string(&path).expect("a process");
        let mask = text.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let mask = u64::from_str_radix(mask.expect("a mask").trim(), 16).expect("hexadecimal");
        if mask & 1 == 1 {
            return;
        }
        assert!(!text.contains("State:\tZ"), "it has ended");
        assert!(Instant::now() < end, "it handles no SIGHUP");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A socket between a bench and a served ring. It sends a signal to the program of the receiver when the bench connects, or when the bench
/// has sent this number of bytes.
fn between(served: &Served, bytes: usize, program: Receiver<String>) -> String {
    let PortAddress::Tcp(ring) = served.endpoints[0].clone() else {
        panic!("a socket");
    };
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    std::thread::spawn(move || {
        let (mut bench, _) = listener.accept().expect("the bench");
        let mut ring = TcpStream::connect(ring).expect("the ring");
        bench.set_nodelay(true).expect("a socket");
        ring.set_nodelay(true).expect("a socket");
        let (mut from, mut to) = (
            ring.try_clone().expect("one"),
            bench.try_clone().expect("one"),
        );
        std::thread::spawn(move || std::io::copy(&mut from, &mut to));
        let mut held = Vec::new();
        let mut read = 0;
        let mut piece = [0; 4096];
        // The last piece waits for the signal: what the bench does behind it needs an answer.
        while read < bytes {
            ring.write_all(&held).expect("the ring");
            let count = bench.read(&mut piece).expect("bytes");
            assert_ne!(count, 0, "it has ended after {read} bytes");
            held = piece[..count].to_vec();
            read += count;
        }
        let id = program.recv().expect("its id");
        let sent = Command::new("kill").args(["-HUP", &id]).status();
        assert!(sent.expect("kill").success());
        ring.write_all(&held).expect("the ring");
        let _gone = std::io::copy(&mut bench, &mut ring);
        let _gone = ring.shutdown(std::net::Shutdown::Both);
    });
    address
}

/// A command that is interrupted when it has sent this number of bytes says these words, and the motor stands then.
#[track_caller]
fn interrupted(served: &Served, desk: &Desk, command: &[&str], bytes: usize, words: &str) {
    let (id, program) = channel();
    let address = between(served, bytes, program);
    let PortAddress::Tcp(ring) = &served.endpoints[0] else {
        panic!("a socket");
    };
    edit(desk, ring, &address);
    let child = heeding(desk, command).spawn().expect("the program");
    id.send(child.id().to_string()).expect("the socket waits");
    ended(&finish(child), 130, words);
    edit(desk, &address, ring);
    shows(desk, "watch 0 nist Flags --for 1ms", "nist 0 rpm  Flags");
}

#[test]
fn every_signal_ends_in_the_safe_state() {
    let (_served, desk) = desk(true);
    for name in ["-INT", "-TERM", "-HUP", "-QUIT", "-XCPU", "-USR1", "-TSTP"] {
        turn(&desk);
        let watch = ["watch", "0", "nist", "--for", "100s"];
        let mut child = heeding(&desk, &watch).spawn().expect("the program");
        playing(&mut child);
        signal(&child, name);
        ended(&finish(child), 130, SAFE);
        shows(&desk, "watch 0 nist Flags --for 1ms", "nist 0 rpm  Flags");
    }
}

/// Nothing was sent when the signal came: the motor turns on, and the message says so.
#[test]
fn interrupted_before_the_ports_are_open() {
    let (_served, desk) = desk(true);
    let hook = "[limits]\n";
    let kill = "[hooks.before]\ncommand = [\"sh\", \"-c\", \"kill -HUP $PPID\"]\n[limits]\n";
    edit(&desk, hook, kill);
    let child = heeding(&desk, &["read", "0", "nist"]).spawn();
    let output = finish(child.expect("the program"));
    ended(&output, 130, "interrupted before anything was sent");
    assert!(!said(&output).contains("rpm"), "{}", said(&output));
}

/// Whether the bench listens, or brings the ring back, or asks drives that were left at rest: a motor that was left turning stops.
#[test]
fn interrupted_while_the_rig_is_opened() {
    for (quiet, bytes) in [(false, 1), (true, 1), (true, 0)] {
        let (served, desk) = desk(quiet);
        turn(&desk);
        let words = format!("interrupted; safe state: {SAFE}");
        interrupted(&served, &desk, &["read", "0", "nist"], bytes, &words);
    }
}

/// What plays, explores and measures, and what changes drives.
#[test]
fn every_command_ends_in_the_safe_state() {
    let (served, desk) = desk(true);
    let file = |name: &str| desk.path(name).to_str().expect("a name").to_owned();
    let [kept, found, saved] = ["kept", "found", "saved.toml"].map(file);
    for command in [
        format!("qualify --allow-motion --evidence {kept}"),
        format!("fuzz run --allow-motion --wire-time 100s --out {found}"),
        "scope 0 nist --move".to_owned(),
        format!("params save 0 {saved}"),
        "reset all --move".to_owned(),
    ] {
        turn(&desk);
        let words: Vec<_> = command.split(' ').collect();
        interrupted(&served, &desk, &words, 300, SAFE);
    }
}

#[test]
fn interrupted_while_it_waits_for_the_rig() {
    let (_served, desk) = desk(true);
    let watch = ["watch", "0", "nist", "--for", "100s"];
    let mut holder = desk.command(&watch).spawn().expect("the program");
    playing(&mut holder);
    let wait = ["read", "0", "nist", "--wait-for-rig", "600s"];
    let waiting = heeding(&desk, &wait).spawn().expect("the program");
    handles_signals(&waiting);
    signal(&waiting, "-HUP");
    ended(
        &finish(waiting),
        130,
        "interrupted before anything was sent",
    );
    signal(&holder, "-INT");
    ended(&finish(holder), 130, SAFE);
}

/// `nohup` keeps SIGHUP from the program.
#[test]
fn a_signal_that_the_parent_ignores_is_ignored() {
    let (_served, desk) = desk(true);
    let watch = ["watch", "0", "nist", "--for", "100s"];
    let program = desk.command(&watch);
    let mut command = Command::new("nohup");
    command.arg(program.get_program()).args(program.get_args());
    command.env("DRIVEBENCH_STATE", desk.path("state"));
    command.stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    playing(&mut child);
    signal(&child, "-HUP");
    // Still at work.
    playing(&mut child);
    playing(&mut child);
    signal(&child, "-TERM");
    ended(&finish(child), 130, SAFE);
}

/// A rig without ports has no safe state, but it ends early all the same.
#[test]
fn a_simulated_rig_is_interrupted() {
    let desk = Desk::new(2, "sim", "");
    edit(&desk, "port = \"\"\nmarks = \"in-band\"\n", "");
    edit(&desk, "time_tolerance = \"20ms\"\n", "");
    let evidence = desk.path("evidence");
    let run = [
        "qualify",
        "--allow-motion",
        "--evidence",
        evidence.to_str().expect("a name"),
    ];
    let mut child = desk.command(&run).spawn().expect("the program");
    playing(&mut child);
    signal(&child, "-INT");
    ended(&finish(child), 130, "evidence in");
}

#[test]
fn a_hook_that_fails_shows_in_the_exit_code() {
    let (_served, desk) = desk(true);
    edit(
        &desk,
        "[limits]\n",
        "[hooks.after]\ncommand = [\"false\"]\n[limits]\n",
    );
    for command in [
        &["read", "0", "nist"][..],
        &["recover"],
        &CHECK,
        &["run", "9.2-synco"],
    ] {
        ended(&desk.run(command), 3, "`false` failed");
    }
}

/// A drive's `ps_v0` after a reset is its maximum speed (ND21 13.1.4), which a rig with `max_speed` does not let be written back.
#[test]
fn a_positioning_ends_under_a_maximum_speed() {
    let (_served, desk) = desk(true);
    edit(&desk, "[limits]\n", "[limits]\nmax_speed = \"300rpm\"\n");
    shows(&desk, "delete-error all --move", "drive 0 is in");
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    let position = "position 0 --by 1turns --init --speed 100rpm --move";
    let output = desk.run(&position.split(' ').collect::<Vec<_>>());
    ended(&output, 0, "drive 0 stands at");
    ended(&output, 0, "ps_v0 stays at");
    ended(&output, 0, SAFE);
}

/// A referencing run is allowed where `ps_v0` and its own speeds are (ND21 13.1.4): `--speed` is for it, too.
#[test]
fn a_referencing_run_ends_under_a_maximum_speed() {
    let cam = ["drive 0 cam GPIN4 1turns..1.5turns"];
    let served = Served::start_with("nd21", &[2], "tcp", true, &[], &cam);
    let desk = Desk::of(&served);
    edit(
        &desk,
        "[limits]\n",
        "[health]\nquiet = true\n[limits]\nmax_speed = \"300rpm\"\n",
    );
    shows(&desk, "delete-error all --move", "drive 0 is in");
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    let position = "position 0 --reference --to 1turns --speed 100rpm --move";
    let output = desk.run(&position.split(' ').collect::<Vec<_>>());
    ended(&output, 0, "drive 0 stands at");
    ended(&output, 0, "a referencing run (RefV1 200.01 rpm,");
    ended(&output, 0, SAFE);
}

/// The cause of an early end is reported once, and so is whether the drives stand.
#[test]
fn a_positioning_that_is_interrupted_ends_in_the_safe_state() {
    let (_served, desk) = desk(true);
    shows(&desk, "delete-error all --move", "drive 0 is in");
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    let position = "position 0 --by 1000turns --init --speed 10rpm --move";
    let words: Vec<_> = position.split(' ').collect();
    let mut child = desk.command(&words).spawn().expect("the program");
    let mut said = std::io::BufReader::new(child.stderr.take().expect("its messages"));
    let mut text = String::new();
    while !text.contains("will turn") {
        let read = said.read_line(&mut text).expect("a line");
        assert_ne!(read, 0, "{text}");
    }
    signal(&child, "-INT");
    said.read_to_string(&mut text).expect("its messages");
    assert_eq!(child.wait().expect("an end").code(), Some(130), "{text}");
    assert!(text.contains(SAFE), "{text}");
    assert!(!text.contains("could not be stopped"), "{text}");
}

/// The guard denies what a scenario needs: what is missing in the rig's file is named. For a scenario that was named itself this is wrong usage;
/// one of a folder is skipped.
#[test]
fn a_denied_scenario_is_not_played() {
    let (_served, desk) = desk(false);
    edit(&desk, "allow_motion = true", "allow_motion = false");
    let path = desk.path("denied.scn");
    for line in [
        "master write-word 0 nsoll = 100rpm",
        "write-word 0 nsoll = 100rpm",
        "drive 0 memory FF6C = 01 00",
    ] {
        let text = format!("title Denied\nring 2\n{line}\n> 80\n");
        std::fs::write(&path, text).expect("room");
        let output = desk.run(&["run", path.to_str().expect("a name")]);
        ended(&output, 2, "needs `allow_motion` in the rig's [limits]");
        ended(&output, 2, "1 skipped");
    }
    let folder = desk.path("");
    let output = desk.run(&["run", folder.to_str().expect("a name")]);
    ended(&output, 5, "needs `allow_motion` in the rig's [limits]");
}

/// `ulimit -f 0` lets every write to a file fail, as a full disk does.
#[test]
fn a_full_disk_is_the_benchs_fault() {
    let desk = Desk::new(2, "sim", "");
    edit(&desk, "port = \"\"\nmarks = \"in-band\"\n", "");
    edit(&desk, "time_tolerance = \"20ms\"\n", "");
    for command in [
        "run 9.2-synco --rig desk.toml --evidence evidence",
        "qualify --filter 9.2-synco --rig desk.toml --evidence evidence",
        "run 9.2-synco --junit junit.xml",
        "run 9.2-synco --html page.html",
        "trace 9.2-synco --format vcd --output trace.vcd",
        "fuzz run --seed 5 --cases 10 --out found",
        "campaign 9.6-single-bits --html page.html",
        "params save 0 drive.toml",
        "scope 0 nist --csv recording.csv",
        "man pages",
    ] {
        let fresh = tempfile::tempdir_in(desk.path("")).expect("a folder");
        std::fs::copy(desk.path("desk.toml"), fresh.path().join("desk.toml")).expect("room");
        std::fs::create_dir(fresh.path().join("pages")).expect("room");
        let mut full = Command::new("sh");
        full.args(["-c", "ulimit -f 0; exec \"$0\" \"$@\""]);
        full.arg(env!("CARGO_BIN_EXE_drivebench"))
            .args(command.split(' '));
        full.current_dir(fresh.path()).stdin(Stdio::null());
        let output = full.output().expect("a shell");
        let text = format!("{command}: {}", said(&output));
        assert_eq!(output.status.code(), Some(3), "{text}");
        assert!(text.contains("File too large"), "{text}");
    }
}

/// The longest run that the rig's file allows ends what is being done, wherever that stands, with the drives in their safe state.
#[test]
fn the_longest_run_ends() {
    let (_served, desk) = desk(true);
    turn(&desk);
    edit(&desk, "[limits]\n", "[limits]\nmax_run = \"2s\"\n");
    let scenario = desk.path("long.scn");
    let name = scenario.to_str().expect("a name");
    let text = "title long\nring 2\nread-byte 0 nist\nwait 600s\nread-byte 0 nist\n";
    std::fs::write(&scenario, text).expect("room");
    let kept = desk.path("kept");
    let folder = kept.to_str().expect("a name");
    for arguments in [
        &["run", name][..],
        &["run", name, "9.2-synco", "--evidence", folder],
        &["watch", "0", "nist", "--every", "100ms"],
    ] {
        let output = desk.run(arguments);
        ended(&output, 6, "`max_run` of the rig's file is over");
        ended(&output, 6, SAFE);
    }
    let program = env!("CARGO_BIN_EXE_drivebench");
    let verified = Command::new(program).args(["verify", folder]).output();
    let verified = verified.expect("the program");
    assert_eq!(verified.status.code(), Some(5), "incomplete");
}
