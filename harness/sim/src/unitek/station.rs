//! The drive as a station of a segment, and what else is on it.

use super::drive::Drive;
use crate::segment::{Host, Station};
use harness_proto::can::{BusError, Frame};
use harness_proto::time::Instant;

impl Station for Drive {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        if self.is_powered() {
            // What it ignores is its own affair.
            let _ = self.receive(at, frame);
        }
    }

    fn wants(&self) -> Option<(Instant, Frame)> {
        Drive::wants(self).map(|waiting| (waiting.ready, waiting.frame))
    }

    fn sent(&mut self, _at: Instant) {
        let _ = Drive::sent(self);
    }

    fn next_action(&self) -> Option<Instant> {
        self.next_scan()
    }

    fn advance(&mut self, to: Instant) {
        Drive::advance(self, to);
    }

    fn acknowledges(&self) -> bool {
        self.is_powered()
    }
}

/// A host or a drive.
#[derive(Clone, Debug)]
pub enum Member<D> {
    /// A host: a bench, a client, a tap.
    Host(Host),
    /// A drive.
    Drive(D),
}

impl<D> Member<D> {
    /// The host, if it is one.
    pub const fn host_mut(&mut self) -> Option<&mut Host> {
        match self {
            Self::Host(host) => Some(host),
            Self::Drive(_) => None,
        }
    }

    /// The host, if it is one.
    #[must_use]
    pub const fn host(&self) -> Option<&Host> {
        match self {
            Self::Host(host) => Some(host),
            Self::Drive(_) => None,
        }
    }

    /// The drive, if it is one.
    pub const fn drive_mut(&mut self) -> Option<&mut D> {
        match self {
            Self::Host(_) => None,
            Self::Drive(drive) => Some(drive),
        }
    }

    /// The drive, if it is one.
    #[must_use]
    pub const fn drive(&self) -> Option<&D> {
        match self {
            Self::Host(_) => None,
            Self::Drive(drive) => Some(drive),
        }
    }
}

impl<D: Station> Member<D> {
    fn station(&self) -> &dyn Station {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }

    fn station_mut(&mut self) -> &mut dyn Station {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }
}

impl<D: Station> Station for Member<D> {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        self.station_mut().hear(at, frame);
    }
    fn wants(&self) -> Option<(Instant, Frame)> {
        self.station().wants()
    }
    fn sent(&mut self, at: Instant) {
        self.station_mut().sent(at);
    }
    fn notice(&mut self, at: Instant, error: BusError) {
        self.station_mut().notice(at, error);
    }
    fn next_action(&self) -> Option<Instant> {
        self.station().next_action()
    }
    fn advance(&mut self, to: Instant) {
        self.station_mut().advance(to);
    }
    fn acknowledges(&self) -> bool {
        self.station().acknowledges()
    }
}
