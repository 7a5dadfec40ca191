//! Wrong parity in its order, and what a pseudo terminal can show of it: it keeps PARODD, though it has no parity.

use super::*;
use harness_proto::line::{LineError, Rate};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::os::unix::ffi::OsStrExt;

/// A port that writes down what is done to it, and fails at one of the steps.
#[derive(Default)]
struct PortLog {
    done: Vec<String>,
    fails_at: Option<&'static str>,
}

impl PortLog {
    fn note(&mut self, step: String) -> io::Result<()> {
        let fails = self.fails_at == Some(step.as_str());
        self.done.push(step);
        if fails {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        Ok(())
    }
}

impl ParityPort for PortLog {
    fn drain(&mut self) -> io::Result<()> {
        std::thread::sleep(Duration::from_millis(2));
        self.note("drain".to_owned())
    }

    fn set_odd(&mut self, odd: bool) -> io::Result<()> {
        self.note(if odd { "odd" } else { "even" }.to_owned())
    }

    fn put(&mut self, byte: u8) -> io::Result<()> {
        self.note(format!("{byte:02X}"))
    }
}

#[test]
fn the_parity_is_switched_between_drained_bytes() {
    let mut port = PortLog::default();
    let gap = send_wrong_parity(&mut port, 0x13, true, Duration::from_millis(5), &mut false)
        .expect("sent");
    assert_eq!(port.done, ["drain", "even", "13", "drain", "odd"]);
    // The second drain ends before the byte can have left: some drivers do so.
    assert!(gap >= Duration::from_millis(5), "{gap:?}");
}

/// A UART has one parity setting for both directions: what comes while it is switched says nothing of the line. A byte may be read later
/// than it came, and a computer that stands still reads it later than any adapter hands it over.
#[test]
fn what_comes_while_the_parity_is_switched_has_no_known_line_status() {
    let (good, bad) = (Received::good(0x14), Received::bad(0x13, LineError::Parity));
    let start = Instant::now();
    let mut switches = Switches::default();
    assert_eq!(switches.judged(bad), bad);
    switches.note(Duration::from_millis(2), start);
    assert_eq!(switches.judged(bad), Received::good(0x13));
    // The port is looked at once more before the adapter must have handed over everything, and then after a standstill.
    switches.has_read_all(start + LATEST / 2);
    assert_eq!(switches.judged(bad), Received::good(0x13));
    assert_eq!(switches.judged(good), good);
    switches.has_read_all(start + LATEST * 50);
    assert_eq!(switches.judged(bad), bad);
    let done = switches.take();
    assert_eq!((done[0].unknown, done[0].marked), (3, 2));
}

/// A fiftieth is what the clocks of adapters are off by.
#[test]
fn a_rate_that_the_chip_does_not_make_is_refused() {
    let port = Path::new("/dev/ttyS1");
    for made in [None, Some(93_750), Some(92_160)] {
        assert!(refuse_rate(port, 93_750, made).is_ok(), "{made:?}");
    }
    let refused = refuse_rate(port, 93_750, Some(115_200)).expect_err("another rate");
    let text = refused.to_string();
    assert!(text.contains("115200") && text.contains("93750"), "{text}");
}

#[test]
fn the_parity_is_right_again_after_every_failure() {
    for (fails_at, done) in [
        ("drain", &["drain"][..]),
        ("even", &["drain", "even", "odd"]),
        ("13", &["drain", "even", "13", "odd"]),
        ("odd", &["drain", "even", "13", "drain", "odd"]),
    ] {
        let mut port = PortLog {
            fails_at: Some(fails_at),
            ..PortLog::default()
        };
        let error = send_wrong_parity(&mut port, 0x13, true, Duration::ZERO, &mut false)
            .expect_err(fails_at);
        assert_eq!(error.kind(), io::ErrorKind::BrokenPipe, "{fails_at}");
        assert_eq!(port.done, done, "{fails_at}");
    }
}

/// Both ends of a pseudo terminal, and its path.
fn terminal() -> (OwnedFd, OwnedFd, std::path::PathBuf) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pty");
    grantpt(&master).expect("rights");
    unlockpt(&master).expect("unlocked");
    let name = ptsname(&master, Vec::new()).expect("a name");
    let path = Path::new(std::ffi::OsStr::from_bytes(name.to_bytes())).to_owned();
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let slave = rustix::fs::open(&path, flags, Mode::empty()).expect("its other end");
    let mut line = rustix::termios::tcgetattr(&slave).expect("settings");
    line.make_raw();
    rustix::termios::tcsetattr(&slave, OptionalActions::Now, &line).expect("raw");
    (master, slave, path)
}

fn is_odd(master: &OwnedFd) -> bool {
    let line = rustix::termios::tcgetattr(master).expect("settings");
    line.control_modes.contains(ControlModes::PARODD)
}

/// The port of a pseudo terminal, looked at from its other end at each byte.
struct WatchedPort<'a> {
    master: &'a OwnedFd,
    slave: BorrowedFd<'a>,
    odd_at_byte: Vec<bool>,
}

impl ParityPort for WatchedPort<'_> {
    fn drain(&mut self) -> io::Result<()> {
        self.slave.drain()
    }

    fn set_odd(&mut self, odd: bool) -> io::Result<()> {
        self.slave.set_odd(odd)
    }

    fn put(&mut self, byte: u8) -> io::Result<()> {
        self.slave.put(byte)?;
        let mut read = [0];
        rustix::io::read(self.master, &mut read)?;
        assert_eq!(read, [byte]);
        self.odd_at_byte.push(is_odd(self.master));
        Ok(())
    }
}

#[test]
fn a_pty_shows_even_parity_at_the_byte_and_odd_around_it() {
    let (master, slave, _) = terminal();
    switch_parity(&slave, true).expect("kept");
    assert!(is_odd(&master));
    let mut port = WatchedPort {
        master: &master,
        slave: slave.as_fd(),
        odd_at_byte: Vec::new(),
    };
    port.put(0x12).expect("a good byte");
    send_wrong_parity(&mut port, 0x13, true, Duration::ZERO, &mut false).expect("a bad byte");
    port.put(0x14).expect("a good byte");
    assert_eq!(port.odd_at_byte, [true, false, true]);
    assert!(is_odd(&master));
}

/// Anything but a serial port is refused, each with its own message.
#[test]
fn what_is_no_serial_port() {
    let (_master, _slave, pty) = terminal();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "text").expect("room");
    let null = Path::new("/dev/null").to_owned();
    let missing = folder.path().join("none");
    for (path, part) in [
        (pty, "transport = \"pty\""),
        (file, "is not a serial port"),
        (null, "is not a serial port"),
        (missing, "there is no port"),
    ] {
        let error = open(&path, Rate::default().into(), false).expect_err("no serial port");
        let text = error.to_string();
        assert!(text.contains(part), "{text}");
        assert!(text.contains(&path.display().to_string()), "{text}");
    }
}
