//! RFC 2217 as ser2net (Debian) speaks it: served drives on a pseudo terminal, ser2net in front of them, and the bench behind that.

use crate::inverters_on_line::{Desk, SAFE};
use crate::program::{ended, said};
use crate::ring::Served;
use harness::port::PortAddress;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A process that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _gone = self.0.kill();
        let _gone = self.0.wait();
    }
}

/// ser2net in front of a terminal that is a port of this rate and format, and its address.
fn in_front_of(terminal: &Path, line: &str) -> (Ends, SocketAddr) {
    let free = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = free.local_addr().expect("an address");
    drop(free);
    let folder = tempfile::tempdir().expect("a folder");
    let config = folder.path().join("ser2net.yaml");
    let text = format!(
        "connection: &line\n  accepter: telnet(rfc2217),tcp,127.0.0.1,{}\n  connector: serialdev,{},{line},local\n",
        address.port(),
        terminal.display()
    );
    std::fs::write(&config, text).expect("room");
    let mut command = Command::new("ser2net");
    command.args(["-n", "-d", "-c"]).arg(&config);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let ser2net = Ends(command.spawn().expect("ser2net"));
    let end = Instant::now() + Duration::from_secs(20);
    while TcpStream::connect(address).is_err() {
        assert!(Instant::now() < end, "ser2net does not listen");
        std::thread::sleep(Duration::from_millis(50));
    }
    // ser2net must first notice that the probing connection has closed.
    std::thread::sleep(Duration::from_millis(500));
    (ser2net, address)
}

/// An inverter is read, exchanges, plays a scenario and is made safe over RFC 2217, as over a socket.
#[test]
fn an_inverter_behind_ser2net() {
    if !crate::debian::has("ser2net", "RFC 2217 as it speaks it") {
        return;
    }
    let setup = "slave 8\nslave 8 parameter 1621 = 2\nrate 19.2\n";
    let desk = Desk::of("pty", "rate = 19.2\n", setup);
    let (_ser2net, address) = in_front_of(&desk.path("terminal"), "19200e81");
    let file = desk.path("desk.toml");
    let text = std::fs::read_to_string(&file).expect("a rig");
    let serial = text.lines().find(|line| line.starts_with("serial = "));
    let behind = format!("transport = \"rfc2217\"\nport = \"{address}\"");
    let text = text.replace(serial.expect("a port"), &behind);
    std::fs::write(&file, text).expect("room");
    ended(&desk.run("rig check desk.toml"), 0, "slave 8");
    let read = desk.run("read 8 1202 --rig desk.toml");
    ended(&read, 0, "");
    assert!(said(&read).contains("5.00 s"), "{}", said(&read));
    let moved = desk.run("exchange 8 STW=047E then STW=047F HSW=20% --move --rig desk.toml");
    ended(&moved, 0, "");
    let played = desk.run("run nordac-en-1-start --rig desk.toml");
    assert!(
        matches!(played.status.code(), Some(0 | 5)),
        "{}",
        said(&played)
    );
    assert!(
        said(&played).contains("passed nordac-en-1-start"),
        "{}",
        said(&played)
    );
    assert!(said(&played).contains(SAFE), "{}", said(&played));
}

#[test]
fn a_ring_behind_ser2net() {
    if !crate::debian::has("ser2net", "RFC 2217 as it speaks it") {
        return;
    }
    let served = Served::start("nd21", &[2], "pty", false, &[]);
    let PortAddress::Pty(path) = &served.endpoints[0] else {
        panic!("a pseudo terminal");
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (_ser2net, address) = in_front_of(path, "38400o81");
    let rig = folder.path().join("rig.toml");
    let text = format!(
        "schema = 1\n[rig]\nid = \"behind-ser2net\"\n[ring.1]\ndrives = {}\ntransport = \"rfc2217\"\nport = \"{address}\"\n\
         time_tolerance = \"100ms\"\n[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n",
        served.sizes[0]
    );
    std::fs::write(&rig, text).expect("room");
    let bench = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command
            .args(arguments)
            .env("DRIVEBENCH_STATE", folder.path());
        let output = command.output().expect("the program");
        let said = [&output.stdout[..], &output.stderr[..]].concat();
        (
            output.status.code(),
            String::from_utf8_lossy(&said).into_owned(),
        )
    };
    let name = rig.to_str().expect("a name");
    // The master gives a bus up whose answers are late for too long, and a machine that stands still makes them late (ND21 11.5).
    let mut checks = (0..3).map(|_| bench(&["rig", "check", name]));
    let (_, said) = checks
        .find(|(code, _)| *code == Some(0))
        .expect("drives that answer");
    assert!(said.contains("drive 1: serial 000001"), "{said}");
    let scenarios = ["9.2-synco", "14.10.1-error-mode"];
    let run = [&["run", "--rig", name, "--allow-motion"], &scenarios[..]].concat();
    let (code, said) = bench(&run);
    assert!(matches!(code, Some(0 | 5)), "{code:?}: {said}");
    // A machine that stood still for a while makes a time marginal, which is no fault of ser2net's; every byte is right all the same.
    for scenario in scenarios {
        let right = ["passed", "marginal"].map(|verdict| format!("{verdict} {scenario} "));
        assert!(right.iter().any(|line| said.contains(line)), "{said}");
    }
    assert!(
        said.contains("2 drives are stopped, standing and blocked"),
        "{said}"
    );
}
