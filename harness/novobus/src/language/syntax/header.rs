//! The header of a scenario: the rings that it needs, and what their drives are before anything is sent.

use super::cell::{CellPlace, Written};
use crate::language::parse::header::parse_lines;
use crate::language::write;
use harness_bench::scenario::expression::{Expression, Located};
use harness_bench::scenario::problem::{Problems, Spanned, TextSpan};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::times::Duration;
use harness_proto::line::Rate;
use harness_proto::nd21::units::DriveType;
use harness_sim::nd21::Stimulus;
use harness_sim::novobus::deviation::{Deviation, MasterDeviation};
use harness_sim::novobus::drive::Model;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

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

impl PartialEq for Header {
    /// Headers are equal if they are written alike.
    fn eq(&self, other: &Self) -> bool {
        write::lines(self) == write::lines(other)
    }
}

impl Eq for Header {}

impl Serialize for Header {
    /// As the lines that a scenario has.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        write::lines(self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Header {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let lines = Vec::<String>::deserialize(deserializer)?;
        let read = lines.join("\n").parse::<Self>();
        read.map_err(|problems| D::Error::custom(problems.lines()))
    }
}

impl FromStr for Header {
    type Err = Problems;

    /// Reads the lines of a header. They need no `ring` line.
    fn from_str(lines: &str) -> Result<Self, Problems> {
        parse_lines(&Source {
            name: "the header".to_owned(),
            text: lines.into(),
        })
    }
}

impl From<Setup> for Header {
    fn from(setup: Setup) -> Self {
        [setup].into_iter().collect()
    }
}

impl FromIterator<Setup> for Header {
    fn from_iter<I: IntoIterator<Item = Setup>>(setups: I) -> Self {
        Self {
            setups: setups.into_iter().collect(),
            ..Self::default()
        }
    }
}

impl Header {
    /// A header without lines.
    pub const NONE: Self = Self {
        rings: Vec::new(),
        rate: None,
        setups: Vec::new(),
        master: None,
    };

    /// A header with rings of these sizes.
    #[must_use]
    pub fn of_rings(sizes: &[u8]) -> Self {
        Self {
            rings: sizes.iter().copied().map(RingRange::of).collect(),
            ..Self::default()
        }
    }

    /// Every drive of this number of rings is a whole ND21.
    #[must_use]
    pub fn whole(rings: usize) -> Self {
        let setup = |ring| Setup::new(DriveRange::all(ring), SetupKind::Model(Model::Nd21));
        (0..rings).map(setup).collect()
    }

    /// The same with the lines of another header behind its own. A later line about the same thing of the same drive holds, as in a
    /// scenario; rings, rate and master are those of the other header where it says them.
    #[must_use]
    pub fn and(&self, more: &Self) -> Self {
        let rings = match more.rings.as_slice() {
            [] => &self.rings,
            _ => &more.rings,
        };
        Self {
            rings: rings.clone(),
            rate: more.rate.or(self.rate),
            setups: [self.setups.as_slice(), &more.setups].concat(),
            master: more.master.clone().or_else(|| self.master.clone()),
        }
    }

    /// The same without the lines about drives for which `keep` is false.
    #[must_use]
    pub fn only(&self, keep: impl Fn(&Setup) -> bool) -> Self {
        let kept = self.setups.iter().filter(|setup| keep(setup));
        Self {
            setups: kept.cloned().collect(),
            ..self.clone()
        }
    }

    /// The same with drives, and a master, that follow the manual.
    #[must_use]
    pub(crate) fn without_deviations(&self) -> Self {
        Self {
            master: None,
            ..self.only(|setup| !matches!(setup.what, SetupKind::Deviates(_)))
        }
    }

    /// Whether it says nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether a line names the model of a drive.
    #[must_use]
    pub(crate) fn names_a_model(&self) -> bool {
        let names = |setup: &Setup| matches!(setup.what, SetupKind::Model(_));
        self.setups.iter().any(names)
    }

    /// The same with a whole ND21 for every drive of this number of rings, unless a line names a model.
    #[must_use]
    pub(crate) fn nd21_by_default(self, rings: usize) -> Self {
        match self.names_a_model() {
            true => self,
            false => Self::whole(rings).and(&self),
        }
    }

    /// Its lines, as a scenario has them.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        write::lines(self)
    }
}

/// The sizes of ring that a scenario can be played on.
#[derive(Clone, Debug)]
pub struct RingRange {
    pub smallest: u8,
    pub largest: u8,
    /// The one to take where nothing else is asked for.
    pub default: u8,
    /// Where it stands.
    pub span: TextSpan,
}

impl RingRange {
    /// Rings of this size only.
    #[must_use]
    pub fn of(drives: u8) -> Self {
        Self {
            smallest: drives,
            largest: drives,
            default: drives,
            span: TextSpan::default(),
        }
    }

    /// Whether rings of this number of drives belong to it.
    #[must_use]
    pub fn contains(&self, drives: u8) -> bool {
        (self.smallest..=self.largest).contains(&drives)
    }

    /// The sizes as a header has them, without the default: `3` or `1..250`.
    #[must_use]
    pub fn sizes(&self) -> String {
        match self.smallest == self.largest {
            true => self.smallest.to_string(),
            false => format!("{}..{}", self.smallest, self.largest),
        }
    }
}

/// Drives: one, or all from one to another, in ring 1 or ring 2.
#[derive(Clone, Debug)]
pub struct DriveRange {
    /// Which ring, counted from 0.
    pub ring: usize,
    pub from: Located,
    /// To; `None` for a single drive.
    pub to: Option<Located>,
}

impl DriveRange {
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
    pub drives: DriveRange,
    pub what: SetupKind,
    /// Where it stands.
    pub span: TextSpan,
}

impl fmt::Display for Setup {
    /// The line, as a scenario has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&write::setup(self))
    }
}

impl Setup {
    /// A setup that stands in no text.
    #[must_use]
    pub fn new(drives: DriveRange, what: SetupKind) -> Self {
        let span = TextSpan::default();
        Self { drives, what, span }
    }

    /// `deviates NAME`
    #[must_use]
    pub fn deviates(drives: DriveRange, deviation: &'static Deviation) -> Self {
        Self::new(drives, SetupKind::Deviates(deviation))
    }

    /// The name of the property that it sets, if it sets one.
    #[must_use]
    pub fn sets(&self) -> Option<&str> {
        match &self.what {
            SetupKind::Word(name, _) | SetupKind::Time(name, _) => Some(&name.value),
            _ => None,
        }
    }
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
    Type(DriveType),
    /// Something from outside the bus, before anything is sent.
    Influence(Influence),
    /// `property NAME = WORD`
    Word(Spanned<String>, Spanned<String>),
    /// `property NAME = TIME`
    Time(Spanned<String>, Duration),
    /// `deviates NAME`
    Deviates(&'static Deviation),
}

impl SetupKind {
    /// `property NAME = WORD`
    #[must_use]
    pub fn word(name: &str, word: &str) -> Self {
        Self::Word(unplaced(name), unplaced(word))
    }

    /// `property NAME = TIME`
    #[must_use]
    pub fn time(name: &str, time: Duration) -> Self {
        Self::Time(unplaced(name), time)
    }

    /// The value of the property that it sets, as a scenario has it; empty where it sets none.
    #[must_use]
    pub fn value(&self) -> String {
        match self {
            Self::Word(_, word) => word.value.clone(),
            Self::Time(_, time) => time.to_string(),
            _ => String::new(),
        }
    }
}

fn unplaced(text: &str) -> Spanned<String> {
    Spanned {
        value: text.to_owned(),
        span: TextSpan::default(),
    }
}

/// What happens to drives from outside the bus: `input GPIN5 high`, `power off`.
#[derive(Clone, Debug)]
pub enum Influence {
    /// At the plugs or the motor.
    Stimuli(Vec<Stimulus>),
    /// The power is switched on or off.
    Power(bool),
}
