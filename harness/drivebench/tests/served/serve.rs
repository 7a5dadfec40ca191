//! `drivebench sim` as a stranger's master sees it: real sockets, real pseudo terminals, the real program.
//!
//! Nothing here measures time: that is done in virtual time, in `serve/tests.rs`. Every wait has an end that a loaded machine
//! does not reach.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// A read of the byte FE13 of drive 0 in a ring of three, and its answer (ND21 10.1).
const READ: [u8; 6] = [0x88, 0xFD, 0xC0, 0x13, 0xFE, 0xD1];
const ANSWER: [u8; 6] = [0x88, 0x00, 0xC0, 0x13, 0x00, 0x2D];

/// More than anything here takes.
const LONG: Duration = Duration::from_secs(60);

/// The program at work; it ends with the test.
pub(crate) struct Sim {
    child: Child,
    out: BufReader<ChildStdout>,
    err: BufReader<ChildStderr>,
}

impl Sim {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .arg("sim")
            .args(arguments)
            // A test that goes wrong ends too.
            .args(["--for", "600s"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let out = BufReader::new(child.stdout.take().expect("a pipe"));
        let err = BufReader::new(child.stderr.take().expect("a pipe"));
        Self { child, out, err }
    }

    /// The next line of standard output.
    pub(crate) fn line(&mut self) -> String {
        let mut line = String::new();
        self.out.read_line(&mut line).expect("a line");
        line.trim_end().to_owned()
    }

    /// The next line for people.
    pub(crate) fn said(&mut self) -> String {
        let mut line = String::new();
        self.err.read_line(&mut line).expect("a line");
        line.trim_end().to_owned()
    }

    /// The address at the end of the next line.
    pub(crate) fn address(&mut self) -> String {
        let line = self.line();
        let word = line.split(' ').next_back().expect("a word");
        word.to_owned()
    }

    pub(crate) fn signal(&self, signal: &str) {
        let id = self.child.id().to_string();
        let status = Command::new("kill").args([signal, &id]).status();
        assert!(status.expect("kill").success());
    }

    pub(crate) fn code(&mut self) -> Option<i32> {
        let end = Instant::now() + LONG;
        while Instant::now() < end {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("the program does not end");
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        let _ended = self.child.kill();
        let _reaped = self.child.wait();
    }
}

pub(crate) fn connect(address: &str) -> TcpStream {
    let stream = TcpStream::connect(address).expect("the server listens");
    stream.set_read_timeout(Some(LONG)).expect("a time-out");
    stream
}

/// Sends a telegram and reads its answer.
fn read_byte(stream: &mut (impl Read + Write)) -> [u8; 6] {
    stream.write_all(&READ).expect("sent");
    let mut answer = [0; 6];
    stream.read_exact(&mut answer).expect("an answer");
    answer
}

/// A path of this test's own where nothing stands.
pub(crate) fn path(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("serve-{name}"));
    let _fresh = std::fs::remove_file(&path);
    path
}

fn terminal(path: &Path) -> File {
    let no_controlling_terminal = i32::try_from(rustix::fs::OFlags::NOCTTY.bits()).expect("a flag");
    OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(no_controlling_terminal)
        .open(path)
        .expect("a terminal")
}

/// Exit code and standard error of a call that ends by itself.
fn refused(arguments: &[&str]) -> (Option<i32>, String) {
    let mut sim = Sim::start(arguments);
    let code = sim.code();
    let mut text = String::new();
    sim.err.read_to_string(&mut text).expect("text");
    (code, text)
}

#[test]
fn one_client_after_another_and_a_second_one_turned_away() {
    let mut sim = Sim::start(&["--rig", "sim:3", "--tcp", "127.0.0.1:0"]);
    let line = sim.line();
    let address = line.strip_prefix("ring 1: 3 drives at ").expect("a place");
    let mut first = connect(address);
    assert_eq!(read_byte(&mut first), ANSWER);
    assert!(sim.said().ends_with(" came"));
    let mut second = connect(address);
    assert_eq!(second.read(&mut [0]).expect("closed"), 0);
    assert!(sim.said().contains("turned away"));
    assert_eq!(read_byte(&mut first), ANSWER);
    drop(first);
    assert!(sim.said().contains("has gone"));
    assert_eq!(read_byte(&mut connect(address)), ANSWER);
    sim.signal("-INT");
    assert_eq!(sim.code(), Some(130));
}

/// A client that closes its connection and opens the next one at once is served, however late the program notices the first end.
#[test]
fn the_next_client_comes_when_the_last_one_has_gone() {
    let mut sim = Sim::start(&[
        "--rig",
        "sim:3",
        "--tcp",
        "127.0.0.1:0",
        "--control",
        "127.0.0.1:0",
    ]);
    let addresses = [sim.address(), sim.address()];
    let ask = |place: usize, stream: &mut TcpStream| match place {
        0 => assert_eq!(read_byte(stream), ANSWER),
        _ => {
            stream.write_all(b"status\n").expect("sent");
            assert_ne!(stream.read(&mut [0]).expect("an answer"), 0);
        }
    };
    for (place, address) in addresses.iter().enumerate() {
        let mut first = connect(address);
        ask(place, &mut first);
        sim.signal("-STOP");
        drop(first);
        let mut next = connect(address);
        sim.signal("-CONT");
        ask(place, &mut next);
    }
}

#[test]
fn two_rings_at_free_pace() {
    let arguments = ["--rig", "sim:3,2", "--tcp", "127.0.0.1:0", "--tcp"];
    let more = ["127.0.0.1:0", "--pace", "free", "--once"];
    let mut sim = Sim::start(&[&arguments[..], &more[..]].concat());
    let mut first = connect(&sim.address());
    let mut second = connect(&sim.address());
    assert_eq!(read_byte(&mut first), ANSWER);
    // Drive 0 is the second one here, so that the address byte is FE; 9.3.
    second
        .write_all(&[0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1])
        .expect("sent");
    let mut answer = [0; 6];
    second.read_exact(&mut answer).expect("an answer");
    assert_eq!(answer, ANSWER);
    drop(first);
    assert_eq!(second.write(&[0x80]).expect("still there"), 1);
    drop(second);
    assert_eq!(sim.code(), Some(0));
}

#[test]
fn a_terminal_is_raw_and_its_link_goes_with_the_program() {
    let link = path("term");
    let place = link.to_str().expect("a plain path");
    let mut sim = Sim::start(&["--rig", "sim:3", "--pty", place, "--marks", "in-band"]);
    assert_eq!(sim.line(), format!("ring 1: 3 drives at {place}"));
    let mut client = terminal(&link);
    assert_eq!(read_byte(&mut client), ANSWER);
    // Carriage return, line feed, interrupt, end of file, XOFF for a drive that is not there: all
    // pass (ND21 9.3).
    let telegram = [0x8C, 0xF0, 0x0D, 0x0A, 0x03, 0x04, 0x13, 0x7F];
    client.write_all(&telegram).expect("sent");
    let mut answer = [0; 8];
    client.read_exact(&mut answer).expect("an answer");
    assert_eq!(answer[2..], telegram[2..]);

    let (code, text) = refused(&["--pty", place]);
    assert_eq!(code, Some(2));
    assert!(text.contains("exists already"), "{text}");
    assert!(link.is_symlink(), "the first one's link stays");

    sim.signal("-TERM");
    assert_eq!(sim.code(), Some(130));
    assert!(!link.is_symlink());
}

#[test]
fn the_next_program_at_a_terminal_reads_nothing_old() {
    let link = path("next");
    let place = link.to_str().expect("a plain path");
    let mut sim = Sim::start(&["--rig", "sim:3", "--pty", place, "--control", "-"]);
    sim.line();
    let mut first = terminal(&link);
    assert_eq!(read_byte(&mut first), ANSWER);
    first.write_all(&READ).expect("sent");
    // One byte of the answer is read, so the telegram has left; then the program goes.
    first.read_exact(&mut [0]).expect("a byte");
    drop(first);
    assert_eq!(sim.said(), "ring 1: a client came");
    assert_eq!(sim.said(), "ring 1: the client has gone");
    // The bytes still under way return while no client is there, within six byte times. The answer to a line of control shows that
    // the server has caught up with the time.
    std::thread::sleep(Duration::from_millis(100));
    let control = sim.child.stdin.as_mut().expect("a pipe");
    control.write_all(b"state 0\n").expect("sent");
    assert!(sim.line().starts_with("ok "));
    assert_eq!(read_byte(&mut terminal(&link)), ANSWER);
}

/// The server does not remove a file that another program has put at its path.
#[test]
fn a_link_that_somebody_has_replaced_stays() {
    let link = path("replaced");
    let place = link.to_str().expect("a plain path");
    let mut sim = Sim::start(&["--pty", place, "--once"]);
    sim.line();
    let client = terminal(&link);
    std::fs::remove_file(&link).expect("removed");
    std::fs::write(&link, "mine").expect("a file");
    drop(client);
    assert_eq!(sim.code(), Some(0));
    assert_eq!(std::fs::read_to_string(&link).expect("a file"), "mine");
}

#[test]
fn what_is_refused() {
    let (code, text) = refused(&["--tcp", "0.0.0.0:0"]);
    assert_eq!(code, Some(2));
    assert!(text.contains("--allow-remote"), "{text}");
    let (code, text) = refused(&["--tcp", "127.0.0.1:0", "--control", "0.0.0.0:0"]);
    assert_eq!(code, Some(2));
    assert!(text.contains("--allow-remote"), "{text}");
    let (code, text) = refused(&["--rig", "sim:3,2", "--tcp", "127.0.0.1:0"]);
    assert_eq!(code, Some(2));
    assert!(
        text.contains("--tcp or --pty is expected once for each ring: 1 given, 2 needed"),
        "{text}"
    );
    let (code, text) = refused(&["--tcp", "nowhere"]);
    assert_eq!(code, Some(2));
    assert!(text.contains("failed to listen at nowhere"), "{text}");
    let (code, text) = refused(&["--pty", "/nowhere/at/all"]);
    assert_eq!(code, Some(2));
    assert!(text.contains("/nowhere/at/all"), "{text}");
    let (code, _) = refused(&[]);
    assert_eq!(code, Some(2));
}

#[test]
fn lines_of_control_over_a_socket() {
    let arguments = ["--rig", "sim:3", "--tcp", "127.0.0.1:0", "--control"];
    let mut sim = Sim::start(&[&arguments[..], &["127.0.0.1:0"]].concat());
    let mut client = connect(&sim.address());
    let place = sim.address();
    let mut control = connect(&place);
    let lines = "! drive 1: off\n\n? drive 0 mode go\nnonsense\n? drive 1 mode go";
    control.write_all(lines.as_bytes()).expect("sent");
    control.shutdown(Shutdown::Write).expect("the end");
    let mut answers = String::new();
    control.read_to_string(&mut answers).expect("answers");
    let answers: Vec<_> = answers.lines().collect();
    assert_eq!(answers[..2], ["ok", "ok"]);
    assert!(answers[2].starts_with("error: column 1"), "{}", answers[2]);
    assert_eq!(answers[3], "no: drive 1: mode is reset, expected go");
    // The next one may come, and the client notices what was done.
    let mut control = connect(&place);
    control.write_all(b"! drive 1: on\n").expect("sent");
    let mut answer = [0; 3];
    control.read_exact(&mut answer).expect("an answer");
    assert_eq!(&answer, b"ok\n");
    assert_eq!(read_byte(&mut client), ANSWER);
}

#[test]
fn lines_of_control_over_standard_input() {
    let arguments = ["--tcp", "127.0.0.1:0", "--control", "-", "--once"];
    let mut sim = Sim::start(&arguments);
    let client = connect(&sim.address());
    let mut input = sim.child.stdin.take().expect("a pipe");
    input
        .write_all(b"? drive 0 nist = 0rpm +-5rpm\n")
        .expect("sent");
    assert_eq!(sim.line(), "ok");
    drop(input);
    drop(client);
    assert_eq!(sim.code(), Some(0), "the end of the input is not the end");
}
