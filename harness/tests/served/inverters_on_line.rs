//! Scenarios on NORDAC inverters that another process serves, over a socket, a pseudo terminal and an adapter that hears itself.

use crate::program::{ended, said};
use crate::serve::Sim;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

const SAFE: &str = "safe state: the output of every inverter is off";

/// A served slave, and a folder with a rig file for it.
struct Desk {
    _sim: Sim,
    folder: tempfile::TempDir,
}

impl Desk {
    /// A rig at one of the ways in, with more in its port.
    fn new(way: &str, more: &str) -> Self {
        Self::of(way, more, "slave 8\nslave 8 parameter 1621 = 2\n")
    }

    /// The same with a slave of these header lines.
    fn of(way: &str, more: &str, setup: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let terminal = folder.path().join("terminal");
        let place = match way {
            "pty" => ["--pty", terminal.to_str().expect("text")],
            _ => ["--tcp", "127.0.0.1:0"],
        };
        let header = folder.path().join("setup.scn");
        std::fs::write(&header, setup).expect("room");
        let header = header.to_str().expect("text");
        let served = ["--bus", "nordac", "--setup", header];
        let mut sim = Sim::start(&[&served[..], &place].concat());
        let address = sim.address();
        let port = match way {
            "pty" => format!("serial = \"{address}\""),
            "echo" => format!("tcp = \"{}\"", hears_itself(address)),
            _ => format!("tcp = \"{address}\""),
        };
        let text = format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"nordac\"\n{port}\n{more}patience = \"1s\"\n\
             drives = [{{ address = 8 }}]\n[limits]\nallow_motion = true\nallow_unsupervised = true\n"
        );
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { _sim: sim, folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, line: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command
            .args(line.split(' '))
            .current_dir(self.folder.path())
            .env("DRIVEBENCH_STATE", self.path("state"))
            .stdin(Stdio::null());
        command.output().expect("the program")
    }
}

/// A half-duplex adapter in front of a served line: it gives back what it is sent.
fn hears_itself(line: String) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let own = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        while let Ok((mut bench, _)) = listener.accept() {
            let mut line = TcpStream::connect(&line).expect("it is served");
            let (mut back, mut replies) = (
                bench.try_clone().expect("a socket"),
                line.try_clone().expect("a socket"),
            );
            std::thread::spawn(move || {
                let mut octets = [0; 256];
                while let Ok(count @ 1..) = replies.read(&mut octets) {
                    if back.write_all(&octets[..count]).is_err() {
                        break;
                    }
                }
            });
            let mut octets = [0; 256];
            while let Ok(count @ 1..) = bench.read(&mut octets) {
                if bench.write_all(&octets[..count]).is_err()
                    || line.write_all(&octets[..count]).is_err()
                {
                    break;
                }
            }
            let _closed = line.shutdown(std::net::Shutdown::Both);
        }
    });
    own
}

/// A right slave passes what it is asked over every way in, ends in its safe state, and the record bears the verdicts out.
#[test]
fn scenarios_over_every_way_in() {
    for (way, more) in [("tcp", ""), ("pty", ""), ("echo", "echo = true\n")] {
        let desk = Desk::new(way, more);
        let played = desk.run("run --filter nordac-en-1-s --rig desk.toml --evidence kept");
        let code = played.status.code();
        assert!(matches!(code, Some(0 | 5)), "{way}: {}", said(&played));
        assert!(said(&played).contains(SAFE), "{way}: {}", said(&played));
        let text = String::from_utf8_lossy(&played.stdout).into_owned();
        let passed = text.lines().filter(|own| own.starts_with("passed "));
        assert!(passed.count() >= 3, "{way}: {}", said(&played));
        ended(&desk.run("verify kept"), 0, " 0 things wrong");
        let record = desk.path("kept/run.jsonl");
        let text = std::fs::read_to_string(&record).expect("a record");
        let edited = text.replacen("6805056888826C3C3EF016", "6805056888826C3B3EEF16", 1);
        assert_ne!(text, edited);
        std::fs::write(&record, edited).expect("room");
        crate::edits::fit(&desk.path("kept"));
        assert_ne!(desk.run("verify kept").status.code(), Some(0), "{way}");
    }
}

/// The message about an adapter whose echo is not as the file says names the remedy.
#[test]
fn a_wrong_echo_is_told_with_its_remedy() {
    let heard = Desk::new("echo", "");
    ended(&heard.run("rig check desk.toml"), 3, "set `echo = true`");
    let deaf = Desk::new("tcp", "echo = true\n");
    ended(&deaf.run("rig check desk.toml"), 3, "set `echo = false`");
}

/// Inverters behind an adapter are explored: a right one is not accused, and a finding is made small on the line where it was made.
#[test]
fn inverters_behind_an_adapter_are_explored() {
    let run = |desk: &Desk, time: &str| {
        let more = "--findings 1 --allow-motion --rig desk.toml --out run";
        desk.run(&format!("fuzz run --wire-time {time} {more}"))
    };
    for way in ["tcp", "pty"] {
        let desk = Desk::new(way, "");
        let right = run(&desk, "5s");
        ended(&right, 0, "0 found, 0 flaky");
        assert!(said(&right).contains(SAFE), "{}", said(&right));
    }
    let wrong = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 deviates answers-broadcasts\n";
    let desk = Desk::of("tcp", "", wrong);
    let found = run(&desk, "60s");
    ended(&found, 1, "1 found, 0 flaky");
    let text = said(&found);
    let line = text
        .lines()
        .find_map(|own| own.split_once("drivebench shrink "));
    let (_, finding) = line.expect("a finding");
    let small = desk.run(&format!(
        "shrink {finding} --rig desk.toml --allow-motion --runs 5"
    ));
    ended(&small, 0, "became");
    assert!(said(&small).contains(SAFE), "{}", said(&small));
}
