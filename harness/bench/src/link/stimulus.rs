//! What happens to drives from outside their bus, and on a line of octets.

use harness_sim::octet_segment::{LineFault, LineFaultAt};
use harness_sim::{nd21, nordac, unitek};
use std::fmt;

/// What happens to a drive from outside the bus, by the bus that it is on; or on its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnyStimulus {
    Novobus(nd21::Stimulus),
    Unitek(unitek::Stimulus),
    Nordac(nordac::Stimulus),
    /// A fault on a line of octets.
    Line(LineFaultAt),
}

impl fmt::Display for AnyStimulus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Novobus(stimulus) => stimulus.fmt(f),
            Self::Unitek(stimulus) => stimulus.fmt(f),
            Self::Nordac(stimulus) => stimulus.fmt(f),
            Self::Line(placed) => match placed.fault {
                LineFault::Octet(fault) => fault.fmt(f),
                LineFault::Telegram(fault) => fault.fmt(f),
            },
        }
    }
}
