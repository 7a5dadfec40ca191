//! How a simulated drive is set up before power-up, and what happens to it from outside its bus.

use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::Properties;
use std::fmt;

/// What an inverter keeps of the time before, where it was not just switched on, or had faults once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct History {
    /// The control word in force: the last valid one stays, whatever controls the inverter now (3.2.1, bit 10).
    pub stw: Option<u16>,
    /// The faults that were acknowledged, the oldest first (5.7).
    pub faults: Vec<u8>,
}

/// How a simulated drive is set up before power-up.
#[derive(Clone, Debug, Default)]
pub struct InverterSetup {
    /// What the manual leaves open.
    pub properties: Properties,
    /// Whether the PosiCon option is fitted, and its parameters exist (5.6).
    pub posicon: bool,
    /// Parameters that are stored already: number, set and element, value. The others have their factory settings, and so have
    /// those whose value does not fit their 16 or 32 bits. The limits do not count here.
    pub parameters: Vec<(u16, Index, i32)>,
    /// What it keeps of the time before.
    pub history: History,
}

/// What happens to a slave from outside its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stimulus {
    /// Inverter and module have found each other (true) or lost each other.
    Link(bool),
    /// The cause of a fault is there, or has gone.
    Fault(u8, bool),
}

impl fmt::Display for Stimulus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link(true) => f.write_str("link to the module found"),
            Self::Link(false) => f.write_str("link to the module lost"),
            Self::Fault(number, true) => write!(f, "fault {number} there"),
            Self::Fault(number, false) => write!(f, "fault {number} gone"),
        }
    }
}
