//! A serial port that is listened to and never written to.
//!
//! A tap has an open of its own: read-only, and with a type that has no way to write. Linux echoes what it receives until echo is turned
//! off, so the first thing that happens to the port is a raw mode without echo and flow control; then what waits to be sent is dropped,
//! and the mode is read back. The program then sends nothing. Two things it cannot prevent: the kernel raises DTR and RTS at every open,
//! and a byte that arrives between open and raw mode may be echoed. So a tap's TX and RTS are not to be wired.

use super::holder::refuse_used;
use super::open::OpenError;
use harness_proto::line::{Format, LineError, Parity, Received};
use harness_proto::marks::Unmark;
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, QueueSelector, Termios,
};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

/// What is read at a time.
const CHUNK: usize = 4_096;

/// An open tap.
#[derive(Debug)]
pub struct SilentTap {
    fd: OwnedFd,
    path: PathBuf,
    unmark: Option<Unmark>,
}

impl Drop for SilentTap {
    /// Lets others open the port. It stays silent: with its echo turned on again it would send what arrives until it is closed.
    fn drop(&mut self) {
        // A port that is gone is nobody's.
        let _gone = rustix::termios::ioctl_tiocnxcl(&self.fd);
    }
}

/// What a tap read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TapState {
    /// There may be more later.
    Open,
    /// The adapter was pulled out, or the other end was closed.
    Gone,
}

impl SilentTap {
    /// Opens a port to listen at it. `marks` says that a pseudo terminal carries line errors as in-band marks.
    ///
    /// # Errors
    /// [`OpenError`]; a mode that the port does not take is one.
    pub fn open(path: &Path, format: Format, marks: bool) -> Result<Self, OpenError> {
        let of = |error: Errno| OpenError::of(path, &error.into());
        let flags = OFlags::RDONLY | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty()).map_err(of)?;
        let name = path.display().to_string();
        let before = rustix::termios::tcgetattr(&fd)
            .map_err(|_| OpenError::NotA(name.clone(), "serial port"))?;
        // A port that another program uses is left as it is.
        refuse_used(path, &fd)?;
        let device = rustix::fs::fstat(&fd).map_err(of)?;
        // Major numbers 136 to 143 are the slave ends of pseudo terminals (Documentation/admin-guide/devices.txt).
        let pty = (136..=143).contains(&rustix::fs::major(device.st_rdev));
        let mode = silent(&before, format, pty);
        let set = |what: &str| OpenError::Setting {
            port: name.clone(),
            what: what.to_owned(),
        };
        // Echo goes first: what is received before is sent back.
        rustix::termios::tcsetattr(&fd, OptionalActions::Now, &mode).map_err(of)?;
        rustix::termios::tcflush(&fd, QueueSelector::IOFlush).map_err(of)?;
        let tap = Self {
            fd,
            path: path.to_owned(),
            unmark: (marks || !pty).then(Unmark::default),
        };
        let now = rustix::termios::tcgetattr(&tap.fd).map_err(of)?;
        if let Some(what) = speaks(&now) {
            return Err(set(what));
        }
        if !pty && !listens(&now, &mode) {
            let Format {
                bits_per_second,
                parity,
                stop_bits,
            } = format;
            let parity = match parity {
                Parity::None => 'N',
                Parity::Odd => 'O',
                Parity::Even => 'E',
            };
            return Err(set(&format!(
                "{bits_per_second} 8{parity}{stop_bits} with marked line errors (INPCK and PARMRK)"
            )));
        }
        rustix::termios::ioctl_tiocexcl(&tap.fd).map_err(of)?;
        Ok(tap)
    }

    /// The port's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Takes what has arrived, without waiting; in order, behind what is in `heard` already.
    ///
    /// # Errors
    /// The port cannot be read and is not merely gone.
    pub fn read(&mut self, heard: &mut Vec<Received>) -> io::Result<TapState> {
        let mut chunk = [0; CHUNK];
        loop {
            let count = match rustix::io::read(&self.fd, &mut chunk) {
                Ok(0) => return Ok(TapState::Gone),
                Ok(count) => count,
                Err(Errno::AGAIN) => return Ok(TapState::Open),
                Err(Errno::INTR) => continue,
                Err(Errno::IO | Errno::NODEV | Errno::NXIO) => return Ok(TapState::Gone),
                Err(error) => return Err(error.into()),
            };
            for byte in &chunk[..count] {
                match &mut self.unmark {
                    None => heard.push(Received::good(*byte)),
                    Some(unmark) => match unmark.push(*byte) {
                        None => {}
                        Some(Ok(own)) => heard.push(own),
                        // An FF that no mark follows: the coding lost a byte.
                        Some(Err(bad)) => heard.push(Received::bad(bad.byte, LineError::Overrun)),
                    },
                }
            }
        }
    }

    /// What the kernel has counted at this port so far; `None` where it does not count for us.
    #[must_use]
    pub fn counts(&self) -> Option<PortCounts> {
        let path = std::fs::canonicalize(&self.path).ok()?;
        let number = path.to_str()?.strip_prefix("/dev/ttyS")?;
        // Only root may read it.
        let table = std::fs::read_to_string("/proc/tty/driver/serial").ok()?;
        counts(&table, number)
    }
}

impl AsFd for SilentTap {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

/// What the kernel has counted at a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortCounts {
    /// Bytes sent.
    pub sent: u64,
    /// Bytes lost because the port's queue was full.
    pub overruns: u64,
}

/// The counts of a port in the table of the kernel's driver: `0: uart:16550A port:000003F8 irq:4 tx:11 rx:0 oe:2`; counts of 0 are left out
/// but those of bytes.
fn counts(table: &str, number: &str) -> Option<PortCounts> {
    let line = table
        .lines()
        .find_map(|line| line.strip_prefix(number)?.strip_prefix(':'))?;
    let count = |name: &str| {
        let count = line
            .split_whitespace()
            .find_map(|own| own.strip_prefix(name));
        count?.parse().ok()
    };
    Some(PortCounts {
        sent: count("tx:")?,
        overruns: count("oe:").unwrap_or(0),
    })
}

/// The mode of a tap: nothing is sent by itself, and every line error is marked.
fn silent(before: &Termios, format: Format, pty: bool) -> Termios {
    let mut mode = before.clone();
    mode.make_raw();
    mode.local_modes -=
        LocalModes::ECHO | LocalModes::ECHONL | LocalModes::ICANON | LocalModes::ISIG;
    mode.output_modes -= OutputModes::OPOST;
    mode.input_modes -= InputModes::IXON | InputModes::IXOFF | InputModes::IXANY;
    mode.input_modes -=
        InputModes::IGNPAR | InputModes::ISTRIP | InputModes::IGNBRK | InputModes::BRKINT;
    mode.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
    mode.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL | ControlModes::CS8;
    if !pty {
        mode.input_modes |= InputModes::INPCK | InputModes::PARMRK;
        mode.control_modes -= ControlModes::PARENB | ControlModes::PARODD;
        mode.control_modes |= match format.parity {
            Parity::None => ControlModes::empty(),
            Parity::Odd => ControlModes::PARENB | ControlModes::PARODD,
            Parity::Even => ControlModes::PARENB,
        };
        mode.control_modes
            .set(ControlModes::CSTOPB, format.stop_bits > 1);
        // A rate that the port cannot have shows when the mode is read back.
        let _read_back = mode.set_speed(format.bits_per_second);
    }
    mode
}

/// Whether a port has the mode that a line needs; its rate may differ by a fiftieth, as the clocks of adapters do.
fn listens(now: &Termios, wanted: &Termios) -> bool {
    let control =
        ControlModes::PARENB | ControlModes::PARODD | ControlModes::CSTOPB | ControlModes::CSIZE;
    let marks = InputModes::INPCK | InputModes::PARMRK;
    let (speed, right) = (now.input_speed(), wanted.input_speed());
    now.control_modes & control == wanted.control_modes & control
        && now.input_modes.contains(marks)
        && speed.abs_diff(right) <= right / 50
}

/// The first flag with which a port answers by itself what it receives.
fn speaks(mode: &Termios) -> Option<&'static str> {
    let local = [
        (LocalModes::ECHO, "to turn echo off (ECHO)"),
        (LocalModes::ECHONL, "to turn echo off (ECHONL)"),
        (LocalModes::ICANON, "raw input (ICANON)"),
        (LocalModes::ISIG, "raw input (ISIG)"),
    ];
    let input = [
        (InputModes::IXON, "to turn flow control off (IXON)"),
        (InputModes::IXOFF, "to turn flow control off (IXOFF)"),
    ];
    let local = local.iter().find(|own| mode.local_modes.contains(own.0));
    let input = input.iter().find(|own| mode.input_modes.contains(own.0));
    let hardware = mode.control_modes.contains(ControlModes::CRTSCTS);
    let output = mode.output_modes.contains(OutputModes::OPOST);
    local
        .map(|own| own.1)
        .or(input.map(|own| own.1))
        .or(hardware.then_some("to turn flow control off (CRTSCTS)"))
        .or(output.then_some("raw output (OPOST)"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pty::OpenptFlags;

    const FORMAT: Format = Format {
        bits_per_second: 38_400,
        parity: Parity::Odd,
        stop_bits: 1,
    };

    /// The master end of a pseudo terminal in its default mode, which echoes, and the path of its slave end.
    fn terminal() -> (OwnedFd, PathBuf) {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = rustix::pty::openpt(flags).expect("a pseudo terminal");
        rustix::io::ioctl_fionbio(&master, true).expect("without waiting");
        rustix::pty::grantpt(&master).expect("granted");
        rustix::pty::unlockpt(&master).expect("unlocked");
        let name = rustix::pty::ptsname(&master, Vec::new()).expect("a name");
        let path = PathBuf::from(name.into_string().expect("a text"));
        (master, path)
    }

    /// Whether there is something to read within this many milliseconds: the kernel hands bytes over a little later.
    fn arrives(fd: impl AsFd, milliseconds: i64) -> bool {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let mut ports = [PollFd::new(&fd, PollFlags::IN)];
        let timeout = Timespec {
            tv_sec: milliseconds / 1_000,
            tv_nsec: milliseconds % 1_000 * 1_000_000,
        };
        poll(&mut ports, Some(&timeout)).expect("a port") == 1
    }

    /// A terminal that echoes is silent under a tap, also with XOFF and XON in the data, and stays so.
    #[test]
    fn a_tap_sends_nothing() {
        let (master, path) = terminal();
        let found = rustix::termios::tcgetattr(&master).expect("a mode");
        assert!(
            found.local_modes.contains(LocalModes::ECHO)
                && found.input_modes.contains(InputModes::IXON)
        );
        let mut tap = SilentTap::open(&path, FORMAT, false).expect("a tap");
        assert!(
            rustix::io::write(&tap, b"x").is_err(),
            "it is open for reading only"
        );
        let sent = [0x10, 0xFE, 0x13, b'\n', 0x11, 0x03, 0xFF];
        assert_eq!(rustix::io::write(&master, &sent).expect("sent"), sent.len());
        let mut heard = Vec::new();
        assert!(arrives(&tap, 5_000));
        assert_eq!(tap.read(&mut heard).expect("open"), TapState::Open);
        let heard: Vec<_> = heard.iter().map(|own| own.byte).collect();
        assert_eq!(heard, sent);
        assert!(!arrives(&master, 200), "an echo");
        assert_eq!(tap.counts(), None);
        let second = SilentTap::open(&path, FORMAT, false);
        assert!(matches!(second, Err(OpenError::InUse { .. })));
        drop(tap);
        let now = rustix::termios::tcgetattr(&master).expect("a mode");
        assert_eq!(speaks(&now), None);
    }

    /// Without the tap's mode the same bytes come back: the test above can fail.
    #[test]
    fn a_terminal_of_its_own_echoes() {
        let (master, path) = terminal();
        let flags = OFlags::RDONLY | OFlags::NOCTTY | OFlags::NONBLOCK;
        let _open = rustix::fs::open(&path, flags, Mode::empty()).expect("open");
        rustix::io::write(&master, &[0xFE]).expect("sent");
        assert!(arrives(&master, 5_000));
    }

    #[test]
    fn marks_and_the_end() {
        let (master, path) = terminal();
        let mut tap = SilentTap::open(&path, FORMAT, true).expect("a tap");
        rustix::io::write(&master, &[0x12, 0xFF, 0, 0x13, 0xFF, 0xFF, 0xFF, 0, 0]).expect("sent");
        let mut heard = Vec::new();
        assert!(arrives(&tap, 5_000));
        assert_eq!(tap.read(&mut heard).expect("open"), TapState::Open);
        let expected = [
            Received::good(0x12),
            Received::bad(0x13, LineError::Parity),
            Received::good(0xFF),
            Received::bad(0, LineError::Break),
        ];
        assert_eq!(heard, expected);
        drop(master);
        assert!(arrives(&tap, 5_000));
        assert_eq!(tap.read(&mut heard).expect("gone"), TapState::Gone);
    }

    #[test]
    fn each_flag_that_speaks_is_refused() {
        let (_master, path) = terminal();
        let tap = SilentTap::open(&path, FORMAT, false).expect("a tap");
        let mode = rustix::termios::tcgetattr(&tap).expect("a mode");
        assert_eq!(speaks(&mode), None);
        let mut echo = mode.clone();
        echo.local_modes |= LocalModes::ECHO;
        assert_eq!(speaks(&echo), Some("to turn echo off (ECHO)"));
        let mut flow = mode.clone();
        flow.input_modes |= InputModes::IXOFF;
        assert_eq!(speaks(&flow), Some("to turn flow control off (IXOFF)"));
        let mut hardware = mode;
        hardware.control_modes |= ControlModes::CRTSCTS;
        assert_eq!(
            speaks(&hardware),
            Some("to turn flow control off (CRTSCTS)")
        );
    }

    /// Both parities of the buses, and a rate that the adapter does not have.
    #[test]
    fn the_mode_is_read_back() {
        let (_master, path) = terminal();
        let tap = SilentTap::open(&path, FORMAT, false).expect("a tap");
        let before = rustix::termios::tcgetattr(&tap).expect("a mode");
        let even = Format {
            bits_per_second: 500_000,
            parity: Parity::Even,
            stop_bits: 1,
        };
        let [odd, even] = [FORMAT, even].map(|format| silent(&before, format, false));
        assert!(listens(&odd, &odd) && listens(&even, &even));
        assert!(!listens(&odd, &even) && !listens(&before, &odd));
        let mut slow = even.clone();
        slow.set_speed(460_800).expect("a rate");
        assert!(!listens(&slow, &even));
        let mut near = even.clone();
        near.set_speed(499_712).expect("a rate");
        assert!(listens(&near, &even));
    }

    #[test]
    fn the_kernel_counts() {
        let table = "serinfo:1.0 driver revision:\n0: uart:16550A port:000003F8 irq:4 tx:11 rx:0\n\
                     1: uart:16550A port:000002F8 irq:3 tx:0 rx:900 oe:2 RTS|DTR\n10: uart:unknown port:00000000 irq:0\n";
        let counted = |sent, overruns| Some(PortCounts { sent, overruns });
        assert_eq!(counts(table, "0"), counted(11, 0));
        assert_eq!(counts(table, "1"), counted(0, 2));
        assert_eq!(counts(table, "10"), None);
        assert_eq!(counts(table, "2"), None);
    }
}
