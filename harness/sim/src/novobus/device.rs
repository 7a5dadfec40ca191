//! The devices of a ring: anything that answers bytes with bytes.

use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{Deadline, Reaction, Relay};
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};

/// A drive as the ring sees it: bytes and deadlines, no topology.
pub trait Device: Clone {
    /// A byte has arrived.
    fn receive(&mut self, now: Instant, received: Received) -> Reaction;

    /// When the device next acts without a byte.
    fn deadline(&self) -> Option<Deadline>;

    /// The deadline has come.
    fn handle_deadline(&mut self, now: Instant) -> Reaction;

    /// Does everything that the device does without the bus, up to and including `now`.
    fn advance(&mut self, now: Instant) {
        let _nothing_of_its_own = now;
    }

    /// The power has come back after it had been off: everything but the EEPROM is lost.
    fn power_on(&mut self, now: Instant);

    /// Whether the device is in the bus's error mode.
    fn in_error(&self) -> bool;

    /// Why it last went into the error mode.
    fn cause(&self) -> Option<BusError>;

    /// How much earlier than one byte time its answers go out. A drive stores and forwards, so this
    /// is 0 (ND21 8.2).
    fn head_start(&self) -> Span {
        Span::ZERO
    }

    /// What the device keeps of bytes that it only passes on. While this is not `None`, a byte that is not for it needs no
    /// [`Self::receive`]: the device sends it on as [`Relay::receive`] says, and [`Self::has_relayed`] makes up for any number of them.
    /// [`Self::answer`] takes a byte that is for it. The device answers each of these, has no deadline, and does nothing of its own that the
    /// bus shows.
    fn relay(&self) -> Option<Relay> {
        None
    }

    /// Takes an undamaged byte that is for the device, as [`Self::receive`] does; called only while [`Self::relay`] is not `None`.
    fn answer(&mut self, now: Instant, byte: u8) -> Reaction {
        let _never_called = (now, byte);
        Reaction::default()
    }

    /// Makes up for bytes that were passed on without it, the last of them at `at`.
    fn has_relayed(&mut self, at: Instant, relay: Relay) {
        let _never_called = (at, relay);
    }
}
