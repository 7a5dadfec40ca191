//! The program in a terminal of its own: it shows drives, obeys keys, and leaves the terminal as it was on every way out.

use super::tty::{Seen, Tty};
use crate::ring::Served;
use harness::port::PortAddress;
use harness::top::{Heading, Screen, Top, TopColumn, TopForm};
use rustix::process::{Pid, Signal, kill_process};
use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};

/// A table of any bus.
static FORM: TopForm = TopForm {
    drive: "drive",
    columns: &[TopColumn::numbers("drive", 5), TopColumn::words("state", 5)],
    give_way: &[],
    states: &["error"],
};

/// `setsid` of util-linux makes the terminal the program's own, so that no output goes to the tester's terminal.
pub(crate) fn in_session(program: &Path, arguments: &[&str]) -> Command {
    let known = Command::new("setsid")
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let mut command = match known.is_ok_and(|status| status.success()) {
        true => Command::new("setsid"),
        false => Command::new(program),
    };
    if command.get_program() == "setsid" {
        // Under `nohup` SIGHUP is ignored, also by the programs that it starts.
        let hang_up = ["--ctty", "env", "--default-signal=HUP"];
        command.args(hang_up).arg(program);
    }
    command.args(arguments);
    command
}

fn top(arguments: &[&str]) -> Tty {
    let program = Path::new(env!("CARGO_BIN_EXE_drivebench"));
    let all = [&["top"], arguments].concat();
    Tty::start(in_session(program, &all))
}

/// The page shows this many drives.
fn shows(seen: &Seen, drives: usize) -> bool {
    seen.other_screen && seen.has(&format!("{drives} drives: ")) && seen.has(" quit ")
}

#[track_caller]
pub(super) fn signal(tty: &Tty, signal: Signal) {
    let pid = Pid::from_child(&tty.child);
    kill_process(pid, signal).expect("a process");
}

/// A rig file for a ring that another process serves.
fn desk(served: &Served, folder: &Path) -> String {
    let (transport, port) = match &served.endpoints[0] {
        PortAddress::Pty(path) => ("pty", path.display().to_string()),
        PortAddress::Tcp(address) => ("tcp", address.clone()),
        other => panic!("{other}"),
    };
    let text = format!(
        "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = {}\ntransport = \"{transport}\"\nport = \"{port}\"\nmarks = \"in-band\"\n",
        served.sizes[0]
    );
    let path = folder.join("desk.toml");
    std::fs::write(&path, text).expect("room");
    path.display().to_string()
}

fn top_of(served: &Served, folder: &Path) -> Tty {
    let rig = desk(served, folder);
    let mut command = in_session(
        Path::new(env!("CARGO_BIN_EXE_drivebench")),
        &["top", "--rig", &rig],
    );
    command.env("DRIVEBENCH_STATE", folder.join("state"));
    Tty::start(command)
}

#[test]
fn drives_are_shown_and_keys_obeyed() {
    let mut tty = top(&["--rig", "sim:3", "--every", "100ms"]);
    let seen = tty.see("three drives", |seen| shows(seen, 3));
    assert!(
        seen.has("rig sim:3") && seen.has("1-3 of 3"),
        "{}",
        seen.text()
    );
    assert!(!seen.cursor && tty.is_raw());
    // Time goes on, and so does the line.
    tty.see("traffic", |seen| {
        !seen.has("00:00:00") && !seen.has(" 0 bytes/s")
    });
    tty.keys("e");
    tty.see("no errors", |seen| seen.has("no drive is in error"));
    tty.keys("e/2 go\r");
    tty.see("one drive", |seen| {
        seen.has("1-1 of 1") && seen.has("with `2 go`")
    });
    // A lone escape is a key too, here one that takes the text away.
    tty.keys("/\x1b");
    tty.see("all drives", |seen| seen.has("1-3 of 3"));
    tty.keys("x1\r");
    tty.see("a stop", |seen| {
        seen.has("2 go, 1 stop") && seen.has("drive 1: software stop (ND21 12.6) at 00:")
    });
    tty.keys("?");
    tty.see("the help", |seen| seen.has("any key closes it"));
    tty.keys("x");
    tty.see("the drives", |seen| seen.has("error, status"));
    tty.keys("q");
    assert_eq!(tty.ended().code(), Some(0));
    tty.is_as_before();
}

#[test]
fn escape_quits() {
    let mut tty = top(&[]);
    tty.see("three drives", |seen| shows(seen, 3));
    tty.keys("\x1b");
    assert_eq!(tty.ended().code(), Some(0));
    tty.is_as_before();
}

#[test]
fn every_interruption_leaves_the_terminal_as_it_was() {
    for how in ["key", "SIGINT", "SIGTERM"] {
        let mut tty = top(&["--rig", "sim:2"]);
        tty.see("two drives", |seen| shows(seen, 2));
        match how {
            "key" => tty.keys("\x03"),
            "SIGINT" => signal(&tty, Signal::INT),
            _ => signal(&tty, Signal::TERM),
        }
        assert_eq!(tty.ended().code(), Some(130), "{how}");
        tty.is_as_before();
    }
}

#[test]
fn a_closed_terminal_ends_the_view() {
    let mut tty = top(&["--rig", "sim:2"]);
    tty.see("two drives", |seen| shows(seen, 2));
    tty.close();
    signal(&tty, Signal::HUP);
    assert_eq!(tty.ended().code(), Some(130));
}

#[test]
fn a_rig_with_a_port_is_only_looked_at() {
    let served = Served::start("nd21", &[2], "pty", true, &[]);
    let folder = tempfile::tempdir().expect("a folder");
    let mut tty = top_of(&served, folder.path());
    let seen = tty.see("two drives in error 0504", |seen| {
        shows(seen, 2) && seen.has("2 error")
    });
    assert!(
        seen.has("rig desk") && seen.has("38400 8O1") && seen.has("  504"),
        "{}",
        seen.text()
    );
    // A second process is refused with the holder's name.
    let rig = folder.path().join("desk.toml");
    let other = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["info", "--rig"])
        .arg(&rig)
        .env("DRIVEBENCH_STATE", folder.path().join("state"))
        .output()
        .expect("the program");
    assert_eq!(other.status.code(), Some(75));
    assert!(
        String::from_utf8_lossy(&other.stderr).contains("`top`"),
        "{other:?}"
    );
    tty.keys("q");
    assert_eq!(tty.ended().code(), Some(0));
    let seen = tty.is_as_before();
    // After a normal quit the drives stay as they are, so no safe state is reported.
    assert!(!seen.first.contains("blocked"), "{}", seen.first);
}

/// ND21 9.7: a byte is damaged while the view is on; it names the link, and the ring comes back.
#[test]
fn a_damaged_link_is_named() {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
    let control = free.expect("a port").to_string();
    let served = Served::start("nd21", &[3], "pty", true, &["--control", &control]);
    let folder = tempfile::tempdir().expect("a folder");
    let mut tty = top_of(&served, folder.path());
    tty.see("a sound ring", |seen| {
        shows(seen, 3) && seen.has("disturbed 0") && !seen.has(" 0 telegrams/s")
    });
    let mut control = TcpStream::connect(&control).expect("its control");
    control.write_all(b"! 2->1: flip 1\n").expect("sent");
    tty.see("the link", |seen| {
        seen.has("the link from drive 2 to drive 1 is damaged (ND21 9.7) at 00:")
            && !seen.has("disturbed 0")
            && !seen.has("corrected 0")
            && seen.has("0502 SCIparity")
    });
    tty.keys("q");
    assert_eq!(tty.ended().code(), Some(0));
    tty.is_as_before();
}

#[test]
fn an_interrupted_view_of_a_port_ends_in_the_safe_state() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let folder = tempfile::tempdir().expect("a folder");
    let mut tty = top_of(&served, folder.path());
    tty.see("two drives", |seen| shows(seen, 2));
    signal(&tty, Signal::TERM);
    assert_eq!(tty.ended().code(), Some(130));
    tty.is_as_before();
    // The last of its output may still be on its way.
    tty.see("the safe state", |seen| seen.first.contains("block"));
}

#[test]
fn a_lost_rig_is_told_on_the_first_screen() {
    for transport in ["tcp", "pty"] {
        let mut served = Served::start("nd21", &[2], transport, true, &[]);
        let folder = tempfile::tempdir().expect("a folder");
        let mut tty = top_of(&served, folder.path());
        tty.see("two drives", |seen| shows(seen, 2));
        served.child.kill().expect("a process");
        // It is not known whether its drives stand.
        assert_eq!(tty.ended().code(), Some(7), "{transport}");
        // The last of its output may still be on its way.
        tty.see("the error", |seen| seen.first.contains("error: "));
        tty.is_as_before();
    }
}

#[test]
fn a_panic_leaves_the_terminal_as_it_was_and_its_message_to_be_read() {
    const OWN: &str = "DRIVEBENCH_TEST_PANICS";
    if std::env::var_os(OWN).is_some() {
        // This test again, in a terminal of its own.
        let mut screen = Screen::enter(true).expect("a terminal");
        let mut top = Top::new(Heading {
            rig: "of a test".to_owned(),
            form: &FORM,
            parts: Vec::new(),
        });
        screen.draw(&mut top).expect("drawn");
        panic!("out of order");
    }
    let program = std::env::current_exe().expect("this program");
    let name = "top::terminal::a_panic_leaves_the_terminal_as_it_was_and_its_message_to_be_read";
    let mut again = in_session(&program, &[name, "--exact", "--nocapture"]);
    again.env(OWN, "1");
    let mut tty = Tty::start(again);
    assert_ne!(tty.ended().code(), Some(0));
    let seen = tty.is_as_before();
    assert!(seen.first.contains("out of order"), "{}", seen.first);
}

#[test]
fn without_a_terminal_other_commands_are_named() {
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.arg("top").args(arguments).stdin(Stdio::null());
        command.output().expect("the program")
    };
    let refused = run(&[]);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        said.contains("top --once") && said.contains("watch") && refused.stdout.is_empty(),
        "{said}"
    );
    let never = run(&["--every", "0ms"]);
    assert_eq!(never.status.code(), Some(2));
    let page = run(&["--once", "--rig", "sim:2,1"]);
    assert_eq!(page.status.code(), Some(0));
    let page = String::from_utf8_lossy(&page.stdout).into_owned();
    for words in [
        "rig sim:2,1",
        "ring 2: 1 drive, simulated",
        "3 drives: 3 go",
        "  2:0  go",
    ] {
        assert!(page.contains(words), "{words}: {page}");
    }
    assert!(!page.contains('\x1b'), "{page}");
}
