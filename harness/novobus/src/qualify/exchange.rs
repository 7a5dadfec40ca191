//! Repeats an attempt with the drives' roles exchanged: the address of every telegram is shifted. A single wrong drive is then wrong at
//! other bytes. A fault on the path of all telegrams, or in every drive, shows at the same byte again.

use crate::language::syntax::{FaultStep, Header, LinkEnds, RingStep, Step};
use crate::language::write::Text;
use crate::section::{EEPROM, SentBytes};
use crate::twin::{Conversation, Done};
use harness_bench::link::{HARMLESS, Moment, PlacedFault};
use harness_bench::scenario::pattern::{Expected, Pattern};
use harness_bench::scenario::syntax::{Action, Scenario};
use harness_bench::scenario::times::Duration;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::novobus::sync::{Addressing, SyncByte, TelegramHeader};
use harness_proto::time::{Instant, Span};
use harness_sim::fault::LinkFault;
use std::collections::BTreeMap;
use std::iter;

/// Bytes on a line at most.
const BYTES_A_LINE: usize = 24;

/// Maximum number of bytes of an attempt that is played again.
const MOST_BYTES: usize = 20_000;

/// From this number of bytes on, only the telegrams to the drive in question are played again.
const LONG: usize = 8_000;

/// Orders to the controller of the EEPROM (14.10.5.1), and the cells that no function of the drive uses (14.10.5.3).
const READ_BYTE: u8 = 0x81;
const WRITE_BYTE: u8 = 0x82;
const CUSTOMERS: std::ops::RangeInclusive<u8> = 0x5C..=0x5F;

/// How long the controller of an EEPROM may take for a byte: twice the time of the model.
const EEPROM_TIME: Span = Span::from_millis(20);

/// What the master did in an attempt, in order.
#[derive(Clone, Debug)]
enum Piece {
    Gap(Span),
    Byte,
    /// A fault on the master's own link, at a byte counted from 1 over all bytes sent.
    Fault(u64, LinkFault),
}

/// What the master sent in an attempt, conversation by conversation.
#[derive(Clone, Debug, Default)]
pub(super) struct AttemptBytes {
    pieces: Vec<Piece>,
    /// The bytes, and whether each went round whole.
    pub(super) bytes: Vec<(u8, bool)>,
    pub(super) roles: Vec<Role>,
}

impl AttemptBytes {
    /// What was sent into a ring of `drives` after the reset of the drives, up to the conversation `last`. `None` if it cannot be repeated:
    /// because it went into two rings, or had faults at other places than bytes of the master's own link.
    pub(super) fn of(
        attempt: &[Conversation],
        last: usize,
        drives: u8,
        byte_time: Span,
    ) -> Option<Self> {
        let mut exchange = Self::default();
        for conversation in attempt.get(begin(attempt, drives)..=last)? {
            let before = exchange.bytes.len() as u64;
            exchange.bytes.extend(conversation.sent_in(0));
            let mut free = Instant::START;
            for (ring, done) in &conversation.done {
                match done {
                    _ if *ring != 0 => return None,
                    Done::Sent(at, _) => {
                        exchange.gap(at.since(free));
                        free = *at + byte_time;
                        exchange.pieces.push(Piece::Byte);
                    }
                    Done::Fault(_, PlacedFault::Link(0, fault), Moment::Byte(number))
                        if is_written_as_read(fault) =>
                    {
                        exchange.pieces.push(Piece::Fault(before + number, *fault));
                    }
                    Done::Fault(..) => return None,
                    Done::Step(_) => {}
                }
            }
            exchange.gap(conversation.end.since(free));
        }
        exchange.roles = roles(RingSize::new(u64::from(drives)).ok()?, &exchange.bytes);
        Some(exchange)
    }

    /// The bytes, and what each is for.
    pub(super) fn sent_bytes(&self) -> SentBytes<'_> {
        let Self { bytes, roles, .. } = self;
        SentBytes { bytes, roles }
    }

    fn gap(&mut self, gap: Span) {
        // Shorter gaps come from the computer.
        if gap < Span::from_micros(100) {
            return;
        }
        match self.pieces.last_mut() {
            Some(Piece::Gap(last)) => *last = *last + gap,
            _ => self.pieces.push(Piece::Gap(gap)),
        }
    }

    /// Whether the master was silent in front of a byte for longer than a computer makes it by chance (ND21 9.9).
    pub(super) fn is_behind_a_silence(&self, index: usize) -> bool {
        let mut bytes = (0..self.pieces.len()).filter(|place| self.pieces[*place].is_byte());
        let before = bytes.nth(index).and_then(|place| place.checked_sub(1));
        matches!(before.map(|place| &self.pieces[place]), Some(Piece::Gap(gap)) if *gap > HARMLESS)
    }

    /// Removes the telegrams to other drives if it is long. Also returns how many of the first `count` bytes are left. The behaviour of a
    /// drive depends on its own telegrams and on bytes that pass all drives.
    pub(super) fn shortened(self, count: usize, drive: u8) -> (Self, usize) {
        let faults = self
            .pieces
            .iter()
            .any(|piece| matches!(piece, Piece::Fault(..)));
        let kept = match count > LONG && !faults {
            true => self.kept(drive),
            false => None,
        };
        let Some(kept) = kept else {
            return (self, count);
        };
        let mut exchange = Self::default();
        let mut index = 0;
        for piece in self.pieces {
            match piece {
                Piece::Byte => {
                    if kept[index] {
                        exchange.pieces.push(Piece::Byte);
                        exchange.bytes.push(self.bytes[index]);
                        exchange.roles.push(self.roles[index]);
                    }
                    index += 1;
                }
                // The gap behind a telegram belongs to it.
                Piece::Gap(gap) if index == 0 || kept[index - 1] => exchange.gap(gap),
                Piece::Gap(_) | Piece::Fault(..) => {}
            }
        }
        let count = kept[..count].iter().filter(|kept| **kept).count();
        (exchange, count)
    }

    /// Which bytes are no part of a telegram to another drive; `None` where a telegram has a short address.
    fn kept(&self, drive: u8) -> Option<Vec<bool>> {
        let mut kept = vec![true; self.bytes.len()];
        for (start, _) in self
            .roles
            .iter()
            .enumerate()
            .filter(|(_, role)| **role == Role::Sync)
        {
            let Ok(SyncByte::Telegram(header)) = SyncByte::decode(self.bytes[start].0) else {
                continue;
            };
            if header.addressing() != Addressing::AddressFollows {
                return None;
            }
            let end = (start + header.telegram_length()).min(self.bytes.len());
            let others = match self.roles.get(start + 1) {
                Some(Role::Address { drive: Some(axis) }) => *axis != drive,
                _ => false,
            };
            if others && !self.roles[start..end].contains(&Role::Foreign) {
                kept[start..end].fill(false);
            }
        }
        Some(kept)
    }

    /// The first `count` bytes with an address byte in place of each short address, and how many they are then; `None` where a telegram
    /// has no byte that needs an address, or a fault is meant for a byte that would have another number.
    pub(super) fn with_addresses(&self, count: usize, drives: u8) -> Option<(Self, usize)> {
        let mut exchange = Self::default();
        let mut index = 0;
        for piece in &self.pieces {
            match piece {
                Piece::Byte if index == count => break,
                Piece::Byte => {
                    let (byte, whole) = self.bytes[index];
                    let (byte, address) = match (self.roles[index], SyncByte::decode(byte)) {
                        (Role::Sync, Ok(SyncByte::Telegram(header)))
                            if header.addressing() != Addressing::AddressFollows =>
                        {
                            let drive = self.roles.get(index + 1)?.drive()?;
                            let (process_data, length) =
                                (header.process_data(), header.net_length());
                            let header = TelegramHeader::new(
                                Addressing::AddressFollows,
                                process_data,
                                length,
                            );
                            let sync = SyncByte::Telegram(header.ok()?).encode();
                            (sync, Some(drive.wrapping_sub(drives)))
                        }
                        _ => (byte, None),
                    };
                    for byte in iter::once(byte).chain(address) {
                        exchange.pieces.push(Piece::Byte);
                        exchange.bytes.push((byte, whole));
                    }
                    index += 1;
                }
                Piece::Gap(gap) => exchange.gap(*gap),
                Piece::Fault(..) => return None,
            }
        }
        exchange.roles = roles(RingSize::new(u64::from(drives)).ok()?, &exchange.bytes);
        let count = exchange.bytes.len();
        Some((exchange, count))
    }

    /// The text of a scenario that sends the first `count` bytes again, each telegram `step` addresses on in a ring of `drives`. `None` where it
    /// would be another conversation: a short address does not go on from the last drive to the first, and what an EEPROM holds is not
    /// exchanged, apart from the cells of the customer.
    pub(super) fn exchanged(&self, count: usize, drives: u8, step: u8) -> Option<String> {
        let on = |drive: u8| {
            let drive = (u16::from(drive) + u16::from(step)) % u16::from(drives);
            u8::try_from(drive).ok()
        };
        let roles = self.roles.get(..count)?;
        if count > MOST_BYTES || self.changes_eeprom(count) {
            return None;
        }
        let mut new: Vec<(u8, bool)> = self.bytes[..count].to_vec();
        for (role, (byte, _)) in roles.iter().zip(&mut new) {
            if let Role::Address { drive: Some(drive) } = role {
                *byte = on(*drive)?.wrapping_sub(drives);
            }
        }
        let size = RingSize::new(u64::from(drives)).ok()?;
        let meant = harness_proto::novobus::role::roles(size, &new);
        let same = |(old, new): (&Role, &Role)| match (old.drive(), new.drive()) {
            (None, None) => true,
            (Some(old), Some(new)) => on(old) == Some(new),
            _ => false,
        };
        if !roles.iter().zip(&meant).all(same) {
            return None;
        }
        Some(self.text(&new, drives, step))
    }

    /// Whether the first `count` bytes may write another cell of an EEPROM than those of the customer (ND21 14.10.5.3).
    fn changes_eeprom(&self, count: usize) -> bool {
        let mut buffers = BTreeMap::new();
        let mut checks = self.roles[..count].iter().enumerate();
        checks.any(|(at, role)| {
            let Role::Check {
                drive: Some(drive),
                writes: Some((address, width)),
                ..
            } = *role
            else {
                return false;
            };
            let cells = address..address.saturating_add(u16::from(width));
            if !cells.clone().any(|cell| EEPROM.contains(&cell)) {
                return false;
            }
            // WriteByte and WriteWord end with the address; in front of it stands the byte for the highest cell first.
            let whole = |place: &usize| self.roles[*place].drive() == Some(drive);
            let data = |cell: u16| {
                let last = at.checked_sub(3)?;
                let place = last.checked_sub(usize::from(cell - address))?;
                (place..at)
                    .all(|place| whole(&place))
                    .then(|| self.bytes[place].0)
            };
            for cell in cells.filter(|cell| EEPROM.contains(cell)) {
                let Some(data) = data(cell) else { return true };
                let customers = |cell: &u8| CUSTOMERS.contains(cell);
                match (cell, data) {
                    (ram::EEPROM_BUFFER, _) => {
                        buffers.insert(drive, data);
                    }
                    (ram::EEPROM_CONTROL, READ_BYTE | 0..=0x80) => {}
                    (ram::EEPROM_CONTROL, WRITE_BYTE)
                        if buffers.get(&drive).is_some_and(customers) => {}
                    (ram::EEPROM_CONTROL, _) => return true,
                    _ => {}
                }
            }
            false
        })
    }

    fn text(&self, bytes: &[(u8, bool)], drives: u8, step: u8) -> String {
        let title = format!("The same conversation, each telegram {step} addresses on");
        let mut text: Text = Text::default();
        text.header(&Scenario::new(&title, Header::of_rings(&[drives])));
        text.empty_line();
        let mut left = bytes.iter().map(|(byte, _)| Expected::Byte(*byte));
        // Bytes stand together up to a gap or a fault.
        let pieces = self.patient();
        for run in pieces.chunk_by(|one, other| one.is_byte() && other.is_byte()) {
            let steps: Vec<Step> = match run {
                [Piece::Gap(gap)] => {
                    let time = Duration::micros(gap.as_nanos() / 1_000);
                    vec![Action::Wait(time).into()]
                }
                [Piece::Fault(byte, fault)] => {
                    let ends = LinkEnds::of_place(drives, 0);
                    let fault = FaultStep::on_link(0, ends, (*fault).into(), *byte);
                    vec![RingStep::Fault(fault).into()]
                }
                run => {
                    let bytes: Vec<_> = left.by_ref().take(run.len()).collect();
                    let lines = Pattern::of(&bytes, usize::MAX).lines(BYTES_A_LINE);
                    let send = |message| Action::Send { port: 0, message }.into();
                    lines.into_iter().map(send).collect()
                }
            };
            for step in steps {
                text.step(&step, "");
            }
        }
        text.into()
    }
}

impl Piece {
    const fn is_byte(&self) -> bool {
        matches!(self, Self::Byte)
    }
}

impl AttemptBytes {
    /// The pieces, with a gap behind each order to an EEPROM: other drives may be slower than the one that was asked first.
    fn patient(&self) -> Vec<Piece> {
        let mut pieces = Vec::with_capacity(self.pieces.len());
        let mut index = 0;
        for piece in &self.pieces {
            pieces.push(piece.clone());
            if piece.is_byte() {
                if self.starts_eeprom(index) {
                    pieces.push(Piece::Gap(EEPROM_TIME));
                }
                index += 1;
            }
        }
        pieces
    }

    /// Whether a byte gives an order to the controller of an EEPROM.
    fn starts_eeprom(&self, index: usize) -> bool {
        let writes = match self.roles[index] {
            Role::Check { writes, .. } => writes,
            _ => None,
        };
        writes.is_some_and(|(address, width)| {
            (address..address.saturating_add(u16::from(width))).contains(&ram::EEPROM_CONTROL)
        })
    }
}

/// The first conversation behind the reset of the drives that comes before a scenario.
pub(super) fn begin(attempt: &[Conversation], drives: u8) -> usize {
    let Ok(size) = RingSize::new(u64::from(drives)) else {
        return 0;
    };
    let is_reset = |role: &Role| {
        matches!(
            role,
            Role::Command {
                section: "10.5",
                ..
            }
        )
    };
    let resets = |part: &Conversation| roles(size, &part.sent_in(0)).iter().any(is_reset);
    let before = |part: &&Conversation| !part.has_steps();
    let before = attempt.iter().take_while(before).count();
    let last = attempt[..before].iter().rposition(resets);
    last.map_or(0, |last| last + 1)
}

/// Whether the scenario language reads a fault as it is written.
fn is_written_as_read(fault: &LinkFault) -> bool {
    matches!(
        fault,
        LinkFault::Flip(_)
            | LinkFault::Replace(_)
            | LinkFault::Drop
            | LinkFault::Duplicate
            | LinkFault::Insert(_)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::plan::Exchange;
    use harness_proto::novobus::command::Command;

    /// ND21 14.10.5: only the customer's cells of another drive are written when roles are exchanged.
    #[test]
    fn no_other_cell_of_an_eeprom_is_written() {
        let orders = |cell: u8, order: u8| {
            let writes = [(ram::EEPROM_BUFFER, cell), (ram::EEPROM_CONTROL, order)];
            let bytes = writes.into_iter().flat_map(|(address, data)| {
                let command = Command::WriteByte { address, data };
                Exchange::new(3, 1, command).expect("a drive").bytes
            });
            let bytes: Vec<_> = bytes.map(|byte| (byte, true)).collect();
            let sent = AttemptBytes {
                pieces: vec![Piece::Byte; bytes.len()],
                roles: roles(RingSize::new(3).expect("a ring"), &bytes),
                bytes,
            };
            sent.exchanged(sent.bytes.len(), 3, 1)
        };
        assert!(orders(0x60, READ_BYTE).is_some());
        let text = orders(0x5C, WRITE_BYTE).expect("a customer's cell");
        assert!(text.trim_end().ends_with("\nwait 20000us"), "{text}");
        assert_eq!(orders(0x60, WRITE_BYTE), None);
        assert_eq!(orders(0x5C, 0x84), None);
    }

    /// ND21 9.2: a short address means the drive of the telegram before, whose address stands in its place then.
    #[test]
    fn a_short_address_is_written_out() {
        let written_out = |bytes: &[u8]| {
            let bytes: Vec<_> = bytes.iter().map(|byte| (*byte, true)).collect();
            let sent = AttemptBytes {
                pieces: vec![Piece::Byte; bytes.len()],
                roles: roles(RingSize::new(3).expect("a ring"), &bytes),
                bytes,
            };
            let (long, count) = sent.with_addresses(sent.bytes.len(), 3)?;
            assert_eq!(count, long.pieces.len());
            Some(long.bytes.iter().map(|(byte, _)| *byte).collect::<Vec<_>>())
        };
        let (read, short) = ([0xC0, 0x12, 0xFE, 0xD0], [0xC0, 0x13, 0xFE, 0xD1]);
        let first = [&[0x88, 0xFE][..], &read, &[0x80]].concat();
        let same = [&first[..], &[0xA8], &short].concat();
        let long = [&first[..], &[0x88, 0xFE], &short].concat();
        assert_eq!(written_out(&same), Some(long.clone()));
        assert_eq!(written_out(&long), Some(long));
        // Without a byte behind it there is no such telegram (9.3).
        assert_eq!(written_out(&[&first[..], &[0xA0]].concat()), None);
    }
}
