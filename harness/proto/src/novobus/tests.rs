//! The codec: round trips, prefixes, every sync byte, the timing tables of 8.2.

use super::address::{AddressError, RingSize};
use super::check_sequence::{CHECK_SEQUENCE, SequenceProgress, SequenceWatch};
use super::checksum::Checksum;
use super::command::{Command, CommandError, LAYOUTS};
use super::decode::Decoded;
use super::error::BusError;
use super::output::OutputChange;
use super::properties::{BusSetting, PROPERTIES, Properties, ReadLongAnswer};
use super::sync::{Addressing, SyncByte, SyncError, TelegramHeader};
use super::telegram::{Address, Telegram, TelegramError};
use super::timing::{exchange_bytes, position_bytes};
use crate::line::Rate;
use crate::time::Span;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use std::string::{String, ToString};
use std::vec::Vec;
use std::{format, vec};

/// Runs a property with a fixed seed (`DRIVEBENCH_SEED` for another) and says how to repeat a failure.
fn property<S: Strategy>(
    name: &str,
    strategy: &S,
    test: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400);
    let config = Config {
        cases: 2_000,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    if let Err(error) = TestRunner::new(config).run(strategy, test) {
        panic!("{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-proto {name}");
    }
}

fn commands() -> impl Strategy<Value = Command> {
    prop_oneof![
        any::<u16>().prop_map(|address| Command::ReadByte { address }),
        any::<u16>().prop_map(|address| Command::ReadWord { address }),
        any::<u16>().prop_map(|address| Command::ReadLong { address }),
        any::<(u16, u8)>().prop_map(|(address, data)| Command::WriteByte { address, data }),
        any::<(u16, u16)>().prop_map(|(address, data)| Command::WriteWord { address, data }),
        any::<(u8, u8)>().prop_map(|(address_low, data)| Command::And { address_low, data }),
        any::<(u8, u8)>().prop_map(|(address_low, data)| Command::Or { address_low, data }),
        (0u8..4).prop_filter_map("a code", |code| OutputChange::from_code(code)
            .map(Command::WriteIo)),
        Just(Command::ResetH8),
    ]
}

fn telegrams() -> impl Strategy<Value = Telegram> {
    let address = prop_oneof![
        any::<u8>().prop_map(Address::Byte),
        Just(Address::SameDrive),
        Just(Address::NextDrive),
    ];
    (
        address,
        any::<Option<u16>>(),
        prop::collection::vec(any::<u8>(), 0..8),
    )
        .prop_filter_map("legal", |(address, data, parameters)| {
            Telegram::new(address, data, &parameters).ok()
        })
}

#[test]
fn commands_come_back_and_prefixes_need_more() {
    property("commands_come_back", &commands(), |command| {
        let bytes = command.encode();
        prop_assert_eq!(
            Command::decode(&bytes),
            Decoded::Value {
                value: command,
                used: bytes.len()
            }
        );
        for length in 0..bytes.len() {
            prop_assert_eq!(Command::decode(&bytes[..length]), Decoded::NeedMore);
        }
        // The answer has the command's length (ND21 9.5), and no checking byte is 00 (9.6).
        let answer = command.answer(&[1, 2, 3, 4], ReadLongAnswer::AsPrinted);
        prop_assert_eq!(answer.len(), bytes.len());
        prop_assert_ne!(bytes[bytes.len() - 1], 0);
        prop_assert_ne!(answer[answer.len() - 1], 0);
        Ok(())
    });
}

#[test]
fn a_changed_byte_is_another_command_or_none_but_never_the_same() {
    property(
        "a_changed_byte",
        &(commands(), any::<(prop::sample::Index, u8)>()),
        |(command, (at, flip))| {
            let mut bytes = command.encode();
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            if flip != 0 {
                prop_assert_ne!(Command::decode(&bytes).value(), Some(command));
            }
            Ok(())
        },
    );
}

#[test]
fn telegrams_come_back_and_prefixes_need_more() {
    property("telegrams_come_back", &telegrams(), |telegram| {
        let bytes = telegram.encode();
        prop_assert!(
            (1..=9).contains(&bytes.len()),
            "ND21 9.7: a maximum of 9 bytes"
        );
        prop_assert_eq!(
            Telegram::decode(&bytes),
            Decoded::Value {
                value: telegram.clone(),
                used: bytes.len()
            }
        );
        for length in 0..bytes.len() {
            prop_assert_eq!(Telegram::decode(&bytes[..length]), Decoded::NeedMore);
        }
        Ok(())
    });
}

#[test]
fn decoders_take_any_bytes() {
    property(
        "decoders_take",
        &prop::collection::vec(any::<u8>(), 0..12),
        |bytes| {
            for decoded in [
                Command::decode(&bytes).value().map(|c| c.encode()),
                Telegram::decode(&bytes).value().map(|t| t.encode()),
            ] {
                let encoded = decoded.unwrap_or_default();
                prop_assert!(bytes.starts_with(&encoded));
            }
            Ok(())
        },
    );
}

/// ND21 9.2: `1 N S 0 T2 T1 T0 D`, every one of the 256 bytes.
#[test]
fn every_byte_is_a_sync_byte_or_breaks_a_rule() {
    let mut counts = [0; 6];
    for byte in 0..=255u8 {
        let (n, s, t, d) = (
            byte & 0x40 != 0,
            byte & 0x20 != 0,
            byte >> 1 & 7,
            byte & 1 != 0,
        );
        let decoded = SyncByte::decode(byte);
        let class = if byte == 0x80 {
            assert_eq!(decoded, Ok(SyncByte::Synco));
            0
        } else if byte == 0x81 {
            assert_eq!(decoded, Ok(SyncByte::Pause));
            1
        } else if byte & 0x80 == 0 {
            assert_eq!(decoded, Err(SyncError::Bit7Clear));
            2
        } else if byte & 0x10 != 0 {
            assert_eq!(decoded, Err(SyncError::Bit4Set));
            2
        } else if n && !s {
            assert_eq!(decoded, Err(SyncError::NextWithoutShort));
            2
        } else if d && t < 2 {
            assert_eq!(decoded, Err(SyncError::NoRoomForProcessData));
            3
        } else {
            let addressing = match (s, n) {
                (false, _) => Addressing::AddressFollows,
                (true, false) => Addressing::SameDrive,
                (true, true) => Addressing::NextDrive,
            };
            let header = TelegramHeader::new(addressing, d, t).unwrap();
            assert_eq!(decoded, Ok(SyncByte::Telegram(header)));
            if s { 5 } else { 4 }
        };
        if let Ok(sync) = decoded {
            assert_eq!(sync.encode(), byte);
        }
        counts[class] += 1;
    }
    // T = 1..7 without and 2..7 with process data after an address; T = 0 too behind a short one.
    assert_eq!(counts, [1, 1, 128 + 64 + 16, 5, 13, 28]);
}

/// ND21 9.1: address or not, process data or not, parameters or not; but never an address alone.
#[test]
fn there_are_seven_legal_forms() {
    let mut forms = Vec::new();
    for address in [Address::Byte(0xFB), Address::SameDrive] {
        for data in [None, Some(0x1234)] {
            for parameters in [&[][..], &[0xC0]] {
                match Telegram::new(address, data, parameters) {
                    Ok(telegram) => forms.push(telegram.encode()),
                    Err(error) => {
                        assert_eq!(error, TelegramError::Sync(SyncError::AddressWithoutData));
                    }
                }
            }
        }
    }
    assert_eq!(
        forms,
        [
            vec![0x82, 0xFB, 0xC0],
            vec![0x85, 0xFB, 0x12, 0x34],
            vec![0x87, 0xFB, 0x12, 0x34, 0xC0],
            vec![0xA0],
            vec![0xA2, 0xC0],
            vec![0xA5, 0x12, 0x34],
            vec![0xA7, 0x12, 0x34, 0xC0],
        ]
    );
    let long = Telegram::new(Address::SameDrive, Some(0), &[0; 6]);
    assert_eq!(long, Err(TelegramError::Sync(SyncError::TooLong)));
    assert_eq!(
        Telegram::new(Address::SameDrive, None, &[0; 300]),
        Err(TelegramError::Sync(SyncError::TooLong))
    );
}

/// ND21 9.6: "Instead of 0, 1 is to be sent", in both directions.
#[test]
fn checking_bytes_are_never_zero() {
    assert_eq!(Checksum::over(&[0xC0, 0x13, 0xFE]).plus(), 0xD1);
    assert_eq!(Checksum::over(&[0xC0, 0x13, 0x88]).minus(), 0xA5);
    assert_eq!(Checksum::over(&[0xC0, 0x40]).plus(), 0x01);
    assert_eq!(Checksum::over(&[0xC0, 0x40]).minus(), 0x01);
    assert_eq!(Checksum::EMPTY.plus(), 0x01);
}

/// ND21 9.3: N = 5, axis 2: k-N = -3 = FD.
#[test]
fn addresses_count_up_to_k() {
    let ring = RingSize::new(5).unwrap();
    assert_eq!(ring.address_byte(2), Ok(0xFD));
    for size in [1, 5, 100, 250] {
        let ring = RingSize::new(size).unwrap();
        for drive in 0..ring.drives() {
            let sent = ring.address_byte(drive).unwrap();
            // Drive d is the (N-d)-th to add 1.
            let sum_at = |d: u8| sent.wrapping_add(ring.drives() - d);
            assert_eq!(sum_at(drive), 0);
            assert_eq!(sum_at(0), drive);
            assert_eq!((0..ring.drives()).filter(|d| sum_at(*d) == 0).count(), 1);
        }
    }
    for drives in [0, 251, 1 << 40] {
        assert_eq!(
            RingSize::new(drives),
            Err(AddressError::RingSize { drives })
        );
        assert!(
            RingSize::new(drives)
                .unwrap_err()
                .to_string()
                .contains("1 to 250 (ND21 8.4)")
        );
    }
    assert!(
        ring.address_byte(5)
            .unwrap_err()
            .to_string()
            .contains("0 to 4")
    );
}

/// ND21 8.2: both tables, all ten rows, from byte counts; 250 drives are printed as 1002,79.
#[test]
fn the_timing_tables_follow_from_first_principles() {
    let byte = Rate::Baud38400.byte_time();
    let time = |bytes: u64, decimals: usize| {
        let ms = (byte * bytes).as_millis_f64();
        format!("{ms:.decimals$}")
    };
    let ring = |drives| RingSize::new(drives).unwrap();
    let exchange: Vec<String> = (1..=6)
        .map(|n| time(exchange_bytes(ring(n)), if n == 1 { 2 } else { 1 }))
        .collect();
    assert_eq!(exchange, ["0.86", "2.0", "2.9", "3.7", "4.6", "5.4"]);
    let positions: Vec<String> = [1, 10, 100, 250]
        .map(|n| time(position_bytes(ring(n)), 2))
        .to_vec();
    assert_eq!(positions, ["4.01", "40.39", "401.33", "1002.89"]);
    assert_eq!(time(1, 5), "0.28646");
}

/// ND21 10: the table of commands holds what chapter 10 prints.
#[test]
fn layouts_are_those_of_chapter_10() {
    for layout in &LAYOUTS {
        assert_eq!(
            layout.command.len(),
            layout.answer.len(),
            "{}",
            layout.printed_name
        );
        assert!((2..=6).contains(&layout.length()), "ND21 9.5: 2 to 6 byte");
        assert_ne!(
            layout.code, 0,
            "ND21 9.5: the command byte may not have the value 00"
        );
    }
    let bad = |bytes: &[u8]| match Command::decode(bytes) {
        Decoded::Bad { reason, offset } => (reason, offset),
        other => panic!("{other:?}"),
    };
    assert_eq!(bad(&[0x00]), (CommandError::UnknownCommand(0), 0));
    assert_eq!(bad(&[0xC8, 4]), (CommandError::UnknownOutput(4), 1));
    let fixed = CommandError::FixedByte {
        expected: b'!',
        found: 0,
    };
    assert_eq!(bad(&[0xDD, 0]), (fixed, 1));
    let sum = CommandError::Checksum {
        expected: 0xFE,
        found: 0,
    };
    assert_eq!(bad(&[0xDD, b'!', 0]), (sum, 2));
}

/// ND21 9.8; a sequence that breaks off may be followed by a fresh start.
#[test]
fn the_watch_finds_the_check_sequence() {
    let mut watch = SequenceWatch::default();
    let seen: Vec<_> = CHECK_SEQUENCE.iter().map(|&b| watch.see(b, true)).collect();
    assert_eq!(
        seen[16..],
        [
            SequenceProgress::None,
            SequenceProgress::Started,
            SequenceProgress::Continued,
            SequenceProgress::Continued,
            SequenceProgress::Continued,
            SequenceProgress::Complete,
        ]
    );
    let broken = [0xFF, 0x44, 0xFF, 0xFF, 0x44, 0x72, 0x4C, 0x41];
    let mut watch = SequenceWatch::default();
    let last = broken.iter().map(|&b| watch.see(b, true)).last();
    assert_eq!(last, Some(SequenceProgress::Complete));
    let mut watch = SequenceWatch::default();
    let damaged = [0xFF, 0x44, 0x72, 0x4C]
        .iter()
        .map(|&b| watch.see(b, true))
        .count();
    assert_eq!(damaged, 4);
    assert_eq!(watch.see(0x41, false), SequenceProgress::None);
    assert_eq!(watch.see(0x41, true), SequenceProgress::None);
}

/// Every property can be set to its default and to nothing that it does not know.
#[test]
fn properties_have_names() {
    for property in &PROPERTIES {
        let mut properties = Properties::default();
        let setting = match property.values[0] {
            "10ms" => BusSetting::Time(Span::from_millis(10)),
            word => BusSetting::Word(word),
        };
        assert_eq!(
            properties.set(property.name, setting),
            Ok(()),
            "{}",
            property.name
        );
        assert_eq!(
            properties,
            Properties::default(),
            "{}: the default comes first",
            property.name
        );
        assert!(
            properties
                .set(property.name, BusSetting::Word("no-such-word"))
                .is_err()
        );
    }
    let mut properties = Properties::default();
    assert!(
        properties
            .set("time-out", BusSetting::Time(Span::from_millis(21)))
            .is_err()
    );
    assert!(
        properties
            .set("no-such-property", BusSetting::Word("accepted"))
            .is_err()
    );
}

/// ND21 14.11.14.
#[test]
fn error_codes_are_those_of_the_table() {
    for error in BusError::ALL {
        assert_eq!(BusError::from_code(error.code()), Some(error));
    }
    assert_eq!(BusError::TimeOut.to_string(), "0508 NBtimeout");
    assert_eq!(BusError::from_code(0x0509), None);
}
