//! Scenarios on NORDAC inverters that another process serves, over a socket, a pseudo terminal and an adapter that hears itself.

use crate::program::{ended, said};
use crate::serve::Sim;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(crate) const SAFE: &str = "safe state: the output of every inverter is off";

/// A computer that stands still for longer than the rig's patience, 1 s, loses the slave: the command is then given again, five times at most.
pub(crate) fn while_the_slave_is_lost(mut run: impl FnMut() -> Output) -> Output {
    let is_lost = |output: &Output| {
        let said = said(output);
        let lost = ["left the exchange, or answers no more", "does not start"];
        lost.iter().any(|lost| said.contains(lost)) && output.status.code() != Some(7)
    };
    let mut output = run();
    for _ in 0..5 {
        if !is_lost(&output) {
            break;
        }
        output = run();
    }
    output
}

/// A served slave, and a folder with a rig file for it.
pub(crate) struct Desk {
    _sim: Sim,
    folder: tempfile::TempDir,
}

impl Desk {
    /// A rig at one of the ways in, with more in its port.
    pub(crate) fn new(way: &str, more: &str) -> Self {
        Self::of(way, more, "slave 8\nslave 8 parameter 1621 = 2\n")
    }

    /// The same with a slave of these header lines.
    pub(crate) fn of(way: &str, more: &str, setup: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let terminal = folder.path().join("terminal");
        let place = match way {
            "pty" => ["--pty", terminal.to_str().expect("text")],
            _ => ["--tcp", "127.0.0.1:0"],
        };
        let header = folder.path().join("setup.scn");
        std::fs::write(&header, setup).expect("room");
        let header = header.to_str().expect("text");
        let served = ["--bus", "nordac", "--setup", header];
        let mut sim = Sim::start(&[&served[..], &place].concat());
        let address = sim.address();
        let port = match way {
            "pty" => format!("serial = \"{address}\""),
            "echo" => format!("tcp = \"{}\"", hears_itself(address)),
            _ => format!("tcp = \"{address}\""),
        };
        let text = format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"nordac\"\n{port}\n{more}patience = \"1s\"\n\
             drives = [{{ address = 8 }}]\n[limits]\nallow_motion = true\nallow_unsupervised = true\n"
        );
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { _sim: sim, folder }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Permits more in the rig's file, where `[limits]` stands last.
    fn permit(&self, more: &[&str]) {
        let path = self.path("desk.toml");
        let mut text = std::fs::read_to_string(&path).expect("a rig");
        for limit in more {
            text += &format!("allow_{limit} = true\n");
        }
        std::fs::write(&path, text).expect("room");
    }

    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command
            .args(line.split(' '))
            .current_dir(self.folder.path())
            .env("DRIVEBENCH_STATE", self.path("state"))
            .stdin(Stdio::null());
        command
    }

    pub(crate) fn run(&self, line: &str) -> Output {
        while_the_slave_is_lost(|| self.command(line).output().expect("the program"))
    }

    /// Turns the motor, and goes on until it is ended. Returns when it turns.
    pub(crate) fn hold(&self) -> (Child, BufReader<std::process::ChildStderr>) {
        let line = "exchange 8 STW=047E then STW=047F HSW=20% --hold --move --rig desk.toml";
        let mut command = self.command(line);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program");
        let mut err = BufReader::new(child.stderr.take().expect("a pipe"));
        let mut said = String::new();
        while !said.contains("held:") {
            let count = err.read_line(&mut said).expect("a line");
            assert_ne!(count, 0, "{said}");
        }
        (child, err)
    }

    /// Asks until an answer holds a text.
    pub(crate) fn shows(&self, line: &str, text: &str) {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let output = self.run(line);
            if String::from_utf8_lossy(&output.stdout).contains(text) {
                return;
            }
            assert!(Instant::now() < end, "{text}: {}", said(&output));
        }
    }
}

/// A half-duplex adapter in front of a served line: it gives back what it is sent.
fn hears_itself(line: String) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        while let Ok((mut bench, _)) = listener.accept() {
            let mut line = TcpStream::connect(&line).expect("it is served");
            let (mut back, mut replies) = (
                bench.try_clone().expect("a socket"),
                line.try_clone().expect("a socket"),
            );
            std::thread::spawn(move || {
                let mut octets = [0; 256];
                while let Ok(count @ 1..) = replies.read(&mut octets) {
                    if back.write_all(&octets[..count]).is_err() {
                        break;
                    }
                }
            });
            let mut octets = [0; 256];
            while let Ok(count @ 1..) = bench.read(&mut octets) {
                if bench.write_all(&octets[..count]).is_err()
                    || line.write_all(&octets[..count]).is_err()
                {
                    break;
                }
            }
            let _closed = line.shutdown(std::net::Shutdown::Both);
        }
    });
    address
}

/// A right slave passes what it is asked over every way in, ends in its safe state, and the record bears the verdicts out.
#[test]
fn scenarios_over_a_pty() {
    scenarios_over(&[("pty", "")]);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn scenarios_over_other_ways_in() {
    scenarios_over(&[("tcp", ""), ("echo", "echo = true\n")]);
}

fn scenarios_over(ways: &[(&str, &str)]) {
    for &(way, more) in ways {
        let desk = Desk::new(way, more);
        let played = desk.run("run --filter nordac-en-1-sd --rig desk.toml --evidence kept");
        let code = played.status.code();
        assert!(matches!(code, Some(0 | 5)), "{way}: {}", said(&played));
        assert!(said(&played).contains(SAFE), "{way}: {}", said(&played));
        let text = String::from_utf8_lossy(&played.stdout).into_owned();
        let passed = text.lines().filter(|row| row.starts_with("passed "));
        assert!(passed.count() >= 2, "{way}: {}", said(&played));
        ended(&desk.run("verify kept"), 0, " 0 things wrong");
        let record = desk.path("kept/run.jsonl");
        let text = std::fs::read_to_string(&record).expect("a record");
        let edited = text.replacen("6805056888826C3C3EF016", "6805056888826C3B3EEF16", 1);
        assert_ne!(text, edited);
        std::fs::write(&record, edited).expect("room");
        crate::edits::fit(&desk.path("kept"));
        assert_ne!(desk.run("verify kept").status.code(), Some(0), "{way}");
    }
}

/// The message about an adapter whose echo is not as the file says names the remedy.
#[test]
fn a_wrong_echo_is_told_with_its_remedy() {
    let heard = Desk::new("echo", "");
    ended(&heard.run("rig check desk.toml"), 3, "set `echo = true`");
    let deaf = Desk::new("tcp", "echo = true\n");
    ended(&deaf.run("rig check desk.toml"), 3, "set `echo = false`");
}

/// Inverters behind an adapter are explored: a right one is not accused, and a finding is made small on the line where it was made.
#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn inverters_behind_an_adapter_are_explored() {
    right_ones_are_explored(&["tcp", "pty"], "5s");
    let wrong = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 deviates answers-broadcasts\n";
    let desk = Desk::of("tcp", "", wrong);
    let found = explore(&desk, "60s");
    ended(&found, 1, "1 found, 0 flaky");
    let text = said(&found);
    let line = text
        .lines()
        .find_map(|row| row.split_once("drivebench shrink "));
    let (_, finding) = line.expect("a finding");
    let small = desk.run(&format!(
        "shrink {finding} --rig desk.toml --allow-motion --runs 5"
    ));
    ended(&small, 0, "became");
    assert!(said(&small).contains(SAFE), "{}", said(&small));
}

fn explore(desk: &Desk, time: &str) -> Output {
    let more = "--findings 1 --allow-motion --rig desk.toml --out run";
    desk.run(&format!("fuzz run --wire-time {time} {more}"))
}

fn right_ones_are_explored(ways: &[&str], time: &str) {
    for way in ways {
        let desk = Desk::new(way, "");
        let right = explore(&desk, time);
        ended(&right, 0, "0 found, 0 flaky");
        assert!(said(&right).contains(SAFE), "{}", said(&right));
    }
}

const SUPERVISED: &str = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 parameter 1625 = 2s\n";

/// Words are held until Ctrl-C, which stops the motor. Meanwhile another bench is refused, and told who holds the rig. Where the program dies,
/// the bus time-out (1625) stops the motor.
#[test]
fn held_words_end_with_the_program() {
    // The time-out is none that a busy computer exceeds between two commands.
    let desk = Desk::of("tcp", "", &SUPERVISED.replace("2s", "60s"));
    let (mut child, mut err) = desk.hold();
    ended(&desk.run("info --rig desk.toml"), 75, "held by");
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status();
    assert!(sent.expect("kill").success());
    let mut said = String::new();
    err.read_to_string(&mut said).expect("text");
    let code = child.wait().expect("its end").code();
    assert!(code == Some(130) && said.contains(SAFE), "{code:?}: {said}");
    desk.shows("read 8 ZSW --rig desk.toml", "start-disable");
    let desk = Desk::of("tcp", "", SUPERVISED);
    let (mut child, _err) = desk.hold();
    child.kill().expect("a process");
    child.wait().expect("its end");
    desk.shows("read 8 1800 --rig desk.toml", "time-out");
}

/// The watchdog ends a program that hangs, and the motor does not go on turning (its output is not read, as when a terminal is held).
#[test]
fn a_program_that_hangs_is_watched() {
    let desk = Desk::of("pty", "", SUPERVISED);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig") + "[safe_state]\nwatchdog = \"2s\"\n";
    std::fs::write(&path, text).expect("room");
    let mut line = "exchange 8 STW=047E".to_owned();
    line.push_str(&" then STW=047F HSW=20%".repeat(200));
    line.push_str(" --move --rig desk.toml");
    let output = while_the_slave_is_lost(|| {
        let mut command = desk.command(&line);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program");
        let pipe = child.stdout.take().expect("its output");
        rustix::pipe::fcntl_setpipe_size(&pipe, 4_096).expect("a small pipe");
        child.wait_with_output().expect("its end")
    });
    ended(&output, 7, "no sign of life");
    // The DP watchdog of the slave (1 s) was faster: it takes no words any more, and the bus time-out (1625) has stopped the motor.
    desk.shows("read 8 ZSW --rig desk.toml", "fault");
}

/// A served inverter is qualified: it is not blamed, the value of an open point is found, and the record bears both out.
#[test]
fn a_served_inverter_is_qualified() {
    let desk = Desk::of(
        "tcp",
        "",
        "slave 8\nslave 8 property description-error-order = task-first\n",
    );
    let output = desk.run("qualify --filter nordac-en-1-start --rig desk.toml --evidence kept");
    assert!(
        matches!(output.status.code(), Some(0 | 5)),
        "{}",
        said(&output)
    );
    let kept = |file: &str| std::fs::read_to_string(desk.path("kept").join(file)).expect("a file");
    let (profile, deviations) = (kept("profile.toml"), kept("deviations.txt"));
    assert!(
        profile.contains("slave 8 property description-error-order = task-first"),
        "{profile}"
    );
    assert!(deviations.starts_with("deviations: no"), "{deviations}");
    ended(&desk.run("verify kept"), 0, " 0 things wrong");
}

/// Settings of the bus that were switched for a scenario are set back, also after a signal. Behind a run that was killed, the next one says
/// which command does it.
#[test]
fn switched_settings_are_set_back_after_a_signal() {
    switched_settings_are_set_back("-INT");
    switched_settings_are_set_back("-KILL");
}

fn switched_settings_are_set_back(signal: &str) {
    let desk = Desk::of("tcp", "", "slave 8\nslave 8 parameter 1621 = 2\n");
    desk.permit(&["eeprom", "bus_settings"]);
    let local =
        "title Local\nsource nordac 2.5.1\nbus nordac\nslave 8\nstart 8\nexchange 8 -> ZSW=09xx\n";
    std::fs::write(desk.path("local.scn"), local).expect("room");
    ended(
        &desk.run("run local.scn --rig desk.toml --allow-motion"),
        0,
        "1 passed",
    );
    desk.shows("read 8 1621 --rig desk.toml", "  2 ");
    std::fs::write(desk.path("local.scn"), local.to_owned() + "wait 100s\n").expect("room");
    let mut command = desk.command("run local.scn --rig desk.toml --allow-motion --evidence kept");
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let end = Instant::now() + Duration::from_secs(60);
    // The wait has begun when the record has the reply of the scenario, behind what switches the settings.
    while !desk.path("state/desk.left").exists()
        || !std::fs::read_to_string(desk.path("kept/run.jsonl"))
            .is_ok_and(|record| record.contains("0970"))
    {
        assert!(Instant::now() < end, "the scenario does not begin");
        std::thread::sleep(Duration::from_millis(50));
    }
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &id])
            .status()
            .expect("kill")
            .success()
    );
    let output = child.wait_with_output().expect("its end");
    if signal == "-KILL" {
        let next = said(&desk.run("run nordac-en-1-start --rig desk.toml"));
        assert!(
            next.contains("the run before ended without putting back"),
            "{next}"
        );
        let command = next
            .split('`')
            .find(|word| word.starts_with("drivebench write 8 "));
        let command = command.expect("what puts it back");
        let program = env!("CARGO_BIN_EXE_drivebench");
        let mut shell = Command::new("sh");
        shell.args(["-c", &command.replacen("drivebench", program, 1)]);
        let shell = shell
            .current_dir(desk.folder.path())
            .env("DRIVEBENCH_STATE", desk.path("state"));
        ended(&shell.output().expect("sh"), 0, "");
        desk.shows("read 8 1621 --rig desk.toml", "  2 ");
        return;
    }
    assert_eq!(output.status.code(), Some(130), "{}", said(&output));
    assert!(said(&output).contains(SAFE), "{}", said(&output));
    desk.shows("read 8 1621 --rig desk.toml", "  2 ");
}

/// A right slave behind a socket is not blamed for the pauses that its server makes behind a telegram, nor for a fault that another scenario has
/// left (3.3): without leave to acknowledge one, such a scenario is not begun; with leave, the fault is acknowledged.
#[test]
fn a_fault_and_a_pause_accuse_no_slave() {
    let desk = Desk::new("tcp", "");
    desk.permit(&["eeprom", "motor_data"]);
    let pause = desk.run("run --rig desk.toml nordac-en-1-too-long");
    // The server parts the octets, and a right slave answers the first ones.
    ended(&pause, 0, "passed nordac-en-1-too-long");
    let both = "nordac-open-timeout-exactly-expires nordac-open-zsw8-always";
    let denied = desk.run(&format!("run --rig desk.toml {both}"));
    ended(&denied, 2, "it leaves slave 8 with a fault");
    let faulted = desk.run("exchange 8 STW=047E then STW=0477 --move --rig desk.toml");
    ended(&faulted, 0, "");
    let played = desk.run(&format!("run --rig desk.toml --allow-motion {both}"));
    let said = said(&played);
    assert!(said.contains("passed nordac-open-zsw8-always"), "{said}");
    assert!(!said.contains("failed nordac"), "{said}");
}

/// A right slave fails no scenario where the rig permits everything but the EEPROM: what needs it is skipped, and says so. A scenario that is
/// named is the user's mistake then.
#[test]
fn without_the_eeprom_no_scenario_fails() {
    let desk = Desk::new("tcp", "");
    desk.permit(&["bus_settings", "motor_data", "other_stations"]);
    let played = desk.run("run --filter nordac-3.3-transition --rig desk.toml --allow-motion");
    let text = said(&played);
    let verdicts = |verdict: &str| {
        let named = format!("{verdict} nordac-3.3-transition");
        text.lines().filter(|row| row.starts_with(&named)).count()
    };
    assert_eq!(verdicts("failed"), 0, "{text}");
    assert!(verdicts("passed") > 0, "{text}");
    // A computer that stands still makes an attempt inconclusive.
    let code = match verdicts("inconclusive") {
        0 => 0,
        _ => 5,
    };
    let denied = "needs `allow_eeprom` in the rig's [limits]";
    let denials = text.lines().filter(|row| row.contains(denied)).count();
    assert!(denials > 0, "{text}");
    let more = format!("`allow_eeprom` in [limits] ({denials})");
    ended(&played, code, &more);
    ended(&played, code, SAFE);
    let named = desk.run("run nordac-3.3-transition-9-10 --rig desk.toml --allow-motion");
    ended(&named, 2, denied);
}
