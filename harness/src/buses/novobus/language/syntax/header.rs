//! The header of a scenario: the rings that it needs, and what their drives are before anything is sent.

use super::cell::{CellPlace, Written};
use crate::scenario::expression::{Expression, Located};
use crate::scenario::problem::{Span, Spanned};
use crate::scenario::times::Duration;
use harness_proto::line::Rate;
use harness_proto::nd21::units::Device;
use harness_sim::nd21::Stimulus;
use harness_sim::novobus::deviation::{Deviation, MasterDeviation};
use harness_sim::novobus::drive::Model;

/// The header lines of a scenario that belong to this bus.
#[derive(Clone, Debug, Default)]
pub struct Header {
    /// The rings it can be played on; one or two.
    pub rings: Vec<RingRange>,
    /// The rate of the line, if a `line` line says it; by default that of [`Rate::default`].
    pub rate: Option<Rate>,
    /// What drives hold and how they behave before anything is sent, in order of the lines.
    pub setups: Vec<Setup>,
    /// How the bench's own master breaks the manual, on purpose: `master deviates NAME`.
    pub master: Option<Spanned<&'static MasterDeviation>>,
}

/// The sizes of ring that a scenario can be played on.
#[derive(Clone, Debug)]
pub struct RingRange {
    /// The smallest.
    pub smallest: u8,
    /// The largest.
    pub largest: u8,
    /// The one to take where nothing else is asked for.
    pub default: u8,
    /// Where it stands.
    pub span: Span,
}

impl RingRange {
    /// Rings of this size only.
    #[must_use]
    pub fn of(drives: u8) -> Self {
        Self {
            smallest: drives,
            largest: drives,
            default: drives,
            span: Span::default(),
        }
    }
}

/// Drives: one, or all from one to another, in ring 1 or ring 2.
#[derive(Clone, Debug)]
pub struct Drives {
    /// Which ring, counted from 0.
    pub ring: usize,
    /// From.
    pub from: Located,
    /// To; `None` for a single drive.
    pub to: Option<Located>,
}

impl Drives {
    /// One drive of a ring, counted from 0.
    #[must_use]
    pub fn one(ring: usize, drive: u8) -> Self {
        Self {
            ring,
            from: Located::number(drive.into()),
            to: None,
        }
    }

    /// Every drive of a ring, counted from 0.
    #[must_use]
    pub fn all(ring: usize) -> Self {
        Self {
            ring,
            from: Located::number(0),
            to: Some(Located {
                expression: Expression::Last,
                ..Located::number(0)
            }),
        }
    }
}

/// What drives hold or how they behave before anything is sent.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Which drives.
    pub drives: Drives,
    /// What.
    pub what: SetupKind,
    /// Where it stands.
    pub span: Span,
}

/// The kinds of a [`Setup`].
#[derive(Clone, Debug)]
pub enum SetupKind {
    /// `memory CELL = VALUE`
    Memory(CellPlace, Written),
    /// `eeprom CELL = VALUE`
    Eeprom(CellPlace, Written),
    /// `model NAME`
    Model(Model),
    /// `type NUMBER`
    Type(Device),
    /// Something from outside the bus, before anything is sent.
    Influence(Influence),
    /// `property NAME = WORD`
    Word(Spanned<String>, Spanned<String>),
    /// `property NAME = TIME`
    Time(Spanned<String>, Duration),
    /// `deviates NAME`
    Deviates(&'static Deviation),
}

/// What happens to drives from outside the bus: `input GPIN5 high`, `power off`.
#[derive(Clone, Debug)]
pub enum Influence {
    /// At the plugs or the motor.
    Stimuli(Vec<Stimulus>),
    /// The power is switched on or off.
    Power(bool),
}
