//! MasterOptions of a master: packing, time-outs, number of attempts.

use super::super::properties::ReadLongAnswer;
use crate::time::Span;

/// MasterOptions of a master. Every field has a default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MasterOptions {
    /// Maximum number of jobs that the master holds: queued, under way, or with a result that was not fetched
    /// (ND21 11.6: "to avoid overloading the buffer each result should be called up").
    pub capacity: u16,
    /// Which of the shorter forms of a telegram it may use.
    pub packing: Packing,
    /// How the drives of this ring answer `ReadLong` (ND21 10.1).
    pub read_long: ReadLongAnswer,
    /// How many recoveries in a row may end without the disturbed work done, before the bus is stopped
    /// (ND21 11.5: "after several unsuccessful correction attempts").
    pub attempts: u8,
    /// How much later than the ring's own round trip a byte may come back: drivers, adapters, a busy host.
    pub slack: Span,
    /// How long after a silence the ring has time to name the drive that hears nothing: the drives wait
    /// 10 to 20 ms, and then 10 ms more (ND21 9.9).
    pub monitoring: Span,
    /// Whether to begin with the check sequence (ND21 9.8). A master that was stopped, or a program that
    /// ended, can leave a drive with an incomplete command, and the first command of the next master then fails. But the
    /// zeros of the sequence put every drive into the error mode for a moment, and its cell `errorcode`
    /// shows that.
    pub check_first: bool,
}

impl Default for MasterOptions {
    fn default() -> Self {
        Self {
            capacity: 1024,
            packing: Packing::ALL,
            read_long: ReadLongAnswer::default(),
            attempts: 8,
            slack: Span::from_millis(20),
            monitoring: Span::from_millis(40),
            check_first: false,
        }
    }
}

/// Which of the shorter forms of a telegram a master may use (ND21 9.1, 9.2, 9.5). Without
/// a short form the long one is sent: an address byte in every telegram, one whole command in each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packing {
    /// The short address "same drive".
    pub same: bool,
    /// The short address "next drive".
    pub next: bool,
    /// Several commands in one telegram.
    pub share: bool,
    /// A command cut over several telegrams.
    pub cut: bool,
}

impl Packing {
    /// Every form.
    pub const ALL: Self = Self {
        same: true,
        next: true,
        share: true,
        cut: true,
    };
    /// No short form at all.
    pub const NONE: Self = Self {
        same: false,
        next: false,
        share: false,
        cut: false,
    };
}

impl Default for Packing {
    fn default() -> Self {
        Self::ALL
    }
}
