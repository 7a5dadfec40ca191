//! What a deviation is, and the ways to inject one.

use super::{behind, cells, channel, errors, numbered, recovery, telegram};
use crate::deviation::{self, DeviationTable};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::bus_end::{Deadline, ParameterByte, Place, Reaction};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Kind, Reply};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::{Marks, Rules};
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::Properties;
use harness_proto::novobus::sync::SyncByte;
use harness_proto::time::Span;

/// A way in which a drive breaks the manual.
pub type Deviation = deviation::Deviation<Injection>;

/// How a drive is made to deviate.
pub struct Injection {
    behind_the_bus: bool,
    pub(super) how: How,
}

impl Deviation {
    /// Whether only a drive of the model `nd21` can deviate so: a plain one has nothing behind its bus.
    #[must_use]
    pub const fn is_behind_the_bus(&self) -> bool {
        self.injection.behind_the_bus
    }
}

/// A deviation that any drive can have.
pub(super) const fn wrong(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    how: How,
) -> Deviation {
    let injection = Injection {
        behind_the_bus: false,
        how,
    };
    Deviation::new(name, section, about, injection)
}

/// A deviation that only a drive of the model `nd21` can have.
pub(super) const fn behind_the_bus(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    how: How,
) -> Deviation {
    let injection = Injection {
        behind_the_bus: true,
        how,
    };
    Deviation::new(name, section, about, injection)
}

/// All of them: first those of the bus end, then those of the drive behind it.
pub static DEVIATIONS: DeviationTable<Injection> = DeviationTable(&[
    telegram::DEVIATIONS,
    channel::DEVIATIONS,
    errors::DEVIATIONS,
    recovery::DEVIATIONS,
    cells::DEVIATIONS,
    behind::DEVIATIONS,
]);

/// Relatives of these with other numbers, and deviations that only a qualification shows. They can be planted and are looked for like all
/// others, and no list shows them.
pub static RELATIVES: DeviationTable<Injection> = DeviationTable(&[
    numbered::COUNTS,
    numbered::SENDS,
    numbered::ADDS,
    numbered::INCREMENTS,
    cells::OF_QUALIFICATIONS,
]);

/// The deviation of this name, the relatives among them.
#[must_use]
pub fn deviation(name: &str) -> Option<&'static Deviation> {
    let known = DEVIATIONS.named(name);
    known.or_else(|| RELATIVES.named(name))
}

/// A byte under consideration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// What the drive takes the byte for.
    pub(super) place: Place,
    pub(super) received: Received,
    /// Whether received + 1 is the answer (9.7).
    pub(super) increments: bool,
    /// Which byte it is, counted from 1 since power-up.
    pub(super) nth: u64,
    /// How many good zeros, this one included, have come in a row.
    pub(super) zeros: u8,
    /// How many had come in a row before it.
    pub(super) zeros_before: u8,
    /// How many bytes of a check sequence stand directly before it, 0 to 4.
    pub(super) matched: u8,
    /// Whether it is the last of the five bytes of a check sequence that have come in their order since the drive
    /// went into the error mode, with others between them.
    pub(super) in_order: bool,
    /// Whether it completes the five bytes of a check sequence.
    pub(super) sequence: bool,
    /// What the drive made of it; nothing while it is only heard.
    pub(super) step: Reaction,
}

/// Bit 6 of a sync byte: "the next drive" (ND21 9.2).
pub(super) const NEXT: u8 = 1 << 6;

impl Moment {
    /// This byte in place of the one received, with its line error.
    pub(super) fn good(&self, byte: u8) -> Received {
        Received {
            byte,
            ..self.received
        }
    }

    /// Whether it is this sync byte.
    pub(super) fn at_sync(&self, byte: u8) -> bool {
        self.place == Place::Sync && self.received.is(byte)
    }

    /// Whether it is no sync byte where one is due.
    pub(super) fn bad_sync(&self) -> bool {
        let undamaged = self.place == Place::Sync && self.received.error.is_none();
        undamaged && SyncByte::decode(self.received.byte).is_err()
    }

    /// Whether it is a sync byte for the next drive.
    pub(super) fn next_drive(&self) -> bool {
        self.place == Place::Sync && self.received.byte & 0xF0 == 0xE0
    }

    /// What it is in a command begun.
    pub(super) fn parameter(&self) -> Option<ParameterByte> {
        match self.place {
            Place::Parameter(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// The right checking byte, where one is due.
    pub(super) fn check(&self) -> Option<u8> {
        let due = self.parameter().filter(|p| p.field == Field::Check)?;
        Some(due.command_sum.plus())
    }

    /// The sum of the answer, where its checking byte goes out.
    pub(super) fn answers_check(&self) -> Option<Checksum> {
        let due = self.parameter().filter(|p| p.reply == Reply::Check)?;
        let goes_out = self.step.marks.contains(Marks::CHECKSUM);
        goes_out.then_some(due.answer_sum)
    }

    /// The byte received, but for an error of this kind.
    pub(super) fn forgive(&self, error: LineError) -> Received {
        if self.received.error == Some(error) {
            Received::good(self.received.byte)
        } else {
            self.received
        }
    }

    /// Whether `byte` goes out for it by the rule of received + 1 (ND21 9.7).
    pub(super) fn increments(&self, byte: u8) -> bool {
        // Behind FF a 00 may be one of the zeros that come before.
        let is_zero = byte == 0 && !self.increments;
        self.place == Place::ErrorMode && byte == self.received.byte.wrapping_add(1) && !is_zero
    }
}

/// A write on its way to a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Write {
    /// What the byte in hand is taken for.
    pub(super) place: Place,
    pub(super) address: u16,
    pub(super) data: u8,
    /// The present contents.
    pub(super) old: u8,
    /// Whether no byte of the telegram stands behind the one in hand.
    pub(super) last: bool,
    /// Whether a command writes it.
    pub(super) of_a_command: bool,
    /// Which command that writes it is, counted from 1 since power-up; the one to come where no command writes.
    pub(super) nth: u64,
}

/// Reads a cell as it is.
pub(super) type Peek<'a> = &'a mut dyn FnMut(u16) -> u8;

/// A cell in which the drive's program finds another value than the real one.
pub(super) struct FalseCell {
    pub(super) address: u16,
    /// One byte or two.
    pub(super) word: bool,
    /// Maps the real value to the value that the program finds.
    pub(super) value: fn(u16) -> u16,
}

/// Where a deviation is injected.
pub(super) enum How {
    /// In the numbers of the error mode and the times.
    Amends(fn(&mut Properties, &mut Rules)),
    /// It hears another byte than the one that arrives.
    Hears(fn(&Moment) -> Received),
    /// It sends another byte, or none.
    Says(fn(&Moment, u8) -> Option<u8>),
    /// Both: it hears another byte and sends another byte.
    Mistakes(fn(&Moment) -> Received, fn(&Moment, u8) -> Option<u8>),
    /// It sends another byte, which depends on its cells.
    Tells(fn(&Moment, &mut dyn Memory, u8) -> u8),
    /// It forgets a command that it has received in part.
    Forgets(fn(&Moment) -> bool),
    /// It keeps a command that it had received in part when it went into the error mode.
    Keeps,
    /// A command reads another value. The arguments are the number of the reading command, the address and the real contents.
    Misreads(fn(u64, u16, u8) -> u8),
    /// It sends a byte twice.
    Repeats(fn(&Moment) -> bool),
    /// It sends every byte later by this time.
    Late(Span),
    /// It sends some bytes later by a time, and what stands behind them when they are out.
    LateAt(fn(&Moment) -> Option<Span>),
    /// It sends every byte earlier by this time.
    Early(Span),
    /// It leaves the error mode after this byte.
    Leaves(fn(&Moment) -> bool),
    /// It does something besides.
    Acts(fn(&Moment, &mut dyn Memory)),
    /// It does not do what is due then.
    Waits(fn(Deadline) -> bool),
    /// It reads another cell.
    ReadsFrom(fn(Place, u16) -> u16),
    /// A cell shows another value to every outside reader.
    Reads(fn(Peek<'_>, u16) -> u8),
    /// It writes something else, elsewhere or nothing.
    Writes(fn(Write) -> Option<(u16, u8)>),
    /// It permits what it must not, or forbids what it must permit.
    Permits(fn(Kind, u16) -> bool),
    /// It changes other outputs.
    Outputs(fn(OutputChange) -> Option<OutputChange>),
    /// It resets less.
    Resets(fn(&mut dyn Memory)),
    /// It reports another error, or none.
    Reports(fn(BusError) -> Option<BusError>),
    /// Its time-out monitoring is always so.
    Monitors(bool),
    /// Its program finds other values in cells.
    Holds(&'static [FalseCell]),
}
