//! An interface of Linux's SocketCAN as a way to the bus, by the crate `harness-socketcan`.

use super::adapter::Event;
use super::open::{AdapterError, Listening};
use super::transport::Transport;
use crate::port::{LastWords, OpenError};
use crate::trouble::Trouble;
use harness_proto::can::Frame;
use harness_proto::time::Instant;
use harness_socketcan as socketcan;
use rustix::event::{PollFd, PollFlags};
use rustix::fd::{AsFd, BorrowedFd};
use std::collections::VecDeque;
use std::io;

/// Frames that wait for the kernel at most.
const MOST_WAITING: usize = 1_000;

/// An open interface, with the frames that its queue has no room for.
#[derive(Debug)]
pub(super) struct Kernel {
    interface: socketcan::Interface,
    name: String,
    queue: VecDeque<[u8; socketcan::LENGTH]>,
}

impl Kernel {
    /// Opens an interface. With `listen_only` it has to be in that mode, unless it may acknowledge.
    pub(super) fn open(
        name: &str,
        listen_only: bool,
        may_acknowledge: bool,
    ) -> Result<(Self, Listening), AdapterError> {
        let port = name.to_owned();
        match socketcan::Interface::open(name, listen_only) {
            Ok(interface) => {
                let own = Self {
                    interface,
                    name: port,
                    queue: VecDeque::new(),
                };
                let listening = match listen_only {
                    true => Listening::Only("LISTEN-ONLY"),
                    false => Listening::MayAcknowledge,
                };
                Ok((own, listening))
            }
            Err(socketcan::OpenError::NotListenOnly) if may_acknowledge => {
                Self::open(name, false, false)
            }
            Err(socketcan::OpenError::NotBuilt) => Err(AdapterError::NotBuilt(port)),
            Err(socketcan::OpenError::NotListenOnly) => Err(AdapterError::Refused {
                port,
                what: "to listen only: `ip -details link show` does not name this mode".to_owned(),
                remedy: "set it while the interface is down: `ip link set can0 type can bitrate 500000 listen-only on`",
            }),
            Err(socketcan::OpenError::System(error)) => {
                Err(AdapterError::Open(OpenError::Other { port, error }))
            }
        }
    }

    fn lost(&self, error: impl std::fmt::Display) -> Trouble {
        Trouble::Lost(format!("{}: the interface is lost: {error}", self.name))
    }

    fn flush(&mut self) -> Result<(), Trouble> {
        while let Some(frame) = self.queue.front() {
            match self.interface.send(frame) {
                Ok(true) => drop(self.queue.pop_front()),
                Ok(false) => return Ok(()),
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
        self.interface.as_fd()
    }

    fn poll_fd(&self) -> PollFd<'_> {
        let mut flags = PollFlags::IN;
        flags.set(PollFlags::OUT, !self.queue.is_empty());
        PollFd::new(&self.interface, flags)
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
        self.queue.push_back(socketcan::encode(frame));
        self.flush()
    }

    fn attend(&mut self, _now: Instant) -> Result<(), Trouble> {
        self.flush()
    }

    fn due(&self) -> Option<Instant> {
        None
    }

    fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble> {
        let interface = &self.interface;
        let end = interface.receive(|heard| events.push(Event::Heard(now, heard)));
        end.map_err(|error| self.lost(error))
    }

    fn last_words(&self, frames: &[Frame]) -> io::Result<Vec<LastWords>> {
        // The kernel takes one frame at a time.
        let words = frames.iter().map(|frame| {
            let fd = self.interface.as_fd().try_clone_to_owned()?;
            Ok(LastWords::raw(
                fd,
                self.name.clone(),
                socketcan::encode(frame).to_vec(),
            ))
        });
        words.collect()
    }
}
