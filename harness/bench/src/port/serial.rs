//! A serial port: 8O1 or 8E1, every line error marked by the kernel, bytes with a wrong parity bit on demand.
//!
//! The crate `serialport` opens the port and sets rate and format. The marks of POSIX termios (`INPCK` and `PARMRK`
//! without `IGNPAR` and `ISTRIP`) are set after it on the same terminal.

use super::holder::refuse_used;
use super::ledger::Ledger;
use super::open::{OpenError, printed};
use harness_proto::line::{Format, Parity as LineParity, Received};
use harness_proto::time::Span;
use harness_uart::LowLatency;
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, PidfdGetfdFlags};
use rustix::termios::{ControlModes, InputModes, OptionalActions, QueueSelector, Termios};
use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits, TTYPort};
use std::io;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::time::{Duration, Instant};

/// Switches that are remembered until they are asked for.
const MOST_SWITCHES: usize = 10_000;

/// How long a drained port may take to take a byte.
const PATIENCE: Duration = Duration::from_secs(1);

/// Bits of a byte on the line with its parity bit.
const BITS: u32 = 11;

/// How late the bytes of a driver may be that reports too early that all were sent: a USB adapter gets them each millisecond.
const HASTY: Duration = Duration::from_millis(2);

/// How late after its arrival a byte may be read: adapters collect bytes for up to 16 ms.
const LATEST: Duration = Duration::from_millis(20);

/// One time that the parity of a port was switched, to send a byte with a wrong parity bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switch {
    /// How long sending was delayed.
    pub idle: Duration,
    /// Bytes that came meanwhile. A UART has one parity setting for both directions, so it is not known whether they came with errors.
    pub unknown: u64,
    /// Those of them that the kernel has marked with an error.
    pub marked: u64,
}

/// The state of a serial port besides its stream.
#[derive(Debug)]
pub(super) struct Serial {
    port: TTYPort,
    /// The settings with which it was found.
    before: Termios,
    fd: OwnedFd,
    /// Whether the right parity is odd.
    odd: bool,
    /// Whether the driver switches the parity, as far as it says so.
    switches_parity: bool,
    /// How long a byte takes.
    byte_time: Duration,
    /// The earliest time at which everything written has left the line.
    free: Instant,
    /// The driver has said that all bytes have left before the line can have carried them.
    hasty: bool,
    switches: Switches,
    /// What the driver counts, if it does.
    ledger: Option<Ledger>,
    /// Whether the driver does not say which rates its chip makes, and the rate is not one of those that every chip makes.
    unproven_rate: bool,
    low_latency: Option<LowLatency>,
}

/// The times that the parity was switched.
#[derive(Debug, Default)]
pub(super) struct Switches {
    done: Vec<Switch>,
    /// Since when the parity is right again, until all bytes that came before are read.
    restored: Option<Instant>,
}

impl Switches {
    pub(super) fn take(&mut self) -> Vec<Switch> {
        std::mem::take(&mut self.done)
    }

    /// The parity was switched, and is right again.
    fn note(&mut self, idle: Duration, restored: Instant) {
        self.restored = Some(restored);
        if self.done.len() < MOST_SWITCHES {
            self.done.push(Switch {
                idle,
                unknown: 0,
                marked: 0,
            });
        }
    }

    /// A byte that was read, without the error that the kernel may have marked because the parity was switched while it came.
    pub(super) fn judged(&mut self, byte: Received) -> Received {
        if self.restored.is_none() {
            return byte;
        }
        if let Some(last) = self.done.last_mut() {
            last.unknown += 1;
            last.marked += u64::from(byte.error.is_some());
        }
        Received::good(byte.byte)
    }

    /// All that had come by this time is read.
    pub(super) fn has_read_all(&mut self, by: Instant) {
        self.restored = self.restored.filter(|restored| by < *restored + LATEST);
    }
}

impl Drop for Serial {
    /// Leaves the port as it was.
    fn drop(&mut self) {
        // A port that is gone has no settings any more.
        let _gone = rustix::termios::tcsetattr(&self.fd, OptionalActions::Now, &self.before);
    }
}

pub(super) fn open(
    path: &Path,
    format: Format,
    low_latency: bool,
) -> Result<(OwnedFd, Serial), OpenError> {
    let name = path.display().to_string();
    let wrong = |error: &serialport::Error| OpenError::Setting {
        port: name.clone(),
        what: format!("{} {} ({error})", format.bits_per_second, printed(format)),
    };
    let parity = match format.parity {
        LineParity::None => Parity::None,
        LineParity::Odd => Parity::Odd,
        LineParity::Even => Parity::Even,
    };
    let (fd, mut serial) = raw(path, format.bits_per_second, parity, &wrong)?;
    let refused = |what| OpenError::Setting {
        port: name.clone(),
        what,
    };
    set_marks(&fd, format).map_err(refused)?;
    serial.switches_parity = parity != Parity::None && tries_parity(&fd, serial.odd);
    // The driver that has tried the other parity has the right one again, or the port is refused.
    set_marks(&fd, format).map_err(refused)?;
    rustix::termios::tcflush(&fd, QueueSelector::IFlush)
        .map_err(|error| OpenError::of(path, &error.into()))?;
    serial.ledger = harness_uart::counts(&fd).map(|counts| Ledger::new(counts, Instant::now()));
    if low_latency {
        serial.low_latency = LowLatency::of(&fd);
    }
    Ok((fd, serial))
}

/// Opens a serial port with 8 data bits, no parity and 1 stop bit, for an adapter that speaks in characters.
pub(super) fn open_plain(
    path: &Path,
    bits_per_second: u32,
) -> Result<(OwnedFd, Serial), OpenError> {
    let name = path.display().to_string();
    let wrong = |error: &serialport::Error| OpenError::Other {
        port: name.clone(),
        error: io::Error::other(format!("{bits_per_second} 8N1 ({error})")),
    };
    let (fd, mut serial) = raw(path, bits_per_second, Parity::None, &wrong)?;
    serial.low_latency = LowLatency::of(&fd);
    Ok((fd, serial))
}

/// Opens a serial port without flow control; nothing is read or sent.
fn raw(
    path: &Path,
    bits_per_second: u32,
    parity: Parity,
    wrong: &dyn Fn(&serialport::Error) -> OpenError,
) -> Result<(OwnedFd, Serial), OpenError> {
    let before = look(path)?;
    let port = serialport::new(path.display().to_string(), bits_per_second)
        .data_bits(DataBits::Eight)
        .parity(parity)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(false)
        .open_native()
        .map_err(|error| wrong(&error))?;
    let other = |error: Errno| OpenError::of(path, &error.into());
    let fd = duplicate(&port).map_err(other)?;
    let made = harness_uart::real_rate(&fd, bits_per_second);
    // From here on the port is put back when `serial` is dropped.
    let serial = Serial {
        port,
        before,
        fd: fd
            .try_clone()
            .map_err(|error| OpenError::of(path, &error))?,
        odd: parity == Parity::Odd,
        switches_parity: false,
        byte_time: Duration::from_secs(1) * BITS / bits_per_second.max(1),
        free: Instant::now(),
        hasty: false,
        switches: Switches::default(),
        ledger: None,
        unproven_rate: made.is_none() && !USUAL_RATES.contains(&bits_per_second),
        low_latency: None,
    };
    refuse_rate(path, bits_per_second, made)?;
    rustix::io::ioctl_fionbio(&fd, true).map_err(other)?;
    rustix::termios::tcflush(&fd, QueueSelector::IOFlush).map_err(other)?;
    Ok((fd, serial))
}

/// Rates that every serial port makes.
const USUAL_RATES: [u32; 5] = [9_600, 19_200, 38_400, 57_600, 115_200];

/// Refuses a rate in place of which the chip makes another one, by more than a fiftieth.
///
/// # Errors
/// [`OpenError::Rate`].
pub(super) fn refuse_rate(path: &Path, asked: u32, made: Option<u32>) -> Result<(), OpenError> {
    match made.filter(|made| made.abs_diff(asked) > asked / 50) {
        None => Ok(()),
        Some(made) => Err(OpenError::Rate {
            port: path.display().to_string(),
            asked,
            made,
        }),
    }
}

/// The settings with which a port is found, read before anything is set.
fn look(path: &Path) -> Result<Termios, OpenError> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = rustix::fs::open(path, flags, Mode::empty())
        .map_err(|error| OpenError::of(path, &error.into()))?;
    let name = path.display().to_string();
    let device = rustix::fs::fstat(&fd).map_err(|error| OpenError::of(path, &error.into()))?;
    // Major numbers 136 to 143 are the slave ends of pseudo terminals (Documentation/admin-guide/devices.txt).
    if (136..=143).contains(&rustix::fs::major(device.st_rdev)) {
        return Err(OpenError::PseudoTerminal(name));
    }
    let found =
        rustix::termios::tcgetattr(&fd).map_err(|_| OpenError::NotA(name, "serial port"))?;
    refuse_used(path, &fd)?;
    Ok(found)
}

/// A second descriptor of the same open port, owned here: the crate gives its own only as a number.
fn duplicate(port: &TTYPort) -> Result<OwnedFd, Errno> {
    let process: Pid = rustix::process::getpid();
    let process = rustix::process::pidfd_open(process, PidfdFlags::empty())?;
    rustix::process::pidfd_getfd(&process, port.as_raw_fd(), PidfdGetfdFlags::empty())
}

/// Lets the kernel mark every line error, and reads back whether the port does what it must.
fn set_marks(fd: impl AsFd, format: Format) -> Result<(), String> {
    let failed = |error: Errno| error.to_string();
    let mut termios = rustix::termios::tcgetattr(&fd).map_err(failed)?;
    termios.input_modes |= InputModes::INPCK | InputModes::PARMRK;
    termios.input_modes -= InputModes::IGNPAR | InputModes::ISTRIP | InputModes::IGNBRK;
    termios.input_modes -= InputModes::BRKINT;
    rustix::termios::tcsetattr(&fd, OptionalActions::Now, &termios).map_err(failed)?;
    let now = rustix::termios::tcgetattr(&fd).map_err(failed)?;
    let control = ControlModes::PARENB | ControlModes::CS8;
    let input = InputModes::INPCK | InputModes::PARMRK;
    let odd = now.control_modes.contains(ControlModes::PARODD);
    let other = odd != (format.parity == LineParity::Odd);
    if !now.control_modes.contains(control)
        || other
        || now.control_modes.contains(ControlModes::CSTOPB)
    {
        return Err(printed(format));
    }
    if !now.input_modes.contains(input) {
        return Err("the marking of line errors (INPCK and PARMRK)".to_owned());
    }
    // Some drivers say which rate the chip makes.
    let asked = format.bits_per_second;
    if now.output_speed().abs_diff(asked) > asked / 50 {
        return Err(format!("{} bit/s", format.bits_per_second));
    }
    Ok(())
}

impl Serial {
    pub(super) fn switches(&mut self) -> &mut Switches {
        &mut self.switches
    }

    /// A byte was read.
    pub(super) fn read(&mut self, byte: Received) -> Received {
        self.ledger.iter_mut().for_each(Ledger::read);
        self.switches.judged(byte)
    }

    /// Bytes since the last call that the driver has lost, or that another program has sent or read at this port, as far as the driver counts.
    pub(super) fn take_unplaced(&mut self, fd: &OwnedFd, has_come: bool) -> u64 {
        let now = Instant::now();
        let ledger = self.ledger.as_mut();
        let ledger = ledger.filter(|ledger| has_come || ledger.is_due(now));
        let beside = ledger.and_then(|ledger| Some(ledger.beside(harness_uart::counts(fd)?, now)));
        beside.map_or(0, |(lost, foreign)| lost + foreign)
    }

    /// Whether it is not known that the port makes the rate that it was asked for.
    pub(super) fn has_unproven_rate(&self) -> bool {
        self.unproven_rate
    }

    /// Whether a byte with a wrong parity bit can be sent, as far as the driver says so.
    pub(super) fn switches_parity(&self) -> bool {
        self.switches_parity
    }

    /// This number of bytes was written.
    pub(super) fn wrote(&mut self, bytes: usize) {
        self.ledger.iter_mut().for_each(|ledger| ledger.sent(bytes));
        let bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
        self.free = self.free.max(Instant::now()) + self.byte_time * bytes;
    }

    /// Waits until all bytes have left the line.
    pub(super) fn drain(&mut self, fd: &OwnedFd) -> io::Result<()> {
        rustix::termios::tcdrain(fd)?;
        settle(self.free, &mut self.hasty);
        Ok(())
    }

    /// Sends a byte with a wrong parity bit. What came before must have been read.
    pub(super) fn send_wrong_parity(&mut self, fd: &OwnedFd, byte: u8) -> io::Result<()> {
        self.ledger.iter_mut().for_each(|ledger| ledger.sent(1));
        let idle = send_wrong_parity(
            &mut fd.as_fd(),
            byte,
            self.odd,
            self.byte_time,
            &mut self.hasty,
        )?;
        self.switches.note(idle, Instant::now());
        Ok(())
    }

    /// Holds the line at 0.
    pub(super) fn send_break(&mut self, fd: &OwnedFd, span: Span) -> io::Result<()> {
        self.drain(fd)?;
        self.port.set_break().map_err(io::Error::from)?;
        std::thread::sleep(Duration::from_nanos(span.as_nanos()));
        self.port.clear_break().map_err(io::Error::from)
    }
}

/// What a byte with a wrong parity bit needs of a port.
trait ParityPort {
    /// Waits until all bytes have left the line.
    fn drain(&mut self) -> io::Result<()>;

    /// Sets odd or even parity, and reads it back.
    fn set_odd(&mut self, odd: bool) -> io::Result<()>;

    /// Hands over a byte.
    fn put(&mut self, byte: u8) -> io::Result<()>;
}

/// Sends a byte with a wrong parity bit: the other parity between drained bytes, which is wrong for every byte of the line;
/// mark and space (CMSPAR) would be right for half of them, and fewer drivers know them.
///
/// Returns how long the line was delayed. Afterwards the parity is right again, or the result is an error.
fn send_wrong_parity(
    port: &mut impl ParityPort,
    byte: u8,
    odd: bool,
    byte_time: Duration,
    hasty: &mut bool,
) -> io::Result<Duration> {
    port.drain()?;
    let start = Instant::now();
    let sent = port.set_odd(!odd).and_then(|()| {
        let begun = Instant::now();
        port.put(byte)?;
        port.drain()?;
        settle(begun + byte_time, hasty);
        Ok(())
    });
    let restored = port.set_odd(odd);
    sent.and(restored)?;
    Ok(start.elapsed())
}

/// Waits after a drain until bytes have left that are due at `free`. Some drivers of USB adapters say so too early.
fn settle(free: Instant, hasty: &mut bool) {
    let now = Instant::now();
    *hasty |= now < free;
    if *hasty {
        std::thread::sleep((free + HASTY).saturating_duration_since(now));
    }
}

impl ParityPort for BorrowedFd<'_> {
    fn drain(&mut self) -> io::Result<()> {
        Ok(rustix::termios::tcdrain(*self)?)
    }

    fn set_odd(&mut self, odd: bool) -> io::Result<()> {
        switch_parity(*self, odd)
    }

    fn put(&mut self, byte: u8) -> io::Result<()> {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            match rustix::io::write(*self, &[byte]) {
                Ok(1) => return Ok(()),
                // The port has just been drained: there is room in a moment.
                Ok(_) | Err(Errno::AGAIN | Errno::INTR) => std::thread::yield_now(),
                Err(error) => return Err(error.into()),
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }
}

/// Sets the parity and reads it back: some drivers of USB adapters ignore it.
fn switch_parity(fd: impl AsFd, odd: bool) -> io::Result<()> {
    let mut termios = rustix::termios::tcgetattr(&fd)?;
    termios.control_modes.set(ControlModes::PARODD, odd);
    rustix::termios::tcsetattr(&fd, OptionalActions::Now, &termios)?;
    let now = rustix::termios::tcgetattr(&fd)?;
    if now.control_modes.contains(ControlModes::PARODD) == odd {
        return Ok(());
    }
    Err(io::Error::other(
        "the driver of this port does not switch the parity",
    ))
}

/// Whether a driver takes the other parity and the right one again; nothing is sent.
fn tries_parity(fd: impl AsFd, odd: bool) -> bool {
    [!odd, odd]
        .into_iter()
        .all(|odd| switch_parity(&fd, odd).is_ok())
}

#[cfg(test)]
#[path = "serial_tests.rs"]
mod tests;
