//! `capture` at pseudo terminals, and what Wireshark's tshark captures by extcap.

use crate::debian::has;
use crate::program::{Desk, ended, name, said};
use harness::capture::{Capture, read};
use rustix::fd::OwnedFd;
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::OpenptFlags;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

/// The far end of a port, and the port's path.
fn port() -> (OwnedFd, PathBuf) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let far = rustix::pty::openpt(flags).expect("a pseudo terminal");
    rustix::io::ioctl_fionbio(&far, true).expect("without waiting");
    rustix::pty::grantpt(&far).expect("granted");
    rustix::pty::unlockpt(&far).expect("unlocked");
    let path = rustix::pty::ptsname(&far, Vec::new()).expect("a name");
    (far, PathBuf::from(path.into_string().expect("a text")))
}

/// `capture` in its own process, listening.
struct Listener {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Listener {
    fn start(mut command: Command) -> Self {
        let mut child = command.spawn().expect("the program");
        let lines = BufReader::new(child.stdout.take().expect("a pipe"));
        // It says that it listens when all ports are open.
        let mut said = String::new();
        let errors = child.stderr.as_mut().expect("a pipe");
        let mut byte = [0];
        while !said.ends_with('\n') && errors.read(&mut byte).expect("a pipe") == 1 {
            said.push(char::from(byte[0]));
        }
        assert!(said.starts_with("listening at"), "{said}");
        Self { child, lines }
    }

    /// Reads lines up to one with this text.
    fn hears(&mut self, text: &str) {
        let mut heard = String::new();
        while !heard.contains(text) {
            let read = self.lines.read_line(&mut heard).expect("a line");
            assert_ne!(read, 0, "{text:?} is not in {heard}");
        }
    }

    /// How it ended, and what it said that was not heard yet.
    fn end(mut self) -> (Option<i32>, String) {
        let mut text = String::new();
        self.lines.read_to_string(&mut text).expect("a pipe");
        let output = self.child.wait_with_output().expect("it ends");
        (output.status.code(), text + &said(&output))
    }

    fn signal(&self, signal: Signal) {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, signal).expect("it lives");
    }
}

fn send(far: &OwnedFd, bytes: &[u8]) {
    assert_eq!(rustix::io::write(far, bytes), Ok(bytes.len()));
}

/// Nothing has come out of a port.
fn is_silent(far: &OwnedFd) -> bool {
    // An echo would come a little later than what was heard.
    std::thread::sleep(std::time::Duration::from_millis(200));
    let mut back = [0; 64];
    rustix::io::read(far, &mut back) == Err(Errno::AGAIN)
}

fn file(path: &Path) -> Capture {
    read(&std::fs::read(path).expect("a file"), None).unwrap_or_else(|error| panic!("{error}"))
}

fn bytes(capture: &Capture) -> Vec<Vec<u8>> {
    let links = capture.traces.iter().flat_map(|own| &own.channels);
    links
        .map(|own| own.octets().iter().filter_map(|own| own.received).collect())
        .collect()
}

/// Two taps: nothing is sent, an adapter that is pulled out is an event and the other goes on, SIGHUP begins a file.
#[test]
fn taps_listen_and_send_nothing() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let ((one, first), (two, second)) = (port(), port());
    let taps = [
        format!("1->0={}", name(&first)),
        format!("0->master={}", name(&second)),
    ];
    let arguments = [
        "capture",
        "--in-band",
        "--tap",
        &taps[0],
        "--tap",
        &taps[1],
        "--files",
        "5",
        "-o",
        "ring.pcapng",
    ];
    let mut listener = Listener::start(desk.command(&arguments));
    // XOFF and XON, a line feed, a parity error, a good FF.
    send(&one, &[0x88, 0x13, b'\n', 0xFF, 0, 0x10, 0x11, 0xFF, 0xFF]);
    listener.hears("1->0 88 13 0A 10 (parity) 11 FF");
    send(&two, &[0x42]);
    listener.hears("0->master 42");
    assert!(is_silent(&one) && is_silent(&two));
    listener.signal(Signal::HUP);
    drop(two);
    listener.hears("0->master the adapter was pulled out");
    send(&one, &[0x99]);
    listener.hears("1->0 99");
    listener.signal(Signal::TERM);
    let (code, said) = listener.end();
    assert_eq!(code, Some(5), "{said}");
    assert!(
        said.contains("not judged: no tap is on the master"),
        "{said}"
    );
    assert!(
        said.contains("bytes sent: not counted by the driver"),
        "{said}"
    );
    let all: Vec<Vec<Vec<u8>>> = [1, 2]
        .map(|number| bytes(&file(&desk.path(&format!("ring_{number:05}.pcapng")))))
        .into();
    let expected = [vec![0x88, 0x13, 0x0A, 0x10, 0x11, 0xFF], vec![0x42]];
    assert_eq!(all[0], expected);
    assert_eq!(all[1], [vec![0x99], vec![]]);
}

/// A capture is whole when the program was killed; another ends by itself at a text, and is judged.
#[test]
fn a_killed_capture_is_whole() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let (far, path) = port();
    let tap = format!("master->0={}", name(&path));
    let mut listener = Listener::start(desk.command(&["capture", "--tap", &tap]));
    send(&far, &[0x12, 0x34]);
    listener.hears("12 34");
    listener.child.kill().expect("it lives");
    listener.child.wait().expect("it ends");
    assert_eq!(
        bytes(&file(&desk.path("capture.pcapng"))),
        [vec![0x12, 0x34]]
    );
    let listener = Listener::start(desk.command(&["capture", "--tap", &tap, "--until", "56 78"]));
    // It has listened to silence for long enough.
    std::thread::sleep(std::time::Duration::from_millis(300));
    send(&far, &[0x56, 0x78]);
    let (_, said) = listener.end();
    assert!(
        !said.contains("not judged") && said.contains("capture.pcapng: 2 bytes"),
        "{said}"
    );
    let missing = desk.run(&["capture", "--tap", "master->0=/dev/none"]);
    ended(&missing, 3, "there is no port /dev/none");
    let wrong = desk.run(&["capture", "--tap", "9->3=/dev/none"]);
    ended(&wrong, 2, "is no tap");
}

/// No call that sends, breaks or moves a modem line reaches the port.
#[test]
fn the_system_calls_of_a_tap() {
    if !has("strace", "the system calls of a tap") {
        return;
    }
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let (far, path) = port();
    let tap = format!("0->master={}", name(&path));
    let log = desk.path("log");
    let inner = desk.command(&["capture", "--quiet", "--tap", &tap, "--for", "1s"]);
    let mut command = Command::new("strace");
    command.args(["-f", "-P", name(&path), "-o", name(&log)]);
    command.arg(inner.get_program()).args(inner.get_args());
    command.current_dir(desk.path("."));
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let listener = Listener::start(command);
    send(&far, &[0x88, 0x13, 0x10]);
    let (_, said) = listener.end();
    let log = std::fs::read_to_string(&log).expect("a log");
    assert!(
        log.contains("O_RDONLY") && log.contains("TCSETS"),
        "{log}{said}"
    );
    for call in [
        "write(", "writev(", "TCSBRK", "TIOCSBRK", "TIOCMBIS", "TIOCMSET", "TIOCMBIC", "TIOCSTI",
        "O_RDWR",
    ] {
        assert!(!log.contains(call), "{call} in {log}");
    }
}

/// What Wireshark asks for at its start and before a capture.
#[test]
fn wireshark_is_answered() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let listed = desk.run(&["extcap", "--extcap-interfaces", "--extcap-version=4.0"]);
    ended(
        &listed,
        0,
        "interface {value=drivebench-sim}{display=drivebench: simulated ring}\n",
    );
    let own = ["extcap", "--extcap-interface", "drivebench-sim"];
    let types = desk.run(&[&own[..], &["--extcap-dlts"]].concat());
    ended(&types, 0, "dlt {number=250}{name=RTAC_SERIAL}");
    let options = desk.run(&[&own[..], &["--extcap-config"]].concat());
    ended(
        &options,
        0,
        "{call=--rig}{display=Rig}{type=string}{default=sim:3}",
    );
    let unknown = desk.run(&["extcap", "--extcap-interface", "eth0", "--extcap-dlts"]);
    ended(&unknown, 2, "there is no interface `eth0`");
    let pipe = desk.path("pipe");
    let wrong = [
        &own[..],
        &["--capture", "--fifo", name(&pipe), "--rig", "sim:x"],
    ]
    .concat();
    ended(&desk.run(&wrong), 3, "`sim:x` is no simulated ring");
}

/// tshark captures a simulated ring live, after `extcap install`.
#[test]
fn tshark_captures_a_simulated_ring() {
    if !has("tshark", "a capture by extcap") {
        return;
    }
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let home = desk.path("home");
    std::fs::create_dir(&home).expect("room");
    let mut install = desk.command(&["extcap", "install"]);
    install.env("HOME", &home).env_remove("XDG_CONFIG_HOME");
    ended(
        &install.output().expect("the program"),
        0,
        "drivebench-extcap",
    );
    let tshark = |arguments: &[&str]| {
        let mut command = Command::new("tshark");
        command
            .args(arguments)
            .env("HOME", &home)
            .env_remove("XDG_CONFIG_HOME");
        let output = command.current_dir(desk.path(".")).output();
        output.expect("tshark")
    };
    ended(
        &tshark(&["-D"]),
        0,
        "drivebench-sim (drivebench: simulated ring)",
    );
    let captured = tshark(&[
        "-i",
        "drivebench-sim",
        "-o",
        "extcap.drivebench_sim.rig:sim:2",
        "-o",
        "extcap.drivebench_sim.scenario:10.1-read-byte",
        "-c",
        "12",
        "-w",
        "live.pcapng",
    ]);
    assert!(captured.status.success(), "{}", said(&captured));
    let capture = file(&desk.path("live.pcapng"));
    assert!(capture.bytes() >= 12, "{}", capture.bytes());
    assert_eq!(bytes(&capture)[0][0], 0x88);
    // Our messages reach the user of Wireshark.
    let failed = tshark(&[
        "-i",
        "drivebench-sim",
        "-o",
        "extcap.drivebench_sim.scenario:no-such-scenario",
        "-c",
        "1",
    ]);
    assert!(
        said(&failed).contains("no-such-scenario"),
        "{}",
        said(&failed)
    );
}
