//! What the bytes on one link of a ring are, as the receiver of that link reads them (ND21 9.1 to 9.8, 10).
//!
//! An `Observer` sees only the bytes of its own link, as a tap does. Its place in the ring follows from the drives at the ends of the
//! link: each drive adds 1 to an address byte (9.3), so behind drive K the byte is `drive - K`. Behind the addressed drive, a command has
//! become its answer (9.5).

use harness_proto::line::LineError;
use harness_proto::novobus::check_sequence::{SequenceProgress, SequenceWatch};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Layout, PAGE, Reply, layout};
use harness_proto::novobus::error_mode::UPSTREAM_ZEROS;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, SyncByte};
use std::collections::BTreeMap;

/// What a byte is on its link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteRole {
    /// SYNCO (9.2).
    Synco,
    /// PAUSE (9.2).
    Pause,
    /// A sync byte (9.2).
    Sync,
    /// An address byte (9.3).
    Address,
    /// A byte of the process data (9.4).
    ProcessData,
    /// The first byte of a command or of its answer (9.5).
    Command,
    /// A byte between: of the cell's address, data to be written, a fixed byte.
    Parameter,
    /// A byte of a cell, in an answer (10.1).
    Data,
    /// A checking byte (9.6).
    Check,
    /// A net byte without a known meaning: no address was seen, or no command starts with this byte.
    Net,
    /// A zero of the error mode (9.7).
    ErrorZero,
    /// The number that a ring in the error mode spells out (9.7).
    ErrorAddress,
    /// A byte of the check sequence (9.8).
    CheckSequence,
    /// Anything else that the receiver takes for no telegram (9.7).
    Foreign,
    /// Nothing arrived.
    Lost,
}

impl ByteRole {
    /// The word that tables and dissectors use.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Synco => "synco",
            Self::Pause => "pause",
            Self::Sync => "sync",
            Self::Address => "address",
            Self::ProcessData => "process-data",
            Self::Command => "command",
            Self::Parameter => "parameter",
            Self::Data => "data",
            Self::Check => "check",
            Self::Net => "net",
            Self::ErrorZero => "error-zero",
            Self::ErrorAddress => "error-address",
            Self::CheckSequence => "check-sequence",
            Self::Foreign => "foreign",
            Self::Lost => "lost",
        }
    }
}

/// What one byte is, and of which conversation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Meaning {
    pub role: ByteRole,
    /// The number that the telegram means, whether the ring has such a drive or not.
    pub drive: Option<u8>,
    /// Whether the drive that is meant has been passed: a command has become its answer.
    pub answer: bool,
    /// The command, where one is known.
    pub command: Option<&'static Layout>,
    /// The cell that a command accesses, once its whole address has been on this link.
    pub cell: Option<u16>,
    /// For a checking byte, whether it fits (9.6).
    pub fits: Option<bool>,
}

impl Meaning {
    const fn of(role: ByteRole) -> Self {
        Self {
            role,
            drive: None,
            answer: false,
            command: None,
            cell: None,
            fits: None,
        }
    }

    /// The document and section of the rule, such as `ND21 9.2`.
    #[must_use]
    pub(crate) fn citation(&self) -> String {
        format!("ND21 {}", self.section())
    }

    /// The section of the ND21 manual with the rule.
    #[must_use]
    pub(crate) fn section(&self) -> &'static str {
        match self.role {
            ByteRole::Synco | ByteRole::Pause | ByteRole::Sync => "9.2",
            ByteRole::Address => "9.3",
            ByteRole::ProcessData => "9.4",
            ByteRole::Command | ByteRole::Parameter | ByteRole::Data => {
                self.command.map_or("9.5", |layout| layout.section)
            }
            ByteRole::Net => "9.5",
            ByteRole::Check => "9.6",
            ByteRole::ErrorZero | ByteRole::ErrorAddress | ByteRole::Foreign | ByteRole::Lost => {
                "9.7"
            }
            ByteRole::CheckSequence => "9.8",
        }
    }

    /// What the byte is, in a few words; the same bytes give the same words.
    #[must_use]
    pub(crate) fn words(&self, byte: Option<u8>) -> String {
        let to = self
            .drive
            .map_or_else(String::new, |drive| format!(" for drive {drive}"));
        let name = self.command.map_or("a command", |known| known.printed_name);
        let side = if self.answer { "answer to" } else { "" };
        let cell = self
            .cell
            .map_or_else(String::new, |cell| format!(" of {cell:04X}"));
        let text = match self.role {
            ByteRole::Synco => "SYNCO".to_owned(),
            ByteRole::Pause => "PAUSE".to_owned(),
            ByteRole::Sync => byte.map_or_else(String::new, sync_words),
            ByteRole::Address => format!("address byte{to}"),
            ByteRole::ProcessData if self.answer => {
                format!("process data from{}", &to[to.len().min(4)..])
            }
            ByteRole::ProcessData => format!("process data{to}"),
            ByteRole::Command => format!("{side} {name}{to}"),
            ByteRole::Parameter => format!("{side} {name}{cell}{to}: parameter"),
            ByteRole::Data => format!("{side} {name}{cell}{to}: data"),
            ByteRole::Check => {
                let fits = if self.fits == Some(false) {
                    " that does not fit"
                } else {
                    ""
                };
                format!("{side} {name}{cell}{to}: checking byte{fits}")
            }
            ByteRole::Net => format!("net byte{to}"),
            ByteRole::ErrorZero => "zero of the error mode".to_owned(),
            ByteRole::ErrorAddress => "number spelled out in the error mode".to_owned(),
            ByteRole::CheckSequence => "check sequence".to_owned(),
            ByteRole::Foreign => "no telegram: the receiver is in the error mode".to_owned(),
            ByteRole::Lost => "nothing arrived".to_owned(),
        };
        text.trim_start().to_owned()
    }
}

fn sync_words(byte: u8) -> String {
    let Ok(SyncByte::Telegram(header)) = SyncByte::decode(byte) else {
        return "sync byte".to_owned();
    };
    let whom = match header.addressing() {
        Addressing::AddressFollows => "address follows",
        Addressing::SameDrive => "same drive",
        Addressing::NextDrive => "next drive",
    };
    let data = if header.process_data() {
        ", process data"
    } else {
        ""
    };
    format!("sync byte: {whom}, {} net bytes{data}", header.net_length())
}

/// A command that has begun.
#[derive(Clone, Debug)]
struct OpenCommand {
    layout: &'static Layout,
    bytes: Vec<u8>,
}

/// Reads the bytes of one link.
#[derive(Clone, Debug)]
pub(crate) struct Observer {
    /// What an address byte on this link falls short of the drive's number.
    behind: u8,
    from: Option<u8>,
    to: Option<u8>,
    target: Option<u8>,
    address_next: bool,
    net: u8,
    process_data: u8,
    begun: BTreeMap<u8, OpenCommand>,
    /// The receiver takes nothing for a telegram any more.
    foreign: bool,
    /// Good zeros in a row, from the offending byte on (9.7).
    zeros: u8,
    /// Whether the receiver looks for a check sequence.
    upstream: bool,
    /// Whether there were zeros enough for a number to follow: seven where a ring is broken (9.9).
    spelling: bool,
    watch: SequenceWatch,
}

impl Observer {
    /// For a link between two ends; `None` is the master.
    #[must_use]
    pub(crate) fn new(from: Option<u8>, to: Option<u8>) -> Self {
        Self {
            behind: from.unwrap_or_else(|| to.unwrap_or(0).wrapping_add(1)),
            from,
            to,
            target: None,
            address_next: false,
            net: 0,
            process_data: 0,
            begun: BTreeMap::new(),
            foreign: false,
            zeros: 0,
            upstream: to.is_none(),
            spelling: false,
            watch: SequenceWatch::default(),
        }
    }

    /// Whether a telegram has begun and is not complete.
    #[must_use]
    pub(crate) const fn in_telegram(&self) -> bool {
        !self.foreign && (self.address_next || self.net > 0)
    }

    /// Takes the next byte of the link, and what its receiver noticed.
    pub(crate) fn see(&mut self, received: Option<u8>, error: Option<LineError>) -> Meaning {
        let Some(byte) = received else {
            return Meaning::of(ByteRole::Lost);
        };
        let good = error.is_none();
        if !self.foreign {
            if good && let Some(meaning) = self.telegram(byte) {
                return meaning;
            }
            self.foreign = true;
        }
        self.error_mode(byte, good)
    }

    /// A byte that the receiver hears in the error mode: eight zeros show that the drive before is in it too, and only
    /// then the check sequence ends it (9.7, 9.8). The master needs no zeros.
    fn error_mode(&mut self, byte: u8, good: bool) -> Meaning {
        self.zeros = if good && byte == 0 {
            self.zeros.saturating_add(1)
        } else {
            0
        };
        self.upstream |= self.zeros >= UPSTREAM_ZEROS;
        self.spelling |= self.zeros >= UPSTREAM_ZEROS - 1;
        if self.upstream {
            match self.watch.see(byte, good) {
                SequenceProgress::None => {}
                SequenceProgress::Complete => {
                    *self = Self::new(self.from, self.to);
                    return Meaning::of(ByteRole::CheckSequence);
                }
                SequenceProgress::Started | SequenceProgress::Continued => {
                    return Meaning::of(ByteRole::CheckSequence);
                }
            }
        }
        Meaning::of(match byte {
            _ if !good => ByteRole::Foreign,
            0 => ByteRole::ErrorZero,
            _ if self.spelling && self.from.is_some() => ByteRole::ErrorAddress,
            _ => ByteRole::Foreign,
        })
    }

    /// A good byte in normal mode; `None` where the receiver goes into the error mode for it.
    fn telegram(&mut self, byte: u8) -> Option<Meaning> {
        if self.address_next {
            self.address_next = false;
            self.target = Some(byte.wrapping_add(self.behind));
            return Some(self.with_target(ByteRole::Address));
        }
        if self.net > 0 {
            self.net -= 1;
            if self.process_data > 0 {
                self.process_data -= 1;
                return Some(self.with_target(ByteRole::ProcessData));
            }
            return self.parameter(byte);
        }
        match SyncByte::decode(byte).ok()? {
            SyncByte::Synco => Some(Meaning::of(ByteRole::Synco)),
            SyncByte::Pause => Some(Meaning::of(ByteRole::Pause)),
            SyncByte::Telegram(header) => {
                self.net = header.net_length();
                self.process_data = if header.process_data() { 2 } else { 0 };
                match header.addressing() {
                    Addressing::AddressFollows => {
                        self.address_next = true;
                        return Some(Meaning::of(ByteRole::Sync));
                    }
                    Addressing::SameDrive => {}
                    Addressing::NextDrive => {
                        self.target = self.target.map(|target| target.wrapping_add(1));
                    }
                }
                Some(self.with_target(ByteRole::Sync))
            }
        }
    }

    fn with_target(&self, role: ByteRole) -> Meaning {
        Meaning {
            drive: self.target,
            answer: self.answered(),
            ..Meaning::of(role)
        }
    }

    /// Whether the addressed drive is in front of this link.
    fn answered(&self) -> bool {
        matches!((self.from, self.target), (Some(from), Some(target)) if from <= target)
    }

    /// Whether the receiver is the drive that is meant: only it looks at commands (9.3).
    fn looked_at(&self) -> bool {
        self.to.is_some() && self.to == self.target
    }

    fn parameter(&mut self, byte: u8) -> Option<Meaning> {
        let Some(target) = self.target else {
            return Some(Meaning::of(ByteRole::Net));
        };
        let looked_at = self.looked_at();
        let mut meaning = self.with_target(ByteRole::Net);
        let Some(begun) = self.begun.get_mut(&target) else {
            let Some(layout) = layout(byte, ReadLongAnswer::default()) else {
                return (!looked_at).then_some(meaning);
            };
            let bytes = vec![byte];
            self.begun.insert(target, OpenCommand { layout, bytes });
            meaning.role = ByteRole::Command;
            meaning.command = Some(layout);
            return Some(meaning);
        };
        let layout = begun.layout;
        let place = begun.bytes.len() - 1;
        let before = Checksum::over(&begun.bytes);
        begun.bytes.push(byte);
        meaning.command = Some(layout);
        meaning.cell = cell(layout, &begun.bytes, meaning.answer);
        let (role, fits) = if meaning.answer {
            match layout.answer[place] {
                Reply::Echo => (ByteRole::Parameter, None),
                Reply::Data(_) => (ByteRole::Data, None),
                Reply::Check => (ByteRole::Check, Some(before.minus() == byte)),
            }
        } else {
            match layout.command[place] {
                Field::Check => (ByteRole::Check, Some(before.plus() == byte)),
                Field::Fixed(due) if due != byte && looked_at => return None,
                _ => (ByteRole::Parameter, None),
            }
        };
        if begun.bytes.len() == layout.length() {
            self.begun.remove(&target);
        }
        (meaning.role, meaning.fits) = (role, fits);
        // The drive that is meant refuses a wrong checking byte (9.7).
        (!(looked_at && fits == Some(false))).then_some(meaning)
    }
}

/// The address in a begun command, once it is whole. Answers to reads hold its low byte only.
fn cell(layout: &Layout, begun: &[u8], answer: bool) -> Option<u16> {
    let mut low = None;
    let mut high = None;
    for (place, byte) in begun[1..].iter().enumerate() {
        if answer && layout.answer[place] != Reply::Echo {
            continue;
        }
        match layout.command[place] {
            Field::AddrL => low = Some(u16::from(*byte)),
            Field::AddrInPage => (low, high) = (Some(u16::from(*byte)), Some(PAGE)),
            Field::AddrH => high = Some(u16::from(*byte) << 8),
            Field::Data(_) | Field::Code | Field::Fixed(_) | Field::Check => {}
        }
    }
    Some(low? | high?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(from: Option<u8>, to: Option<u8>, bytes: &[u8]) -> Vec<&'static str> {
        let mut observer = Observer::new(from, to);
        let seen = bytes.iter().map(|byte| observer.see(Some(*byte), None));
        seen.map(|meaning| meaning.role.name()).collect()
    }

    /// ND21 9.3, 10.1: a read of drive 1 in a ring of three, in front of it and behind it.
    #[test]
    fn a_read_on_both_sides() {
        let front = [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1, 0x80];
        let command = [
            "sync",
            "address",
            "command",
            "parameter",
            "parameter",
            "check",
            "synco",
        ];
        assert_eq!(names(None, Some(2), &front), command);
        let behind = [0x88, 0x01, 0xC0, 0x13, 0x88, 0xA5, 0x80];
        let answer = [
            "sync",
            "address",
            "command",
            "parameter",
            "data",
            "check",
            "synco",
        ];
        assert_eq!(names(Some(0), None, &behind), answer);
        let mut observer = Observer::new(Some(0), None);
        let last: Vec<_> = behind.map(|b| observer.see(Some(b), None)).into();
        assert_eq!((last[5].fits, last[5].drive), (Some(true), Some(1)));
    }

    /// ND21 9.7, 9.8: zeros, the number, the check sequence; eight zeros are needed, but not by the master.
    #[test]
    fn the_error_mode() {
        let mut bytes = vec![0; 9];
        bytes.extend([2, 2, 0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80]);
        let seen = names(Some(1), Some(0), &bytes);
        assert_eq!(seen[..9], ["error-zero"; 9]);
        assert_eq!(seen[9..11], ["error-address"; 2]);
        assert_eq!(seen[11..16], ["check-sequence"; 5]);
        assert_eq!(seen[16], "synco");
        let short = [0, 0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80];
        assert_eq!(names(Some(1), Some(0), &short)[1..], ["foreign"; 6]);
        assert_eq!(names(Some(0), None, &short)[6], "synco");
    }

    /// ND21 9.7: only the drive that is meant looks at a command.
    #[test]
    fn an_unknown_command() {
        let bytes = [0x84, 0xFE, 0x12, 0x34, 0x80];
        assert_eq!(names(None, Some(2), &bytes)[4], "synco");
        let bytes = [0x84, 0xFF, 0x12, 0x34, 0x80];
        assert_eq!(names(Some(2), Some(1), &bytes)[2..], ["foreign"; 3]);
    }
}
