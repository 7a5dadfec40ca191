//! An interface of Linux's SocketCAN: frames as the kernel has them (`struct can_frame` of `linux/can.h`).
//!
//! Rate and listen-only are settings of the interface, which its administrator makes: `ip link set can0 type can bitrate 500000
//! listen-only on`. This is the optional feature `socketcan`. Its codec is tested; the socket was never tried on a kernel with CAN.

use super::adapter::Event;
use super::open::AdapterError;
use super::transport::Transport;
use crate::frames::socketcand::class;
use crate::frames::socketcand::flag::{ERROR, EXTENDED, REMOTE};
use crate::port::{LastWords, OpenError};
use crate::trouble::Trouble;
use harness_proto::can::{CanError, CanEvent, Frame, Id, MAX_DATA};
use harness_proto::time::Instant;
use rustix::event::{PollFd, PollFlags};
use rustix::fd::{AsFd, BorrowedFd};
use rustix::io::Errno;
use socketcan::{CanSocket, Socket, SocketOptions};
use std::collections::VecDeque;
use std::io;

/// The length of the kernel's frame.
const LENGTH: usize = 16;

/// Where the data begins in it.
const DATA: usize = 8;

/// Frames that wait for the kernel at most.
const MOST_WAITING: usize = 1_000;

/// A raw socket of an interface.
#[derive(Debug)]
pub(super) struct Kernel {
    socket: CanSocket,
    name: String,
    queue: VecDeque<[u8; LENGTH]>,
}

impl Kernel {
    /// Opens an interface, with reports of its errors. With `listen_only` it has to be in that mode.
    pub(super) fn open(interface: &str, listen_only: bool) -> Result<Self, AdapterError> {
        if listen_only && !mode_is_listen_only(interface) {
            return Err(AdapterError::Refused {
                port: interface.to_owned(),
                what: "to listen only: `ip -details link show` does not name this mode".to_owned(),
                remedy: "set it while the interface is down: `ip link set can0 type can bitrate 500000 listen-only on`",
            });
        }
        let failed = |error: io::Error| {
            AdapterError::Open(OpenError::Other {
                port: interface.to_owned(),
                error,
            })
        };
        let socket = CanSocket::open(interface).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        socket.set_error_filter_accept_all().map_err(failed)?;
        Ok(Self {
            socket,
            name: interface.to_owned(),
            queue: VecDeque::new(),
        })
    }

    fn lost(&self, error: impl std::fmt::Display) -> Trouble {
        Trouble::Lost(format!("{}: the interface is lost: {error}", self.name))
    }

    fn flush(&mut self) -> Result<(), Trouble> {
        while let Some(frame) = self.queue.front() {
            match rustix::io::write(&self.socket, frame) {
                Ok(_) => {
                    self.queue.pop_front();
                }
                // The interface's own queue is full.
                Err(Errno::AGAIN | Errno::NOBUFS) => return Ok(()),
                Err(Errno::INTR) => {}
                Err(error) => return Err(self.lost(error)),
            }
        }
        Ok(())
    }
}

impl Transport for Kernel {
    fn name(&self) -> &str {
        &self.name
    }

    fn fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    fn poll_fd(&self) -> PollFd<'_> {
        let mut flags = PollFlags::IN;
        flags.set(PollFlags::OUT, !self.queue.is_empty());
        PollFd::new(&self.socket, flags)
    }

    fn waits(&self) -> bool {
        !self.queue.is_empty()
    }

    fn carries(&self, _frame: &Frame) -> bool {
        true
    }

    fn is_ready(&self) -> bool {
        self.queue.is_empty()
    }

    fn send(&mut self, _now: Instant, frame: &Frame) -> Result<(), Trouble> {
        if self.queue.len() >= MOST_WAITING {
            return Err(self.lost("it takes no frames"));
        }
        self.queue.push_back(encode(frame));
        self.flush()
    }

    fn attend(&mut self, _now: Instant) -> Result<(), Trouble> {
        self.flush()
    }

    fn due(&self) -> Option<Instant> {
        None
    }

    fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble> {
        loop {
            let mut frame = [0; LENGTH];
            match rustix::io::read(&self.socket, &mut frame) {
                Ok(LENGTH) => events.extend(decode(&frame).map(|heard| Event::Heard(now, heard))),
                Ok(_) => {}
                Err(Errno::AGAIN) => return Ok(()),
                Err(Errno::INTR) => {}
                Err(error) => return Err(self.lost(error)),
            }
        }
    }

    fn last_words(&self, frames: &[Frame]) -> io::Result<Vec<LastWords>> {
        // The kernel takes one frame at a time.
        let words = frames.iter().map(|frame| {
            let fd = self.socket.as_fd().try_clone_to_owned()?;
            Ok(LastWords::raw(
                fd,
                self.name.clone(),
                encode(frame).to_vec(),
            ))
        });
        words.collect()
    }
}

/// Whether an interface is in listen-only mode, as `ip` of iproute2 reads it back from the kernel.
fn mode_is_listen_only(interface: &str) -> bool {
    let arguments = ["-details", "-json", "link", "show", "dev", interface];
    let output = std::process::Command::new("ip").args(arguments).output();
    output.is_ok_and(|own| listens_only(&own.stdout))
}

/// The same, of what `ip` says.
fn listens_only(json: &[u8]) -> bool {
    let links: serde_json::Value = serde_json::from_slice(json).unwrap_or_default();
    let mode = links.pointer("/0/linkinfo/info_data/ctrlmode");
    let words = mode.and_then(serde_json::Value::as_array);
    words.is_some_and(|own| own.iter().any(|word| word == "LISTEN-ONLY"))
}

fn encode(frame: &Frame) -> [u8; LENGTH] {
    let mut id = frame.id().number();
    if frame.id().is_extended() {
        id |= EXTENDED;
    }
    if frame.is_remote() {
        id |= REMOTE;
    }
    let mut bytes = [0; LENGTH];
    bytes[..4].copy_from_slice(&id.to_ne_bytes());
    bytes[4] = frame.dlc() as u8;
    bytes[DATA..DATA + frame.data().len()].copy_from_slice(frame.data());
    bytes
}

/// What a frame of the kernel reports; `None` for what says nothing of the bus.
fn decode(bytes: &[u8; LENGTH]) -> Option<CanEvent> {
    let id = u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let number = id & Id::MAX_EXTENDED;
    if id & ERROR != 0 {
        return match number {
            bits if bits & class::BUS_OFF != 0 => Some(CanEvent::Error(CanError::BusOff)),
            bits if bits & class::NO_ACKNOWLEDGE != 0 => {
                Some(CanEvent::Error(CanError::NoAcknowledge))
            }
            bits if bits & class::RESTARTED != 0 => None,
            _ => Some(CanEvent::Error(CanError::ErrorFrame)),
        };
    }
    let id_of = match id & EXTENDED != 0 {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let len = usize::from(bytes[4]).min(MAX_DATA);
    let frame = match id & REMOTE != 0 {
        true => Frame::remote(id_of?, len),
        false => Frame::new(id_of?, &bytes[DATA..DATA + len]),
    };
    frame.ok().map(CanEvent::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_kernel_survive() {
        for text in [
            "201#3D4000",
            "1FFFFFFF#R8",
            "181#",
            "00000181#0011223344556677",
        ] {
            let frame: Frame = text.parse().expect("a frame");
            assert_eq!(decode(&encode(&frame)), Some(CanEvent::Frame(frame)));
        }
        let error = |class: u32| {
            let mut bytes = [0; LENGTH];
            bytes[..4].copy_from_slice(&(ERROR | class).to_ne_bytes());
            decode(&bytes)
        };
        assert_eq!(
            error(class::BUS_OFF),
            Some(CanEvent::Error(CanError::BusOff))
        );
        assert_eq!(
            error(class::CONTROLLER),
            Some(CanEvent::Error(CanError::ErrorFrame))
        );
        assert_eq!(error(class::RESTARTED), None);
    }

    /// As iproute2 writes it.
    #[test]
    fn the_mode_is_read_back() {
        let of = |modes: &str| {
            format!(
                r#"[{{"ifname":"can0","linkinfo":{{"info_kind":"can","info_data":{{"ctrlmode":[{modes}],"state":"ERROR-ACTIVE"}}}}}}]"#
            )
        };
        assert!(listens_only(of(r#""LOOPBACK","LISTEN-ONLY""#).as_bytes()));
        assert!(!listens_only(of(r#""LOOPBACK""#).as_bytes()));
        assert!(!listens_only(b"Device \"can0\" does not exist."));
        assert!(Kernel::open("can-none0", true).is_err());
    }

    #[test]
    fn an_interface_that_is_not_there_is_named() {
        let error = Kernel::open("can-none0", false)
            .expect_err("no interface")
            .to_string();
        assert!(error.contains("can-none0"), "{error}");
    }
}
