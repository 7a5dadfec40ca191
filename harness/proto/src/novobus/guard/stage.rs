//! Where the drives stand, as far as a guard knows: what they take the next byte for.

/// What the drives take the next byte for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// A drive may be anywhere: only zeros pass (ND21 9.8).
    Doubt,
    /// No drive is in the middle of a telegram, but one may be in the error mode: SYNCO, PAUSE and the check sequence pass too.
    Cleared,
    /// The same, directly after 17 zeros: a check sequence ends the doubt.
    Zeros,
    /// Within a check sequence after 17 zeros.
    Sequence,
    /// Within a check sequence that does not end the doubt.
    IdleSequence,
    /// A sync byte (9.2).
    Sync,
    /// An address byte (9.3).
    Address,
    /// A net byte of a telegram that addresses no drive (9.3).
    Nobody,
    /// The high byte of process data (9.4).
    ProcessHigh,
    /// Their low byte.
    ProcessLow,
    /// A command byte (9.5).
    Command,
    /// A byte of a command.
    Parameter,
    /// A checking byte (9.6).
    Check,
}
