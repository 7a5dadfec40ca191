//! What comes back from a ring, read as far as the guard must know what drives have answered (ND21 9.1 to 9.6).

use super::half::{Half, length};
use crate::line::Received;
use crate::novobus::address::RingSize;
use crate::novobus::checksum::Checksum;
use crate::novobus::sync::{Addressing, SyncByte, TelegramHeader};
use alloc::boxed::Box;

/// Reads answers from the begin of a conversation on, where every drive waits for a sync byte and nothing is on its way. Behind anything
/// that it does not understand it reads none before the next conversation: with bytes chosen for it, it could be brought to read telegrams
/// from their middle on, and take a byte for an answer that is none.
#[derive(Clone, Debug)]
pub(super) struct Listener {
    stage: ListenerStage,
    /// The last address byte, counted up by "next" (9.2).
    kept: Option<u8>,
    /// Answers received in part, by the address byte that means their drive.
    halves: Box<[Half; 256]>,
}

/// What the next byte is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ListenerStage {
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
    /// One that reads nothing yet.
    pub(super) fn new() -> Self {
        Self {
            stage: ListenerStage::Lost,
            kept: None,
            halves: Box::new([Half::default(); 256]),
        }
    }

    /// Every drive waits for a sync byte, and nothing is on its way; `kept` is what a short address goes on from.
    pub(super) fn start(&mut self, kept: Option<u8>) {
        *self = Self {
            stage: ListenerStage::Sync,
            kept,
            ..Self::new()
        };
    }

    /// Nothing is read before the next conversation.
    pub(super) fn lose(&mut self) {
        self.stage = ListenerStage::Lost;
    }

    /// Takes a byte. Returns the answer that it completes, without its checking byte, and the address byte that was sent to its drive.
    pub(super) fn hear(&mut self, received: Received, ring: RingSize) -> Option<(u8, Half)> {
        match self.read(received, ring) {
            Ok((stage, answer)) => {
                self.stage = stage;
                answer
            }
            Err(NotUnderstood) => {
                self.lose();
                None
            }
        }
    }

    fn read(&mut self, received: Received, ring: RingSize) -> Result<Read, NotUnderstood> {
        let Received { byte, error: None } = received else {
            return Err(NotUnderstood);
        };
        Ok(match self.stage {
            ListenerStage::Lost => (ListenerStage::Lost, None),
            ListenerStage::Sync => (self.sync_byte(byte)?, None),
            ListenerStage::Address(header) => {
                let address = byte.wrapping_sub(ring.drives());
                (self.addressed(header, address), None)
            }
            ListenerStage::Net {
                address,
                left,
                process,
            } => {
                let answer = match process {
                    // What no drive answers comes back as it was sent (8.4, 9.3).
                    0 if address >= ring.lowest_address() => self.parameter(address, byte)?,
                    _ => None,
                };
                let next = match left {
                    1 => ListenerStage::Sync,
                    _ => ListenerStage::Net {
                        address,
                        left: left - 1,
                        process: process.saturating_sub(1),
                    },
                };
                (next, answer)
            }
        })
    }

    /// ND21 9.2.
    fn sync_byte(&mut self, byte: u8) -> Result<ListenerStage, NotUnderstood> {
        let Ok(read) = SyncByte::decode(byte) else {
            return Err(NotUnderstood);
        };
        let SyncByte::Telegram(header) = read else {
            return Ok(ListenerStage::Sync);
        };
        let address = match (header.addressing(), self.kept) {
            (Addressing::AddressFollows, _) => return Ok(ListenerStage::Address(header)),
            (Addressing::SameDrive, Some(kept)) => kept,
            (Addressing::NextDrive, Some(kept)) => kept.wrapping_add(1),
            (_, None) if header.net_length() == 0 => return Ok(ListenerStage::Sync),
            (_, None) => return Err(NotUnderstood),
        };
        Ok(self.addressed(header, address))
    }

    /// The telegram of this drive.
    fn addressed(&mut self, header: TelegramHeader, address: u8) -> ListenerStage {
        self.kept = Some(address);
        match header.net_length() {
            0 => ListenerStage::Sync,
            left => ListenerStage::Net {
                address,
                left,
                process: if header.process_data() { 2 } else { 0 },
            },
        }
    }

    /// ND21 9.5, 9.6, chapter 10: an answer begins with the command byte and is as long as its command.
    fn parameter(&mut self, address: u8, byte: u8) -> Result<Option<(u8, Half)>, NotUnderstood> {
        let half = self.halves[usize::from(address)];
        let sent = half.sent();
        let code = sent.first().copied().unwrap_or(byte);
        let length = length(code).ok_or(NotUnderstood)?;
        if sent.len() < length {
            self.halves[usize::from(address)] = half.with(byte);
            return Ok(None);
        }
        self.halves[usize::from(address)] = Half::default();
        // A ReadLong may have no checking byte (10.1).
        match code == 0xC7 || Checksum::over(sent).minus() == byte {
            true => Ok(Some((address, half))),
            false => Err(NotUnderstood),
        }
    }
}

/// What comes next, and an answer that is complete.
type Read = (ListenerStage, Option<(u8, Half)>);

/// A byte that does not come where every drive does as it should.
struct NotUnderstood;
