//! A serial port that is listened to and never written to.
//!
//! A tap has an open of its own: read-only, and with a type that has no way to write. Linux echoes what it receives until echo is turned
//! off, so the first thing that happens to the port is a raw mode without echo and flow control; then what waits to be sent is dropped,
//! and the mode is read back. The program then sends nothing. Two things it cannot prevent: the kernel raises DTR and RTS at every open,
//! and a byte that arrives between open and raw mode may be echoed. So a tap's TX and RTS are not to be wired.

use super::holder::refuse_used;
use super::ledger::Ledger;
use super::open::OpenError;
use super::serial::refuse_rate;
use harness_proto::line::{Format, LineError, Parity, Received};
use harness_proto::marks::Unmark;
use harness_uart::{Counts, LowLatency};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, QueueSelector, Termios,
};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;
use std::time::Instant;

/// What is read at a time.
const CHUNK: usize = 4_096;

#[derive(Debug)]
pub struct SilentTap {
    fd: OwnedFd,
    unmark: Option<Unmark>,
    kinds: ErrorKinds,
    ledger: Option<Ledger>,
    _low_latency: Option<LowLatency>,
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
            unmark: (marks || !pty).then(Unmark::default),
            kinds: ErrorKinds::new(harness_uart::counts(&fd)),
            ledger: harness_uart::counts(&fd).map(|counts| Ledger::new(counts, Instant::now())),
            _low_latency: LowLatency::of(&fd),
            fd,
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
        let made = harness_uart::real_rate(&tap.fd, format.bits_per_second);
        refuse_rate(path, format.bits_per_second, made)?;
        rustix::termios::ioctl_tiocexcl(&tap.fd).map_err(of)?;
        Ok(tap)
    }

    /// Takes what has arrived, without waiting; in order, after what is in `heard` already.
    ///
    /// # Errors
    /// The port cannot be read, for another reason than that it was lost.
    pub fn read(&mut self, heard: &mut Vec<Received>) -> io::Result<TapState> {
        let before = heard.len();
        let state = self.read_all(heard)?;
        let new = heard.get_mut(before..).unwrap_or_default();
        if let Some(ledger) = &mut self.ledger {
            new.iter().for_each(|_| ledger.read());
        }
        if new.iter().any(|received| received.error.is_some()) {
            self.kinds.name(new, harness_uart::counts(&self.fd));
        }
        Ok(state)
    }

    fn read_all(&mut self, heard: &mut Vec<Received>) -> io::Result<TapState> {
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
                        Some(Ok(received)) => heard.push(received),
                        // An FF that no mark follows: the coding lost a byte.
                        Some(Err(bad)) => heard.push(Received::bad(bad.byte, LineError::Overrun)),
                    },
                }
            }
        }
    }

    /// Bytes since the last call that the driver has lost, or that another program has read, as far as the driver counts.
    pub fn take_lost(&mut self) -> u64 {
        let counts = harness_uart::counts(&self.fd);
        let both = self.ledger.as_mut().zip(counts);
        let now = Instant::now();
        both.map_or(0, |(ledger, counts)| ledger.beside(counts, now).0)
    }

    /// The driver's counts of this port; `None` if it does not count.
    #[must_use]
    pub fn counts(&self) -> Option<Counts> {
        harness_uart::counts(&self.fd)
    }
}

impl AsFd for SilentTap {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

/// Which line errors the driver has counted and no byte that was read has had. The kernel's marks do not tell a break from a damaged 00, nor a
/// byte without a stop bit from one with a wrong parity bit.
#[derive(Debug)]
struct ErrorKinds(Option<Counts>);

impl ErrorKinds {
    fn new(counts: Option<Counts>) -> Self {
        Self(counts)
    }

    /// Gives damaged bytes the error that the driver has counted, where it has counted errors of one kind only.
    fn name(&mut self, heard: &mut [Received], now: Option<Counts>) {
        let Some((known, now)) = self.0.as_mut().zip(now) else {
            return;
        };
        let new = now.since(*known);
        let (kind, counted) = match [new.parity, new.framing, new.breaks] {
            [0, 0, 0] => return,
            [_, 0, 0] => (LineError::Parity, &mut known.parity),
            [0, _, 0] => (LineError::Framing, &mut known.framing),
            [0, 0, _] => (LineError::Break, &mut known.breaks),
            _ => return *known = now,
        };
        for byte in heard.iter_mut().filter(|byte| byte.error.is_some()) {
            byte.error = Some(kind);
            *counted = counted.wrapping_add(1);
        }
    }
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

/// The first flag by which a port itself answers what it receives.
fn speaks(mode: &Termios) -> Option<&'static str> {
    let local = |flag| mode.local_modes.contains(flag);
    let input = |flag| mode.input_modes.contains(flag);
    let hardware = mode.control_modes.contains(ControlModes::CRTSCTS);
    let output = mode.output_modes.contains(OutputModes::OPOST);
    let flags = [
        (local(LocalModes::ECHO), "to turn echo off (ECHO)"),
        (local(LocalModes::ECHONL), "to turn echo off (ECHONL)"),
        (local(LocalModes::ICANON), "raw input (ICANON)"),
        (local(LocalModes::ISIG), "raw input (ISIG)"),
        (input(InputModes::IXON), "to turn flow control off (IXON)"),
        (input(InputModes::IXOFF), "to turn flow control off (IXOFF)"),
        (hardware, "to turn flow control off (CRTSCTS)"),
        (output, "raw output (OPOST)"),
    ];
    let first = flags.into_iter().find(|(is_set, _)| *is_set);
    first.map(|(_, words)| words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pty::OpenptFlags;
    use std::path::PathBuf;

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
        let heard: Vec<_> = heard.iter().map(|received| received.byte).collect();
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

    /// A bad 00 is a break, a wrong parity bit or a missing stop bit, by what the driver has counted.
    #[test]
    fn a_bad_byte_is_named_by_the_counts() {
        let none = Counts::default();
        let parity = Counts { parity: 1, ..none };
        let framing = Counts { framing: 1, ..none };
        let breaks = Counts { breaks: 1, ..none };
        let both = Counts {
            parity: 1,
            ..breaks
        };
        for (counted, named) in [
            (parity, LineError::Parity),
            (framing, LineError::Framing),
            (breaks, LineError::Break),
            // As the mark says it.
            (both, LineError::Break),
            (none, LineError::Break),
        ] {
            let mut kinds = ErrorKinds::new(Some(none));
            let mut heard = [Received::good(0x12), Received::bad(0, LineError::Break)];
            kinds.name(&mut heard, Some(counted));
            assert_eq!(
                heard,
                [Received::good(0x12), Received::bad(0, named)],
                "{counted:?}"
            );
            // The next one is another one.
            let mut next = [Received::bad(0, LineError::Break)];
            let more = Counts {
                framing: counted.framing + 1,
                ..counted
            };
            kinds.name(&mut next, Some(more));
            assert_eq!(next[0].error, Some(LineError::Framing), "{counted:?}");
        }
    }
}
