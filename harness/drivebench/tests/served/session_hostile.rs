//! `drivebench shell --json` with clients that send nonsense, read nothing, or are gone.

use crate::program::{Desk, ended, said};
use crate::ring::Served;
use crate::session::{Session, at, code_of};
use serde_json::json;
use std::io::Write;
use std::process::Output;
use std::time::{Duration, Instant};

/// How much more memory a session may take for a hostile client, in KiB: a line of 1 MiB some times over, and what may be unread.
const MORE: u64 = 48 << 10;

fn desk() -> Desk {
    Desk::new("drives = 3\ntransport = \"sim\"\n")
}

/// What a session on a ring of two drives says at its end, where the motor of one turned.
#[track_caller]
fn ended_safe(output: &Output) {
    ended(output, 3, "the client reads no answers any more");
    let said = said(output);
    assert!(said.contains("safe state"), "{said}");
}

#[test]
fn lines_of_nonsense() {
    let desk = desk();
    let mut session = Session::open(&desk, &["--rig", "sim:3"]);
    let before = session.peak().expect("a process");
    let mut random = 1_u32;
    let noise = std::iter::repeat_with(|| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 24) as u8
    });
    let noise: Vec<u8> = noise.filter(|byte| *byte != b'\n').take(5_000).collect();
    let deep = |open: &str, close: &str| {
        let [open, close] = [open, close].map(|part| part.repeat(100_000));
        format!(r#"{{"id":1,"do":"cancel","of":{open}0{close}}}"#).into_bytes()
    };
    let named = |name: &[u8]| [br#"{"id":1,"do":""#, name, br#""}"#].concat();
    let lines = [
        noise,
        vec![0],
        vec![0; 5_000],
        named(b"in\0fo"),
        named(b"info\xFF\xFE"),
        b"\xEF\xBB\xBF{\"id\":1,\"do\":\"info\"}".to_vec(),
        vec![b'['; 500_000],
        deep("[", "]"),
        deep("{\"a\":", "}"),
        br#"{"id":[1],"do":"info"}"#.to_vec(),
        br#"{"id":1e999,"do":"info"}"#.to_vec(),
        br#"{"id":1,"id":2,"do":"info","do":"end","drive":0}"#.to_vec(),
        format!(r#"{{"id":"{}","do":"info"}}"#, "i".repeat(300)).into_bytes(),
        named(&vec![b'x'; 900_000]),
        vec![b'{'; 50 << 20],
    ];
    for line in lines {
        session.send(&line);
        let answer = session.answer();
        let start = String::from_utf8_lossy(&line[..line.len().min(40)]).into_owned();
        assert_eq!(code_of(&answer), 2, "{start}");
        let what = answer["error"]["what"].as_str().expect("a sentence");
        assert!((1..70_000).contains(&what.len()), "{start}: {}", what.len());
        let info = session.ask(&json!({"id": "next", "do": "info"}));
        assert_eq!(info["id"], "next", "{start}: {info}");
    }
    let more = session.peak().expect("a process") - before;
    assert!(more < MORE, "{more} KiB more");
    let (last, output) = session.end();
    assert_eq!(last["code"], 0, "{last}");
    ended(&output, 0, "");
}

/// A client that sends and reads nothing is lost after a bounded number of answers, and of bytes.
#[test]
fn a_client_that_reads_nothing() {
    let short = r#"{"id":1,"do":"info"}"#.to_owned();
    let long = format!(r#"{{"id":1,"do":"{}"}}"#, "x".repeat(60_000));
    for line in [short, long] {
        let desk = desk();
        let mut session = Session::open(&desk, &["--rig", "sim:3"]);
        let before = session.peak().expect("a process");
        let mut last = before;
        let mut input = session.input.take().expect("open");
        for sent in 0.. {
            assert!(sent < 1_000_000, "the session never ends");
            last = session.peak().unwrap_or(last);
            if writeln!(input, "{line}").is_err() {
                break;
            }
        }
        assert!(last - before < MORE, "{} KiB more", last - before);
        let output = session.child.wait_with_output().expect("its end");
        ended(&output, 3, "the client reads no answers any more");
    }
}

/// With a port: what is under way ends, and the motor with it. So it does when the client is gone, whatever its input does.
#[test]
fn a_lost_client_ends_what_is_under_way() {
    for reads in [false, true] {
        let served = Served::start("nd21", &[2], "tcp", true, &[]);
        let desk = at(&served);
        let mut session = Session::open(&desk, &["--rig", "desk.toml", "--move"]);
        session.turn_drive_0();
        let began = Instant::now();
        session.send(br#"{"id":3,"do":"wait","ms":60000}"#);
        let mut input = session.input.take().expect("open");
        if reads {
            // Its input stays open, as where another program has it too.
            drop(session.lines);
        } else {
            while writeln!(input, "nonsense").is_ok() {}
        }
        let output = session.child.wait_with_output().expect("its end");
        assert!(began.elapsed() < Duration::from_secs(50), "it has waited");
        ended_safe(&output);
        let state = desk.run(&["info", "0", "--rig", "desk.toml"]);
        ended(&state, 0, "");
        let state = said(&state);
        assert!(!state.contains(" go"), "{state}");
    }
}
