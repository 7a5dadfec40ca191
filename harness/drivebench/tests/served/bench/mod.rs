//! The bench end to end: a ring that another process serves, the program as a process of its own, and everything that can go
//! wrong between them.

mod commands;
mod taps;
mod ways_out;

use crate::edits::fit;
use crate::program::{ended, said, verify};
use crate::ring::{Served, in_the_end};
use harness::port::PortAddress;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The rig of this command stands without `--rig`.
const CHECK: [&str; 2] = ["rig", "check"];

/// A folder with a rig file, and the folder of locks.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new(drives: u8, transport: &str, port: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let marks = match transport {
            "serial" => "",
            _ => "marks = \"in-band\"\n",
        };
        let text = format!(
            "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = {drives}\ntransport = \"{transport}\"\nport = \"{port}\"\n{marks}\
             time_tolerance = \"20ms\"\n[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n"
        );
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    fn of(served: &Served) -> Self {
        let (transport, port) = match &served.endpoints[0] {
            PortAddress::Pty(path) => ("pty", path.display().to_string()),
            PortAddress::Tcp(address) => ("tcp", address.clone()),
            other => panic!("{other}"),
        };
        Self::new(served.sizes[0], transport, &port)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(arguments);
        if arguments != CHECK {
            command.arg("--rig");
        }
        command.arg(self.path("desk.toml"));
        command.env("DRIVEBENCH_STATE", self.path("state"));
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs it to its end, which must come within bounded time.
    fn run(&self, arguments: &[&str]) -> Output {
        finish(self.command(arguments).spawn().expect("the program"))
    }
}

fn finish(mut child: Child) -> Output {
    let end = Instant::now() + Duration::from_secs(240);
    while child.try_wait().expect("a process").is_none() {
        if Instant::now() > end {
            let _gone = child.kill();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().expect("its output")
}

/// Waits until the first scenario has been played, whatever the machine is busy with: the rig is in use then, and more are to come.
#[track_caller]
fn playing(child: &mut Child) {
    let out = child.stdout.as_mut().expect("its output");
    let mut byte = [0];
    while byte != *b"\n" {
        out.read_exact(&mut byte)
            .expect("a line for the first scenario");
    }
}

fn signal(child: &Child, name: &str) {
    let pid = child.id().to_string();
    let done = Command::new("kill").args([name, &pid]).status();
    assert!(done.expect("kill").success());
}

/// Without resets and writes to the EEPROM, and with one scenario.
#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn a_ring_is_qualified_in_little_time() {
    let served = Served::start("nd21", &[2], "pty", true, &[]);
    let desk = Desk::of(&served);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig file");
    let text = text.replace("allow_reset = true", "allow_reset = false");
    let text = text.replace("allow_eeprom = true", "allow_eeprom = false");
    std::fs::write(&path, text).expect("room");
    is_qualified(&desk, &["9.2-synco", "--allow-motion"]);
}

#[test]
#[ignore = "takes a minute for each transport; .ci/nightly runs it"]
fn a_ring_is_qualified() {
    for transport in ["tcp", "pty"] {
        let served = Served::start("nd21", &[2], transport, true, &[]);
        is_qualified(&Desk::of(&served), &["--allow-motion"]);
    }
}

/// Passes bytes on between a client and a ring, and holds the end of an answer back for 150 ms, behind the end of its conversation.
fn holding_back(to: &str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let place = listener.local_addr().expect("an address").to_string();
    let to = to.to_owned();
    std::thread::spawn(move || {
        while let Ok((client, _)) = listener.accept() {
            let Ok(ring) = TcpStream::connect(&to) else {
                return;
            };
            for stream in [&client, &ring] {
                stream.set_nodelay(true).expect("a socket");
            }
            let copy = |stream: &TcpStream| stream.try_clone().expect("a socket");
            let (sent, into) = (copy(&client), copy(&ring));
            std::thread::spawn(move || pass(sent, into, &[]));
            // ReadByte of FE17, as it comes back (ND21 10.1).
            std::thread::spawn(move || pass(ring, client, &[0xC0, 0x17]));
        }
    });
    place
}

/// Passes bytes on, and waits once, in front of the byte that follows these two.
fn pass(mut from: TcpStream, mut to: TcpStream, mut hold: &[u8]) {
    let mut byte = [0];
    let mut before = Vec::new();
    while let Ok(1) = from.read(&mut byte) {
        if !hold.is_empty() && before.ends_with(hold) {
            std::thread::sleep(Duration::from_millis(150));
            hold = &[];
        }
        before.push(byte[0]);
        if to.write_all(&byte).is_err() {
            return;
        }
    }
    let _gone = to.shutdown(Shutdown::Both);
}

/// Bytes that come behind the end of an attempt are no answers in the next one, which is right.
#[test]
fn late_bytes_are_not_taken_for_those_of_the_next_attempt() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let PortAddress::Tcp(place) = &served.endpoints[0] else {
        panic!("a socket");
    };
    let desk = Desk::new(2, "tcp", &holding_back(place));
    let scenario = desk.path("late.scn");
    let text = "title A cell that nothing else reads\nring 2\n> 80*3\n> 88 FE C0 17 FE D5 80*2\n";
    std::fs::write(&scenario, text).expect("room");
    let path = desk.path("desk.toml");
    let rig = std::fs::read_to_string(&path).expect("a rig file");
    std::fs::write(&path, rig + "[retry]\nattempts = 2\n").expect("room");
    // Where the computer stands still as well, the bytes may come before the end, or the second attempt may not pass.
    let words = "2 attempts: failed, passed";
    let runs = || desk.run(&["run", scenario.to_str().expect("a name")]);
    let mut tries = std::iter::repeat_with(runs).take(4);
    let output = tries.find(|output| said(output).contains(words));
    ended(&output.expect("two attempts"), 5, words);
}

/// A right ring has no deviations, and its evidence is judged again.
fn is_qualified(desk: &Desk, more: &[&str]) {
    let folder = desk.path("evidence");
    let evidence = folder.to_str().expect("a name");
    let output = desk.run(&[&["qualify", "--evidence", evidence], more].concat());
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 5)), "{code:?}: {}", said(&output));
    ended(&output, code.unwrap_or(0), "deviations: n");
    ended(
        &output,
        code.unwrap_or(0),
        "read-long (nd21 10.1): four-data",
    );
    ended(
        &output,
        code.unwrap_or(0),
        "2 drives are stopped, standing and blocked",
    );
    ended(&verify(&folder), 0, "0 things wrong");
    // What was found is made again from the record.
    for (file, from) in [
        ("profile.toml", "four-data"),
        ("deviations.txt", "compared"),
    ] {
        let path = folder.join(file);
        let text = std::fs::read_to_string(&path).expect("a file");
        std::fs::write(&path, text.replace(from, "other")).expect("room");
        fit(&folder);
        ended(&verify(&folder), 1, &format!("{file}, line "));
        std::fs::write(&path, text).expect("room");
    }
    fit(&folder);
    // Another byte in the record is another verdict, and the sums tell of it.
    let record = folder.join("run.jsonl");
    let text = std::fs::read_to_string(&record).expect("a record");
    let at = text.rfind("\"kind\":\"received\"").expect("a byte");
    let byte = text[at..].find("\"byte\":\"").expect("its value") + at + 8;
    let mut changed = text.clone();
    changed.replace_range(byte..byte + 2, "5B");
    std::fs::write(&record, changed).expect("room");
    ended(&verify(&folder), 1, "run.jsonl was changed");
    std::fs::write(&record, &text).expect("room");
    std::fs::write(folder.join("SHA256SUMS"), [0xFF, 0xFE]).expect("room");
    ended(&verify(&folder), 1, "was added");
    // A run that was killed leaves half a line, and no sums.
    std::fs::write(&record, &text[..byte]).expect("room");
    std::fs::remove_file(folder.join("SHA256SUMS")).expect("sums");
    ended(&verify(&folder), 5, "incomplete");
    std::fs::write(&record, "nonsense\n").expect("room");
    ended(&verify(&folder), 2, "line 1, column");
}

/// ND21 9.6: the same over a socket, where the ring is another process.
#[test]
fn a_wrong_drive_behind_a_socket_is_named() {
    let more = ["drive 1 deviates checksum-wrong"];
    let served = Served::start_with("nd21", &[2], "tcp", true, &[], &more);
    let desk = Desk::of(&served);
    let folder = desk.path("evidence");
    let evidence = folder.to_str().expect("a name");
    let output = desk.run(&["qualify", "9.2-synco", "--evidence", evidence]);
    let said = said(&output);
    assert!(said.contains("drive 1: checksum-wrong"), "{said}");
    ended(&verify(&folder), 0, "0 things wrong");
}

#[test]
fn what_is_no_ring_says_so() {
    // No server listens.
    let desk = Desk::new(2, "tcp", "127.0.0.1:1");
    let output = desk.run(&["run"]);
    ended(&output, 3, "failed to connect to 127.0.0.1:1");
    ended(
        &output,
        3,
        "no server listens at this port. Next: start the server",
    );
    // A port that is no tty, a pty where a serial port should be, nothing at all.
    let desk = Desk::new(2, "serial", "/dev/null");
    ended(&desk.run(&["run"]), 3, "is not a serial port");
    let desk = Desk::new(2, "serial", "/dev/there-is-none");
    ended(&desk.run(&["run"]), 3, "there is no port");
    let served = Served::start("plain", &[2], "pty", true, &[]);
    let PortAddress::Pty(path) = &served.endpoints[0] else {
        panic!("a pty");
    };
    let desk = Desk::new(2, "serial", path.to_str().expect("a name"));
    ended(&desk.run(&["run"]), 3, "pseudo terminal");
}

/// More drives than the rig's file states, and fewer.
#[test]
fn a_ring_of_another_size_says_so() {
    for stated in [1, 3] {
        let served = Served::start("plain", &[2], "pty", true, &[]);
        let PortAddress::Pty(path) = &served.endpoints[0] else {
            panic!("a pty");
        };
        let desk = Desk::new(stated, "pty", path.to_str().expect("a name"));
        let words = format!("the ring has 2 drives, the rig's file says {stated}");
        // A computer that stands still hears another cause.
        let mut output = desk.run(&["run"]);
        for _ in 0..4 {
            if said(&output).contains(&words) {
                break;
            }
            output = desk.run(&["run"]);
        }
        ended(&output, 3, &words);
        ended(&output, 3, "with 2 drives set `drives = 2`");
    }
}

#[test]
fn a_silent_or_noisy_port_says_so() {
    // An open ring: nothing comes back.
    let open = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = open.local_addr().expect("an address").to_string();
    let desk = Desk::new(2, "tcp", &address);
    ended(&desk.run(&["run"]), 3, "nothing comes back");
    // Another master talks, or noise.
    let talker = std::thread::spawn(move || {
        // Two connections of the run before, which tried the port with marks and without, and two of the next one.
        for stream in open.incoming().take(4) {
            let mut stream = stream.expect("a bench");
            while stream.write_all(&[0x80, 0x88, 0x55]).is_ok() {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    });
    ended(
        &desk.run(&["run"]),
        3,
        "noise on the cable, or another master",
    );
    talker.join().expect("an end");
}

/// A port whose other end does this with each connection.
fn port_of(other_end: fn(TcpStream)) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            other_end(stream.expect("a bench"));
        }
    });
    address
}

/// What is no ring is named: a port that hears itself, zeros without end, a server that closes.
#[test]
fn what_answers_and_is_no_ring_is_named() {
    let echo = port_of(|mut stream| {
        let mut bytes = [0; 256];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            if stream.write_all(&bytes[..length]).is_err() {
                return;
            }
        }
    });
    let zeros = port_of(|mut stream| {
        while stream.write_all(&[0; 8]).is_ok() {
            std::thread::sleep(Duration::from_millis(2));
        }
    });
    let closed = port_of(drop);
    let closed_later = port_of(|mut stream| {
        stream.write_all(&[0x80; 5]).expect("a bench");
        let _first = stream.read(&mut [0; 1]);
    });
    let cases: [(&str, &[&str]); 4] = [
        (
            &echo,
            &[
                "every byte comes back as it was sent",
                "Next: use an adapter with separate pairs",
            ][..],
        ),
        (
            &zeros,
            &[
                "bytes came although nothing was sent (00 00",
                "drive 0 sends zeros by itself",
                "Next: disconnect drive 0 from the bench",
            ],
        ),
        (
            &closed,
            &[
                "the other end has closed the connection before it sent a byte",
                "Next: check that the server runs",
            ],
        ),
        (
            &closed_later,
            &["after it sent 5 bytes", "Next: check that"],
        ),
    ];
    // Most of it is waiting, so they wait together.
    let check = |(port, words): (&str, &[&str])| {
        let output = Desk::new(3, "tcp", port).run(&["run"]);
        for words in words {
            ended(&output, 3, words);
        }
        let text = said(&output);
        assert!(!text.contains("reports a fault"), "{text}");
    };
    std::thread::scope(|scope| {
        for case in cases {
            scope.spawn(move || check(case));
        }
    });
    // `recover` blames no link of drive 0.
    let output = Desk::new(3, "tcp", &zeros).run(&["recover"]);
    ended(
        &output,
        3,
        "zeros come without end although nothing is sent",
    );
    assert!(!said(&output).contains("spells out"), "{}", said(&output));
}

/// A ring that does not open as its file says: the cause and the remedy are named (ND21 8.3, 9.9).
#[test]
fn a_ring_that_does_not_open_says_why() {
    let edited = |desk: &Desk, from: &str, to: &str| {
        let path = desk.path("desk.toml");
        let text = std::fs::read_to_string(&path).expect("a rig file");
        std::fs::write(&path, text.replace(from, to)).expect("room");
    };
    // The drives are set to half the rate.
    let slow = Served::start_with("nd21", &[3], "tcp", true, &[], &["line 19200"]);
    let desk = Desk::of(&slow);
    ended(&desk.run(&["run"]), 3, "set `line = \"19200 8O1\"`");
    edited(&desk, "drives = 3", "drives = 3\nline = \"19200 8O1\"");
    ended(&in_the_end(0, || desk.run(&["run", "9.2-synco"])), 0, "");
    // Either end alone knows in-band marks.
    let marked = Served::start("nd21", &[3], "tcp", true, &[]);
    let desk = Desk::of(&marked);
    edited(&desk, "marks = \"in-band\"", "");
    ended(&desk.run(&["run"]), 3, "set `marks = \"in-band\"`");
    let plain = Served::start("nd21", &[3], "tcp", false, &[]);
    let desk = Desk::of(&plain);
    ended(&desk.run(&["run"]), 3, "set `marks = \"none\"`");
    // Also where the guard reads the drives when the rig is opened.
    edited(&desk, "allow_monitoring = true", "");
    ended(
        &desk.run(&["run", "--allow-motion"]),
        3,
        "set `marks = \"none\"`",
    );
    edited(&desk, "marks = \"in-band\"", "");
    ended(&in_the_end(0, || desk.run(&["run", "9.2-synco"])), 0, "");
}

#[test]
fn one_at_a_time_and_never_in_quarantine() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = Desk::of(&served);
    let mut first = desk
        .command(&["run", "--allow-motion"])
        .spawn()
        .expect("the program");
    playing(&mut first);
    let busy = desk.run(&["run", "9.2-synco"]);
    ended(&busy, 75, "held by");
    // kill -9: the lock goes with the process, and the ring is brought back by the next.
    signal(&first, "-KILL");
    let _gone = first.wait();
    let output = in_the_end(0, || desk.run(&["run", "8.2-exchange-2", "--allow-motion"]));
    ended(&output, 0, "2 drives are stopped, standing and blocked");
    let path = desk.path("desk.toml");
    let path = path.to_str().expect("a name");
    let mut quarantine = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    quarantine.args(["rig", "quarantine", path, "--reason", "smells of smoke"]);
    quarantine.env("DRIVEBENCH_STATE", desk.path("state"));
    assert!(quarantine.status().expect("the program").success());
    ended(&desk.run(&["run"]), 3, "smells of smoke");
}

#[test]
fn an_interruption_ends_in_the_safe_state() {
    for name in ["-INT", "-TERM"] {
        let served = Served::start("nd21", &[2], "tcp", true, &[]);
        let desk = Desk::of(&served);
        let mut child = desk
            .command(&["run", "--allow-motion"])
            .spawn()
            .expect("the program");
        playing(&mut child);
        signal(&child, name);
        let output = finish(child);
        ended(&output, 130, "2 drives are stopped, standing and blocked");
    }
}

#[test]
fn a_port_that_vanishes_ends_the_run() {
    let mut served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = Desk::of(&served);
    let part = desk.path("part");
    let mut child = desk
        .command(&[
            "run",
            "--allow-motion",
            "--partition",
            "slice:1/2",
            "--evidence",
            part.to_str().expect("a name"),
        ])
        .spawn()
        .expect("the program");
    playing(&mut child);
    let _gone = served.child.kill();
    let output = finish(child);
    ended(&output, 7, "the safe state is NOT confirmed");
    // What is merged of such a part is not safe either, whatever its verdicts are.
    let mut merge = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    merge
        .args(["merge", "--output"])
        .args([desk.path("merged"), part]);
    ended(&merge.output().expect("the program"), 7, "incomplete");
    // As the operating system puts it: bytes were under way or were not.
    let said = said(&output);
    let lost = ["closed the connection", "the port is lost"];
    assert!(lost.iter().any(|words| said.contains(words)), "{said}");
}

/// A command that the rig's file does not permit never reaches the ring, and the message names the missing permission.
#[test]
fn nothing_that_is_not_allowed() {
    let served = Served::start("nd21", &[3], "tcp", true, &[]);
    let desk = Desk::of(&served);
    let text = std::fs::read_to_string(desk.path("desk.toml")).expect("a rig");
    let (text, _) = text.split_once("[limits]").expect("limits");
    std::fs::write(desk.path("desk.toml"), text).expect("room");
    let scenario = desk.path("go.scn");
    let lines = "title x\nsource nd21 14.10\nring 3\nwrite-word 0 nsoll = 0100\n";
    std::fs::write(&scenario, lines).expect("room");
    let output = desk.run(&["run", scenario.to_str().expect("a name"), "--allow-motion"]);
    let said = said(&output);
    assert!(said.contains("allow_motion"), "{said}");
    assert!(!said.contains("1 passed"), "{said}");
    assert!(
        said.contains("3 drives are stopped, standing and blocked"),
        "{said}"
    );
}
