//! `drivebench shell --json`: a session that holds a bench, as a program sees it.

use crate::program::{Desk, ended};
use crate::ring::Served;
use crate::serve::Sim;
use harness::port::PortAddress;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio};

/// A session that is open.
pub(crate) struct Session {
    pub(crate) child: Child,
    pub(crate) input: Option<ChildStdin>,
    pub(crate) lines: Lines<BufReader<ChildStdout>>,
}

impl Session {
    /// Opens a session and reads its first two lines.
    pub(crate) fn open(desk: &Desk, arguments: &[&str]) -> Self {
        let mut session = Self::start(desk, arguments);
        assert_eq!(session.next()["event"], "hello");
        let ready = session.next();
        assert_eq!(ready["event"], "ready", "{ready}");
        session
    }

    fn start(desk: &Desk, arguments: &[&str]) -> Self {
        let mut command = desk.command(&["shell", "--json"]);
        let mut child = command
            .args(arguments)
            .stdin(Stdio::piped())
            .spawn()
            .expect("the program");
        let output = child.stdout.take().expect("a pipe");
        Self {
            input: child.stdin.take(),
            child,
            lines: BufReader::new(output).lines(),
        }
    }

    pub(crate) fn send(&mut self, line: &[u8]) {
        let input = self.input.as_mut().expect("open");
        input.write_all(line).expect("a reader");
        input.write_all(b"\n").expect("a reader");
    }

    pub(crate) fn next(&mut self) -> Value {
        let line = self.lines.next().expect("a line").expect("text");
        serde_json::from_str(&line).expect("JSON")
    }

    /// The next line that is no event.
    pub(crate) fn answer(&mut self) -> Value {
        loop {
            let line = self.next();
            if line.get("event").is_none() {
                return line;
            }
        }
    }

    /// Lets drive 0 turn, with the requests 1 and 2.
    pub(crate) fn turn_drive_0(&mut self) {
        for request in [
            json!({"id": 1, "do": "write", "drive": 0, "values": ["nsoll=200rpm"]}),
            json!({"id": 2, "do": "go", "drive": 0}),
        ] {
            let answer = self.ask(&request);
            assert!(answer.get("result").is_some(), "{answer}");
        }
    }

    pub(crate) fn ask(&mut self, request: &Value) -> Value {
        self.send(request.to_string().as_bytes());
        self.answer()
    }

    /// The most memory that the program has taken so far, in KiB; `None` when it has ended.
    pub(crate) fn peak(&self) -> Option<u64> {
        let path = format!("/proc/{}/status", self.child.id());
        let text = std::fs::read_to_string(path).ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        line.trim().strip_suffix(" kB")?.parse().ok()
    }

    /// Ends the input; returns the last line and how the program ended.
    pub(crate) fn end(mut self) -> (Value, Output) {
        drop(self.input.take());
        let last = self.lines.map_while(Result::ok).last().expect("a line");
        let output = self.child.wait_with_output().expect("its end");
        (serde_json::from_str(&last).expect("JSON"), output)
    }
}

pub(crate) fn code_of(answer: &Value) -> u64 {
    answer["error"]["code"].as_u64().unwrap_or_default()
}

/// A desk at a served ring.
pub(crate) fn at(served: &Served) -> Desk {
    let PortAddress::Tcp(address) = &served.endpoints[0] else {
        panic!("a socket");
    };
    Desk::new(&format!(
        "drives = {}\ntransport = \"tcp\"\nport = \"{address}\"\nmarks = \"in-band\"\ntime_tolerance = \"20ms\"\n",
        served.sizes[0]
    ))
}

/// The motor turns on between requests.
#[test]
fn a_session_holds_the_bench_and_ends_in_the_safe_state() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let mut session = Session::open(&desk, &["--rig", "desk.toml", "--move"]);
    session.turn_drive_0();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let read = session.ask(&json!({"id": 3, "do": "read", "drive": 0, "cells": ["nist"]}));
    let speed = read["result"]["values"][0]["value"]
        .as_f64()
        .expect("a number");
    assert!((speed - 200.0).abs() < 20.0, "{read}");
    // Another program waits in vain, and is told for whom.
    let second = desk.run(&["shell", "--json", "--rig", "desk.toml"]);
    ended(&second, 75, "shell");
    let last = String::from_utf8_lossy(&second.stdout);
    let last = last.lines().last().expect("a line");
    let last: Value = serde_json::from_str(last).expect("JSON");
    let holder = format!("pid {} ", session.child.id());
    let what = last["what"].as_str().expect("a sentence");
    assert_eq!((&last["event"], &last["code"]), (&json!("end"), &json!(75)));
    assert!(what.contains(&holder), "{what}");
    // A stop overtakes what is under way.
    session.send(br#"{"id":4,"do":"wait","ms":60000}"#);
    session.send(br#"{"id":5,"do":"stop"}"#);
    let answers = [session.answer(), session.answer()];
    let of = |id: u64| {
        answers
            .iter()
            .find(|answer| answer["id"] == id)
            .expect("an answer")
    };
    assert_eq!(code_of(of(4)), 130, "{answers:?}");
    assert!(of(5).get("result").is_some(), "{answers:?}");
    let (last, output) = session.end();
    assert_eq!(last["code"], 0, "{last}");
    assert!(
        last["what"]
            .as_str()
            .is_some_and(|what| what.contains("safe state")),
        "{last}"
    );
    ended(&output, 0, "");
}

#[test]
fn a_signal_ends_a_session_in_the_safe_state() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let mut session = Session::open(&desk, &["--rig", "desk.toml", "--move"]);
    session.ask(&json!({"id": 1, "do": "go", "drive": "all"}));
    let killed = Command::new("kill")
        .args(["-TERM", &session.child.id().to_string()])
        .status();
    assert!(killed.is_ok_and(|status| status.success()));
    let (last, output) = session.end();
    assert_eq!(
        (&last["event"], &last["code"]),
        (&json!("end"), &json!(130))
    );
    assert!(
        last["what"]
            .as_str()
            .is_some_and(|what| what.contains("safe state")),
        "{last}"
    );
    ended(&output, 130, "");
}

/// One word releases drives on every bus; what is a command only is named as one.
#[test]
fn go_is_a_word_of_every_bus() {
    for (rig, drive, key, released) in [
        ("sim:2", 0, "mode", "go"),
        ("sim:unitek:1", 1, "mode", "released"),
        ("sim:nordac", 8, "status", "operation enabled"),
    ] {
        let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
        let mut session = Session::open(&desk, &["--rig", rig, "--move"]);
        let go = session.ask(&json!({"id": 1, "do": "go", "drive": drive}));
        assert!(go.get("result").is_some(), "{rig}: {go}");
        let state = session.ask(&json!({"id": 2, "do": "state", "drive": drive}));
        let value = state["result"]["data"]["drives"][0][key].to_string();
        assert!(
            value.trim_matches('"').starts_with(released),
            "{rig}: {state}"
        );
        let start = session.ask(&json!({"id": 3, "do": "exchange", "drive": drive}));
        let what = start["error"]["what"].as_str().expect("an error");
        assert!(
            what.contains(r#"{"do": "command", "words": ["exchange", ...]}"#),
            "{what}"
        );
        let stop = session.ask(&json!({"id": 4, "do": "stop"}));
        assert!(stop.get("result").is_some(), "{rig}: {stop}");
        session.end();
    }
}

/// A denial is an answer, and the session goes on, where the limits allow some things and not others.
#[test]
fn a_denial_does_not_end_a_session() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    let (rig, _) = text.split_once("[limits]").expect("limits");
    let limited = format!("{rig}[limits]\nallow_motion = true\n");
    std::fs::write(&path, limited).expect("room");
    let mut session = Session::open(&desk, &["--rig", "desk.toml", "--move"]);
    let denied = session.ask(&json!({"id": 1, "do": "write", "drive": 0, "values": ["AnOut=55"]}));
    assert_eq!(code_of(&denied), 2, "{denied}");
    let read = session.ask(&json!({"id": 2, "do": "read", "drive": 0, "cells": ["nist"]}));
    assert_eq!(read["result"]["values"][0]["unit"], "rpm", "{read}");
    let (_, output) = session.end();
    assert_eq!(output.status.code(), Some(0));
}

/// On a rig with a port, times are those of the day, a scenario leaves a mark, and the end of the session writes the file.
#[test]
fn a_capture_of_a_port() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let mut session = Session::open(&desk, &["--rig", "desk.toml"]);
    session.ask(&json!({"id": 1, "do": "capture", "path": "ring.pcapng"}));
    session.ask(&json!({"id": 2, "do": "read", "drive": 0, "cells": ["nist"]}));
    let run = session.ask(&json!({"id": 3, "do": "run", "path": "9.4-process-data-cut"}));
    assert!(run.get("result").is_some(), "{run}");
    let read = session.ask(&json!({"id": 4, "do": "read", "drive": 1, "cells": ["nist"]}));
    assert_eq!(read["result"]["values"][0]["unit"], "rpm", "{read}");
    let (last, _) = session.end();
    assert_eq!(last["code"], 0, "{last}");
    let output = desk.run(&["import", "ring.pcapng"]);
    ended(&output, 5, "scenario 9.4-process-data-cut is lost: ");
    let bytes = std::fs::read(desk.path("ring.pcapng")).expect("a file");
    // The first packet of the file, behind the section and three interfaces of a ring of two drives.
    let mut rest = &bytes[..];
    let word = |block: &[u8], at: usize| {
        u32::from_le_bytes([block[at], block[at + 1], block[at + 2], block[at + 3]])
    };
    while word(rest, 0) != 6 {
        rest = &rest[word(rest, 4) as usize..];
    }
    let nanos = u64::from(word(rest, 12)) << 32 | u64::from(word(rest, 16));
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let now = u64::try_from(now.expect("a time").as_nanos()).expect("a number");
    assert!(
        (now - 600_000_000_000..=now).contains(&nanos),
        "{nanos} {now}"
    );
}

/// Scenarios on drives of the other buses at ports: between them the session reads the drives, and a scenario that is broken off leaves them
/// in their safe state.
#[test]
fn scenarios_on_ports_of_other_buses() {
    let mut can = Sim::start(&["--bus", "unitek", "--slcan", "127.0.0.1:0"]);
    let mut line = Sim::start(&["--bus", "nordac", "--slaves", "8", "--tcp", "127.0.0.1:0"]);
    let limits = "[limits]\nallow_motion = true\nallow_unsupervised = true\n";
    let port = |bus: &str, way: String| {
        format!("schema = 2\n[rig]\nid = \"{bus}\"\n[port.1]\nbus = \"{bus}\"\nrate = 500\n{way}\n")
    };
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let unitek = format!("slcan = \"{}\"\ndrives = [{{ node = 1 }}]", can.address());
    let nordac = format!(
        "tcp = \"{}\"\ndrives = [{{ address = 8, ppo = 1 }}]",
        line.address()
    );
    for (bus, way, drive, cell, scenario, turns) in [
        (
            "unitek",
            unitek,
            "1",
            "SPEED_ACTUAL",
            "unitek-5.1-too-short",
            "bus unitek\ndrive 1\n> 201 31 CD 0C\nwait 60s\n",
        ),
        (
            "nordac",
            nordac,
            "8",
            "HIW",
            "nordac-en-1-whole-telegrams",
            "bus nordac\nslave 8\nslave 8 parameter 1621 = 2\nstart 8\non 8\nexchange 8 HSW=20%\nwait 60s\n",
        ),
    ] {
        let mut text = port(bus, way);
        text += match bus {
            "unitek" => "[limits]\nallow_motion = true\n",
            _ => limits,
        };
        let file = format!("{bus}.toml");
        std::fs::write(desk.path(&file), text).expect("room");
        let mut session = Session::open(&desk, &["--rig", &file, "--move"]);
        let run = session.ask(&json!({"id": 1, "do": "run", "path": scenario}));
        assert_eq!(run["result"]["verdict"], "passed", "{run}");
        let read = session.ask(&json!({"id": 2, "do": "read", "drive": drive, "cells": [cell]}));
        assert!(read.get("result").is_some(), "{read}");
        let other = session.ask(&json!({"id": 3, "do": "run", "path": "9.7-parity-error"}));
        assert_eq!(other["result"]["verdict"], "skipped", "{other}");
        let turns = format!("title turns\n{turns}");
        session.send(
            json!({"id": 4, "do": "run", "scenario": turns})
                .to_string()
                .as_bytes(),
        );
        std::thread::sleep(std::time::Duration::from_secs(3));
        session.send(br#"{"id":5,"do":"cancel","of":4}"#);
        let answers = [session.answer(), session.answer()];
        assert!(
            answers.iter().any(|answer| answer["id"] == 5),
            "{answers:?}"
        );
        let read = session.ask(&json!({"id": 6, "do": "read", "drive": drive, "cells": [cell]}));
        assert!(read.get("result").is_some(), "{read}");
        let (last, output) = session.end();
        assert_eq!(last["code"], 0, "{last}");
        ended(&output, 0, "safe state: ");
    }
}
