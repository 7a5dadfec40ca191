//! `drivebench shell --json`: a session that holds a bench, as a program sees it.

use crate::program::{Desk, ended};
use crate::ring::Served;
use harness::port::Endpoint;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Lines, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio};

/// A session that is open.
struct Session {
    child: Child,
    input: Option<ChildStdin>,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Session {
    /// Opens a session and reads its first two lines.
    fn open(desk: &Desk, arguments: &[&str]) -> Self {
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

    fn send(&mut self, line: &[u8]) {
        let input = self.input.as_mut().expect("open");
        input.write_all(line).expect("a reader");
        input.write_all(b"\n").expect("a reader");
    }

    fn next(&mut self) -> Value {
        let line = self.lines.next().expect("a line").expect("text");
        serde_json::from_str(&line).expect("JSON")
    }

    /// The next line that is no event.
    fn answer(&mut self) -> Value {
        loop {
            let line = self.next();
            if line.get("event").is_none() {
                return line;
            }
        }
    }

    fn ask(&mut self, request: &Value) -> Value {
        self.send(request.to_string().as_bytes());
        self.answer()
    }

    /// Ends the input; returns the last line and how the program ended.
    fn end(mut self) -> (Value, Output) {
        drop(self.input.take());
        let last = self.lines.map_while(Result::ok).last().expect("a line");
        let output = self.child.wait_with_output().expect("its end");
        (serde_json::from_str(&last).expect("JSON"), output)
    }
}

fn code(answer: &Value) -> u64 {
    answer["error"]["code"].as_u64().unwrap_or_default()
}

/// A desk at a served ring.
pub(crate) fn at(served: &Served) -> Desk {
    let Endpoint::Tcp(address) = &served.endpoints[0] else {
        panic!("a socket");
    };
    Desk::new(&format!(
        "drives = {}\ntransport = \"tcp\"\nport = \"{address}\"\nmarks = \"in-band\"\ntime_tolerance = \"20ms\"\n",
        served.sizes[0]
    ))
}

#[test]
fn each_line_is_answered() {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let mut session = Session::open(&desk, &["--rig", "sim:3"]);
    let read = session.ask(&json!({"id": 1, "do": "read", "drive": 0, "cells": ["nist"]}));
    assert_eq!(read["id"], 1);
    assert_eq!(read["result"]["values"][0]["unit"], "rpm", "{read}");
    let refused = [
        ("no JSON", "JSON object"),
        ("[1]", "JSON object"),
        (r#"{"do":"info"}"#, "`id`"),
        (r#"{"id":2,"do":"fly"}"#, "fly"),
        (r#"{"id":2,"do":"info","drive":0}"#, "drive"),
        (r#"{"id":2,"do":"read","drive":9,"cells":["nist"]}"#, "9"),
        (r#"{"id":2,"do":"read","drive":0,"cells":["nits"]}"#, "nist"),
        (
            r#"{"id":2,"do":"write","drive":0,"values":["nsoll=1500"]}"#,
            "unit",
        ),
        (r#"{"id":2,"do":"go","drive":0}"#, "--move"),
        (
            r#"{"id":2,"do":"command","words":["run"]}"#,
            "no command of a session",
        ),
        (
            r#"{"id":2,"do":"command","words":["info","0","--rig","sim:4"]}"#,
            "--rig",
        ),
        (r#"{"id":2,"do":"fault","line":"9->8: flip 0"}"#, "9"),
        (r#"{"id":2,"do":"run"}"#, "one of them"),
        (r#"{"id":2,"do":"wait","ms":60001}"#, "60000"),
    ];
    for (line, words) in refused {
        session.send(line.as_bytes());
        let answer = session.answer();
        assert_eq!(code(&answer), 2, "{line}: {answer}");
        let what = answer["error"]["what"].as_str().expect("a sentence");
        assert!(what.contains(words), "{line}: {what}");
    }
    // A line beyond its bound is skipped whole, and the next one is read.
    session.send(&vec![b'{'; 3 << 20]);
    assert_eq!(code(&session.answer()), 2);
    let info = session.ask(&json!({"id": "x", "do": "info"}));
    assert_eq!(
        (&info["id"], &info["result"]["bus"]),
        (&json!("x"), &json!("novobus"))
    );
    let (last, output) = session.end();
    assert_eq!((&last["event"], &last["code"]), (&json!("end"), &json!(0)));
    ended(&output, 0, "");
}

#[test]
fn faults_are_counted_from_now_on() {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let mut session = Session::open(&desk, &["--rig", "sim:3"]);
    session.ask(&json!({"id": 1, "do": "wait", "ms": 100}));
    session.ask(&json!({"id": 2, "do": "fault", "line": "2->1 byte 10: flip 0"}));
    session.send(br#"{"id":3,"do":"wait","ms":100}"#);
    session.send(br#"{"id":4,"do":"read","drive":0,"cells":["nist"]}"#);
    let mut events = String::new();
    loop {
        let line = session.next();
        if line["id"] == 4 {
            break;
        }
        events += &line.to_string();
    }
    assert!(events.contains("drive 1"), "{events}");
    // A scenario would begin without the fault and pass.
    let run = session.ask(&json!({"id": 5, "do": "run", "path": "9.7-parity-error"}));
    assert_eq!(code(&run), 2, "{run}");
}

#[test]
fn scenarios_have_verdicts() {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let mut session = Session::open(&desk, &["--rig", "sim:3"]);
    let run = session.ask(&json!({"id": 1, "do": "run", "path": "9.7-parity-error"}));
    assert_eq!(run["result"]["verdict"], "passed", "{run}");
    let wrong = "title wrong\nring 3\n> 88 FD C0 13 FE D1\n< 88 00 C0 13 99\n";
    let run = session.ask(&json!({"id": 2, "do": "run", "scenario": wrong}));
    assert_eq!(
        (&run["result"]["verdict"], &run["result"]["code"]),
        (&json!("failed"), &json!(1)),
        "{run}"
    );
    assert_eq!(run["result"]["scenarios"][0]["finding"]["line"], 4, "{run}");
    let run = session.ask(&json!({"id": 3, "do": "run", "scenario": "title x\nrung 3\n"}));
    assert_eq!(code(&run), 2, "{run}");
}

/// The motor turns on between requests.
#[test]
fn a_session_holds_the_bench_and_ends_in_the_safe_state() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let mut session = Session::open(&desk, &["--rig", "desk.toml", "--move"]);
    for request in [
        json!({"id": 1, "do": "write", "drive": 0, "values": ["nsoll=200rpm"]}),
        json!({"id": 2, "do": "go", "drive": 0}),
    ] {
        let answer = session.ask(&request);
        assert!(answer.get("result").is_some(), "{answer}");
    }
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let read = session.ask(&json!({"id": 3, "do": "read", "drive": 0, "cells": ["nist"]}));
    let speed = read["result"]["values"][0]["value"]
        .as_f64()
        .expect("a number");
    assert!((speed - 200.0).abs() < 20.0, "{read}");
    // Another program waits in vain, and is told for whom.
    let second = desk.run(&["shell", "--json", "--rig", "desk.toml"]);
    ended(&second, 75, "shell");
    // A stop overtakes what is under way.
    session.send(br#"{"id":4,"do":"wait","ms":60000}"#);
    session.send(br#"{"id":5,"do":"stop"}"#);
    let answers = [session.answer(), session.answer()];
    let of = |id: u64| {
        answers
            .iter()
            .find(|own| own["id"] == id)
            .expect("an answer")
    };
    assert_eq!(code(of(4)), 130, "{answers:?}");
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
    assert!(killed.is_ok_and(|own| own.success()));
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

/// Nothing but lines of the session comes from standard output, whatever a rig says.
#[test]
fn a_rig_that_does_not_open_is_said_in_the_last_line() {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let mut session = Session::start(&desk, &["--rig", "absent"]);
    assert_eq!(session.next()["event"], "hello");
    let (last, output) = session.end();
    assert_eq!((&last["event"], &last["code"]), (&json!("end"), &json!(2)));
    assert!(
        last["what"]
            .as_str()
            .is_some_and(|what| what.contains("absent")),
        "{last}"
    );
    ended(&output, 2, "");
}

/// The package's own tests, with the program of this build.
#[test]
fn the_python_package_works() {
    if !crate::debian::has("python3", "the_python_package_works") {
        return;
    }
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("harness/python");
    let mut child = Command::new("python3")
        .args(["-m", "unittest", "discover", "-s", "tests"])
        .current_dir(folder)
        .env("PYTHONPATH", "src")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("DRIVEBENCH", env!("CARGO_BIN_EXE_drivebench"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("python3");
    let mut said = String::new();
    let read = child
        .stderr
        .take()
        .expect("a pipe")
        .read_to_string(&mut said);
    read.expect("text");
    assert!(child.wait().is_ok_and(|own| own.success()), "{said}");
    // `discover` without tests would pass too.
    assert!(said.contains("Ran 8 tests"), "{said}");
}
