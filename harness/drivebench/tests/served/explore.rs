//! Rings behind sockets: a deviating drive is found, confirmed and made small there, and what the rig does not allow never leaves.

use crate::program::{ended, findings, name, said};
use crate::ring::Served;
use harness::explore::RECORD;
use harness::port::PortAddress;
use harness_proto::nd21::ram;
use harness_sim::novobus::reference;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex};

const EVERYTHING: &str = "allow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n";

/// A folder with a rig file for a ring behind a socket.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new(drives: u8, port: &str, limits: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!(
            "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = {drives}\ntransport = \"tcp\"\nport = \"{port}\"\n\
             marks = \"in-band\"\ntime_tolerance = \"40ms\"\n[limits]\n{limits}"
        );
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    /// The same for the rings of a server, whichever they are.
    fn of(served: &Served, limits: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut text = "schema = 1\n[rig]\nid = \"desk\"\n".to_owned();
        for ((number, drives), endpoint) in (1..).zip(&served.sizes).zip(&served.endpoints) {
            let (transport, port) = match endpoint {
                PortAddress::Tcp(place) => ("tcp", place.clone()),
                PortAddress::Pty(path) => ("pty", path.display().to_string()),
                other => panic!("{other}"),
            };
            text.push_str(&format!(
                "[ring.{number}]\ndrives = {drives}\ntransport = \"{transport}\"\nport = \"{port}\"\n\
                 marks = \"in-band\"\ntime_tolerance = \"40ms\"\n"
            ));
        }
        text.push_str(&format!("[limits]\n{limits}"));
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command
            .args(arguments)
            .arg("--rig")
            .arg(self.path("desk.toml"));
        command
            .env("DRIVEBENCH_STATE", self.path("state"))
            .stdin(Stdio::null());
        command.output().expect("the program")
    }
}

fn place(served: &Served) -> String {
    match &served.endpoints[0] {
        PortAddress::Tcp(place) => place.clone(),
        other => panic!("{other}"),
    }
}

/// ND21 9.7: a drive that counts wrongly is found over a socket, seen again, and made small in few runs.
#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn a_deviating_drive_behind_a_socket() {
    let more = ["drive 1 deviates counts-9-zeros"];
    let served = Served::start_with("nd21", &[2], "tcp", true, &[], &more);
    let desk = Desk::new(served.sizes[0], &place(&served), EVERYTHING);
    let out = desk.path("run");
    let output = desk.run(&[
        "fuzz",
        "run",
        "--allow-motion",
        "--seed",
        "3",
        "--findings",
        "1",
        "--wire-time",
        "40s",
        "--out",
        name(&out),
    ]);
    ended(&output, 1, "seen again 2 of");
    ended(&output, 1, "2 drives are stopped, standing and blocked");
    // A busy computer is late now and then: what was flaky is kept too.
    let confirmed = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).expect("a finding");
        text.contains("\"confirmed\": true")
    };
    let found: Vec<_> = findings(&out).into_iter().filter(confirmed).collect();
    assert_eq!(found.len(), 1);
    let output = desk.run(&["shrink", name(&found[0]), "--allow-motion"]);
    ended(&output, 0, "made small there first");
    ended(&output, 0, "(ND21 9.7, error mode)");
}

/// ND21 10.1, 14.2, 14.10.3: what ROM holds, where process data come from, and how fast the EEPROM is: the drive's choice, and no finding.
#[test]
fn what_the_manual_leaves_to_a_drive_is_no_finding() {
    let more = [
        "drive 0..last memory 2F00 = 4E 44 32 31",
        "drive 0..last property eeprom-write-time = 2ms",
        "drive 0..last property self-test-time = 40ms",
        "drive 0..last property read-long = as-printed",
    ];
    let served = Served::start_with("nd21", &[2], "tcp", true, &[], &more);
    let desk = Desk::new(served.sizes[0], &place(&served), EVERYTHING);
    let out = desk.path("run");
    let run = [
        "fuzz",
        "run",
        "--allow-motion",
        "--wire-time",
        "8s",
        "--out",
        name(&out),
    ];
    let output = desk.run(&run);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 5)), "{}", said(&output));
    // More than one case a second: the drives are not reset for each.
    let cases = std::fs::read_to_string(out.join(RECORD)).expect("a record");
    assert!(cases.contains("\"cases\":30,"), "{}", said(&output));
    let output = desk.run(&["run", "12.5-driver-eeprom", "--allow-motion"]);
    assert!(
        !matches!(output.status.code(), Some(1)),
        "{}",
        said(&output)
    );
}

/// Two rings behind ports, and a drive of the second one deviates: it is found there, confirmed, made small, and its scenario runs on
/// the rig. The run is killed on the way (SIGKILL), the next one brings the rings back and goes on.
fn two_rings(transport: &str) {
    let more = ["drive 2:1 deviates counts-9-zeros"];
    let served = Served::start_with("nd21", &[1, 2], transport, true, &[], &more);
    let desk = Desk::of(&served, EVERYTHING);
    let out = desk.path("run");
    let run = ["fuzz", "run", "--allow-motion", "--findings", "1"];
    let begun = ["--seed", "3", "--wire-time", "60s", "--out"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args([&run[..], &begun[..], &[name(&out)]].concat())
        .arg("--rig")
        .arg(desk.path("desk.toml"))
        .env("DRIVEBENCH_STATE", desk.path("state"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program");
    let record = out.join(RECORD);
    let begun = || std::fs::read_to_string(&record).is_ok_and(|text| text.contains("\"cases\":2,"));
    while !begun() && child.try_wait().expect("a process").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().expect("SIGKILL");
    let _gone = child.wait().expect("an end");
    let resume = ["--wire-time", "60s", "--resume", name(&out)];
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command
        .args([&run[..], &resume[..]].concat())
        .env("DRIVEBENCH_STATE", desk.path("state"))
        .stdin(Stdio::null());
    let output = command.output().expect("the program");
    ended(&output, 1, "seen again 2 of");
    ended(&output, 1, "3 drives are stopped, standing and blocked");
    let (finding, path) = findings(&out)
        .iter()
        .map(|path| {
            let text = std::fs::read_to_string(path).expect("a finding");
            (
                serde_json::from_str::<Value>(&text).expect("JSON"),
                path.clone(),
            )
        })
        .find(|(finding, _)| finding["confirmed"] == true)
        .expect("one that was seen again");
    let case = &finding["case"];
    assert_eq!(
        (&case["drives"], &case["beside"]),
        (&json!(2), &json!({"first": 1}))
    );
    assert_eq!(finding["difference"]["ring"], 1);
    let scenario = path.with_extension("scn");
    let output = desk.run(&["run", name(&scenario), "--allow-motion"]);
    // A finding of a moment is one that is late again, or not.
    let code = output.status.code();
    assert!(matches!(code, Some(1 | 5)), "{}", said(&output));
    let output = desk.run(&["shrink", name(&path), "--allow-motion", "--runs", "12"]);
    ended(&output, 0, "ring    1, 2");
    let output = desk.run(&["fuzz", "replay", name(&out), "--wire-time", "2s"]);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1 | 5)), "{}", said(&output));
}

/// Over sockets.
#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn two_rings_behind_sockets() {
    two_rings("tcp");
}

/// Over pseudo-terminals.
#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn two_rings_behind_ptys() {
    two_rings("pty");
}

/// Passes bytes on between a client and a ring, and keeps what the clients send.
fn relay(to: String) -> (String, Arc<Mutex<Vec<u8>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let place = listener.local_addr().expect("an address").to_string();
    let heard = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&heard);
    std::thread::spawn(move || {
        while let Ok((client, _)) = listener.accept() {
            let Ok(ring) = TcpStream::connect(&to) else {
                return;
            };
            for stream in [&client, &ring] {
                stream.set_nodelay(true).expect("a socket");
            }
            let pass =
                |mut from: TcpStream, mut to: TcpStream, kept: Option<Arc<Mutex<Vec<u8>>>>| {
                    std::thread::spawn(move || {
                        let mut bytes = [0; 4096];
                        while let Ok(count @ 1..) = from.read(&mut bytes) {
                            if let Some(kept) = &kept {
                                kept.lock().expect("no panic").extend(&bytes[..count]);
                            }
                            if to.write_all(&bytes[..count]).is_err() {
                                break;
                            }
                        }
                        let _gone = to.shutdown(Shutdown::Both);
                    })
                };
            let copy = |stream: &TcpStream| stream.try_clone().expect("a socket");
            pass(copy(&client), copy(&ring), Some(Arc::clone(&kept)));
            pass(ring, client, None);
        }
    });
    (place, heard)
}

/// The stream with marks as bytes and whether each is good: FF FF is FF, FF 00 x an x with bad parity.
fn unmarked(stream: &[u8]) -> Vec<reference::Cell> {
    let mut cells = Vec::new();
    let mut bytes = stream.iter().copied();
    while let Some(byte) = bytes.next() {
        let (byte, error) = match byte {
            0xFF => match bytes.next() {
                Some(0xFF) | None => (0xFF, false),
                Some(_) => (bytes.next().unwrap_or(0), true),
            },
            other => (other, false),
        };
        cells.push(reference::Cell { byte, error });
    }
    cells
}

/// What the drives of the reference model execute of it, command by command without checking bytes.
fn executed(drives: u8, cells: &[reference::Cell]) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    let mut inbound = cells.to_vec();
    for _ in 0..drives {
        let mut drive = reference::Drive::new();
        let good = |byte| reference::Cell { byte, error: false };
        inbound = inbound
            .iter()
            .filter_map(|cell| drive.receive(*cell))
            .map(good)
            .collect();
        all.extend(drive.take_executed().iter().map(|bytes| bytes.to_vec()));
    }
    all
}

/// On a rig that allows nothing no drive executes anything but reads, stop and block (ND21 14.10), whatever a run makes.
#[test]
fn nothing_that_is_not_allowed_leaves() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let (port, heard) = relay(place(&served));
    let desk = Desk::new(2, &port, "");
    let out = desk.path("run");
    let output = desk.run(&[
        "fuzz",
        "run",
        "--seed",
        "9",
        "--wire-time",
        "12s",
        "--out",
        name(&out),
    ]);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 5)), "{}", said(&output));
    let cells = unmarked(&heard.lock().expect("no panic"));
    let executed = executed(2, &cells);
    let reads = executed
        .iter()
        .filter(|command| matches!(command[0], 0xC0 | 0xC1 | 0xC7))
        .count();
    assert!(reads > 20, "{reads} reads\n{}", said(&output));
    for command in &executed {
        let harmless = match command[..] {
            [0xC0 | 0xC1 | 0xC7, ..] => true,
            // The nominal speed 0; block and stop.
            [0x63, 0, 0, low, high] => u16::from_be_bytes([high, low]) == ram::NSOLL,
            [0x82, 0x81, low, high] => {
                // Stop and block; the EEPROM controller reads.
                [ram::STATUS, ram::EEPROM_CONTROL].contains(&u16::from_be_bytes([high, low]))
            }
            [0xA5, mask, low] => {
                low == ram::STATUS as u8 && mask & !0x81 == 0
                    || low == ram::FLAGS2 as u8 && mask & !0x04 == 0
            }
            [0xA4, 0xFF, low] => low == ram::STATUS as u8,
            // The oscilloscope, the EEPROM controller's buffer and its reading: nothing moves and nothing is kept.
            [0x82 | 0x63, .., low, high] => {
                let cell = u16::from_be_bytes([high, low]);
                let looks = (ram::SCOPE_STATUS..=ram::SCOPE_DELAY).contains(&cell)
                    || (ram::SCOPE_TRIGGER..=ram::SCOPE_SIGNAL2).contains(&cell);
                looks
                    || [ram::EEPROM_BUFFER, ram::EEPROM_BUFFER + 1, ram::DATA_OUT].contains(&cell)
                    || cell == ram::EEPROM_CONTROL && matches!(command[1], 0x81 | 0x10)
            }
            _ => false,
        };
        assert!(harmless, "{command:02X?} was sent");
    }
}
