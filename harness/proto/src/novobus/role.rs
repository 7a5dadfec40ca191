//! What each byte of the master's is for, and the answer to it, by ND21 9.1 to 9.8 and 10.

use super::address::RingSize;
use super::check_sequence::{SEQUENCE, SequenceProgress, SequenceWatch};
use super::command::{Command, CommandError, Field, Layout, Reply, layout};
use super::properties::{Properties, ReadLongAnswer, ShortAddress};
use super::sync::{Addressing, SyncByte};
use crate::decode::Decoded;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// What a byte is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// SYNCO or PAUSE (9.2).
    Idle,
    /// A sync byte (9.2).
    Sync,
    /// An address byte (9.3), which comes back as the drive's number.
    Address {
        /// The drive that is meant, if the ring has it.
        drive: Option<u8>,
    },
    /// A byte of the process data (9.4).
    ProcessData {
        /// The drive that is meant.
        drive: Option<u8>,
    },
    /// A byte of a command that comes back as it is (9.5, chapter 10).
    Command {
        /// The drive that is meant.
        drive: Option<u8>,
        /// Where the command is printed.
        section: &'static str,
    },
    /// A byte in whose place a cell's comes back (10.1).
    Data {
        /// The drive that is meant.
        drive: Option<u8>,
        /// The address of the cell.
        address: u16,
    },
    /// The last byte of a command, in whose place the -checksum of the answer comes back (9.6).
    Check {
        /// The drive that is meant.
        drive: Option<u8>,
        /// How many bytes the answer has.
        length: u8,
        /// The cell that is written with it: its first address, and how many bytes.
        writes: Option<(u16, u8)>,
    },
    /// A byte of the check sequence (9.8).
    CheckSequence,
    /// Anything else: no drive takes it for a telegram until a check sequence has been (9.7).
    Foreign,
}

impl Role {
    /// The drive that is meant, where one is.
    #[must_use]
    pub const fn drive(self) -> Option<u8> {
        match self {
            Self::Address { drive }
            | Self::ProcessData { drive }
            | Self::Command { drive, .. }
            | Self::Data { drive, .. }
            | Self::Check { drive, .. } => drive,
            Self::Idle | Self::Sync | Self::CheckSequence | Self::Foreign => None,
        }
    }

    /// The drive that alone may change the byte: an address byte is changed by every drive on its way (ND21 9.3).
    #[must_use]
    pub const fn answering(self) -> Option<u8> {
        match self {
            Self::Address { .. } => None,
            _ => self.drive(),
        }
    }

    /// The section of the ND21 manual with the rule for it, and the rule in a word.
    #[must_use]
    pub const fn rule(self) -> (&'static str, &'static str) {
        match self {
            Self::Idle => ("9.2", "SYNCO and PAUSE"),
            Self::Sync => ("9.2", "sync byte"),
            Self::Address { .. } => ("9.3", "address byte"),
            Self::ProcessData { .. } => ("9.4", "process data"),
            Self::Command { section, .. } => (section, "command"),
            Self::Data { .. } => ("10.1", "data of the answer"),
            Self::Check { .. } => ("9.6", "checking byte of the answer"),
            Self::CheckSequence => ("9.8", "check sequence"),
            Self::Foreign => ("9.7", "error mode"),
        }
    }
}

#[derive(Default)]
struct Reader {
    ring: u8,
    read_long: ReadLongAnswer,
    watch: SequenceWatch,
    /// Bytes of the present telegram that are still to come.
    net: u8,
    address_next: bool,
    process_data: u8,
    /// The number of the addressed drive, counted on beyond the ring.
    number: Option<u8>,
    drive: Option<u8>,
    /// The begun command of each drive.
    commands: BTreeMap<u8, Vec<u8>>,
    foreign: bool,
}

/// The role of every byte of a conversation; `good` is false for a byte with a line error.
#[must_use]
pub fn roles(ring: RingSize, sent: &[(u8, bool)]) -> Vec<Role> {
    roles_with(ring, sent, &Properties::default())
}

/// The same for drives with these properties of `ReadLong` (10.1) and of short addresses after a check sequence (9.2).
#[must_use]
pub fn roles_with(ring: RingSize, sent: &[(u8, bool)], properties: &Properties) -> Vec<Role> {
    read(ring, sent, properties).0
}

/// Whether a telegram may begin behind these bytes: none is under way, no drive has a begun command (9.5), and
/// none is in the error mode (9.7) as far as the bytes tell.
#[must_use]
pub fn at_rest(ring: RingSize, sent: &[(u8, bool)]) -> bool {
    let reader = read(ring, sent, &Properties::default()).1;
    !reader.foreign && !reader.address_next && reader.net == 0 && reader.commands.is_empty()
}

fn read(ring: RingSize, sent: &[(u8, bool)], properties: &Properties) -> (Vec<Role>, Reader) {
    let begun = |number: Option<u8>| Reader {
        ring: ring.drives(),
        read_long: properties.read_long,
        drive: number.filter(|number| *number < ring.drives()),
        number,
        ..Reader::default()
    };
    let mut reader = begun(None);
    let mut roles: Vec<Role> = Vec::with_capacity(sent.len());
    for (byte, good) in sent {
        let role = reader.read(*byte, *good);
        roles.push(role);
        if reader.watch.see(*byte, *good) == SequenceProgress::Complete {
            let from = roles.len().saturating_sub(SEQUENCE.len());
            roles[from..].fill(Role::CheckSequence);
            let keeps = properties.short_address == ShortAddress::KeptSum;
            reader = begun(reader.number.filter(|_| keeps));
        }
    }
    (roles, reader)
}

impl Reader {
    fn read(&mut self, byte: u8, good: bool) -> Role {
        self.foreign |= !good;
        if self.foreign {
            return Role::Foreign;
        }
        if self.address_next {
            self.address_next = false;
            self.number = Some(byte.wrapping_add(self.ring));
            self.drive = self.number.filter(|number| *number < self.ring);
            return Role::Address { drive: self.drive };
        }
        if self.net > 0 {
            self.net -= 1;
            if self.process_data > 0 {
                self.process_data -= 1;
                return Role::ProcessData { drive: self.drive };
            }
            return self.parameter(byte);
        }
        match SyncByte::decode(byte) {
            Ok(SyncByte::Synco | SyncByte::Pause) => Role::Idle,
            Ok(SyncByte::Telegram(header)) => {
                self.net = header.net_length();
                self.process_data = if header.process_data() { 2 } else { 0 };
                match header.addressing() {
                    Addressing::AddressFollows => self.address_next = true,
                    Addressing::SameDrive => {}
                    Addressing::NextDrive => {
                        // Behind an address that no drive has, the next one may be a drive's (9.2).
                        self.number = self.number.map(|number| number.wrapping_add(1));
                        self.drive = self.number.filter(|number| *number < self.ring);
                    }
                }
                Role::Sync
            }
            Err(_) => {
                self.foreign = true;
                Role::Foreign
            }
        }
    }

    fn parameter(&mut self, byte: u8) -> Role {
        let Some(drive) = self.drive else {
            // No drive is addressed, so no drive reads a command in it.
            return Role::Command {
                drive: None,
                section: "9.5",
            };
        };
        let begun = self.commands.entry(drive).or_default();
        begun.push(byte);
        let Some(layout) = layout(begun[0], self.read_long) else {
            self.foreign = true;
            return Role::Foreign;
        };
        // A byte that no drive accepts in this place puts it into the error mode: 00 comes back for it (9.7), and no data.
        if let Decoded::Bad {
            reason: CommandError::FixedByte { .. } | CommandError::UnknownOutput(_),
            ..
        } = Command::decode(begun)
        {
            self.foreign = true;
            return Role::Foreign;
        }
        let place = begun.len() - 1;
        let addressed = drive;
        let drive = Some(drive);
        let role = match place.checked_sub(1).and_then(|i| layout.answer.get(i)) {
            None | Some(Reply::Echo) => Role::Command {
                drive,
                section: layout.section,
            },
            Some(Reply::Data(n)) => Role::Data {
                drive,
                address: address(layout, begun).wrapping_add(u16::from(*n)),
            },
            Some(Reply::Check) => Role::Check {
                drive,
                length: u8::try_from(layout.length()).unwrap_or(u8::MAX),
                writes: writes(layout, begun),
            },
        };
        if begun.len() == layout.length() {
            self.commands.remove(&addressed);
        }
        role
    }
}

/// The address in a begun command, as far as it is known; page FF where only its low byte stands in it (10.3).
fn address(layout: &Layout, begun: &[u8]) -> u16 {
    let fields = layout.command.iter().zip(&begun[1..]);
    fields.fold(0xFF00, |address, (field, byte)| match field {
        Field::AddrL | Field::AddrInPage => address & 0xFF00 | u16::from(*byte),
        Field::AddrH => address & 0x00FF | u16::from(*byte) << 8,
        _ => address,
    })
}

fn writes(layout: &Layout, begun: &[u8]) -> Option<(u16, u8)> {
    let width = layout.kind.width();
    (!layout.kind.reads() && width > 0).then(|| (address(layout, begun), width))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8]) -> Vec<Role> {
        let ring = RingSize::new(3).expect("a size");
        let sent: Vec<_> = bytes.iter().map(|byte| (*byte, true)).collect();
        roles(ring, &sent)
    }

    /// ND21 9.7, 10.1: in the place of a '?' that is wrong no data come back.
    #[test]
    fn a_wrong_fixed_byte_has_no_data() {
        let roles = of(&[0x8A, 0xFE, 0xC1, 0x12, 0xFE, 0x3E, 0x00]);
        assert!(matches!(roles[4], Role::Data { .. }), "{roles:?}");
        assert_eq!(roles[5..], [Role::Foreign, Role::Foreign]);
    }

    /// ND21 9.3, 10.1: `88 FE C0 13 FE D1` reads byte FE13 of drive 1 in a ring of three.
    #[test]
    fn a_read() {
        let drive = Some(1);
        let section = "10.1";
        let expected = [
            Role::Sync,
            Role::Address { drive },
            Role::Command { drive, section },
            Role::Command { drive, section },
            Role::Data {
                drive,
                address: 0xFE13,
            },
            Role::Check {
                drive,
                length: 4,
                writes: None,
            },
            Role::Idle,
        ];
        assert_eq!(
            of(&[0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1, 0x80])[..],
            expected
        );
    }

    /// ND21 9.8: everything after an error is foreign until the check sequence.
    #[test]
    fn behind_an_error() {
        let sent = [0, 0xFF, 0x44, 0x72, 0x4C, 0x41].map(|byte| (byte, true));
        let ring = RingSize::new(3).expect("a size");
        assert!(!at_rest(ring, &sent[..1]) && at_rest(ring, &sent));
        let roles = of(&[0, 0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80]);
        assert_eq!(roles[0], Role::Foreign);
        assert_eq!(roles[1..6], [Role::CheckSequence; 5]);
        assert_eq!(roles[6], Role::Idle);
    }
}
