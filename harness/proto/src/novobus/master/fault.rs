//! What can be wrong with a ring, as far as its master can tell (ND21 9.7-9.9, 11.5).

use super::super::address::RingSize;
use super::super::command::Kind;
use crate::counted::counted;
use core::fmt;

/// An end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkEnd {
    /// The master.
    Master,
    /// A drive.
    Drive(u8),
}

impl fmt::Display for LinkEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Master => f.write_str("the master"),
            Self::Drive(drive) => write!(f, "drive {drive}"),
        }
    }
}

/// A link of the ring, by its two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RingLink {
    /// The end that sends.
    pub from: LinkEnd,
    /// The end that receives.
    pub to: LinkEnd,
}

impl RingLink {
    /// The link that ends at `drive`: in front of it is the drive with the next higher number, or, in
    /// front of the first one, the master (ND21 8.5).
    #[must_use]
    pub const fn into(ring: RingSize, drive: u8) -> Self {
        Self {
            from: if drive >= ring.first() {
                LinkEnd::Master
            } else {
                LinkEnd::Drive(drive + 1)
            },
            to: LinkEnd::Drive(drive),
        }
    }

    /// The link that ends at the master.
    #[must_use]
    pub const fn last() -> Self {
        Self {
            from: LinkEnd::Drive(0),
            to: LinkEnd::Master,
        }
    }
}

impl fmt::Display for RingLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the link from {} to {}", self.from, self.to)
    }
}

/// What was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// A byte was damaged on this link: its receiver spelled out its address (9.7), or is the master.
    /// A drive that finds a fault with a command spells out its address too.
    Damaged(RingLink),
    /// The receiver of this link heard nothing (9.9): the link is broken, or its sender is dead.
    Broken(RingLink),
    /// Nothing comes back, and no drive says where: a link is broken, or a drive is dead.
    Silent,
    /// Another number of drives counted the address byte up.
    WrongRingSize {
        /// How many there are.
        counted: u8,
        /// How many there should be.
        ring: RingSize,
    },
    /// The right bytes came, but too late.
    Late,
    /// Bytes did not come back: the answer for a later job came instead.
    Lost {
        /// How many.
        bytes: u8,
    },
    /// Unexpected bytes came: an answer was doubled, or a byte inserted.
    Extra {
        /// How many.
        bytes: u8,
    },
    /// A drive answered, in step and without an error, with a byte that it must not send.
    Protocol {
        /// The drive.
        drive: u8,
        /// What must have come; `None` where it depends on data.
        expected: Option<u8>,
        /// What came.
        received: u8,
    },
    /// A drive goes into the error mode whenever it is given this command.
    Rejected {
        /// The drive.
        drive: u8,
        /// The command.
        kind: Kind,
    },
    /// Bytes came back wrong, and nothing shows where or why.
    Unclear,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damaged(link) => write!(f, "{link} is damaged (ND21 9.7)"),
            Self::Broken(link) => write!(
                f,
                "{link} is broken, or {} is not ready for operation (ND21 9.9)",
                link.from
            ),
            Self::Silent => f.write_str(
                "nothing comes back: a link is broken or a drive is not ready for operation",
            ),
            Self::WrongRingSize {
                counted: found,
                ring,
            } => write!(
                f,
                "the ring has {} and not {} (ND21 9.3)",
                counted(*found, "drive"),
                ring.drives()
            ),
            Self::Late => f.write_str("answers come too late"),
            Self::Lost { bytes } => write!(
                f,
                "{} lost: the answer was that for a later byte",
                counted(*bytes, "byte")
            ),
            Self::Extra { bytes } => write!(
                f,
                "{} came back that nobody had sent",
                counted(*bytes, "byte")
            ),
            Self::Protocol {
                drive,
                expected: Some(expected),
                received,
            } => write!(
                f,
                "drive {drive} answered {received:02X} in place of {expected:02X}"
            ),
            Self::Protocol {
                drive,
                expected: None,
                received,
            } => write!(f, "drive {drive} answered with a wrong {received:02X}"),
            Self::Rejected { drive, kind } => {
                write!(f, "drive {drive} does not accept {kind:?} (ND21 10)")
            }
            Self::Unclear => f.write_str("wrong bytes came back, and nothing shows from where"),
        }
    }
}

/// Why a bus was stopped (ND21 11.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BusStop {
    /// What was wrong when the last recovery had failed.
    pub fault: Fault,
    /// How many recoveries had not helped.
    pub attempts: u8,
}

impl fmt::Display for BusStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the bus is stopped after {} recoveries: {} (ND21 11.5)",
            self.attempts, self.fault
        )
    }
}

impl core::error::Error for BusStop {}
