//! What has been sent and must come back: one entry a byte, oldest first, bounded by the size of the
//! ring and the slack.

use super::super::sync::SYNCO;
use crate::time::Instant;
use alloc::collections::VecDeque;

/// A job in the store.
pub(super) type JobSlot = u16;

/// What a byte on the line is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// Nothing: SYNCO.
    Idle,
    /// The telegram that counts the drives.
    Count,
    Job(JobSlot),
    /// The exchange of process data with a drive.
    Exchange(u8),
}

/// Which byte it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BytePlace {
    /// A sync byte.
    Sync,
    /// An address byte.
    Address,
    /// The high byte of the process data.
    ProcessHigh,
    /// The low byte of the process data.
    ProcessLow,
    /// A byte of the parameter channel.
    Parameter,
    /// The last byte of the telegram that counts the drives.
    Last,
}

/// A byte that has been composed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ComposedByte {
    /// As it goes out.
    pub(super) byte: u8,
    /// As it must come back; `None` for data, and for a checking byte that depends on data.
    pub(super) back: Option<u8>,
    pub(super) place: BytePlace,
    pub(super) owner: Owner,
}

impl ComposedByte {
    pub(super) const SYNCO: Self = Self {
        byte: SYNCO,
        back: Some(SYNCO),
        place: BytePlace::Sync,
        owner: Owner::Idle,
    };
}

/// A byte that has been sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct ByteInFlight {
    pub(super) composed: ComposedByte,
    /// The byte is missed from then on.
    pub(super) due: Instant,
}

/// The bytes under way.
#[derive(Clone, Debug)]
pub(super) struct InFlight {
    bytes: VecDeque<ByteInFlight>,
    most: usize,
}

impl InFlight {
    pub(super) fn new(most: usize) -> Self {
        Self {
            // The slack allows for many more than are ever under way.
            bytes: VecDeque::new(),
            most,
        }
    }

    pub(super) fn is_full(&self) -> bool {
        self.bytes.len() >= self.most
    }

    pub(super) fn push(&mut self, sent: ByteInFlight) {
        self.bytes.push_back(sent);
    }

    pub(super) fn pop(&mut self) -> Option<ByteInFlight> {
        self.bytes.pop_front()
    }

    /// When the oldest byte is missed.
    pub(super) fn due(&self) -> Option<Instant> {
        self.bytes.front().map(|sent| sent.due)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &ByteInFlight> {
        self.bytes.iter()
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }
}
