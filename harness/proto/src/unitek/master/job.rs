//! Jobs, what becomes of them, and what a master reports besides.

use super::super::frame::{Data, NoReply, Reply};
use crate::time::Span;
use core::fmt;

/// Settings of a master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How long a reply may take, from the moment that the request was given out.
    pub time_out: Span,
    /// How often a request without a reply is sent again.
    pub repeats: u8,
    /// Whether RW and SP registers are read after a write.
    pub read_back: bool,
    /// How far a cyclic frame may be from its time; a real drive's jitter is unknown.
    pub cycle_tolerance: Span,
}

impl Default for Options {
    /// 20 ms, two repeats, writes are read back, 2 ms.
    fn default() -> Self {
        Self {
            time_out: Span::from_millis(20),
            repeats: 2,
            read_back: true,
            cycle_tolerance: Span::from_millis(2),
        }
    }
}

/// Something for the master to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// Reads a register once (5.2 item 1).
    Read {
        /// The register.
        register: u8,
    },
    /// Writes a register, and reads it back.
    Write {
        /// The register.
        register: u8,
        /// The value, with 16 or 32 bits.
        data: Data,
    },
    /// Starts a cycle, or gives it another interval (5.2 item 2).
    Cycle {
        /// The register.
        register: u8,
        /// 1 to 254 ms.
        every: u8,
    },
    /// Stops a cycle.
    Stop {
        /// The register.
        register: u8,
    },
    /// The routine of ex 11 and 12: ready, lock, no command, hardware enable, release.
    StartUp {
        /// How long each of ready and hardware enable may take.
        patience: Span,
    },
}

/// The number of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobNumber(pub u64);

/// Why a job is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobRefusal {
    /// Too many jobs wait.
    Full,
    /// The drive has places for 8 cycles.
    EightCycles,
    /// The interval is not 1 to 254 ms.
    Interval,
}

impl fmt::Display for JobRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Full => "too many jobs wait: wait for results first",
            Self::EightCycles => "the drive sends at most 8 registers cyclically: stop one first",
            Self::Interval => {
                "the interval of a cycle is 1 to 254 ms (0 is a single reply, 255 stops)"
            }
        })
    }
}

impl core::error::Error for JobRefusal {}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The register was read.
    Read(Reply),
    /// The register was written and reads so.
    Written(Reply),
    /// The register was written and reads differently: the drive refused it, changed it, or has lost the frame.
    Differs {
        /// What was written.
        wrote: Data,
        /// What was read.
        reads: Reply,
    },
    /// The frame was given out, and nothing tells what became of it.
    Sent,
    /// The first frame of the cycle has come.
    Started(Reply),
    /// The start-up is done: the lock is released.
    Released,
    /// The drive did not become ready, or its hardware enable was not closed, in time. It is locked if the lock was written before.
    NotReady(Reply),
    /// No reply, or no cyclic frame, has come.
    NoReply {
        /// How often the frame was sent.
        tries: u8,
    },
}

/// Something to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MasterEvent {
    /// A job has ended; each one does so once.
    Ended {
        /// The job.
        id: JobNumber,
        /// How.
        outcome: Outcome,
    },
    /// A frame of a cycle under supervision.
    Cyclic {
        /// The frame.
        reply: Reply,
    },
    /// STATUS came without a request, while sending by event is on.
    Status {
        /// The frame.
        reply: Reply,
    },
    /// Something is not as it should be.
    Disturbance(Disturbance),
}

/// What is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// A frame with the drive's identifier that is no reply.
    Odd(NoReply),
    /// A reply to no request, of no cycle: late, doubled, asked for by another master, or of another drive with the same
    /// identifiers.
    Unasked {
        /// The frame.
        reply: Reply,
    },
    /// A cyclic frame did not come in time.
    Missing {
        /// The register.
        register: u8,
    },
    /// A cyclic frame came too early: it was sent twice, for another request, or the drive has another interval.
    Early {
        /// The register.
        register: u8,
        /// The time since the frame before it.
        after: Span,
    },
}
