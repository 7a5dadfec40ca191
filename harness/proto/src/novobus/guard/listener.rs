//! What comes back from a ring, read as far as the guard must know what drives have answered (ND21 9.1 to 9.8).

use super::FIRST_ADDRESS;
use super::half::{Half, length};
use crate::line::Received;
use crate::novobus::address::RingSize;
use crate::novobus::check_sequence::{SequenceProgress, SequenceWatch};
use crate::novobus::checksum::Checksum;
use crate::novobus::sync::{Addressing, SyncByte, TelegramHeader};
use alloc::boxed::Box;

/// Reads answers. Behind anything that it does not understand it reads none before a check sequence, so that no byte is taken for an
/// answer that is none.
#[derive(Clone, Debug)]
pub(super) struct Listener {
    stage: Stage,
    /// The last address byte, counted up by "next" (9.2).
    kept: Option<u8>,
    /// Answers received in part, by the address byte that means their drive.
    halves: Box<[Half; 256]>,
    sequence: SequenceWatch,
    /// Check sequences that were sent, behind which drives wait for a sync byte, and have not come round.
    awaited: u32,
}

/// What the next byte is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Lost,
    Sync,
    Address(TelegramHeader),
    /// A net byte: how many are left, and how many of these are process data.
    Net {
        address: u8,
        left: u8,
        process: u8,
    },
}

impl Listener {
    /// One that waits for a check sequence.
    pub(super) fn new() -> Self {
        Self {
            stage: Stage::Lost,
            kept: None,
            halves: Box::new([Half::default(); 256]),
            sequence: SequenceWatch::default(),
            awaited: 0,
        }
    }

    /// Every drive waits for a sync byte, and nothing is on its way.
    pub(super) fn start(&mut self) {
        *self = Self {
            stage: Stage::Sync,
            ..Self::new()
        };
    }

    /// Bytes may be missing.
    pub(super) fn lose(&mut self) {
        self.stage = Stage::Lost;
        self.sequence = SequenceWatch::default();
    }

    /// A check sequence was sent.
    pub(super) fn recovered(&mut self) {
        self.lose();
        self.awaited = self.awaited.saturating_add(1);
    }

    /// Takes a byte. Returns the answer that it completes, without its checking byte, and the address byte that was sent to its drive.
    pub(super) fn hear(&mut self, received: Received, ring: RingSize) -> Option<(u8, Half)> {
        let Received { byte, error } = received;
        if self.stage == Stage::Lost {
            self.seek(byte, error.is_none());
            return None;
        }
        if error.is_some() {
            self.lose();
            return None;
        }
        let stage = self.stage;
        let (next, answer) = match stage {
            Stage::Lost => (Some(Stage::Lost), None),
            Stage::Sync => (self.sync_byte(byte), None),
            Stage::Address(header) => {
                let address = byte.wrapping_sub(ring.drives());
                (Some(self.addressed(header, address)), None)
            }
            Stage::Net {
                address,
                left,
                process,
            } => {
                let answer = match process {
                    0 if address >= FIRST_ADDRESS => self.parameter(address, byte),
                    _ => Ok(None),
                };
                let next = match left {
                    1 => Stage::Sync,
                    _ => Stage::Net {
                        address,
                        left: left - 1,
                        process: process.saturating_sub(1),
                    },
                };
                (answer.is_ok().then_some(next), answer.ok().flatten())
            }
        };
        match next {
            Some(next) => self.stage = next,
            None => self.lose(),
        }
        answer
    }

    /// Waits for the last of the check sequences that were sent.
    fn seek(&mut self, byte: u8, good: bool) {
        if self.sequence.see(byte, good) == SequenceProgress::Complete && self.awaited > 0 {
            self.awaited -= 1;
            if self.awaited == 0 {
                self.start();
            }
        }
    }

    /// ND21 9.2. `None`: no drive sends that, if all are as they should be.
    fn sync_byte(&mut self, byte: u8) -> Option<Stage> {
        let SyncByte::Telegram(header) = SyncByte::decode(byte).ok()? else {
            return Some(Stage::Sync);
        };
        let address = match (header.addressing(), self.kept) {
            (Addressing::AddressFollows, _) => return Some(Stage::Address(header)),
            (Addressing::SameDrive, Some(kept)) => kept,
            (Addressing::NextDrive, Some(kept)) => kept.wrapping_add(1),
            (_, None) if header.net_length() == 0 => return Some(Stage::Sync),
            (_, None) => return None,
        };
        Some(self.addressed(header, address))
    }

    /// The telegram of this drive.
    fn addressed(&mut self, header: TelegramHeader, address: u8) -> Stage {
        self.kept = Some(address);
        match header.net_length() {
            0 => Stage::Sync,
            left => Stage::Net {
                address,
                left,
                process: if header.process_data() { 2 } else { 0 },
            },
        }
    }

    /// ND21 9.5, 9.6, chapter 10: an answer begins with the command byte and is as long as its command.
    fn parameter(&mut self, address: u8, byte: u8) -> Result<Option<(u8, Half)>, NoAnswer> {
        let half = self.halves[usize::from(address)];
        let sent = half.sent();
        let code = sent.first().copied().unwrap_or(byte);
        let length = length(code).ok_or(NoAnswer)?;
        if sent.len() < length {
            self.halves[usize::from(address)] = half.with(byte);
            return Ok(None);
        }
        self.halves[usize::from(address)] = Half::default();
        match code {
            // It may have no checking byte (10.1), and nothing is learnt from it.
            0xC7 => Ok(None),
            _ if Checksum::over(sent).minus() == byte => Ok(Some((address, half))),
            _ => Err(NoAnswer),
        }
    }
}

/// A byte that is no part of an answer.
struct NoAnswer;
