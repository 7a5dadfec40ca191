//! `drivebench sim --bus nordac` as masters of others see it: real sockets, real pseudo terminals, the real program.
//!
//! Every wait has an end that a loaded machine does not reach.

use crate::inverters_on_line::while_the_slave_is_lost;
use crate::serve::{Sim, connect, path};
use std::io::{Read, Write};
use std::process::Command;

/// FDL status of slave 8, and its reply (EN 2).
const STATUS: [u8; 6] = [0x10, 0x08, 0x02, 0x49, 0x53, 0x16];
const PRESENT: [u8; 6] = [0x10, 0x02, 0x08, 0x00, 0x0A, 0x16];

fn start(arguments: &[&str]) -> Sim {
    Sim::start(&[&["--bus", "nordac"], arguments].concat())
}

fn file(name: &str, text: &[u8]) -> String {
    let path = path(name);
    std::fs::write(&path, text).expect("a file");
    path.to_str().expect("text").to_owned()
}

/// A public master, unmodified, over a pseudo terminal: with the GSD of the product it brings the slave into the exchange and turns the motor.
#[test]
fn pyprofibus_turns_the_motor() {
    let Some(python) = crate::python::with("pyprofibus", "PROFIBUS as a public master speaks it")
    else {
        return;
    };
    let gsd = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .arg("gsd")
        .output();
    let gsd = file("nordac.gsd", &gsd.expect("the program").stdout);
    for ppo in 1..=4 {
        let setup = format!(
            "slave 8 ppo {ppo}\nslave 8 parameter 1621 = 2\nslave 8 parameter 1202 = 0.5s\nrate 19.2\n"
        );
        let setup = file(&format!("dp-{ppo}.scn"), setup.as_bytes());
        let terminal = path(&format!("dp-{ppo}"));
        let terminal = terminal.to_str().expect("text");
        let mut sim = start(&["--pty", terminal, "--setup", &setup]);
        let device = sim.address();
        let script = concat!(
            env!("TREE"),
            "/harness/drivebench/tests/served/dp_master.py"
        );
        let mut command = Command::new(&python);
        let output = command
            .args([script, &device, &gsd, &ppo.to_string()])
            .output();
        let output = output.expect("python");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "PPO{ppo}: {said}");
        let told = String::from_utf8_lossy(&output.stdout);
        assert!(told.ends_with("done\n"), "PPO{ppo}: {told}{said}");
    }
}

/// Two masters share the segment: each hears the telegrams of the other and the replies to them. Lines of control act beside them.
#[test]
fn two_masters_share_the_segment() {
    let mut sim = start(&[
        "--slaves",
        "8,9",
        "--tcp",
        "127.0.0.1:0",
        "--tcp",
        "127.0.0.1:0",
        "--control",
        "127.0.0.1:0",
    ]);
    let first = sim.line();
    assert!(
        first.starts_with("master 1: 2 slaves, 500 kbit/s at 127.0.0.1:"),
        "{first}"
    );
    let address = |line: &str| line.rsplit(' ').next().expect("a word").to_owned();
    let mut one = connect(&address(&first));
    let mut two = connect(&address(&sim.line()));
    let mut control = connect(&address(&sim.line()));
    // Both are there when the slave answers both.
    let mut reply = [0; 6];
    two.write_all(&STATUS).expect("a socket");
    two.read_exact(&mut reply).expect("a reply");
    assert_eq!(reply, PRESENT);
    one.write_all(&STATUS).expect("a socket");
    let mut heard = [0; 12];
    two.read_exact(&mut heard).expect("both telegrams");
    assert_eq!(heard, [STATUS, PRESENT].concat()[..]);
    let mut ask = |line: &str| {
        control
            .write_all(format!("{line}\n").as_bytes())
            .expect("a socket");
        let mut answer = String::new();
        let mut byte = [0];
        while !answer.ends_with('\n') {
            control.read_exact(&mut byte).expect("an answer");
            answer.push(char::from(byte[0]));
        }
        answer.trim_end().to_owned()
    };
    assert_eq!(
        ask("state 8"),
        "ok power=on address=8 dp=Wait_Prm state=SD frequency=0"
    );
    assert_eq!(ask("? slave 9 parameter 1621 = 2"), "ok");
    assert!(ask("? slave 9 parameter 1202 = 7").starts_with("no: "));
    assert_eq!(ask("! slave 9: off"), "ok");
    assert!(ask("state 9").starts_with("ok power=off"));
    assert!(ask("state 7").starts_with("error: "));
    assert!(ask("> 10 08 02 49 53 16").starts_with("error: "));
}

/// Options of other buses are refused, and so are addresses that no slave can have.
#[test]
fn options_of_other_buses() {
    for (arguments, expected) in [
        (
            &["--bus", "nordac", "--tcp", "127.0.0.1:0", "--drives", "2"][..],
            "--drives is not for the bus nordac",
        ),
        (
            &[
                "--bus",
                "nordac",
                "--tcp",
                "127.0.0.1:0",
                "--tap",
                "2->1=127.0.0.1:0",
            ],
            "--tap is not for the bus nordac",
        ),
        (
            &["--bus", "unitek", "--slcan", "127.0.0.1:0", "--slaves", "8"],
            "--slaves is not for the bus unitek",
        ),
        (
            &["--drives", "2", "--tcp", "127.0.0.1:0", "--slaves", "8"],
            "--bus nordac expected",
        ),
        (
            &["--bus", "nordac", "--tcp", "127.0.0.1:0", "--slaves", "127"],
            "127",
        ),
        (&["--bus", "nordac", "--tcp", "0.0.0.0:0"], "--allow-remote"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        let output = command
            .arg("sim")
            .args(arguments)
            .output()
            .expect("the program");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

#[path = "../../examples/profibus_master.rs"]
#[expect(dead_code, reason = "a program, of which the test calls one function")]
mod profibus_master;

/// The program of the page on masters, over profirust: it turns the motor. The page shows it as it is.
#[test]
fn profirust_turns_the_motor() {
    let mut sim = start(&["--slaves", "8", "--tcp", "127.0.0.1:0"]);
    let first = sim.line();
    let address = first.rsplit(' ').next().expect("a word");
    let turned = profibus_master::turn(address);
    assert_eq!(turned.expect("it turns"), (0x0F37, 0x2000));
    let page = include_str!("../../../docs/profibus-master.md");
    let program = include_str!("../../examples/profibus_master.rs");
    let shown = page
        .split("```rust\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    assert_eq!(shown, Some(program));
}

/// The bench's own master over a socket and over a pseudo terminal, in real time: start, parameters, on at 50 %, and the ways to stop.
#[test]
fn commands_over_a_line() {
    let setup = "slave 8 parameter 1621 = 2\nslave 8 parameter 1202 = 0.5s\nslave 8 parameter 1203 = 0.5s\nslave 8 parameter 1625 = 5s\n";
    let setup = file("dp-commands.scn", setup.as_bytes());
    let terminal = path("dp-commands");
    let terminal = terminal.to_str().expect("text");
    for place in [["--tcp", "127.0.0.1:0"], ["--pty", terminal]] {
        let mut sim = start(&[&place[..], &["--setup", &setup]].concat());
        let first = sim.line();
        let address = first.rsplit(' ').next().expect("a word");
        let port = match place[0] {
            "--tcp" => format!("tcp = \"{address}\""),
            _ => format!("serial = \"{address}\""),
        };
        let rig = format!(
            "schema = 2\n[rig]\nid = \"dp{}\"\n[port.1]\nbus = \"nordac\"\n{port}\ndrives = [{{ address = 8 }}]\n\
             [limits]\nallow_motion = true\nallow_eeprom = true\nallow_motor_data = true\n",
            place[0]
        );
        let rig = file(&format!("dp{}.toml", place[0]), rig.as_bytes());
        let run = |arguments: &[&str]| {
            let output = while_the_slave_is_lost(|| {
                let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
                let command = command.args(arguments).args(["--rig", &rig]);
                let output = command.env("DRIVEBENCH_STATE", path("dp-state")).output();
                output.expect("the program")
            });
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
            String::from_utf8(output.stdout).expect("text")
        };
        assert!(run(&["start", "8"]).starts_with("slave 8: PPO1 (12 octets)"));
        assert_eq!(
            run(&["write", "8", "1205.3 = 50.0Hz", "--move"]),
            "slave 8: 1205.3 Maximum frequ. = 50.0 Hz\n"
        );
        assert!(run(&["read", "8", "1205.3", "Bus timeout"]).contains("50.0 Hz"));
        let on = run(&["on", "8", "--setpoint", "50%", "--for", "2s", "--move"]);
        let lines: Vec<_> = on.lines().collect();
        assert!(lines[1].ends_with("HIW 2000 (50.0 %)"), "{on}");
        assert!(lines[2].contains("(ready to start"), "{on}");
        assert!(run(&["quick-stop", "8"]).contains("start-disable, OFF3 active"));
        assert!(run(&["info", "8"]).contains("5.0 s"));
    }
}
