//! What each byte is that a master sends (ND21 9.1-9.6), byte by byte as it goes out.

use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Layout, Reply, layout};
use harness_proto::novobus::master::Phase;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, SyncByte};
use std::collections::BTreeMap;

/// What a byte is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// SYNCO or PAUSE (9.2).
    Idle,
    /// The sync byte of a telegram (9.2).
    Sync(Addressing),
    /// An address byte (9.3).
    Address,
    /// The bytes of the process data (9.4).
    ProcessData,
    /// A command byte (9.5).
    Code,
    /// A byte after the command byte: what it is, and what comes in its place.
    Field(Field, Reply),
    /// This byte of the 22 of the check sequence (9.8), counted from 0.
    Sequence(u8),
    /// The last byte of the telegram that counts the drives (9.3).
    Nobody,
}

/// A byte as the master inside sends it.
#[derive(Clone, Copy, Debug)]
pub(super) struct SentByte {
    pub(super) byte: u8,
    /// What it is for.
    pub(super) what: What,
    /// The drive that is meant, as far as the address is known.
    pub(super) drive: Option<u8>,
    /// The sum of the command before it.
    pub(super) sum: Checksum,
    /// What the master was doing.
    pub(super) phase: Phase,
    /// Whether it belongs to the first telegram since the ring runs again.
    pub(super) after_sequence: bool,
    /// The drive of the telegram before, also of one before the last check sequence.
    pub(super) drive_before: Option<u8>,
}

/// A command begun.
#[derive(Clone, Copy, Debug)]
struct BegunCommand {
    layout: &'static Layout,
    taken: usize,
    sum: Checksum,
}

/// Follows what a master sends.
#[derive(Clone, Debug)]
pub(super) struct Speech {
    drives: u8,
    read_long: ReadLongAnswer,
    net: u8,
    process_data: u8,
    address_next: bool,
    drive: Option<u8>,
    drive_before: Option<u8>,
    begun: BTreeMap<u8, BegunCommand>,
    sequence: u8,
    after_sequence: bool,
}

impl Speech {
    pub(super) fn new(drives: u8, read_long: ReadLongAnswer) -> Self {
        Self {
            drives,
            read_long,
            net: 0,
            process_data: 0,
            address_next: false,
            drive: None,
            drive_before: None,
            begun: BTreeMap::new(),
            sequence: 0,
            after_sequence: false,
        }
    }

    /// A check sequence ends whatever was begun (9.8).
    pub(super) fn reset(&mut self) {
        let before = self.drive.or(self.drive_before);
        *self = Self {
            drive_before: before,
            after_sequence: true,
            ..Self::new(self.drives, self.read_long)
        };
    }

    /// The next byte, sent in this phase.
    pub(super) fn read(&mut self, byte: u8, phase: Phase) -> SentByte {
        let sum = Checksum::EMPTY;
        if phase == Phase::Resetting {
            let what = What::Sequence(self.sequence);
            let place = self.sequence + 1;
            self.reset();
            self.sequence = place;
            return self.spoken(byte, what, sum, phase);
        }
        self.sequence = 0;
        if self.address_next {
            self.address_next = false;
            let drive = byte.wrapping_add(self.drives);
            self.drive = (drive < self.drives).then_some(drive);
            return self.spoken(byte, What::Address, sum, phase);
        }
        if self.net == 0 {
            return self.sync(byte, phase);
        }
        self.net -= 1;
        let spoken = if self.process_data > 0 {
            self.process_data -= 1;
            self.spoken(byte, What::ProcessData, sum, phase)
        } else {
            let (what, sum) = self.parameter(byte);
            self.spoken(byte, what, sum, phase)
        };
        if self.net == 0 {
            self.drive_before = self.drive;
            self.after_sequence = false;
        }
        spoken
    }

    fn sync(&mut self, byte: u8, phase: Phase) -> SentByte {
        let what = match SyncByte::decode(byte) {
            Ok(SyncByte::Telegram(header)) => {
                self.net = header.net_length();
                self.process_data = if header.process_data() { 2 } else { 0 };
                match header.addressing() {
                    Addressing::AddressFollows => {
                        self.address_next = true;
                        self.drive = None;
                    }
                    Addressing::SameDrive => {}
                    Addressing::NextDrive => {
                        self.drive = self.drive.and_then(|drive| drive.checked_add(1));
                    }
                }
                What::Sync(header.addressing())
            }
            _ => What::Idle,
        };
        self.spoken(byte, what, Checksum::EMPTY, phase)
    }

    fn parameter(&mut self, byte: u8) -> (What, Checksum) {
        let Some(drive) = self.drive else {
            return (What::Nobody, Checksum::EMPTY);
        };
        let Some(begun) = self.begun.get_mut(&drive) else {
            if let Some(layout) = layout(byte, self.read_long) {
                let begun = BegunCommand {
                    layout,
                    taken: 0,
                    sum: Checksum::EMPTY.with(byte),
                };
                self.begun.insert(drive, begun);
            }
            return (What::Code, Checksum::EMPTY);
        };
        let sum = begun.sum;
        let pair = begun.layout.command.get(begun.taken);
        let pair = pair.zip(begun.layout.answer.get(begun.taken));
        begun.sum = sum.with(byte);
        begun.taken += 1;
        if begun.taken >= begun.layout.command.len() {
            self.begun.remove(&drive);
        }
        let what = pair.map_or(What::Nobody, |(field, reply)| What::Field(*field, *reply));
        (what, sum)
    }

    fn spoken(&mut self, byte: u8, what: What, sum: Checksum, phase: Phase) -> SentByte {
        SentByte {
            byte,
            what,
            drive: self.drive,
            sum,
            phase,
            after_sequence: self.after_sequence,
            drive_before: self.drive_before,
        }
    }
}
