//! The options and the result of a comparison with a twin.

use harness_bench::rig::LateByte;
use harness_proto::line::Received;
use harness_proto::novobus::role::Role;
use harness_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How exact a comparison is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exactness {
    /// Maximum difference of times.
    pub tolerance: Span,
    /// Whether the link shows line errors at their bytes.
    pub line_errors: bool,
    /// Whether the twin knows the content of every cell: true for a rig whose drives are simulated too.
    pub knows_cells: bool,
    /// Cells of a drive that are compared although it writes them itself.
    pub looks: Option<(u8, &'static [DecidingBits])>,
}

/// Bits of a cell that decide a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DecidingBits {
    pub address: u16,
    pub mask: u8,
}

/// How a ring differs from what is expected. In a file it is a name; folders of older versions hold the description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Symptom {
    /// Another value.
    #[serde(alias = "another value")]
    Value,
    /// The same value, with or without a line error.
    #[serde(alias = "another line status")]
    LineStatus,
    /// The model expects a byte that did not come.
    #[serde(alias = "a byte is missing")]
    Missing,
    /// A byte came that the model does not expect.
    #[serde(alias = "a byte too many")]
    Surplus,
    /// The right byte, at another time.
    #[serde(alias = "another time")]
    Time,
    /// A drive does what that of the manual does not.
    #[serde(alias = "another drive than that of the manual")]
    Drive,
    /// The ring carries a byte although nothing was sent to it.
    #[serde(alias = "a byte on the other ring")]
    OtherRing,
    /// A link carries another byte than in the reference model.
    #[serde(alias = "another byte on a link than in the reference model")]
    Link,
    /// A drive is in another state than in the reference model.
    #[serde(alias = "another state than in the reference model")]
    State,
}

impl Symptom {
    #[must_use]
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Value => "another value",
            Self::LineStatus => "another line status",
            Self::Missing => "a byte is missing",
            Self::Surplus => "a byte too many",
            Self::Time => "another time",
            Self::Drive => "another drive than that of the manual",
            Self::OtherRing => "a byte on the other ring",
            Self::Link => "another byte on a link than in the reference model",
            Self::State => "another state than in the reference model",
        }
    }
}

/// The first byte that differs from the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Divergence {
    /// In which ring, counted from 0.
    pub ring: usize,
    /// Which byte received in this conversation, counted from 1.
    pub byte: usize,
    pub what: Symptom,
    /// The byte that the model expects, and its time.
    pub expected: Option<(Instant, Received)>,
    pub received: Option<(Instant, Received)>,
    pub role: Role,
    /// The section of the ND21 manual with the rule that is broken, and the rule in a few words.
    pub rule: (&'static str, &'static str),
    /// The step of the scenario that was running when the byte was sent, as a place in its text.
    pub step: Option<usize>,
    /// The drive whose answers are the only differing bytes of the conversation; `None` if the bytes do not show which drive is wrong.
    pub drive: Option<u8>,
}

impl Divergence {
    /// Which byte was late, and by how much.
    pub(crate) fn late_byte(&self) -> LateByte {
        let place = (self.ring, self.role, self.step, self.drive, self.what);
        LateByte {
            which: format!("{place:?}"),
            by: self.late_by(),
        }
    }

    /// How late the byte was, in nanoseconds; negative if it was early.
    fn late_by(&self) -> i128 {
        let at = |byte: &Option<(Instant, Received)>| {
            byte.map(|(at, _)| i128::from(at.since_start().as_nanos()))
        };
        match (at(&self.expected), at(&self.received)) {
            (Some(expected), Some(received)) => received - expected,
            _ => 0,
        }
    }
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let show = |byte: &Option<(Instant, Received)>| match byte {
            None => "nothing".to_owned(),
            Some((at, byte)) => match byte.error {
                None => format!("{:02X} at {at}", byte.byte),
                Some(error) => format!("{:02X} ({error}) at {at}", byte.byte),
            },
        };
        let (section, rule) = self.rule;
        let what = self.what.words();
        let ring = if self.ring == 0 { "" } else { " of ring 2" };
        write!(f, "byte {}{ring}", self.byte)?;
        if let Some(drive) = self.drive {
            write!(f, ", drive {drive}")?;
        }
        write!(
            f,
            ": {what}: received {}, the manual says {} (ND21 {section}, {rule})",
            show(&self.received),
            show(&self.expected)
        )
    }
}

/// A cell whose content the model did not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AdoptedCell {
    /// In which ring, counted from 0.
    pub ring: usize,
    pub drive: u8,
    pub address: u16,
    pub value: u8,
}

/// A received byte with bits that are the drive's choice: of a cell that it writes itself, of a cell that was not written since the
/// attempt began, or the checking byte of such data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OwnByte {
    /// In which ring, counted from 0.
    pub ring: usize,
    /// When it was received.
    pub at: Instant,
    /// The place of the byte sent that it answers, counted from 0.
    pub place: usize,
    pub drive: u8,
    /// The cell of the data or of its checking byte; `None` for process data of an unknown cell.
    pub address: Option<u16>,
    /// The bits that are not the drive's choice, because the master has written them.
    pub known: u8,
    pub value: u8,
}

/// The first byte in a conversation that a drive sent unasked (ND21 9.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UnaskedByte {
    /// In which ring, counted from 0.
    pub ring: usize,
    /// When it was received, or was due.
    pub at: Instant,
    /// When the first byte came after a check sequence with which the bytes are compared again.
    pub until: Option<Instant>,
    /// How many bytes the model sends after it, up to a check sequence, that are neither zeros nor numbers of drives (ND21 9.7).
    pub answers: usize,
}

impl Comparison {
    /// The rings of which no model knows the state after the conversation.
    pub(crate) fn open_races(&self) -> impl Iterator<Item = usize> + '_ {
        let open = self.unasked.iter().filter(|race| race.until.is_none());
        open.map(|race| race.ring)
    }

    /// Whether a difference comes after a check sequence that ends such a race.
    pub(crate) fn is_after_a_race(&self, found: &Divergence) -> bool {
        let at = found.received.map(|(at, _)| at);
        let ended = |race: &&UnaskedByte| race.ring == found.ring && race.until.is_some();
        self.unasked
            .iter()
            .filter(ended)
            .any(|race| at >= race.until)
    }
}

/// The result of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Comparison {
    /// How many bytes were compared.
    pub compared: u64,
    /// How many were not compared, because the drive measures their data itself.
    pub measured: u64,
    /// How many hold what the master wrote, although the model is a wrong drive's and holds something else.
    pub against: u64,
    /// The contents of cells that the model took over.
    pub adopted: Vec<AdoptedCell>,
    /// The bytes whose values are the drives' choice, in order; empty if the twin knows the content of every cell.
    pub own: Vec<OwnByte>,
    /// The first byte that differs in more than its time.
    pub divergence: Option<Divergence>,
    /// Whether a drive of the model monitored time-outs (ND21 9.9).
    pub monitored: bool,
    /// In real time, whether the bench was silent or late in front of that byte, so that drives that monitor time-outs may have missed their
    /// bytes (ND21 9.9).
    pub silenced: bool,
    /// Whether that is so because there are more places than are tried at which bytes may have been held back.
    pub too_many: bool,
    /// In real time, the first byte of each ring that a drive sent unasked. The bytes after it are a race of clocks: only properties that
    /// hold for every order are compared, up to a check sequence that ends it.
    pub unasked: Vec<UnaskedByte>,
    /// Whether a ring was left out: an earlier conversation left such a race open.
    pub left_out: bool,
    /// The first byte that differs only in its time.
    pub untimely: Option<Divergence>,
    /// The first byte that was read at another time than it was due, also where the bench had not looked for it in time.
    pub held_up: Option<Divergence>,
    /// All differences of times together.
    pub apart: Span,
}
