//! The same view on drives that share a line: CAN and PROFIBUS.

use super::terminal::{in_session, signal};
use super::tty::{Seen, Tty};
use crate::serve::{Sim, connect};
use rustix::process::Signal;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_drivebench");

/// What is to be seen of two simulated drives of a bus.
struct Drives {
    rig: &'static str,
    /// What the drives are called.
    drive: &'static str,
    /// How they are at first.
    states: &'static str,
    /// The second one, and the beginning of its row.
    second: [&'static str; 2],
    /// What its stop shows.
    stopped: [&'static str; 2],
}

const BUSES: [Drives; 2] = [
    Drives {
        rig: "sim:unitek:2",
        drive: "drive",
        states: "2 drives: 2 released",
        second: ["2", "2 yes"],
        stopped: ["2 released", "drive 2: its speed command is 0 at 00:"],
    },
    Drives {
        rig: "sim:nordac:2",
        drive: "slave",
        states: "2 slaves: 2 start-disable",
        second: ["9", "9 PPO1"],
        // NORDAC 3.3: OFF1 with the other bits set ends the start-disable.
        stopped: [
            "1 ready to start, 1 start-disable",
            "slave 9: STW 047E, OFF1: it stops on its ramp at 00:",
        ],
    },
];

fn top(rig: &str) -> Tty {
    Tty::start(in_session(Path::new(PROGRAM), &["top", "--rig", rig]))
}

fn shows(seen: &Seen, words: &str) -> bool {
    seen.other_screen && seen.has(words) && seen.has(" quit ")
}

#[test]
fn every_key_is_obeyed_on_every_bus() {
    for drives in BUSES {
        let mut tty = top(drives.rig);
        let [name, row] = drives.second;
        let seen = tty.see("two drives", |seen| shows(seen, drives.states));
        assert!(!seen.cursor && tty.is_raw());
        tty.see("time and traffic", |seen| {
            !seen.has("00:00:00") && seen.has("s/s, ") && seen.has(" 0 damaged")
        });
        let drive = drives.drive;
        for (keys, words) in [
            (format!("/{row}\r"), "1-1 of 1".to_owned()),
            ("/\x1b".to_owned(), "1-2 of 2".to_owned()),
            ("e".to_owned(), format!("no {drive} is in error")),
            ("e?".to_owned(), "any key closes it".to_owned()),
            ("zp".to_owned(), "paused".to_owned()),
            ("x7\r".to_owned(), format!("no {drive} has this name")),
        ] {
            tty.keys(&keys);
            tty.see(&words, |seen| seen.has(&words));
        }
        tty.keys(&format!("\x7f{name}\r"));
        tty.see("the stop", |seen| {
            drives.stopped.iter().all(|words| seen.has(words)) && !seen.has("paused")
        });
        tty.keys("c");
        tty.see("no message", |seen| !seen.has(drives.stopped[1]));
        tty.keys("q");
        assert_eq!(tty.ended().code(), Some(0), "{}", drives.rig);
        tty.is_as_before();
    }
}

#[test]
fn every_interruption_leaves_the_terminal_as_it_was() {
    for drives in BUSES {
        for how in ["key", "SIGTERM", "closed"] {
            let mut tty = top(drives.rig);
            tty.see("two drives", |seen| shows(seen, drives.states));
            match how {
                "key" => tty.keys("\x03"),
                "SIGTERM" => signal(&tty, Signal::TERM),
                _ => {
                    tty.close();
                    signal(&tty, Signal::HUP);
                }
            }
            assert_eq!(tty.ended().code(), Some(130), "{}: {how}", drives.rig);
            if how != "closed" {
                tty.is_as_before();
            }
        }
    }
}

/// A served bus, the words of its rig's file, what a drive is called, and what a stop shows where the file permits no motion.
const SERVED: [(&[&str], &str, &str, [&str; 2]); 2] = [
    (
        &["--bus", "unitek", "--slcan", "127.0.0.1:0"],
        "bus = \"unitek\"\nrate = 500\ndrives = [{ node = 1 }]\nslcan",
        "drive",
        [
            "1 locked",
            "drive 1: it is locked and coasts: the rig's file permits",
        ],
    ),
    (
        &["--bus", "nordac", "--tcp", "127.0.0.1:0"],
        "bus = \"nordac\"\nrate = 500\ndrives = [{ address = 8, ppo = 1 }]\ntcp",
        "slave",
        [
            "1 ready to start",
            "slave 8: STW 047E, OFF1: it stops on its ramp",
        ],
    ),
];

/// A drive without supply is shown as such while the view goes on. A stop needs no permission, and Ctrl-C takes the rig to its safe state.
#[test]
fn a_silent_drive_does_not_end_the_view_of_a_port() {
    for (served, port, drive, stopped) in SERVED {
        let mut sim = Sim::start(&[served, &["--control", "127.0.0.1:0"]].concat());
        let (place, control) = (sim.address(), sim.address());
        let folder = tempfile::tempdir().expect("a folder");
        let rig = folder.path().join("desk.toml");
        let text = format!("schema = 2\n[rig]\nid = \"desk\"\n[port.1]\n{port} = \"{place}\"\n");
        std::fs::write(&rig, text).expect("room");
        let start = || {
            let rig = rig.display().to_string();
            let mut command = in_session(Path::new(PROGRAM), &["top", "--rig", &rig]);
            command.env("DRIVEBENCH_STATE", folder.path().join("state"));
            Tty::start(command)
        };
        let one = format!("1 {drive}: 1 ");
        let mut tty = start();
        let seen = tty.see("the drive", |seen| shows(seen, &one));
        assert!(
            seen.has("rig desk") && seen.has(&place) && seen.has("500 kbit/s"),
            "{}",
            seen.text()
        );
        let number = if drive == "drive" { 1 } else { 8 };
        let mut control = connect(&control);
        writeln!(control, "! {drive} {number}: off").expect("sent");
        tty.see("its silence", |seen| seen.has("1 not read"));
        writeln!(control, "! {drive} {number}: on").expect("sent");
        tty.see("the drive again", |seen| {
            shows(seen, &one) && !seen.has("1 not read")
        });
        tty.keys("q");
        assert_eq!(tty.ended().code(), Some(0), "{drive}");
        let seen = tty.is_as_before();
        assert!(!seen.first.contains("safe state"), "{}", seen.first);
        let mut tty = start();
        tty.see("the drive", |seen| shows(seen, &one));
        tty.keys("x\r");
        tty.see("the stop", |seen| {
            stopped.iter().all(|words| seen.has(words))
        });
        tty.keys("\x03");
        assert_eq!(tty.ended().code(), Some(130), "{drive}");
        tty.is_as_before();
        tty.see("the safe state", |seen| seen.first.contains("safe state: "));
    }
}

/// Without a terminal that can move its cursor nothing but a refusal is printed, and `--once` prints what it did before there were keys.
#[test]
fn plain_output_has_no_escape_codes() {
    for drives in BUSES {
        let arguments = ["TERM=dumb", PROGRAM, "top", "--rig", drives.rig];
        let mut tty = Tty::start(in_session(Path::new("env"), &arguments));
        assert_eq!(tty.ended().code(), Some(2));
        tty.see("the refusal", |seen| seen.first.contains("top --once"));
        assert!(!tty.written().contains("\x1b[?"), "{}", tty.written());
        for (more, code) in [(&[][..], 2), (&["--once"], 0)] {
            let mut command = Command::new(PROGRAM);
            command.args(["top", "--rig", drives.rig]).args(more);
            let output = command.stdin(Stdio::null()).output().expect("the program");
            let shown = String::from_utf8_lossy(&output.stdout).into_owned();
            assert_eq!(output.status.code(), Some(code), "{shown}");
            assert!(!shown.contains('\x1b'), "{shown}");
            let lines = if code == 0 { 3 } else { 0 };
            assert_eq!(shown.lines().count(), lines, "{shown}");
            assert!(
                shown.is_empty() || shown.starts_with(drives.drive),
                "{shown}"
            );
        }
    }
}
