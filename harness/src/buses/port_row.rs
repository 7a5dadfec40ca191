//! What each bus knows of `[port.1]`, as a row of a table.

use super::PortBus;
use crate::bus::Bus;
use crate::command::drive::DriveCommand;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::fuzz::LineFuzz;
use crate::command::held::HeldBench;
use crate::command::output::Output;
use crate::rig::condition::Mistake;
use crate::rig::file::Interlock;
use crate::rig::port_file::{Node, Port};
use crate::rig::segment::{SegmentJudge, SegmentRun};
use crate::rig::{Rig, SessionError, UseOptions};
use crate::scenario::problem::{Problem, Problems};
use crate::scenario::source::{Source, line_number};

/// Takes a rig to play scenarios on it.
type OpenRun = fn(&Rig, &UseOptions) -> Result<Box<dyn SegmentRun>, SessionError>;

/// Takes a rig for a session.
type OpenSession = fn(&Rig, &UseOptions) -> Result<Box<dyn HeldBench>, SessionError>;

/// Judges what was played on a rig again.
type OpenJudge = fn(&Rig, bool, bool) -> Box<dyn SegmentJudge>;

/// Checks an entry of `[[interlock]]`.
type CheckInterlock = fn(&Interlock) -> Result<(), Mistake>;

/// What a bus knows of `[port.1]` and of the drives there.
pub(crate) struct PortRow {
    /// The bus of its scenarios.
    pub(crate) bus: Bus,
    /// See [`PortBus::adapters`].
    pub(crate) adapters: &'static [&'static str],
    /// See [`PortBus::keys`].
    pub(crate) keys: &'static [&'static str],
    /// See [`PortBus::limits`].
    pub(crate) limits: &'static [&'static str],
    /// See [`PortBus::most_drives`].
    pub(crate) most_drives: u8,
    /// See [`PortBus::simulated`].
    pub(crate) simulated: fn(u8) -> (String, String),
    /// See [`PortBus::named`].
    pub(crate) named: fn(Node) -> Result<(), (&'static str, &'static str)>,
    /// See [`PortBus::has_rate`].
    pub(crate) has_rate: fn(u32) -> bool,
    /// See [`PortBus::drive`].
    pub(crate) drive: fn(usize, Node) -> (u8, Vec<u16>),
    /// The mistakes of a setup, whose steps are ignored.
    pub(crate) setup_mistakes: fn(&Port, &Source) -> Option<Problems>,
    /// The steps among lines of a header.
    pub(crate) steps: fn(&Source) -> Option<Problems>,
    /// See [`PortBus::special_register`].
    pub(crate) special_register: fn(&str) -> Result<u8, (String, String)>,
    /// The key under which an entry of `[[interlock]]` names what it looks at, and what checks the entry.
    pub(crate) interlock: (&'static str, CheckInterlock),
    /// Takes a rig to play scenarios on it.
    pub(crate) run: OpenRun,
    /// Judges what was played again, with or without `--allow-motion`.
    pub(crate) judge: Option<OpenJudge>,
    /// Runs a command on its drives.
    pub(crate) command: fn(&Rig, &DriveCommand, &mut Output) -> Result<Exit, Failure>,
    /// Takes a rig for a session.
    pub(crate) hold: OpenSession,
    /// Runs `rig check`, as text or for tools.
    pub(crate) check: fn(&Rig, &UseOptions, bool, &mut Output) -> Result<Exit, Failure>,
    /// Explores its drives.
    pub(crate) fuzz: LineFuzz,
}

impl PortBus {
    /// The bus of its scenarios.
    #[must_use]
    pub const fn bus(self) -> Bus {
        self.row().bus
    }

    /// The name in a rig's file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.bus().name()
    }

    /// The drive at a place of a port's list: its number, and its identifiers.
    #[must_use]
    pub fn drive(self, index: usize, node: Node) -> (u8, Vec<u16>) {
        (self.row().drive)(index, node)
    }

    /// The keys of its adapters.
    #[must_use]
    pub const fn adapters(self) -> &'static [&'static str] {
        self.row().adapters
    }

    /// The keys of `[port.1]` that not every bus has, beside those of adapters.
    #[must_use]
    pub const fn keys(self) -> &'static [&'static str] {
        self.row().keys
    }

    /// The keys of `[limits]` that not every bus has.
    #[must_use]
    pub const fn limits(self) -> &'static [&'static str] {
        self.row().limits
    }

    /// The most drives of a simulated bench.
    #[must_use]
    pub const fn most_drives(self) -> u8 {
        self.row().most_drives
    }

    /// The drives of a simulated bench as its file lists them, and the limits with which all is permitted.
    #[must_use]
    pub fn simulated(self, drives: u8) -> (String, String) {
        (self.row().simulated)(drives)
    }

    /// Whether a drive is named as on this bus.
    ///
    /// # Errors
    /// What is wrong, and what was expected.
    pub fn named(self, node: Node) -> Result<(), (&'static str, &'static str)> {
        (self.row().named)(node)
    }

    /// Whether the bus has a rate of this number of bits a second.
    #[must_use]
    pub fn has_rate(self, bits: u32) -> bool {
        (self.row().has_rate)(bits)
    }

    /// The mistakes of `setup` lines of a simulated port, each with the number of its line, counted from 0.
    pub(crate) fn setup_mistakes(self, port: &Port, lines: &[String]) -> Vec<(usize, Problem)> {
        let source = Source {
            name: "setup".to_owned(),
            text: lines.join("\n").into(),
        };
        let row = self.row();
        let read = (row.steps)(&source).or_else(|| (row.setup_mistakes)(port, &source));
        let line = |own: &Problem| line_number(&source.text, own.span.start) - 1;
        let problems = read.iter().flat_map(Problems::all);
        let placed = problems.map(|own| (line(own), own.clone()));
        placed.collect()
    }

    /// The register of `allow_registers`.
    ///
    /// # Errors
    /// What is wrong, and what was expected.
    pub(crate) fn special_register(self, text: &str) -> Result<u8, (String, String)> {
        (self.row().special_register)(text)
    }
}
