//! What the files of rigs ask of the buses: a table that the program hands in.

use super::check::RigCheck;
use super::condition::Mistake;
use super::file::{Interlock, RigFile};
use super::port_file::{Node, Port, PortBus, PortLimits};
use super::profile::{ProfileError, ProfileLines};
use crate::file::schema::PathStep;
use crate::scenario::problem::{Problem, Problems, TextSpan};
use crate::scenario::source::{Source, line_number};
use std::fmt;

/// Checks an entry of `[[interlock]]`.
type CheckInterlock = fn(&Interlock) -> Result<(), Mistake>;

/// What a bus knows of `[port.1]` and of the drives there.
pub struct PortRow {
    pub bus: PortBus,
    /// The keys of its adapters.
    pub adapters: &'static [&'static str],
    /// The keys of `[port.1]` that not every bus has, beside those of adapters.
    pub keys: &'static [&'static str],
    /// The keys of `[limits]` that not every bus has.
    pub limits: &'static [&'static str],
    /// The drives of a simulated bench as its file lists them, and the limits with which all is permitted.
    pub simulated: fn(u8) -> (String, String),
    /// Whether a drive is named as on this bus; or what is wrong, and what was expected.
    pub named: fn(Node) -> Result<(), (&'static str, &'static str)>,
    /// Whether the bus has a rate of this number of bits a second.
    pub has_rate: fn(u32) -> bool,
    /// The drive at a place of a port's list: its number, and its identifiers.
    pub drive: fn(usize, Node) -> (u8, Vec<u16>),
    /// The mistakes of a setup, whose steps are ignored.
    pub setup_mistakes: fn(&Port, &Source) -> Option<Problems>,
    /// The steps among lines of a header.
    pub steps: fn(&Source) -> Option<Problems>,
    /// What is wrong with the registers that `[limits]` name.
    pub register_mistakes: fn(&PortLimits) -> Vec<RegisterMistake>,
    /// The key under which an entry of `[[interlock]]` names what it looks at, and what checks the entry.
    pub interlock: (&'static str, CheckInterlock),
}

impl PortRow {
    /// The mistakes of `setup` lines of a simulated port, each with the number of its line, counted from 0.
    pub(crate) fn line_mistakes(&self, port: &Port, lines: &[String]) -> Vec<(usize, Problem)> {
        let source = Source {
            name: "setup".to_owned(),
            text: lines.join("\n").into(),
        };
        let read = (self.steps)(&source).or_else(|| (self.setup_mistakes)(port, &source));
        let line = |problem: &Problem| line_number(&source.text, problem.span.start) - 1;
        let problems = read.iter().flat_map(Problems::all);
        let placed = problems.map(|problem| (line(problem), problem.clone()));
        placed.collect()
    }
}

/// What is wrong with a register that a list of `[limits]` names.
#[derive(Clone, Debug)]
pub struct RegisterMistake {
    /// The list.
    pub key: &'static str,
    /// Its entry, counted from 0.
    pub index: usize,
    pub message: String,
    pub expected: String,
}

/// What is wrong with the drives of a rig's rings; `None` in place of a line of `[sim]` where it is in the profile.
pub type RingMistakes = Vec<(Option<TextSpan>, Problem)>;

/// What the bus of rings knows of `[ring.1]` and `[ring.2]`.
#[derive(Clone, Copy)]
pub struct RingRow {
    /// The lines of a profile.
    pub profile: fn(&str) -> Result<ProfileLines, ProfileError>,
    /// The mistakes of the lines of `[sim]` behind those of the profile.
    pub mistakes: fn(&RigFile, Option<&[String]>, &Source) -> RingMistakes,
    /// Checks an entry of `[[interlock]]` at its place.
    pub interlock: fn(&mut RigCheck<'_>, &[PathStep<'_>], &Interlock),
}

/// The buses, as the files of rigs know them.
pub struct RigBuses {
    pub rings: RingRow,
    /// In the order of [`PortBus::ALL`].
    pub ports: [&'static PortRow; PortBus::ALL.len()],
}

impl RigBuses {
    /// A table in which each port is one of this bus, and rings say nothing.
    #[cfg(any(test, feature = "trials"))]
    pub const fn alone(port: &'static PortRow) -> Self {
        Self {
            rings: RingRow {
                profile: |_| Ok(Vec::new()),
                mistakes: |_, _, _| Vec::new(),
                interlock: |_, _, _| {},
            },
            ports: [port, port],
        }
    }

    /// A table in which rings are these, and ports say nothing.
    #[cfg(any(test, feature = "trials"))]
    pub const fn of_rings(rings: RingRow) -> Self {
        const NONE: PortRow = PortRow {
            bus: PortBus::Unitek,
            adapters: &[],
            keys: &[],
            limits: &[],
            simulated: |_| Default::default(),
            named: |_| Ok(()),
            has_rate: |_| true,
            drive: |_, _| (0, Vec::new()),
            setup_mistakes: |_, _| None,
            steps: |_| None,
            register_mistakes: |_| Vec::new(),
            interlock: ("", |_| Ok(())),
        };
        Self {
            rings,
            ports: [&NONE; PortBus::ALL.len()],
        }
    }

    /// What a bus knows of `[port.1]`.
    pub const fn port(&self, bus: PortBus) -> &'static PortRow {
        self.ports[bus as usize]
    }

    /// The drive at a place of a port's list: its number, and its identifiers.
    #[must_use]
    pub fn drive(&self, bus: PortBus, index: usize, node: Node) -> (u8, Vec<u16>) {
        (self.port(bus).drive)(index, node)
    }
}

impl fmt::Debug for RigBuses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RigBuses")
    }
}

impl PartialEq for RigBuses {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}
