//! RFC 2217 as ser2net (Debian) speaks it: a served ring on a pseudo terminal, ser2net in front of it, and the bench behind that.

use crate::ring::Served;
use harness::port::PortAddress;
use std::net::{TcpListener, TcpStream};
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
    let free = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = free.local_addr().expect("an address");
    drop(free);
    let config = folder.path().join("ser2net.yaml");
    let text = format!(
        "connection: &ring\n  accepter: telnet(rfc2217),tcp,127.0.0.1,{}\n  connector: serialdev,{},38400o81,local\n",
        address.port(),
        path.display()
    );
    std::fs::write(&config, text).expect("room");
    let mut command = Command::new("ser2net");
    command.args(["-n", "-d", "-c"]).arg(&config);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let _ser2net = Ends(command.spawn().expect("ser2net"));
    let end = Instant::now() + Duration::from_secs(20);
    while TcpStream::connect(address).is_err() {
        assert!(Instant::now() < end, "ser2net does not listen");
        std::thread::sleep(Duration::from_millis(50));
    }
    // ser2net must first notice that the probing connection has closed.
    std::thread::sleep(Duration::from_millis(500));
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
