//! The two kinds of ring ends that a rig can have, as one link.

use crate::link::{Capability, Lead, Line, Link, Moment, PlacedFault, PortLink, Trouble};
use crate::medium::{HeardPiece, Medium, Out};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::fmt;

/// Where a rig's rings end: in the simulator, or at ports.
pub enum Ends {
    /// In the simulator, in virtual time.
    Simulated(Box<dyn Link>),
    /// At ports, in real time.
    Ports(Box<dyn PortLink>),
}

impl fmt::Debug for Ends {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Simulated(_) => "Simulated",
            Self::Ports(_) => "Ports",
        })
    }
}

/// The same call for whichever it is.
macro_rules! each {
    ($self:ident, $link:ident => $call:expr) => {
        match $self {
            Ends::Simulated($link) => $call,
            Ends::Ports($link) => $call,
        }
    };
}

impl Ends {
    /// The link at ports, if it is one.
    pub fn ports(&self) -> Option<&dyn PortLink> {
        match self {
            Self::Simulated(_) => None,
            Self::Ports(link) => Some(link.as_ref()),
        }
    }

    /// The link at ports, if it is one.
    pub fn ports_mut(&mut self) -> Option<&mut dyn PortLink> {
        match self {
            Self::Simulated(_) => None,
            Self::Ports(link) => Some(link.as_mut()),
        }
    }
}

impl Line for Ends {
    fn medium(&self, port: usize) -> Medium {
        each!(self, link => link.medium(port))
    }

    fn now(&self) -> Instant {
        each!(self, link => link.now())
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        each!(self, link => link.send(ring, what))
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        each!(self, link => link.receive(ring))
    }

    fn wait(&mut self, until: Instant) -> bool {
        each!(self, link => link.wait(until))
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        each!(self, link => link.attend(ring, at));
    }

    fn trouble(&self) -> Option<&Trouble> {
        each!(self, link => link.trouble())
    }

    fn lead(&self) -> Lead {
        each!(self, link => link.lead())
    }
}

impl Link for Ends {
    fn capabilities(&self) -> &[Capability] {
        each!(self, link => link.capabilities())
    }

    fn begin(&mut self) {
        each!(self, link => link.begin());
    }

    fn busy(&self) -> bool {
        each!(self, link => link.busy())
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        each!(self, link => link.inject(ring, fault, moment));
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        each!(self, own => own.reaches(ring, link))
    }

    fn damages_parity(&self, ring: usize, link: usize) -> bool {
        each!(self, own => own.damages_parity(ring, link))
    }

    fn listens(&self, ring: usize, link: usize) -> bool {
        each!(self, own => own.listens(ring, link))
    }

    fn tapped(&mut self, ring: usize, link: usize) -> Option<Vec<Received>> {
        each!(self, own => own.tapped(ring, link))
    }

    fn time_tolerance(&self) -> Span {
        each!(self, link => link.time_tolerance())
    }

    fn unwatched_since(&self) -> Option<Instant> {
        each!(self, link => link.unwatched_since())
    }

    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        each!(self, link => link.probe(ring, octets))
    }

    fn beside(&self) -> Option<&dyn Any> {
        each!(self, link => link.beside())
    }

    fn unused_faults(&self) -> Vec<String> {
        each!(self, link => link.unused_faults())
    }

    fn record(&mut self, on: bool) {
        each!(self, link => link.record(on));
    }

    fn carried(&self) -> u64 {
        each!(self, link => link.carried())
    }

    fn drives(&self, ring: usize) -> u8 {
        each!(self, link => link.drives(ring))
    }

    fn trace(&self, ring: usize) -> Trace {
        each!(self, link => link.trace(ring))
    }
}
