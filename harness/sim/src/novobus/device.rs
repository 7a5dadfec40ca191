//! The devices of a ring: anything that answers bytes with bytes.

use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{Deadline, Reaction};
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};

/// A drive as the ring sees it: bytes and deadlines, no topology.
pub trait Device {
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
}
