//! `capture` at pseudo terminals, and what Wireshark's tshark captures by extcap.

use crate::debian::has;
use crate::program::{Desk, ended, name, said};
use harness::capture::{Capture, ReadSettings, read, read_with};
use rustix::fd::OwnedFd;
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::OpenptFlags;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

/// The far end of a port, and the port's path.
pub(crate) fn port() -> (OwnedFd, PathBuf) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let far = rustix::pty::openpt(flags).expect("a pseudo terminal");
    rustix::io::ioctl_fionbio(&far, true).expect("without waiting");
    rustix::pty::grantpt(&far).expect("granted");
    rustix::pty::unlockpt(&far).expect("unlocked");
    let path = rustix::pty::ptsname(&far, Vec::new()).expect("a name");
    (far, PathBuf::from(path.into_string().expect("a text")))
}

/// `capture` in its own process, listening.
pub(crate) struct Listener {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Listener {
    pub(crate) fn start(mut command: Command) -> Self {
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
    pub(crate) fn hears(&mut self, text: &str) {
        let mut heard = String::new();
        while !heard.contains(text) {
            let read = self.lines.read_line(&mut heard).expect("a line");
            assert_ne!(read, 0, "{text:?} is not in {heard}");
        }
    }

    /// How it ended, and what it said that was not heard yet.
    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        let mut text = String::new();
        self.lines.read_to_string(&mut text).expect("a pipe");
        let output = self.child.wait_with_output().expect("it ends");
        (output.status.code(), text + &said(&output))
    }

    pub(crate) fn signal(&self, signal: Signal) {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, signal).expect("it lives");
    }
}

pub(crate) fn send(far: &OwnedFd, bytes: &[u8]) {
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
    let links = capture.traces.iter().flat_map(|trace| &trace.channels);
    links
        .map(|channel| {
            channel
                .octets()
                .iter()
                .filter_map(|octet| octet.received)
                .collect()
        })
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

/// An SLCAN adapter: it takes the commands that open it, but for one that it refuses, and keeps all commands.
pub(crate) struct SlcanAdapter {
    listener: TcpListener,
    refuses: &'static str,
    told: Vec<String>,
    stream: Option<TcpStream>,
}

impl SlcanAdapter {
    pub(crate) fn new(refuses: &'static str) -> Self {
        Self {
            listener: TcpListener::bind("127.0.0.1:0").expect("a port"),
            refuses,
            told: Vec::new(),
            stream: None,
        }
    }

    pub(crate) fn address(&self) -> String {
        self.listener.local_addr().expect("an address").to_string()
    }

    /// Answers a client until it has opened the channel, or was refused.
    pub(crate) fn answer(&mut self) {
        let (mut stream, _) = self.listener.accept().expect("a client");
        let mut byte = [0];
        let mut command = String::new();
        while stream.read(&mut byte).expect("a client") == 1 {
            if byte != [b'\r'] {
                command.push(char::from(byte[0]));
                continue;
            }
            let refused = command == self.refuses;
            let answer: &[u8] = match command.as_str() {
                _ if refused => b"\x07",
                "V" => b"V1013\r",
                "F" => b"F00\r",
                _ => b"\r",
            };
            stream.write_all(answer).expect("a client");
            let open = command == "L";
            self.told.push(std::mem::take(&mut command));
            if open {
                break;
            }
        }
        self.stream = Some(stream);
    }

    pub(crate) fn says(&mut self, text: &str) {
        let stream = self.stream.as_mut().expect("it is open");
        stream.write_all(text.as_bytes()).expect("a client");
    }

    /// All that it was told until the client has gone.
    pub(crate) fn end(mut self) -> Vec<String> {
        let mut rest = String::new();
        let stream = self.stream.as_mut().expect("it is open");
        stream.read_to_string(&mut rest).expect("a text");
        self.told
            .extend(rest.split_terminator('\r').map(str::to_owned));
        self.told
    }
}

/// The bytes or frames of a part of a capture.
fn part(path: &Path, link: &str) -> String {
    let settings = ReadSettings {
        links: vec![link.parse().expect("a link")],
        ..ReadSettings::default()
    };
    let file = std::fs::read(path).expect("a file");
    let read = read_with(&file, &settings).unwrap_or_else(|error| panic!("{error}"));
    let mut text = String::new();
    for channel in read.capture.traces.iter().flat_map(|trace| &trace.channels) {
        text += &format!("{:?}:", channel.from);
        text.extend(
            channel
                .octets()
                .iter()
                .map(|octet| format!(" {:02X}", octet.received.unwrap_or(0))),
        );
        text.extend(
            channel
                .frames()
                .iter()
                .map(|frame| format!(" {:?} {}", frame.from, frame.frame)),
        );
        text += "\n";
    }
    text
}

/// Taps of all three buses in one capture: a line of text for each telegram or frame, an adapter that only listens, its losses and its
/// absence as events, and each bus judged by itself.
#[test]
fn every_bus_in_one_capture() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let ((ring, first), (line, second)) = (port(), port());
    let mut adapter = SlcanAdapter::new("none");
    let mut taps = vec![
        "capture".to_owned(),
        "-o".to_owned(),
        "all.pcapng".to_owned(),
    ];
    for tap in [
        format!("0->master={}", name(&first)),
        format!("bus={}", name(&second)),
        format!("can0=slcan:{}@250", adapter.address()),
    ] {
        taps.extend(["--tap".to_owned(), tap]);
    }
    let taps: Vec<_> = taps.iter().map(String::as_str).collect();
    let command = desk.command(&taps);
    let opened = std::thread::spawn(move || {
        adapter.answer();
        adapter
    });
    let mut listener = Listener::start(command);
    let mut adapter = opened.join().expect("a client");
    adapter.says("t20133D4000\rt1814400");
    adapter.says("40100\rF01\r");
    listener.hears("can0 master    201       3D 40 00                 read 40 STATUS");
    listener.hears("can0 drive 1   181       40 04 01 00");
    // A request and its reply at once, and a request in two portions.
    let ask = [0x10, 8, 2, 0x49, 0x53, 0x16];
    send(
        &line,
        &[&ask[..], &[0x10, 2, 8, 0, 0x0A, 0x16], &ask[..2]].concat(),
    );
    // A slave gives half a telegram up: nothing is waited for in between.
    send(&line, &ask[2..]);
    listener.hears("bus slave 8   2");
    listener.hears("bus master    slave 8");
    send(&ring, &[0x88]);
    listener.hears("0->master 88");
    drop(adapter.stream.take());
    listener.hears("can0 the adapter was pulled out");
    adapter.answer();
    listener.hears("can0 the adapter is back");
    adapter.says("t2010\r");
    listener.hears("can0 master    201");
    assert!(is_silent(&ring) && is_silent(&line));
    listener.signal(Signal::TERM);
    let told = adapter.end();
    let (code, said) = listener.end();
    for line in &told {
        let known = ["N", "C", "V", "S5", "Z1", "L", "F"].contains(&line.as_str());
        assert!(known, "the adapter was told {line:?}");
    }
    assert_eq!(told.iter().filter(|line| *line == "L").count(), 2);
    assert_eq!(code, Some(5), "{said}");
    assert!(
        said.contains("ring not judged: no tap is on the master"),
        "{said}"
    );
    assert!(
        said.contains("3 frames, 0 errors, some lost; the adapter took the listen-only mode (L)"),
        "{said}"
    );
    assert!(said.contains("all.pcapng: 3 telegrams"), "{said}");
    let file = desk.path("all.pcapng");
    assert_eq!(part(&file, "ring"), "Some(0): 88\n");
    let sent = "10 08 02 49 53 16";
    assert_eq!(
        part(&file, "bus=bus"),
        format!("None: {sent} {sent}\nSome(8): 10 02 08 00 0A 16\n")
    );
    assert!(part(&file, "bus=can0").starts_with("None: None 201#3D4000 Some(1) 181#40040100"));
    let mixed = desk.run(&["import", "all.pcapng"]);
    ended(&mixed, 2, "frames of CAN (--link \"bus=can0\")");
    let lost = std::fs::read(&file).expect("a file");
    let words = b"frames lost: the adapter's queue was full";
    assert!(lost.windows(words.len()).any(|part| part == words));
}

/// An adapter that cannot listen only is refused; so is a server of which that is not known.
#[test]
fn adapters_that_would_acknowledge_are_refused() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let mut adapter = SlcanAdapter::new("L");
    let tap = format!("can0=slcan:{}", adapter.address());
    let refused = std::thread::spawn(move || {
        adapter.answer();
        adapter.told
    });
    let output = desk.run(&["capture", "--tap", &tap]);
    ended(&output, 3, "refuses to listen only (L)");
    let told = refused.join().expect("a client");
    assert!(!told.contains(&"O".to_owned()), "{told:?}");
    let server = desk.run(&["capture", "--tap", "can0=socketcand:127.0.0.1:1"]);
    ended(&server, 3, "permit it with --may-acknowledge");
    let twice = ["capture", "--tap", "bus=/dev/a", "--tap", "bus=/dev/b"];
    ended(&desk.run(&twice), 3, "two taps are named bus");
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
    for link in ["0->master", "bus"] {
        silent_calls(link);
    }
}

fn silent_calls(link: &str) {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let (far, path) = port();
    let tap = format!("{link}={}", name(&path));
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
    let command = ["extcap", "--extcap-interface", "drivebench-sim"];
    let types = desk.run(&[&command[..], &["--extcap-dlts"]].concat());
    ended(&types, 0, "dlt {number=250}{name=RTAC_SERIAL}");
    let options = desk.run(&[&command[..], &["--extcap-config"]].concat());
    ended(
        &options,
        0,
        "{call=--rig}{display=Rig}{type=string}{default=sim:3}",
    );
    for (bus, number, scenario) in [
        ("unitek", 227, "unitek-ex-11-speed-routine"),
        ("nordac", 250, "nordac-3.3-start-up"),
    ] {
        let name = format!("drivebench-sim-{bus}");
        let interface =
            format!("interface {{value={name}}}{{display=drivebench: simulated {bus}}}\n");
        ended(&listed, 0, &interface);
        let asked = |what: &str| desk.run(&["extcap", "--extcap-interface", &name, what]);
        ended(
            &asked("--extcap-dlts"),
            0,
            &format!("dlt {{number={number}}}"),
        );
        ended(
            &asked("--extcap-config"),
            0,
            &format!("{{default={scenario}}}"),
        );
    }
    let unknown = desk.run(&["extcap", "--extcap-interface", "eth0", "--extcap-dlts"]);
    ended(&unknown, 2, "there is no interface `eth0`");
    let pipe = desk.path("pipe");
    for rig in ["sim:x", "sim:400"] {
        let wrong = [
            &command[..],
            &["--capture", "--fifo", name(&pipe), "--rig", rig],
        ]
        .concat();
        let what = format!("`{rig}` is no simulated ring: ");
        let wrong = desk.run(&wrong);
        ended(&wrong, 3, &what);
        ended(&wrong, 3, "1 to 250");
    }
    let other = [
        &command[..],
        &["--capture", "--fifo", name(&pipe)],
        &["--scenario", "nordac-3.3-start-up"],
    ]
    .concat();
    let words = "it is a scenario of nordac; the interface of that bus is drivebench-sim-nordac";
    ended(&desk.run(&other), 3, words);
    let more = [
        &["extcap", "--extcap-interface", "drivebench-sim-nordac"][..],
        &["--capture", "--fifo", name(&pipe), "--rig", "sim:4"],
    ]
    .concat();
    ended(
        &desk.run(&more),
        3,
        "says which drives it has; leave --rig out",
    );
}

/// A simulated bench of each other bus is captured live, and what is captured passes as that of right drives.
#[test]
fn every_bus_is_captured_by_extcap() {
    for (bus, scenario, judged) in [
        (
            "unitek",
            "unitek-dump-00-1f",
            "11 frames in 1.778 ms, 5 of 5 replies compared",
        ),
        (
            "nordac",
            "nordac-3.1-ppo-1",
            "8 telegrams in 2.860 ms, 4 of 4 replies compared",
        ),
    ] {
        let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
        let pipe = desk.path("pipe");
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RWXU).expect("a pipe");
        let interface = format!("drivebench-sim-{bus}");
        let mut command = desk.command(&["extcap", "--extcap-interface", &interface]);
        command.args(["--capture", "--scenario", scenario, "--fifo"]);
        let child = command.arg(&pipe).spawn().expect("the program");
        let mut reader = std::fs::File::open(&pipe).expect("a pipe");
        let mut kept = vec![0; 600];
        reader.read_exact(&mut kept).expect("packets");
        drop(reader);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        // The last block is cut off.
        let length = |at: usize| {
            let bytes = kept.get(at + 4..at + 8)?;
            usize::try_from(u32::from_le_bytes(bytes.try_into().ok()?)).ok()
        };
        let mut whole = 0;
        while let Some(next) = length(whole)
            .map(|end| whole + end)
            .filter(|end| *end <= kept.len())
        {
            whole = next;
        }
        std::fs::write(desk.path("live.pcapng"), &kept[..whole]).expect("room");
        let shown = desk.run(&["import", "live.pcapng"]);
        ended(&shown, 0, &format!("passed live.pcapng: {judged}"));
    }
}

/// tshark captures simulated benches of every bus live, after `extcap install`.
#[test]
fn tshark_captures_simulated_benches() {
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
    for (bus, scenario, judged) in [
        ("unitek", "unitek-dump-00-1f", "12 frames"),
        ("nordac", "nordac-3.3-start-up", "12 telegrams"),
    ] {
        let (interface, live) = (format!("drivebench-sim-{bus}"), format!("{bus}.pcapng"));
        let option = format!("extcap.drivebench_sim_{bus}.scenario:{scenario}");
        let captured = tshark(&["-i", &interface, "-o", &option, "-c", "12", "-w", &live]);
        assert!(captured.status.success(), "{}", said(&captured));
        let passed = format!("passed {live}: {judged}");
        ended(&desk.run(&["import", &live]), 0, &passed);
    }
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
