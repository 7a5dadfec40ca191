//! One stream with its coding.

use super::last_words::{LastWords, WireParts};
use super::rfc2217::{Telnet, is_telnet};
use super::serial::{Serial, Switch};
use crate::counted::counted;
use crate::trouble::Trouble;
use harness_proto::line::{LineError, Received};
use harness_proto::marks::{Unmark, mark};
use harness_proto::time::Span;
use rustix::event::{PollFd, PollFlags};
use rustix::io::Errno;
use std::collections::VecDeque;
use std::io::ErrorKind;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Instant;

/// How much is read from the operating system at a time: few bytes arrive between two polls.
const CHUNK: usize = 256;

/// How often the operating system is asked in one poll: a peer that sends faster than it is read must not block the caller.
const MOST_CHUNKS: usize = 1_024;

/// What may wait to be taken by the operating system.
pub(super) const MOST_WAITING: usize = 65_536;

/// What a wire can do besides carrying bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Abilities {
    /// A line error received is shown at its byte.
    pub shows_errors: bool,
    /// A byte can be sent with a wrong parity bit.
    pub sends_wrong_parity: bool,
    /// A break can be sent.
    pub sends_break: bool,
}

/// What can be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outgoing {
    Byte(u8),
    /// A byte whose parity bit is wrong.
    WrongParity(u8),
    /// The line at 0 for this long.
    Break(Span),
}

/// How bytes and line errors are written into the stream.
#[derive(Debug)]
pub(super) enum Coding {
    /// Bytes alone.
    Plain,
    /// In-band marks both ways.
    Marked(Unmark),
    /// A serial port: marks from the kernel, bytes to it.
    Serial(Unmark, Box<Serial>),
    /// Telnet with the COM port options of RFC 2217.
    Telnet(Box<Telnet>),
}

/// An open stream with its coding.
#[derive(Debug)]
pub struct Wire {
    fd: OwnedFd,
    name: String,
    coding: Coding,
    waiting: VecDeque<WirePiece>,
    /// Bytes in `waiting`.
    bytes_waiting: usize,
    /// Line errors whose byte is not known.
    unplaced: u64,
    /// Bytes that were read, as coded.
    read: u64,
    /// What was read before the parity was switched.
    early: Vec<Received>,
    /// A serial port under plain bytes: its settings are put back with it.
    plain_serial: Option<Box<Serial>>,
    /// The first bytes of a connection that should carry bytes alone, and what to do if they are telnet's; `None` once they are known.
    first: Option<(Vec<u8>, &'static str)>,
}

#[derive(Debug)]
enum WirePiece {
    /// Coded bytes.
    Bytes(VecDeque<u8>),
    WrongParity(u8),
    Break(Span),
}

impl Wire {
    pub(super) fn new(fd: OwnedFd, name: String, coding: Coding) -> Self {
        Self {
            fd,
            name,
            coding,
            waiting: VecDeque::new(),
            bytes_waiting: 0,
            unplaced: 0,
            read: 0,
            early: Vec::new(),
            plain_serial: None,
            first: None,
        }
    }

    /// The same over a connection: one that begins as telnet does is refused, with this remedy.
    pub(super) fn without_telnet(self, remedy: &'static str) -> Self {
        Self {
            first: Some((Vec::new(), remedy)),
            ..self
        }
    }

    /// The same over a serial port that carries plain bytes.
    pub(super) fn keeping(self, serial: Serial) -> Self {
        Self {
            plain_serial: Some(Box::new(serial)),
            ..self
        }
    }

    /// The name of the port in the rig's file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The descriptor, for locks.
    #[must_use]
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }

    /// How another thread can send when the owner of this wire hangs, coded as on this wire.
    ///
    /// # Errors
    /// No more descriptors are available.
    pub fn last_words(&self, parts: WireParts) -> std::io::Result<LastWords> {
        let fd = self.fd.try_clone()?;
        let plain = LastWords::plain(fd, self.name.clone(), parts);
        Ok(match &self.coding {
            Coding::Plain | Coding::Serial(..) => plain,
            Coding::Marked(_) => plain.coded(|byte| mark(Received::good(byte)).as_bytes().to_vec()),
            Coding::Telnet(_) => plain.coded(|byte| {
                let (escaped, length) = Telnet::escape(byte);
                escaped[..length].to_vec()
            }),
        })
    }

    /// What it shows and does.
    #[must_use]
    pub fn abilities(&self) -> Abilities {
        match self.coding {
            Coding::Plain | Coding::Telnet(_) => Abilities::default(),
            Coding::Marked(_) | Coding::Serial(..) => Abilities {
                shows_errors: true,
                sends_wrong_parity: match &self.coding {
                    Coding::Serial(_, serial) => serial.switches_parity(),
                    _ => true,
                },
                sends_break: true,
            },
        }
    }

    /// Whether it is a port of this computer with a parity of its own.
    pub fn is_uart(&self) -> bool {
        matches!(self.coding, Coding::Serial(..))
    }

    /// Whether bytes reach the other end as soon as they are handed over: no adapter collects them for a millisecond.
    #[must_use]
    pub(crate) fn is_prompt(&self) -> bool {
        match self.coding {
            Coding::Plain | Coding::Marked(_) => self.plain_serial.is_none(),
            Coding::Serial(..) | Coding::Telnet(_) => false,
        }
    }

    /// Whether it is a serial port of which it is not known that it makes the rate that it was asked for.
    pub fn has_unproven_rate(&self) -> bool {
        matches!(&self.coding, Coding::Serial(_, serial) if serial.has_unproven_rate())
    }

    /// Number of line errors that the other end has reported without their bytes since the last call.
    pub fn take_unplaced(&mut self) -> u64 {
        std::mem::take(&mut self.unplaced)
    }

    /// Every time that the parity was switched to send a byte with a wrong parity bit.
    pub fn take_switches(&mut self) -> Vec<Switch> {
        match &mut self.coding {
            Coding::Serial(_, serial) => serial.switches().take(),
            _ => Vec::new(),
        }
    }

    /// For waiting on several wires at once; also for room to send, where something waits.
    #[must_use]
    pub fn poll_fd(&self) -> PollFd<'_> {
        let mut flags = PollFlags::IN;
        if !self.waiting.is_empty() {
            flags |= PollFlags::OUT;
        }
        PollFd::from_borrowed_fd(self.fd.as_fd(), flags)
    }

    /// Bytes that the operating system has not taken yet, as coded.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.bytes_waiting
    }

    /// Takes something to be sent, after what waits.
    ///
    /// # Errors
    /// [`Trouble::Lost`] where the other end has not taken anything for so long that too much waits.
    pub fn send(&mut self, outgoing: Outgoing) -> Result<(), Trouble> {
        if self.bytes_waiting > MOST_WAITING {
            return Err(Trouble::Lost(format!(
                "{}: the other end takes no bytes ({} wait)",
                self.name, self.bytes_waiting
            )));
        }
        let waiting = match (&mut self.coding, outgoing) {
            (Coding::Serial(..), Outgoing::WrongParity(byte)) => WirePiece::WrongParity(byte),
            (Coding::Serial(..), Outgoing::Break(span)) => WirePiece::Break(span),
            (Coding::Marked(_), Outgoing::WrongParity(byte)) => {
                return self.queue(mark(Received::bad(byte, LineError::Parity)).as_bytes());
            }
            (Coding::Marked(_), Outgoing::Break(_)) => {
                return self.queue(mark(Received::bad(0, LineError::Break)).as_bytes());
            }
            (Coding::Marked(_), Outgoing::Byte(byte)) => {
                return self.queue(mark(Received::good(byte)).as_bytes());
            }
            (Coding::Telnet(_), Outgoing::Byte(byte)) => {
                let (bytes, length) = Telnet::escape(byte);
                return self.queue(&bytes[..length]);
            }
            // What a wire cannot send is sent as a good byte; callers check its abilities first.
            (_, Outgoing::Byte(byte) | Outgoing::WrongParity(byte)) => {
                return self.queue(&[byte]);
            }
            (Coding::Plain | Coding::Telnet(_), Outgoing::Break(_)) => return Ok(()),
        };
        self.bytes_waiting += 1;
        self.waiting.push_back(waiting);
        Ok(())
    }

    fn queue(&mut self, bytes: &[u8]) -> Result<(), Trouble> {
        self.bytes_waiting += bytes.len();
        if let Some(WirePiece::Bytes(queue)) = self.waiting.back_mut() {
            queue.extend(bytes);
        } else {
            let queue = bytes.iter().copied().collect();
            self.waiting.push_back(WirePiece::Bytes(queue));
        }
        Ok(())
    }

    /// Gives the operating system as much as it takes.
    ///
    /// # Errors
    /// [`Trouble::Lost`]: the port is gone or the connection closed.
    pub fn flush(&mut self) -> Result<(), Trouble> {
        while let Some(first) = self.waiting.front_mut() {
            match first {
                WirePiece::Bytes(queue) => match rustix::io::write(&self.fd, queue.as_slices().0) {
                    Ok(taken) => {
                        if let Coding::Serial(_, serial) = &mut self.coding {
                            serial.wrote(taken);
                        }
                        queue.drain(..taken);
                        self.bytes_waiting -= taken;
                        if !queue.is_empty() {
                            continue;
                        }
                    }
                    Err(Errno::AGAIN) => return Ok(()),
                    Err(Errno::INTR) => continue,
                    Err(error) => return Err(self.lost(error)),
                },
                WirePiece::WrongParity(byte) => {
                    let byte = *byte;
                    self.send_wrong_parity(byte)?;
                    self.bytes_waiting -= 1;
                }
                WirePiece::Break(span) => {
                    let span = *span;
                    let sent = match &mut self.coding {
                        Coding::Serial(_, serial) => serial.send_break(&self.fd, span),
                        _ => Ok(()),
                    };
                    sent.map_err(|error| self.lost(error))?;
                    self.bytes_waiting -= 1;
                }
            }
            self.waiting.pop_front();
        }
        Ok(())
    }

    /// Sends a byte with a wrong parity bit on a serial port. What came before the parity is switched keeps its line errors.
    fn send_wrong_parity(&mut self, byte: u8) -> Result<(), Trouble> {
        let drained = match &mut self.coding {
            Coding::Serial(_, serial) => serial.drain(&self.fd),
            _ => Ok(()),
        };
        drained.map_err(|error| self.lost(error))?;
        let mut early = std::mem::take(&mut self.early);
        let read = self.read_all(&mut early);
        self.early = early;
        read?;
        let sent = match &mut self.coding {
            Coding::Serial(_, serial) => serial.send_wrong_parity(&self.fd, byte),
            _ => Ok(()),
        };
        sent.map_err(|error| self.lost(error))
    }

    fn lost(&self, error: impl Into<std::io::Error>) -> Trouble {
        let error = error.into();
        match error.kind() {
            _ if self.has_no_adapter(Some(&error)) => self.closed(),
            ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => self.closed(),
            _ => Trouble::Lost(format!("{}: the port is lost: {error}", self.name)),
        }
    }

    /// What a serial port shows when its adapter is gone: an end, or one of these errors.
    fn has_no_adapter(&self, error: Option<&std::io::Error>) -> bool {
        let gone = [Errno::IO, Errno::NODEV, Errno::NXIO].map(|errno| Some(errno.raw_os_error()));
        let is_port = self.is_uart() || self.plain_serial.is_some();
        is_port && error.is_none_or(|error| gone.contains(&error.raw_os_error()))
    }

    fn closed(&self) -> Trouble {
        if self.has_no_adapter(None) {
            return Trouble::Lost(format!(
                "{}: the port is lost: its adapter was pulled out or has no power",
                self.name
            ));
        }
        let when = match self.read {
            0 => "before it sent a byte".to_owned(),
            read => format!("after it sent {}", counted(read, "byte")),
        };
        Trouble::Lost(format!(
            "{}: the other end has closed the connection {when}",
            self.name
        ))
    }

    /// Whether something is read that [`Self::receive`] has not given yet: the operating system does not report it again.
    #[must_use]
    pub(crate) fn has_early(&self) -> bool {
        !self.early.is_empty()
    }

    /// Reads what was received.
    ///
    /// # Errors
    /// [`Trouble::Lost`] where the port is gone or the other end has closed the connection,
    /// [`Trouble::Garbled`] if the input is not coded as required. The input before it is in `into`.
    pub fn receive(&mut self, into: &mut Vec<Received>) -> Result<(), Trouble> {
        into.append(&mut self.early);
        self.read_all(into)
    }

    fn read_all(&mut self, into: &mut Vec<Received>) -> Result<(), Trouble> {
        let (by, before) = (Instant::now(), into.len());
        self.read_chunks(into)?;
        if let Coding::Serial(_, serial) = &mut self.coding {
            serial.switches().has_read_all(by);
            self.unplaced += serial.take_unplaced(&self.fd, into.len() > before);
        }
        Ok(())
    }

    fn read_chunks(&mut self, into: &mut Vec<Received>) -> Result<(), Trouble> {
        let mut buffer = [0; CHUNK];
        for _ in 0..MOST_CHUNKS {
            let length = match rustix::io::read(&self.fd, &mut buffer) {
                Ok(0) => return Err(self.closed()),
                Ok(length) => length,
                Err(Errno::AGAIN) => return Ok(()),
                Err(Errno::INTR) => continue,
                Err(error) => return Err(self.lost(error)),
            };
            self.read += length as u64;
            self.look_for_telnet(&buffer[..length])?;
            self.decode(&buffer[..length], into)?;
            if length < CHUNK {
                return Ok(());
            }
        }
        Ok(())
    }

    fn look_for_telnet(&mut self, bytes: &[u8]) -> Result<(), Trouble> {
        let Some((first, remedy)) = &mut self.first else {
            return Ok(());
        };
        first.extend(bytes.iter().take(3 - first.len()));
        let Ok([iac, command, option]) = <[u8; 3]>::try_from(first.as_slice()) else {
            return Ok(());
        };
        let remedy = *remedy;
        self.first = None;
        match is_telnet([iac, command, option]) {
            true => Err(Trouble::Garbled(format!(
                "{}: the other end speaks telnet or RFC 2217: its first bytes are {iac:02X} {command:02X} {option:02X}. Next: {remedy}",
                self.name
            ))),
            false => Ok(()),
        }
    }

    fn decode(&mut self, bytes: &[u8], into: &mut Vec<Received>) -> Result<(), Trouble> {
        match &mut self.coding {
            Coding::Plain => into.extend(bytes.iter().map(|byte| Received::good(*byte))),
            Coding::Marked(unmark) => {
                for byte in unmarked(unmark, bytes, &self.name) {
                    into.push(byte?);
                }
            }
            Coding::Serial(unmark, serial) => {
                for byte in unmarked(unmark, bytes, &self.name) {
                    into.push(serial.read(byte?));
                }
            }
            Coding::Telnet(telnet) => {
                for byte in bytes {
                    into.extend(telnet.push(*byte).map(Received::good));
                }
                self.unplaced += telnet.take_errors();
                let replies = telnet.take_replies();
                self.queue(&replies)?;
                self.flush()?;
            }
        }
        Ok(())
    }
}

/// Bytes without their marks.
fn unmarked<'a>(
    unmark: &'a mut Unmark,
    bytes: &'a [u8],
    name: &'a str,
) -> impl Iterator<Item = Result<Received, Trouble>> + 'a {
    let bytes = bytes.iter().filter_map(|byte| unmark.push(*byte));
    bytes.map(move |byte| byte.map_err(|bad| Trouble::Garbled(format!("{name}: {bad}"))))
}
