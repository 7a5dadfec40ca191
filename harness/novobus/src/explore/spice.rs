//! What a conversation on the ring can have.

use harness_bench::explore::Spiced;

/// Something that a conversation can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Spice {
    /// `ReadByte` (ND21 10.1).
    ReadByte,
    /// `ReadWord` (10.1).
    ReadWord,
    /// `ReadLong` (10.1).
    ReadLong,
    /// `WriteByte` (10.2).
    WriteByte,
    /// `WriteWord` (10.2).
    WriteWord,
    /// `And` (10.3).
    And,
    /// `Or` (10.3).
    Or,
    /// `WriteIO` (10.4).
    WriteIo,
    /// `ResetH8` (10.5).
    Reset,
    /// Process data (9.4).
    ProcessData,
    /// The drive of the telegram before (9.2).
    Same,
    /// The next drive (9.2).
    Next,
    /// Addresses of no drive (9.3).
    Nobody,
    /// SYNCO and PAUSE between telegrams (9.2).
    Idle,
    /// Commands cut over several telegrams (9.5).
    Cut,
    /// Wrong bytes in commands: code, fixed byte, checking byte (9.6, 9.7).
    Spoil,
    /// Addresses that no command may touch (10.1, 10.2).
    Forbidden,
    /// Any bytes where a sync byte is due (9.2, 9.7).
    Noise,
    /// Zeros and check sequences in parts (9.7, 9.8).
    Zeros,
    /// Silence (9.9).
    Silence,
    /// Inverted bits (9.7).
    Flip,
    /// Stop bits of 0 and receivers that are too slow (9.7).
    Framing,
    /// Bytes that are lost, doubled, put in or exchanged.
    Slip,
    /// Bytes that come late, and breaks.
    Late,
    /// Drives without power.
    Power,
    /// Motors that turn (14.10, 14.5.3.1, 13.2).
    Motion,
    /// The EEPROM controller (14.10.5).
    Eeprom,
}

impl Spice {
    /// All with their names.
    pub(crate) const NAMES: [(&'static str, Self); 27] = [
        ("read-byte", Self::ReadByte),
        ("read-word", Self::ReadWord),
        ("read-long", Self::ReadLong),
        ("write-byte", Self::WriteByte),
        ("write-word", Self::WriteWord),
        ("and", Self::And),
        ("or", Self::Or),
        ("write-io", Self::WriteIo),
        ("reset", Self::Reset),
        ("process-data", Self::ProcessData),
        ("same-drive", Self::Same),
        ("next-drive", Self::Next),
        ("nobody", Self::Nobody),
        ("idle", Self::Idle),
        ("cut", Self::Cut),
        ("spoil", Self::Spoil),
        ("forbidden", Self::Forbidden),
        ("noise", Self::Noise),
        ("zeros", Self::Zeros),
        ("silence", Self::Silence),
        ("flip", Self::Flip),
        ("framing", Self::Framing),
        ("slip", Self::Slip),
        ("late", Self::Late),
        ("power", Self::Power),
        ("motion", Self::Motion),
        ("eeprom", Self::Eeprom),
    ];

    /// The commands; a conversation has at least one of them.
    pub(crate) const COMMANDS: [Self; 9] = [
        Self::ReadByte,
        Self::ReadWord,
        Self::ReadLong,
        Self::WriteByte,
        Self::WriteWord,
        Self::And,
        Self::Or,
        Self::WriteIo,
        Self::Reset,
    ];

    /// The faults on links.
    pub(crate) const FAULTS: [Self; 4] = [Self::Flip, Self::Framing, Self::Slip, Self::Late];
}

impl Spiced for Spice {
    const ALL: &'static [(&'static str, Self)] = &Self::NAMES;
}
