//! Repairs commands in raw bytes, so that a mutated input gets past the checking byte (ND21 9.5, 9.6).

use harness_proto::novobus::address::passed_on;
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Layout, layout};
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, SyncByte};

/// Sets the fixed bytes and the checking byte of every command in `wire`, for every drive; lengths, addresses and data stay as
/// they are. Behind a byte that is no sync byte or no command everything stays, up to the next check sequence (9.8).
pub fn repair(wire: &mut [u8]) {
    let mut left = wire;
    loop {
        let read = Reader::default().read(left);
        left = &mut left[read..];
        while !left.starts_with(&SEQUENCE) {
            // On to the next byte that may begin one.
            let Some(place) = left.iter().skip(1).position(|byte| *byte == SEQUENCE[0]) else {
                return;
            };
            left = &mut left[1 + place..];
        }
        left = &mut left[SEQUENCE.len()..];
    }
}

/// Drives whose commands are repaired at the same time; behind a further one everything stays as behind a byte that is no command.
const MOST_BEGUN: usize = 4;

#[derive(Default)]
struct Reader {
    /// Net bytes still to come, and how many of them are process data.
    net: u8,
    process_data: u8,
    address_next: bool,
    /// The last address byte, counted on by "next drive".
    address: u8,
    /// Commands half received: there are few, so they are looked for one after another, in a place that costs no memory.
    begun: [Option<PartialCommand>; MOST_BEGUN],
    lost: bool,
}

/// A command as far as received, and by which drive.
struct PartialCommand {
    address: u8,
    layout: &'static Layout,
    received: usize,
    sum: Checksum,
}

impl Reader {
    /// Reads up to a byte that no drive accepts, or all; says how many bytes stand in front of that one.
    fn read(mut self, wire: &mut [u8]) -> usize {
        for (place, byte) in wire.iter_mut().enumerate() {
            self.take(byte);
            if self.lost {
                return place;
            }
        }
        wire.len()
    }

    fn take(&mut self, byte: &mut u8) {
        if self.address_next {
            self.address_next = false;
            self.address = *byte;
        } else if self.net > 0 {
            self.net -= 1;
            if self.process_data > 0 {
                self.process_data -= 1;
            } else {
                self.parameter(byte);
            }
        } else {
            self.sync(*byte);
        }
    }

    fn sync(&mut self, byte: u8) {
        match SyncByte::decode(byte) {
            Err(_) => self.lost = true,
            Ok(SyncByte::Synco | SyncByte::Pause) => {}
            Ok(SyncByte::Telegram(header)) => {
                self.net = header.net_length();
                self.process_data = if header.process_data() { 2 } else { 0 };
                match header.addressing() {
                    Addressing::AddressFollows => self.address_next = true,
                    Addressing::SameDrive => {}
                    Addressing::NextDrive => self.address = passed_on(self.address),
                }
            }
        }
    }

    fn parameter(&mut self, byte: &mut u8) {
        let address = self.address;
        let of_address = |one: &PartialCommand| one.address == address;
        let mut begun = self.begun.iter_mut();
        let Some(place) = begun.find(|place| place.as_ref().is_some_and(of_address)) else {
            let free = self.begun.iter_mut().find(|place| place.is_none());
            match (layout(*byte, ReadLongAnswer::default()), free) {
                (Some(layout), Some(free)) => {
                    *free = Some(PartialCommand {
                        address,
                        layout,
                        received: 1,
                        sum: Checksum::EMPTY.with(*byte),
                    });
                }
                _ => self.lost = true,
            }
            return;
        };
        let Some(begun) = place else {
            return;
        };
        match begun.layout.command[begun.received - 1] {
            Field::Fixed(fixed) => *byte = fixed,
            Field::Check => *byte = begun.sum.plus(),
            _ => {}
        }
        begun.received += 1;
        begun.sum = begun.sum.with(*byte);
        if begun.received == begun.layout.length() {
            *place = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::novobus::command::Command;
    use harness_proto::novobus::decode::Decoded;
    use proptest::prelude::*;

    /// ND21 9.7: the telegram of the 100-axis table with a wrong checking byte.
    #[test]
    fn the_checking_byte_of_a_read() {
        let mut wire = [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0x00, 0x80];
        repair(&mut wire);
        assert_eq!(wire, [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1, 0x80]);
    }

    /// ND21 9.5: a command cut over two telegrams, with process data and another drive's telegram between.
    #[test]
    fn a_command_that_is_cut() {
        let mut wire = [
            0x84, 0xFF, 0xC1, 0x13, 0x84, 0xFE, 0xC8, 0x01, 0x8B, 0xFF, 1, 2, 0xFE, 0, 0,
        ];
        repair(&mut wire);
        let whole = [0xC1, 0x13, 0xFE, wire[13], wire[14]];
        let decoded = Command::decode(&whole).value();
        assert_eq!(decoded, Some(Command::ReadWord { address: 0xFE13 }));
        assert_eq!(
            wire[..13],
            [
                0x84, 0xFF, 0xC1, 0x13, 0x84, 0xFE, 0xC8, 0x01, 0x8B, 0xFF, 1, 2, 0xFE
            ]
        );
    }

    /// Behind an error only a check sequence lets it go on (ND21 9.8).
    #[test]
    fn behind_an_error() {
        let broken = [0x01, 0x88, 0xFE, 0xC0, 0x13, 0xFE, 0x00];
        let mut wire = broken;
        repair(&mut wire);
        assert_eq!(wire, broken);
        let mut wire = [&[0x01, 0xFF, 0x44, 0x72, 0x4C, 0x41][..], &broken[1..]].concat();
        repair(&mut wire);
        assert_eq!(wire.last(), Some(&0xD1));
    }

    proptest! {
        /// What is repaired decodes, unless an address is out of range; and a second time nothing is left to do.
        #[test]
        fn what_it_repairs_decodes(code in prop::sample::select(vec![0xC0_u8, 0xC1, 0xC7, 0x82, 0x63, 0xA4, 0xA5, 0xC8, 0xDD]), fields in any::<[u8; 5]>()) {
            let layout = layout(code, ReadLongAnswer::default()).expect("a command");
            let mut fields = fields;
            for (field, byte) in layout.command.iter().zip(&mut fields) {
                match field {
                    Field::AddrH => *byte = 0xFE,
                    Field::AddrInPage => *byte &= 0x7F,
                    Field::Code => *byte &= 3,
                    _ => {}
                }
            }
            let length = layout.length();
            let mut wire = vec![0x80 | (length as u8) << 1, 0xFF, code];
            wire.extend(&fields[..length - 1]);
            repair(&mut wire);
            let decoded = Command::decode(&wire[2..]);
            prop_assert!(matches!(decoded, Decoded::Value { used, .. } if used == length), "{:02X?}: {:?}", wire, decoded);
        }

        #[test]
        fn twice_is_once(wire in prop::collection::vec(any::<u8>(), 0..80)) {
            let mut once = wire;
            repair(&mut once);
            let mut twice = once.clone();
            repair(&mut twice);
            prop_assert_eq!(once, twice);
        }
    }
}
