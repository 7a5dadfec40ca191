//! Captures of long sessions on simulated drives: what they need of memory and of the disk.

use crate::program::{Desk, ended};
use crate::session::{Session, code_of};
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

/// Bytes that a ring of three drives carries in a minute of virtual time at full traffic, on four links.
const BYTES_A_MINUTE: u64 = 4 * 60 * 38_400 / 11;

fn desk() -> Desk {
    Desk::new("drives = 3\ntransport = \"sim\"\n")
}

fn done(session: &mut Session, request: &Value) -> Value {
    let answer = session.ask(request);
    assert!(answer.get("result").is_some(), "{answer}");
    answer["result"].clone()
}

/// Without a capture nothing is kept of what the links carry; with one its file grows, and memory does not. A record of two minutes would
/// have 26 MiB.
#[test]
fn a_long_session_needs_no_memory() {
    let desk = desk();
    let mut session = Session::open(&desk, &["--rig", "sim:3"]);
    let wait = json!({"id": 1, "do": "wait", "ms": 60_000});
    done(&mut session, &json!({"id": 1, "do": "info"}));
    let before = session.peak().expect("a process");
    done(&mut session, &wait);
    done(&mut session, &wait);
    let more = session.peak().expect("a process") - before;
    assert!(more < 8 << 10, "{more} KiB more");
    done(
        &mut session,
        &json!({"id": 1, "do": "capture", "path": "long.pcapng"}),
    );
    let size = |desk: &Desk| std::fs::metadata(desk.path("long.pcapng")).map(|file| file.len());
    let mut sizes = vec![size(&desk).expect("a file")];
    for _ in 0..2 {
        done(&mut session, &wait);
        sizes.push(size(&desk).expect("a file"));
    }
    assert!(sizes.is_sorted_by(|size, next| size + 40 * BYTES_A_MINUTE < *next));
    let more = session.peak().expect("a process") - before;
    assert!(more < 16 << 10, "{more} KiB more");
    let captured = done(&mut session, &json!({"id": 1, "do": "capture-end"}));
    let packets = captured["packets"].as_u64().expect("a number");
    let expected = 2 * BYTES_A_MINUTE;
    assert!(
        (expected - 10..=expected + 10).contains(&packets),
        "{packets}, not {expected}"
    );
    let (last, _) = session.end();
    assert_eq!(last["code"], 0, "{last}");
}

/// The file of a capture on a full disk is whole as far as it goes, and the session says so at once and at the end.
#[test]
fn a_capture_on_a_full_disk() {
    let desk = desk();
    let session = desk.command(&["shell", "--json", "--rig", "sim:3"]);
    let mut command = std::process::Command::new("sh");
    command.args(["-c", "ulimit -f 1000; exec \"$@\"", "sh"]);
    command.arg(session.get_program()).args(session.get_args());
    command.current_dir(desk.path(""));
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let output = child.stdout.take().expect("a pipe");
    let mut session = Session {
        input: child.stdin.take(),
        child,
        lines: BufReader::new(output).lines(),
    };
    done(
        &mut session,
        &json!({"id": 1, "do": "capture", "path": "full.pcapng"}),
    );
    session.send(br#"{"id":2,"do":"wait","ms":6000}"#);
    let event = session.next();
    assert_eq!(event["event"], "bus", "{event}");
    let what = event["what"].as_str().expect("a sentence");
    assert!(
        what.starts_with("the capture takes nothing more: "),
        "{what}"
    );
    // The session goes on.
    assert_eq!(session.next()["id"], 2);
    let ended_by = session.ask(&json!({"id": 3, "do": "capture-end"}));
    assert_eq!(code_of(&ended_by), 3, "{ended_by}");
    session.end();
    let length = std::fs::metadata(desk.path("full.pcapng"))
        .expect("a file")
        .len();
    assert!((400_000..=512_000).contains(&length), "{length}");
    ended(
        &desk.run(&["import", "full.pcapng"]),
        0,
        "10000 bytes on 4 links",
    );
}
