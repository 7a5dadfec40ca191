//! The commands on drives, on a ring that another process serves: one process a command, as a person types them.

use super::{CHECK, Desk, finish, playing, signal};
use crate::program::{ended, said};
use crate::ring::{Served, in_the_end};
use harness::port::PortAddress;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) const SAFE: &str = "2 drives are stopped, standing and blocked";

pub(crate) fn desk(quiet: bool) -> (Served, Desk) {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = Desk::of(&served);
    if quiet {
        let path = desk.path("desk.toml");
        let text = std::fs::read_to_string(&path).expect("a rig");
        let text = text.replace("[limits]", "[health]\nquiet = true\n[limits]");
        std::fs::write(path, text).expect("room");
    }
    (served, desk)
}

/// The command goes well and says this. Behind a standstill of the computer the bench recovers the ring, and its drives are in error
/// (ND21 9.8): then the errors are confirmed, and it is given again.
#[track_caller]
pub(crate) fn shows(desk: &Desk, command: &str, words: &str) {
    let arguments: Vec<_> = command.split(' ').collect();
    let mut output = desk.run(&arguments);
    for _ in 1..4 {
        let text = said(&output);
        if text.contains(words) || !text.contains("error 0504") {
            break;
        }
        let _confirmed = desk.run(&["delete-error", "all", "--move"]);
        output = desk.run(&arguments);
    }
    ended(&output, 0, words);
}

/// What only looks leaves drives as they are; what changes them ends in the safe state (ND21 11.8).
#[test]
fn every_command_on_a_ring_behind_a_port() {
    let (_served, desk) = desk(false);
    shows(&desk, "read all nist Status", "0 rpm");
    let look = desk.run(&["read", "0", "Status"]);
    assert!(!said(&look).contains("safe state"), "{}", said(&look));
    shows(&desk, "info", "2 drives on the bus");
    ended(&desk.run(&["go", "0"]), 2, "add --move");
    // The zeros of the check sequence put drives in error (9.8), and what may move confirms it.
    shows(
        &desk,
        "go 0 --move",
        "error 0504 (ND21 9.8); the error was confirmed",
    );
    shows(&desk, "go 0 --move", "drive 0 is in go");
    shows(&desk, "go 0 --move", SAFE);
    // The command says how a drive stays in go, and what that costs.
    shows(&desk, "go 0 --move", "add --hold to leave the drives in go");
    shows(&desk, "block 0", "drive 0 is in");
    let blocked = desk.run(&["position", "0", "--by", "2turns", "--init", "--move"]);
    ended(&blocked, 1, "`drivebench go 0 --move --hold`");
    ended(&blocked, 1, "without supervision");
    let kept = desk.run(&["go", "0", "--move", "--hold"]);
    ended(&kept, 0, "drive 0 is in go");
    assert!(!said(&kept).contains("add --hold"), "{}", said(&kept));
    shows(&desk, "position 0 --by 2turns --init --move", "stands at");
    shows(&desk, "write 0 nsoll=0rpm --move", "nsoll: 0000");
    // Behind a reset the guard knows no more where drives are; the next telegram passes all the same (9.8, 10.5).
    shows(&desk, "reset 0..1 --move", "drive 1 is in go");
    shows(&desk, "stop all", "drive 1 is in");
    shows(&desk, "block 0", "drive 0 is in");
    ended(&desk.run(&["delete-error", "all"]), 2, "add --move");
    shows(&desk, "delete-error all --move", "drive 1 is in block");
    shows(&desk, "recover", "2 drives answered");
    shows(&desk, "scope 0 nist", "recorded at once");
    shows(&desk, "watch 0 nist --for 50ms --every 10ms", "nist 0 rpm");
    let file = desk.path("drive.toml");
    let file = file.to_str().expect("a name");
    shows(
        &desk,
        &format!("params save 0 {file}"),
        "32 parameters saved",
    );
    shows(&desk, &format!("params diff 0 {file}"), "are equal");
}

/// Drives that monitor time-outs from power-up (ND21 14.10.2) miss their master between two commands. Every command brings them back,
/// and none takes that for a fault of a link (9.9).
#[test]
fn drives_that_monitor_time_outs_do_not_lock_the_bench_out() {
    let lines = ["drive 0..last eeprom 47 = 80"];
    let served = Served::start_with("nd21", &[3], "tcp", true, &[], &lines);
    let desk = Desk::of(&served);
    for _ in 0..2 {
        let recovered = desk.run(&["recover"]);
        ended(&recovered, 0, "3 drives answer");
        let text = said(&recovered);
        assert!(!text.contains("the fault is in front of it"), "{text}");
        shows(&desk, "info", "3 drives on the bus");
        shows(&desk, "stop all", "drive 2 is in");
        // A busy computer leaves the drives without bytes for more than their 10 ms again and again (ND21 9.9).
        let arguments = ["reset", "all", "--move"];
        let mut resets = std::iter::repeat_with(|| desk.run(&arguments)).take(4);
        let back = resets.find(|output| !said(output).contains("does not answer after its reset"));
        ended(&back.expect("an answer"), 0, "drive 2 is in go");
    }
}

/// A ring that was left at rest is opened without a zero, and a motor that was left turning turns on.
#[test]
fn quietly_from_command_to_command() {
    let (_served, desk) = desk(true);
    shows(&desk, "delete-error all --move", "drive 0 is in go");
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    let write = "write 0 nsoll=500rpm --move --hold";
    shows(&desk, write, "075F (499.88 rpm)");
    std::thread::sleep(std::time::Duration::from_millis(700));
    shows(&desk, "read 0 nist", "499.88 rpm");
    // A killed process leaves no valid mark of a ring at rest, so the next command opens the ring with zeros.
    let mut watch = desk
        .command(&["watch", "0", "nist", "--for", "30s"])
        .spawn()
        .expect("the program");
    playing(&mut watch);
    signal(&watch, "-KILL");
    let _gone = watch.wait();
    shows(&desk, "read 0 Status", "error 0504 (ND21 9.8)");
}

#[test]
fn an_interrupted_command_ends_in_the_safe_state() {
    let (mut served, desk) = desk(true);
    shows(&desk, "delete-error all --move", "drive 0 is in go");
    shows(&desk, "write 0 nsoll=500rpm --move --hold", "499.88 rpm");
    let files = ["w.csv", "w.html", "w.svg"].map(|name| desk.path(name));
    let watch = || {
        let arguments = "watch 0 nist --for 30s --csv w.csv --html w.html --svg w.svg";
        let arguments: Vec<_> = arguments.split(' ').collect();
        let mut command = desk.command(&arguments);
        command.current_dir(desk.folder.path());
        let mut child = command.spawn().expect("the program");
        playing(&mut child);
        child
    };
    // What was read until then is in the files, and nothing lies beside them.
    let kept = || {
        let [csv, html, svg] = files.each_ref().map(|file| {
            let text = std::fs::read_to_string(file).expect("a file");
            std::fs::remove_file(file).expect("a file");
            text
        });
        assert!(
            csv.starts_with("time_ms,0 nist [rpm]\n0.") && csv.contains(",499."),
            "{csv}"
        );
        assert!(csv.ends_with('\n'), "{csv}");
        let samples = format!("0 nist [rpm]: {} sample", csv.lines().count() - 1);
        assert!(
            html.contains(&samples) && svg.contains(&samples),
            "{samples}"
        );
        let folder = std::fs::read_dir(desk.folder.path()).expect("a folder");
        let part = folder.filter_map(Result::ok).find(|entry| {
            let name = entry.file_name();
            name.to_string_lossy().ends_with(".part")
        });
        assert!(part.is_none(), "{part:?}");
    };
    let child = watch();
    // A second process is refused with the holder's name.
    ended(&desk.run(&["read", "0", "nist"]), 75, "held by");
    signal(&child, "-INT");
    ended(&finish(child), 130, SAFE);
    kept();
    // Its motor stands now.
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    shows(&desk, "write 0 nsoll=500rpm --move --hold", "499.88 rpm");
    std::thread::sleep(std::time::Duration::from_millis(700));
    let child = watch();
    let _gone = served.child.kill();
    ended(&finish(child), 7, "the safe state is NOT confirmed");
    kept();
}

/// `rig check` reports the rig's state and every difference from its file.
#[test]
fn a_rig_is_checked() {
    let (_served, desk) = desk(false);
    let path = desk.path("desk.toml");
    let name = path.to_str().expect("a name");
    let check = |more: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(["rig", "check", name]).args(more);
        command.env("DRIVEBENCH_STATE", desk.path("state"));
        command.output().expect("the program")
    };
    let output = check(&[]);
    ended(
        &output,
        0,
        "a byte takes 0.573 ms round the ring (ND21 8.2)",
    );
    let rate = "SYNCO without a gap comes back at 38400 bit/s";
    ended(&output, 0, rate);
    ended(&output, 0, "drive 1: serial 000001");
    let output = check(&["--format", "json"]);
    let figures: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let ring = &figures["rings"][0];
    let middle = ring["middle_ms"].as_f64().expect("a time");
    assert!((0.5..50.0).contains(&middle), "{ring}");
    assert_eq!(ring["lost"], 0);
    assert_eq!(figures["drives"][1]["serial_number"], 1);
    let text = std::fs::read_to_string(&path).expect("a rig");
    let other = text.clone() + "[[drive]]\naddress = 1\nserial = \"4711\"\n";
    std::fs::write(&path, other).expect("room");
    ended(&check(&[]), 3, "the rig's file says 4711");
    std::fs::write(&path, text.replace("drives = 2", "drives = 3")).expect("room");
    ended(&check(&[]), 3, "the ring has 2 drives");
}

/// Nothing that the rig's file does not allow, whatever the command line says.
#[test]
fn the_rigs_limits_hold_for_commands() {
    let (_served, desk) = desk(false);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    let (text, _) = text.split_once("[limits]").expect("limits");
    std::fs::write(&path, text).expect("room");
    for command in [
        "go 0 --move",
        "reset 0 --move",
        "write 0 EE_pole=06 --move",
        "position 0 --to 1turns --init --move",
    ] {
        let arguments: Vec<_> = command.split(' ').collect();
        let output = desk.run(&arguments);
        ended(&output, 2, "needs `allow_");
        ended(&output, 2, SAFE);
    }
    let missing = ["read", "0", "nist", "--rig", "no-such-rig"];
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_drivebench"));
    let output = command.args(missing).output().expect("the program");
    ended(&output, 2, "nor a rig of that name");
}

/// Power goes on before the ports are opened and off behind the last telegram; hooks run around, also where nothing answers.
#[test]
fn power_and_hooks_stand_around_a_use() {
    let (mut served, desk) = desk(false);
    let path = desk.path("desk.toml");
    let log = desk.path("log");
    let (log, state) = (log.display(), desk.path("power"));
    let state = state.display();
    let say = |what: &str| format!("[\"sh\", \"-c\", \"echo {what} >> {log}\"]");
    let switch = |what: &str, how: &str| {
        format!("[\"sh\", \"-c\", \"echo {what} >> {log}; {how} {state}\"]")
    };
    let text = std::fs::read_to_string(&path).expect("a rig")
        + &format!(
            "[power.main]\non = {}\noff = {}\nstatus = [\"test\", \"-e\", \"{state}\"]\n\
             [hooks.before]\ncommand = {}\n[hooks.after]\ncommand = {}\n[hooks.on_error]\ncommand = {}\n\
             [safe_state]\norder = [\"stop\", \"block\", \"power-off\"]\nspeed_tolerance = \"20rpm\"\nwithin = \"3s\"\n",
            switch("on", "touch"),
            switch("off", "rm -f"),
            say("before"),
            say("after"),
            say("error")
        );
    std::fs::write(&path, &text).expect("room");
    let said = || {
        let text = std::fs::read_to_string(desk.path("log")).expect("a log");
        std::fs::remove_file(desk.path("log")).expect("a log");
        text.lines().collect::<Vec<_>>().join(" ")
    };
    shows(&desk, "go 0 --move", SAFE);
    assert_eq!(said(), "before on off after");
    // A command that only reads leaves the power on, and the next one does not switch it on again.
    shows(&desk, "read 0 nist", "0 rpm");
    shows(&desk, "read 0 nist", "0 rpm");
    assert_eq!(said(), "before on after before after");
    // A power switch that does not work makes the safe state unconfirmed.
    let stuck = text.replace("rm -f", "true");
    std::fs::write(&path, stuck).expect("room");
    ended(
        &desk.run(&["go", "0", "--move"]),
        7,
        "power main off: it is still on",
    );
    std::fs::write(&path, text).expect("room");
    shows(&desk, "go 0 --move", SAFE);
    let _log = said();
    let _gone = served.child.kill();
    let _gone = served.child.wait();
    assert_eq!(desk.run(&["read", "0", "nist"]).status.code(), Some(3));
    assert_eq!(said(), "before on off after error");
}

const INTERLOCK: &str = "[[interlock]]\ndrive = 0\ncell = \"nist\"\nmin = \"-300rpm\"\nmax = \"300rpm\"\nevery = \"50ms\"\n\
                         message = \"the belt comes off\"\n";

const FASTER: &str = "title faster\nsource nd21 14.5.3.1\nring 2\nwait 20ms\nwrite-byte 0 errorcode = AF\nwrite-word 0 nsoll = {}\nwait 3s\n\
                      ? drive 0 nist = 136rpm +-20rpm\n";

/// An interlock that trips in the middle of a run ends it, with the drives in their safe state.
#[test]
fn an_interlock_trips() {
    let (_served, desk) = desk(false);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig");
    std::fs::write(&path, text.clone() + INTERLOCK).expect("room");
    let scenario = desk.path("faster.scn");
    let name = scenario.to_str().expect("a name");
    let run = |speed: &str| {
        std::fs::write(&scenario, FASTER.replace("{}", speed)).expect("room");
        desk.run(&["run", name, "--allow-motion"])
    };
    ended(&in_the_end(0, || run("0200")), 0, "1 passed");
    let fast = in_the_end(6, || run("075F"));
    let words = "interlock on nist of drive 0 (the belt comes off):";
    ended(&fast, 6, words);
    ended(&fast, 6, "at least -300 and at most 300 is required");
    ended(&fast, 6, SAFE);
    // The driver's own commands are watched as well.
    shows(&desk, "go 0 --move --hold", "drive 0 is in go");
    let arguments = ["position", "0", "--by", "100turns", "--init", "--move"];
    let output = desk.run(&arguments);
    ended(&output, 6, words);
    ended(&output, 6, SAFE);
    // An input that is not as it must be lets nothing begin.
    let input = "[[interlock]]\ndrive = 1\ninput = \"GPIN4\"\nlevel = \"high\"\n";
    std::fs::write(&path, text + input).expect("room");
    for arguments in [
        &["run", "9.2-synco"][..],
        &["read", "0", "nist"],
        &["recover"],
        &CHECK,
    ] {
        let output = desk.run(arguments);
        ended(
            &output,
            6,
            "interlock on GPIN4 of drive 1: it is low, high is required",
        );
        ended(&output, 6, SAFE);
    }
}

/// The same in virtual time: where it trips is no accident.
#[test]
fn an_interlock_of_a_simulated_rig_trips() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("rig.toml");
    let text = "schema = 1\n[rig]\nid = \"sim\"\n[ring.1]\ndrives = 2\ntransport = \"sim\"\n[limits]\nallow_motion = true\n[sim]\n\
                setup = [\"drive 0..last input GPIN3 GPIN5 high\"]\n";
    std::fs::write(&rig, text.to_owned() + INTERLOCK).expect("room");
    let scenario = folder.path().join("faster.scn");
    let run = |speed: &str| {
        std::fs::write(&scenario, FASTER.replace("{}", speed)).expect("room");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.arg("run").arg(&scenario).arg("--rig").arg(&rig);
        command.output().expect("the program")
    };
    ended(&run("0200"), 0, "1 passed");
    let first = run("075F");
    ended(&first, 6, "the belt comes off");
    assert_eq!(said(&first), said(&run("075F")));
}

/// The watchdog stops the motors when the program hangs (its output is not read, as when a terminal is held).
#[test]
fn a_program_that_hangs_is_watched() {
    let (_served, desk) = desk(true);
    let path = desk.path("desk.toml");
    let text = std::fs::read_to_string(&path).expect("a rig") + "[safe_state]\nwatchdog = \"2s\"\n";
    std::fs::write(&path, text).expect("room");
    shows(&desk, "delete-error all --move", "drive 0 is in go");
    shows(&desk, "write 0 nsoll=500rpm --move --hold", "499.88 rpm");
    let cells = [
        "nist", "nsoll", "position", "TempKK", "TempMot", "Status", "Flags",
    ];
    let watch = [
        &["watch", "0"][..],
        &cells,
        &["--every", "1ms", "--for", "100s"],
    ]
    .concat();
    let mut child = desk.command(&watch).spawn().expect("the program");
    // Soon full, if it is not by now.
    let pipe = child.stdout.as_ref().expect("its output");
    let _fuller = rustix::pipe::fcntl_setpipe_size(pipe, 4_096);
    let end = std::time::Instant::now() + std::time::Duration::from_secs(60);
    let status = loop {
        if let Some(status) = child.try_wait().expect("a process") {
            break status;
        }
        assert!(std::time::Instant::now() < end, "it hangs");
        std::thread::sleep(std::time::Duration::from_millis(50));
    };
    let output = child.wait_with_output().expect("its output");
    assert_eq!(status.code(), Some(7), "{}", said(&output));
    assert!(
        said(&output).contains("no sign of life for 2 s"),
        "{}",
        said(&output)
    );
    // A stop takes time; a `watch` of 2 s sees the drive stand.
    shows(
        &desk,
        "watch 0 nist Flags --every 2s --for 2s",
        "nist 0 rpm  Flags",
    );
    shows(&desk, "read 0 Flags", "stop");
}

/// A user without permission for the port gets an error that says so. Root may open every port, so the test drops root's privileges.
#[test]
fn a_port_without_rights() {
    let root = rustix::process::geteuid().is_root();
    if root && !crate::debian::has("setpriv", "a port without rights, tried by root") {
        return;
    }
    let served = Served::start("plain", &[2], "pty", false, &[]);
    let PortAddress::Pty(port) = &served.endpoints[0] else {
        panic!("a pseudo terminal");
    };
    let desk = Desk::new(2, "pty", &port.display().to_string());
    let mode = |path: &Path, mode| {
        let set = std::fs::set_permissions(path, Permissions::from_mode(mode));
        set.expect("the owner's right");
    };
    mode(port, 0o000);
    // All of what else is needed, the folder of the port too, is everybody's.
    mode(port.parent().expect("a folder"), 0o755);
    let state = desk.path("state");
    std::fs::create_dir(&state).expect("room");
    mode(&state, 0o777);
    let program = desk.path("drivebench");
    std::fs::copy(env!("CARGO_BIN_EXE_drivebench"), &program).expect("room");
    mode(desk.folder.path(), 0o755);
    let mut command = Command::new(if root { Path::new("setpriv") } else { &program });
    if root {
        command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]);
        command.arg(&program);
    }
    command.args(["rig", "check"]).arg(desk.path("desk.toml"));
    command.env("DRIVEBENCH_STATE", &state);
    let output = command.output().expect("the program");
    ended(&output, 3, "no permission to open ");
    let held = std::fs::read_dir(&state).expect("a folder");
    let held: Vec<_> = held.map(|entry| entry.expect("a file").path()).collect();
    let free =
        |path: &PathBuf| std::fs::read_to_string(path).is_ok_and(|text| !text.contains("pid"));
    assert!(held.iter().all(free), "a lock is left: {held:?}");
}
