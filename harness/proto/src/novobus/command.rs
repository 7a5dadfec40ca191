//! The nine commands of the parameter channel and their answers (ND21 9.5, 10.1-10.5).
//!
//! A command and its answer have the same length and run in step: when the drive has read byte n of
//! the command it sends byte n of the answer. [`LAYOUTS`] is the manual's chapter 10 as a table; the
//! drive's end interprets it and the master's end composes from it.

use super::checksum::Checksum;
use super::decode::Decoded;
use super::output::OutputChange;
use super::properties::ReadLongAnswer;
use alloc::vec::Vec;
use core::fmt;

/// The page of RAM that the bit commands and process data reach (ND21 10.3, 14.10.3).
pub const PAGE: u16 = 0xFF00;

/// Which command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Reads a byte (10.1).
    ReadByte,
    /// Reads a word (10.1).
    ReadWord,
    /// Reads four bytes (10.1).
    ReadLong,
    /// Writes a byte (10.2).
    WriteByte,
    /// Writes a word (10.2).
    WriteWord,
    /// Logical AND into a cell of page FF (10.3).
    And,
    /// Logical OR into a cell of page FF (10.3).
    Or,
    /// Changes a digital output (10.4).
    WriteIo,
    /// Resets the drive's program (10.5).
    ResetH8,
}

impl Kind {
    /// How many bytes of memory the command touches.
    #[must_use]
    pub const fn width(self) -> u8 {
        match self {
            Self::ReadByte | Self::WriteByte | Self::And | Self::Or => 1,
            Self::ReadWord | Self::WriteWord => 2,
            Self::ReadLong => 4,
            Self::WriteIo | Self::ResetH8 => 0,
        }
    }

    /// Whether the command fetches data.
    #[must_use]
    pub const fn reads(self) -> bool {
        matches!(self, Self::ReadByte | Self::ReadWord | Self::ReadLong)
    }
}

/// A byte of a command, after the command byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Field {
    /// The low byte of the address.
    AddrL,
    /// The high byte of the address; the address is complete with it.
    AddrH,
    /// The low byte of an address in page FF, which is complete with it (10.3).
    AddrInPage,
    /// Data byte i, counted in memory order: 0 stands at the lowest address.
    Data(u8),
    /// An output code (10.4).
    Code,
    /// A byte that must have this value.
    Fixed(u8),
    /// The +checksum (9.6).
    Check,
}

/// A byte of an answer, after the command byte, which is always echoed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reply {
    /// The byte just received.
    Echo,
    /// Data byte i of what was read, counted in memory order.
    Data(u8),
    /// The -checksum (9.6).
    Check,
}

/// One row of the manual's chapter 10.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Layout {
    /// Which command.
    pub kind: Kind,
    /// The name that the manual prints.
    pub printed_name: &'static str,
    /// The section.
    pub section: &'static str,
    /// The command byte.
    pub code: u8,
    /// The bytes of the command after the command byte.
    pub command: &'static [Field],
    /// The bytes of the answer, in step with them.
    pub answer: &'static [Reply],
}

impl Layout {
    /// How many bytes command and answer have, the command byte included: 3 to 6.
    #[must_use]
    pub const fn length(&self) -> usize {
        1 + self.command.len()
    }
}

use Field::{AddrH, AddrInPage, AddrL, Check, Code, Data, Fixed};

/// The commands as printed (ND21 10.1-10.5). `ReadLong` comes in two forms of the answer
/// (see [`ReadLongAnswer`]).
pub const LAYOUTS: [Layout; 10] = [
    Layout {
        kind: Kind::ReadByte,
        printed_name: "ReadByte",
        section: "10.1",
        code: 0xC0,
        command: &[AddrL, AddrH, Check],
        answer: &[Reply::Echo, Reply::Data(0), Reply::Check],
    },
    Layout {
        kind: Kind::ReadWord,
        printed_name: "ReadWord",
        section: "10.1",
        code: 0xC1,
        command: &[AddrL, AddrH, Fixed(b'?'), Check],
        answer: &[Reply::Echo, Reply::Data(1), Reply::Data(0), Reply::Check],
    },
    Layout {
        kind: Kind::ReadLong,
        printed_name: "ReadLong",
        section: "10.1",
        code: 0xC7,
        command: &[AddrL, AddrH, Fixed(b'1'), Fixed(b'2'), Check],
        answer: &[
            Reply::Echo,
            Reply::Data(0),
            Reply::Data(1),
            Reply::Data(2),
            Reply::Data(3),
        ],
    },
    Layout {
        kind: Kind::WriteByte,
        printed_name: "WriteByte",
        section: "10.2",
        code: 0x82,
        command: &[Data(0), AddrL, AddrH, Check],
        answer: &[Reply::Echo, Reply::Echo, Reply::Echo, Reply::Check],
    },
    Layout {
        kind: Kind::WriteWord,
        printed_name: "WriteWord",
        section: "10.2",
        code: 0x63,
        command: &[Data(1), Data(0), AddrL, AddrH, Check],
        answer: &[
            Reply::Echo,
            Reply::Echo,
            Reply::Echo,
            Reply::Echo,
            Reply::Check,
        ],
    },
    Layout {
        kind: Kind::And,
        printed_name: "And",
        section: "10.3",
        code: 0xA4,
        command: &[Data(0), AddrInPage, Check],
        answer: &[Reply::Echo, Reply::Echo, Reply::Check],
    },
    Layout {
        kind: Kind::Or,
        printed_name: "Or",
        section: "10.3",
        code: 0xA5,
        command: &[Data(0), AddrInPage, Check],
        answer: &[Reply::Echo, Reply::Echo, Reply::Check],
    },
    Layout {
        kind: Kind::WriteIo,
        printed_name: "WriteIO",
        section: "10.4",
        code: 0xC8,
        command: &[Code, Check],
        answer: &[Reply::Echo, Reply::Check],
    },
    Layout {
        kind: Kind::ResetH8,
        printed_name: "ResetH8",
        section: "10.5",
        code: 0xDD,
        command: &[Fixed(b'!'), Check],
        answer: &[Reply::Echo, Reply::Check],
    },
    Layout {
        kind: Kind::ReadLong,
        printed_name: "ReadLong",
        section: "10.1",
        code: 0xC7,
        command: &[AddrL, AddrH, Fixed(b'1'), Fixed(b'2'), Check],
        answer: &[
            Reply::Echo,
            Reply::Data(0),
            Reply::Data(1),
            Reply::Data(3),
            Reply::Check,
        ],
    },
];

const READ_LONG_AS_PRINTED: usize = 9;

/// The layout of a command byte; `None` where it is not one of the nine.
#[must_use]
pub fn layout(code: u8, read_long: ReadLongAnswer) -> Option<&'static Layout> {
    let layout = LAYOUTS.iter().find(|layout| layout.code == code)?;
    if layout.kind == Kind::ReadLong && read_long == ReadLongAnswer::AsPrinted {
        return Some(&LAYOUTS[READ_LONG_AS_PRINTED]);
    }
    Some(layout)
}

/// A command with its parameters, as the master gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// Reads the byte at an address.
    ReadByte {
        /// 2F00-2FBF or FD80-FFFF.
        address: u16,
    },
    /// Reads the word at an address.
    ReadWord {
        /// 2F00-2FDE or FD80-FF7E.
        address: u16,
    },
    /// Reads the four bytes from an address on.
    ReadLong {
        /// FD80-FF7C.
        address: u16,
    },
    /// Writes a byte.
    WriteByte {
        /// FD80-FF7F.
        address: u16,
        /// The byte.
        data: u8,
    },
    /// Writes a word.
    WriteWord {
        /// FD80-FF7E.
        address: u16,
        /// The word; its high byte goes to the lower address.
        data: u16,
    },
    /// ANDs a cell of page FF with a mask.
    And {
        /// The low byte of the address, 00-7F.
        address_low: u8,
        /// The mask.
        data: u8,
    },
    /// ORs a cell of page FF with a mask.
    Or {
        /// The low byte of the address, 00-7F.
        address_low: u8,
        /// The mask.
        data: u8,
    },
    /// Changes a digital output.
    WriteIo(OutputChange),
    /// Resets the drive.
    ResetH8,
}

impl Command {
    /// Which command it is.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        match self {
            Self::ReadByte { .. } => Kind::ReadByte,
            Self::ReadWord { .. } => Kind::ReadWord,
            Self::ReadLong { .. } => Kind::ReadLong,
            Self::WriteByte { .. } => Kind::WriteByte,
            Self::WriteWord { .. } => Kind::WriteWord,
            Self::And { .. } => Kind::And,
            Self::Or { .. } => Kind::Or,
            Self::WriteIo(_) => Kind::WriteIo,
            Self::ResetH8 => Kind::ResetH8,
        }
    }

    /// The row of chapter 10 that it belongs to.
    #[must_use]
    pub fn layout(&self, read_long: ReadLongAnswer) -> &'static Layout {
        let index = match self.kind() {
            Kind::ReadLong if read_long == ReadLongAnswer::AsPrinted => READ_LONG_AS_PRINTED,
            // The variants stand in the table's order.
            kind => kind as usize,
        };
        &LAYOUTS[index]
    }

    /// The bytes on the bus, checking byte included.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let layout = self.layout(ReadLongAnswer::default());
        let mut bytes = Vec::with_capacity(layout.length());
        bytes.push(layout.code);
        for &field in layout.command {
            let byte = match field {
                Field::Check => Checksum::over(&bytes).plus(),
                field => self.field(field),
            };
            bytes.push(byte);
        }
        bytes
    }

    /// The bytes with which a drive answers, where the answer's data (in memory order) are `data`.
    /// Writes need none. Missing data read as 00.
    #[must_use]
    pub fn answer(&self, data: &[u8], read_long: ReadLongAnswer) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.layout(read_long).length());
        for (reply, echo) in self.answer_form(read_long) {
            bytes.push(match reply {
                Reply::Echo => echo,
                Reply::Data(n) => data.get(usize::from(n)).copied().unwrap_or(0),
                Reply::Check => Checksum::over(&bytes).minus(),
            });
        }
        bytes
    }

    /// The answer byte for byte: what each byte is, and the byte of the command in step with it.
    #[must_use]
    pub fn answer_form(&self, read_long: ReadLongAnswer) -> Vec<(Reply, u8)> {
        let layout = self.layout(read_long);
        let replies = core::iter::once(&Reply::Echo).chain(layout.answer);
        replies.copied().zip(self.encode()).collect()
    }

    /// The address that the command touches, if it touches memory.
    #[must_use]
    pub const fn address(&self) -> Option<u16> {
        match *self {
            Self::ReadByte { address }
            | Self::ReadWord { address }
            | Self::ReadLong { address }
            | Self::WriteByte { address, .. }
            | Self::WriteWord { address, .. } => Some(address),
            Self::And { address_low, .. } | Self::Or { address_low, .. } => {
                Some(PAGE | address_low as u16)
            }
            Self::WriteIo(_) | Self::ResetH8 => None,
        }
    }

    fn field(&self, field: Field) -> u8 {
        let [high, low] = self.address().unwrap_or_default().to_be_bytes();
        match field {
            Field::AddrL | Field::AddrInPage => low,
            Field::AddrH => high,
            Field::Data(i) => match *self {
                Self::WriteByte { data, .. } | Self::And { data, .. } | Self::Or { data, .. } => {
                    data
                }
                Self::WriteWord { data, .. } => data.to_be_bytes()[usize::from(i)],
                _ => 0,
            },
            Field::Code => match self {
                Self::WriteIo(change) => change.code(),
                _ => 0,
            },
            Field::Fixed(byte) => byte,
            Field::Check => 0,
        }
    }

    /// Reads a command from the front of `bytes`, as any drive would accept it that has the ND21's
    /// memory ranges left out of the question.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Decoded<Self, CommandError> {
        let Some(&code) = bytes.first() else {
            return Decoded::NeedMore;
        };
        let Some(layout) = layout(code, ReadLongAnswer::default()) else {
            return Decoded::Bad {
                reason: CommandError::UnknownCommand(code),
                offset: 0,
            };
        };
        let mut address = PAGE.to_be_bytes();
        let mut data = [0; 2];
        let mut change = None;
        for (i, &field) in layout.command.iter().enumerate() {
            let offset = 1 + i;
            let Some(&byte) = bytes.get(offset) else {
                return Decoded::NeedMore;
            };
            let bad = |reason| Decoded::Bad { reason, offset };
            match field {
                Field::AddrL | Field::AddrInPage => address[1] = byte,
                Field::AddrH => address[0] = byte,
                Field::Data(n) => data[usize::from(n)] = byte,
                Field::Code => match OutputChange::from_code(byte) {
                    None => return bad(CommandError::UnknownOutput(byte)),
                    known => change = known,
                },
                Field::Fixed(expected) if byte != expected => {
                    return bad(CommandError::FixedByte {
                        expected,
                        found: byte,
                    });
                }
                Field::Fixed(_) => {}
                Field::Check => {
                    let expected = Checksum::over(&bytes[..offset]).plus();
                    if byte != expected {
                        return bad(CommandError::Checksum {
                            expected,
                            found: byte,
                        });
                    }
                }
            }
        }
        let word = u16::from_be_bytes(address);
        let value = match layout.kind {
            Kind::ReadByte => Self::ReadByte { address: word },
            Kind::ReadWord => Self::ReadWord { address: word },
            Kind::ReadLong => Self::ReadLong { address: word },
            Kind::WriteByte => Self::WriteByte {
                address: word,
                data: data[0],
            },
            Kind::WriteWord => Self::WriteWord {
                address: word,
                data: u16::from_be_bytes(data),
            },
            Kind::And => Self::And {
                address_low: address[1],
                data: data[0],
            },
            Kind::Or => Self::Or {
                address_low: address[1],
                data: data[0],
            },
            Kind::WriteIo => match change {
                Some(change) => Self::WriteIo(change),
                None => return Decoded::NeedMore,
            },
            Kind::ResetH8 => Self::ResetH8,
        };
        Decoded::Value {
            value,
            used: layout.length(),
        }
    }
}

/// Why bytes are no command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandError {
    /// Not one of the nine command bytes.
    UnknownCommand(u8),
    /// An output code above 3 (ND21 10.4).
    UnknownOutput(u8),
    /// A byte that has just one right value has another.
    FixedByte {
        /// The right one.
        expected: u8,
        /// The one that was there.
        found: u8,
    },
    /// The checking byte does not fit (ND21 9.6).
    Checksum {
        /// The +checksum.
        expected: u8,
        /// The one that was there.
        found: u8,
    },
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownCommand(code) => {
                write!(f, "{code:02X} is none of the nine command bytes (ND21 10)")
            }
            Self::UnknownOutput(code) => {
                write!(f, "output code {code:02X} is not 00 to 03 (ND21 10.4)")
            }
            Self::FixedByte { expected, found } => {
                write!(f, "{found:02X} stands where {expected:02X} must (ND21 10)")
            }
            Self::Checksum { expected, found } => {
                write!(
                    f,
                    "checking byte {found:02X} should be {expected:02X} (ND21 9.6)"
                )
            }
        }
    }
}

impl core::error::Error for CommandError {}
