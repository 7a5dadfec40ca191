//! From jobs and process data to telegrams (ND21 9.1-9.5): short addresses where they are valid, several
//! commands in one telegram, commands cut over several.

use super::super::address::RingSize;
use super::super::command::Kind;
use super::super::sync::{Addressing, MAX_NET_LENGTH, SYNCO, SyncByte, TelegramHeader};
use super::Master;
use super::in_flight::{BytePlace, ComposedByte, JobSlot, Owner};
use crate::time::Instant;

/// Sync byte, address byte and the net bytes.
const MOST_BYTES: usize = 2 + MAX_NET_LENGTH as usize;
/// Parameter bytes beside process data (ND21 9.1).
const ROOM: usize = MAX_NET_LENGTH as usize - 2;

/// A telegram on its way out.
#[derive(Clone, Debug)]
pub(super) struct Outgoing {
    bytes: [ComposedByte; MOST_BYTES],
    length: u8,
    next: u8,
}

impl Default for Outgoing {
    fn default() -> Self {
        Self {
            bytes: [ComposedByte::SYNCO; MOST_BYTES],
            length: 0,
            next: 0,
        }
    }
}

impl Outgoing {
    pub(super) fn is_empty(&self) -> bool {
        self.next == self.length
    }

    #[inline]
    pub(super) fn next(&mut self) -> Option<ComposedByte> {
        if self.is_empty() {
            return None;
        }
        let composed = self.bytes[usize::from(self.next)];
        self.next += 1;
        Some(composed)
    }

    pub(super) fn clear(&mut self) {
        self.length = 0;
        self.next = 0;
    }

    fn push(&mut self, byte: u8, back: Option<u8>, place: BytePlace, owner: Owner) {
        if let Some(free) = self.bytes.get_mut(usize::from(self.length)) {
            *free = ComposedByte {
                byte,
                back,
                place,
                owner,
            };
            self.length += 1;
        }
    }
}

/// From which of the two orders a telegram takes its commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// All jobs as they came: only as long as the next one is for the same drive.
    All,
    /// The jobs of the drive.
    Drive,
}

impl Master {
    /// Composes the next telegram, if there is anything to say.
    pub(super) fn compose(&mut self, now: Instant) {
        if self.unconfirmed.must_ask() {
            self.compose_count();
            return;
        }
        let jobs = self.store.first().is_some();
        let exchange = self.cycle.inside_round()
            || self.cycle.is_due(now) && !(self.jobs_turn && jobs && !self.is_woven());
        if exchange {
            if let Some(drive) = self.cycle.compose(now) {
                self.compose_exchange(drive);
                self.jobs_turn = !self.cycle.inside_round();
            }
        } else if jobs {
            self.jobs_turn = false;
            self.compose_jobs();
        }
    }

    /// Whether the first job is one for which the process data leave room.
    fn is_woven(&self) -> bool {
        let first = self.store.first().and_then(|slot| self.store.get(slot));
        first.is_some_and(|job| {
            self.cycle.includes(job.drive) && (self.options.packing.cut || job.left() <= ROOM)
        })
    }

    /// The telegram that counts the drives: with the address byte 00 no drive is meant, and the sum comes
    /// back as their number (ND21 9.3). It leaves no drive to which a short address could go.
    pub(super) fn compose_count(&mut self) {
        let Ok(header) = TelegramHeader::new(Addressing::AddressFollows, false, 1) else {
            return;
        };
        let sync = SyncByte::Telegram(header).encode();
        let drives = self.ring.drives();
        self.last_addressed = None;
        self.outgoing.clear();
        for (byte, back, place) in [
            (sync, sync, BytePlace::Sync),
            (0, drives, BytePlace::Address),
            (SYNCO, SYNCO, BytePlace::Last),
        ] {
            self.outgoing.push(byte, Some(back), place, Owner::Count);
        }
    }

    /// A telegram with process data for `drive`, and with as much of its commands as there is room for.
    fn compose_exchange(&mut self, drive: u8) {
        let owner = Owner::Exchange(drive);
        let (length, reset) = self.plan(drive, Order::Drive, ROOM);
        self.begin(drive, true, 2 + length, owner);
        let [high, low] = self.cycle.nominal(drive).to_be_bytes();
        self.outgoing
            .push(high, None, BytePlace::ProcessHigh, owner);
        self.outgoing.push(low, None, BytePlace::ProcessLow, owner);
        self.take_commands(drive, Order::Drive, length);
        if reset {
            self.last_addressed = None;
        }
    }

    /// A telegram with the first job, and with those behind it that are for the same drive.
    fn compose_jobs(&mut self) {
        let Some((slot, drive)) = self.store.first().and_then(|slot| {
            let entry = self.store.get(slot)?;
            Some((slot, entry.drive))
        }) else {
            return;
        };
        let (length, reset) = self.plan(drive, Order::All, usize::from(MAX_NET_LENGTH));
        self.begin(drive, false, length, Owner::Job(slot));
        self.take_commands(drive, Order::All, length);
        if reset {
            self.last_addressed = None;
        }
    }

    /// Sync byte and, where it is needed, address byte.
    fn begin(&mut self, drive: u8, process_data: bool, net_length: usize, owner: Owner) {
        let addressing = self.addressing(drive);
        let length = u8::try_from(net_length).unwrap_or(MAX_NET_LENGTH);
        self.outgoing.clear();
        let Ok(header) = TelegramHeader::new(addressing, process_data, length) else {
            return;
        };
        let sync = SyncByte::Telegram(header).encode();
        self.outgoing.push(sync, Some(sync), BytePlace::Sync, owner);
        if addressing == Addressing::AddressFollows {
            let byte = address_byte(self.ring, drive);
            self.outgoing
                .push(byte, Some(drive), BytePlace::Address, owner);
        }
        self.last_addressed = Some(drive);
    }

    /// The shortest form of the address that is valid and allowed (ND21 9.2).
    fn addressing(&self, drive: u8) -> Addressing {
        let packing = self.options.packing;
        match self.last_addressed {
            Some(last) if packing.same && last == drive => Addressing::SameDrive,
            Some(last) if packing.next && last.checked_add(1) == Some(drive) => {
                Addressing::NextDrive
            }
            _ => Addressing::AddressFollows,
        }
    }

    /// The job with the next byte for `drive`.
    fn candidate(&self, drive: u8, order: Order) -> Option<JobSlot> {
        let slot = match order {
            Order::All => self.store.first()?,
            Order::Drive => self.store.first_of(drive)?,
        };
        (self.store.get(slot)?.drive == drive).then_some(slot)
    }

    /// How many parameter bytes the telegram takes, and whether the last of them resets the drive. With a
    /// reset the telegram must end: the drive waits for a sync byte after it (ND21 10.5).
    fn plan(&self, drive: u8, order: Order, room: usize) -> (usize, bool) {
        let packing = self.options.packing;
        let mut taken = 0;
        let mut next = self.candidate(drive, order);
        while let Some(entry) = next.and_then(|slot| self.store.get(slot)) {
            let left = entry.left();
            if entry.drive != drive || taken > 0 && !packing.share || taken == room {
                break;
            }
            if left > room - taken {
                return (if packing.cut { room } else { taken }, false);
            }
            taken += left;
            if entry.kind == Kind::ResetH8 {
                return (taken, true);
            }
            next = match order {
                Order::All => entry.behind(),
                Order::Drive => entry.behind_in_drive(),
            };
        }
        (taken, false)
    }

    /// Puts `length` bytes of commands into the telegram.
    fn take_commands(&mut self, drive: u8, order: Order, length: usize) {
        for _ in 0..length {
            let Some(slot) = self.candidate(drive, order) else {
                return;
            };
            let Some(entry) = self.store.get_mut(slot) else {
                return;
            };
            if let Some((byte, back)) = entry.compose() {
                let done = entry.left() == 0;
                self.outgoing
                    .push(byte, back, BytePlace::Parameter, Owner::Job(slot));
                if done {
                    self.store.unlink(slot);
                }
            }
        }
    }
}

/// The address byte of a drive that is in the ring (ND21 9.3).
fn address_byte(ring: RingSize, drive: u8) -> u8 {
    ring.address_byte(drive).unwrap_or_default()
}
