//! What carries frames to an adapter and back: a stream in a language of its own, or an interface of the kernel.

use super::adapter::{Adapter, Event};
use crate::port::{LastWords, Outgoing, Wire};
use crate::trouble::Trouble;
use harness_proto::can::Frame;
use harness_proto::time::Instant;
use rustix::event::PollFd;
use rustix::fd::BorrowedFd;
use std::collections::VecDeque;
use std::fmt;
use std::io;

/// The way to an open CAN adapter. Times are those of the adapter's clock, which begins when it is opened.
pub(super) trait FrameTransport: fmt::Debug + Send {
    /// Where it leads, as the rig's file says it.
    fn name(&self) -> &str;
    /// Its descriptor, for locks.
    fn fd(&self) -> BorrowedFd<'_>;
    /// For waiting.
    fn poll_fd(&self) -> PollFd<'_>;
    /// Whether something waits for the operating system.
    fn waits(&self) -> bool;
    /// Whether there is such a frame here.
    fn carries(&self, frame: &Frame) -> bool;
    /// Whether the next frame may be handed over.
    fn is_ready(&self) -> bool;
    /// Takes a frame to be sent.
    fn send(&mut self, now: Instant, frame: &Frame) -> Result<(), Trouble>;
    /// Does what is due, and hands over what waits.
    fn attend(&mut self, now: Instant) -> Result<(), Trouble>;
    /// When [`Self::attend`] is to be called again.
    fn due(&self) -> Option<Instant>;
    /// Reads what was received into `events`, including what came before an error.
    fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble>;
    /// How another thread can send frames.
    fn last_words(&self) -> io::Result<LastWords>;
    /// Whether it recovers from bus-off by itself.
    fn restarts(&self) -> bool {
        false
    }
    /// Takes it up again where it was lost, and is back soon.
    fn revive(&mut self) -> bool {
        false
    }
}

#[derive(Debug)]
pub(super) struct StreamTransport {
    pub(super) wire: Wire,
    pub(super) adapter: Adapter,
    /// What the opening has read after the last answer.
    pub(super) come: VecDeque<u8>,
}

impl StreamTransport {
    fn put(&mut self, bytes: &[u8]) -> Result<(), Trouble> {
        let mut bytes = bytes.iter();
        bytes.try_for_each(|byte| self.wire.send(Outgoing::Byte(*byte)))?;
        self.wire.flush()
    }
}

impl Drop for StreamTransport {
    fn drop(&mut self) {
        let mut close = Vec::new();
        self.adapter.close(&mut close);
        // A port that is gone has no channel any more.
        let _gone = self.put(&close);
    }
}

impl FrameTransport for StreamTransport {
    fn name(&self) -> &str {
        self.wire.name()
    }

    fn fd(&self) -> BorrowedFd<'_> {
        self.wire.fd()
    }

    fn poll_fd(&self) -> PollFd<'_> {
        self.wire.poll_fd()
    }

    fn waits(&self) -> bool {
        self.wire.waiting() > 0
    }

    fn carries(&self, frame: &Frame) -> bool {
        self.adapter.carries(frame)
    }

    fn is_ready(&self) -> bool {
        self.adapter.is_ready()
    }

    fn send(&mut self, now: Instant, frame: &Frame) -> Result<(), Trouble> {
        let mut bytes = Vec::new();
        self.adapter.send(now, frame, &mut bytes);
        self.put(&bytes)
    }

    fn attend(&mut self, now: Instant) -> Result<(), Trouble> {
        let mut bytes = Vec::new();
        self.adapter.attend(now, &mut bytes);
        self.put(&bytes)
    }

    fn due(&self) -> Option<Instant> {
        self.adapter.due()
    }

    fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble> {
        let mut read = Vec::new();
        let result = self.wire.receive(&mut read);
        let come = self.come.drain(..);
        for byte in come.chain(read.iter().map(|received| received.byte)) {
            events.extend(self.adapter.push(byte, now));
        }
        result
    }

    fn last_words(&self) -> io::Result<LastWords> {
        self.wire.last_words(self.adapter.parts())
    }
}
