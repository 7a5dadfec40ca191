//! Jobs: a command for a drive, and how it ended (ND21 10, 11.6).

use super::super::address::{AddressError, RingSize};
use super::super::command::{Command, Kind};
use super::super::memory::{in_range, ranges};
use super::fault::{BusStop, Fault};
use core::fmt;

/// The number of a job; a later job has a greater one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub(super) u64);

impl JobId {
    /// The number.
    #[must_use]
    pub const fn number(self) -> u64 {
        self.0
    }
}

/// A command for a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Job {
    /// The drive.
    pub drive: u8,
    /// The command.
    pub command: Command,
    /// Whether it may run a second time when its first answer was lost.
    pub repeat: Repeat,
}

impl Job {
    /// `command` for `drive`, repeated as its kind allows.
    #[must_use]
    pub const fn new(drive: u8, command: Command) -> Self {
        Self {
            drive,
            command,
            repeat: Repeat::ByKind,
        }
    }

    /// The job, never to be run twice: for cells that start something when they are written.
    #[must_use]
    pub const fn once(self) -> Self {
        Self {
            repeat: Repeat::Never,
            ..self
        }
    }

    /// The job, to be repeated whatever it is.
    #[must_use]
    pub const fn repeatable(self) -> Self {
        Self {
            repeat: Repeat::Always,
            ..self
        }
    }

    /// Whether running it twice does no more than running it once: so for reads, for writes of plain
    /// cells, for AND and OR with one mask and for outputs; not for a reset.
    pub(super) const fn may_repeat(&self) -> bool {
        match self.repeat {
            Repeat::ByKind => !matches!(self.command.kind(), Kind::ResetH8),
            Repeat::Never => false,
            Repeat::Always => true,
        }
    }

    /// Whether `ring` can do it.
    pub(super) fn check(&self, ring: RingSize) -> Result<(), Refused> {
        ring.address_byte(self.drive).map_err(Refused::Drive)?;
        let kind = self.command.kind();
        match self.command.address() {
            Some(address) if !in_range(kind, address) => Err(Refused::OutOfRange { kind, address }),
            _ => Ok(()),
        }
    }
}

/// Whether a job may run a second time when it is not known to have run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Repeat {
    /// All commands but `ResetH8` may.
    #[default]
    ByKind,
    /// It must not: it ends as [`Outcome::Unknown`].
    Never,
    /// It may.
    Always,
}

/// Why a job was not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// The ring has no such drive.
    Drive(AddressError),
    /// The command must not touch all of the bytes from this address on.
    OutOfRange {
        /// The command.
        kind: Kind,
        /// The address.
        address: u16,
    },
    /// The master holds as many jobs and unfetched results as it may.
    Full {
        /// How many.
        capacity: u16,
    },
    /// The bus has been stopped.
    Stopped(BusStop),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drive(error) => error.fmt(f),
            Self::OutOfRange { kind, address } => {
                write!(f, "{kind:?} at {address:04X}: it reaches ")?;
                for (i, range) in ranges(*kind).iter().enumerate() {
                    let between = if i > 0 { " and " } else { "" };
                    write!(f, "{between}{:04X} to {:04X}", range.start(), range.end())?;
                }
                write!(f, " with all of its {} bytes (ND21 10)", kind.width())
            }
            Self::Full { capacity } => write!(
                f,
                "{capacity} jobs and unfetched results are held already (ND21 11.6)"
            ),
            Self::Stopped(stop) => stop.fmt(f),
        }
    }
}

impl core::error::Error for Refused {}

/// How a job ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The data that were read.
    Read(ReadData),
    /// It ran: the drive's own checking byte has come back.
    Done {
        /// Whether it may have run before, with its answer lost.
        perhaps_twice: bool,
    },
    /// "Unknown, not repeated": all of the command was sent and the answer was lost, or it never ended
    /// before the bus stopped.
    Unknown(Fault),
    /// It did not run (a read: has no result), and the bus is stopped.
    Failed(BusStop),
}

/// What a read brought, in memory order: byte 0 stands at the lowest address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadData {
    pub(super) bytes: [u8; 4],
    pub(super) known: u8,
    pub(super) width: u8,
}

impl ReadData {
    /// Byte `i`, if the answer holds it (one form of `ReadLong` leaves byte 2 out).
    #[must_use]
    pub fn byte(&self, i: usize) -> Option<u8> {
        let known = i < 4 && self.known >> i & 1 == 1;
        self.bytes.get(i).copied().filter(|_| known)
    }

    /// The number that the bytes are, the highest at the lowest address; `None` where one is missing.
    #[must_use]
    pub fn value(&self) -> Option<u32> {
        (0..usize::from(self.width))
            .try_fold(0, |value, i| Some(value << 8 | u32::from(self.byte(i)?)))
    }
}
