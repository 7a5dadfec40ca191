//! What a plan consists of.

use crate::link::{Capability, Moment, PlacedFault};
use crate::scenario::pattern::Expected;
use crate::scenario::problem::Span;
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::RAM;
use harness_proto::novobus::properties::{Properties, Setting};
use harness_proto::time;
use harness_sim::drive::Model;
use harness_sim::nd21::Nd21Properties;
use std::ops::RangeInclusive;

/// A scenario for rings of given sizes.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The rings; one or two.
    pub rings: Vec<RingSize>,
    /// The rate of the line.
    pub rate: Rate,
    /// Whether bytes that no line asked for are a failure.
    pub strict: bool,
    /// How long a line without a time waits.
    pub deadline: time::Span,
    /// What a rig must have.
    pub needs: Vec<Capability>,
    /// The steps, in order.
    pub steps: Vec<PlannedStep>,
    pub(super) setups: Vec<PlannedSetup>,
}

#[derive(Clone, Debug)]
pub(super) struct PlannedSetup {
    pub(super) ring: usize,
    pub(super) drives: RangeInclusive<u8>,
    pub(super) what: PlannedSetupKind,
}

#[derive(Clone, Debug)]
pub(in crate::scenario) enum PlannedSetupKind {
    Memory(u16, Vec<u8>),
    Eeprom(u8, Vec<u8>),
    Model(Model),
    Word(String, String),
    Time(String, time::Span),
}

impl PlannedSetupKind {
    /// Sets what the setup says of a drive's properties, if it says anything of them.
    pub(in crate::scenario) fn apply_to(&self, properties: &mut Properties) {
        // Planning has refused what cannot be set.
        let _known = match self {
            Self::Word(name, word) => properties.set(name, Setting::Word(word)),
            Self::Time(name, span) => properties.set(name, Setting::Time(*span)),
            Self::Memory(..) | Self::Eeprom(..) | Self::Model(_) => Ok(()),
        };
    }

    /// What a rig must have for it.
    pub(in crate::scenario) fn needs(&self) -> Option<Capability> {
        match self {
            // No command writes ROM or registers (ND21 10.2): only a simulated drive can be given them.
            Self::Memory(address, _) if !RAM.contains(address) => Some(Capability::Simulator),
            Self::Memory(..) => Some(Capability::Memory),
            Self::Eeprom(..) => Some(Capability::Eeprom),
            // A real drive is what it is.
            Self::Word(..) | Self::Time(..) => Some(Capability::Simulator),
            Self::Model(_) => None,
        }
    }

    /// The same for what the manual does not say of the drive behind the bus.
    pub(in crate::scenario) fn apply_to_nd21(&self, properties: &mut Nd21Properties) {
        let _known = match self {
            Self::Word(name, word) => properties.set(name, Setting::Word(word)),
            Self::Time(name, span) => properties.set(name, Setting::Time(*span)),
            _ => false,
        };
    }
}

/// A step, settled.
#[derive(Clone, Debug)]
pub struct PlannedStep {
    /// The time in front.
    pub when: PlannedWhen,
    /// What happens.
    pub action: PlannedAction,
    /// Where it stands.
    pub span: Span,
}

/// A time in front of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedWhen {
    /// None.
    Now,
    /// After the line before.
    After(PlannedWindow),
    /// Since the start.
    At(PlannedWindow),
}

/// A time from, to, and how exact they are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedWindow {
    /// From.
    pub from: time::Span,
    /// To.
    pub to: time::Span,
    /// Half a unit of the last digit written, for an exact time; zero for a window.
    pub tolerance: time::Span,
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum PlannedAction {
    /// The master sends.
    Send(usize, Vec<u8>),
    /// The master receives.
    Receive(usize, Vec<Expected>),
    /// A fault.
    Fault(usize, PlacedFault, Moment),
    /// A check.
    Check(PlannedCheck),
    /// A telegram and its answer.
    Telegram(usize, Vec<u8>, Vec<Expected>),
    /// 17 zeros and the check sequence.
    Recover(usize),
}

/// A check, settled.
#[derive(Clone, Debug)]
pub enum PlannedCheck {
    /// The ring spells out this drive, after at most so many zeros.
    Located(usize, u8, Option<u64>),
    /// It does so after at most so many zeros.
    Within(u64),
    /// Drives are in the error mode, or are not.
    InError(usize, RangeInclusive<u8>, bool),
    /// A drive's error mode has this cause.
    Error(usize, u8, BusError),
    /// Drives' cells hold these bytes.
    Memory(usize, RangeInclusive<u8>, u16, Vec<Expected>),
    /// So many check sequences came back whole.
    Corrected(u64),
    /// So many bytes were sent since the last check, in this time (and its tolerance).
    Sent(u64, Option<(time::Span, time::Span)>),
    /// So many bytes were received since the start.
    Received(u64),
}

impl Plan {
    /// What drive `drive` is set to hold and how to behave, in order of the lines.
    pub(in crate::scenario) fn setups_of(
        &self,
        ring: usize,
        drive: u8,
    ) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
        setups_of(&self.setups, ring, drive)
    }
}

pub(super) fn setups_of(
    setups: &[PlannedSetup],
    ring: usize,
    drive: u8,
) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
    setups
        .iter()
        .filter(move |setup| setup.ring == ring && setup.drives.contains(&drive))
        .map(|setup| &setup.what)
}
