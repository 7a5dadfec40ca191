//! The codec against the print, the register table, units, bit timing and the guard.

use super::bit_timing::{Nbt, PRINTED};
use super::frame::{Data, Ignored, NoReply, Occasion, Reply, Request, reply_data};
use super::guard::Denial;
use super::properties::*;
use super::register::{Access, BadName, Register, Unit, Width};
use super::units::{Decimal, Given, Scaling, shown, to_raw, usual};
use super::{ALIASES, DEFAULT_RX, DEFAULT_TX, REGISTERS};
use crate::can::{BitRate, Frame, Id};
use crate::time::{Instant, Span};
use proptest::prelude::*;
use std::format;
use std::string::{String, ToString};
use std::vec::Vec;

const VECTORS: &str = include_str!("../../../../corpora/vectors/unitek.txt");

fn frame(text: &str) -> Frame {
    text.parse().unwrap()
}

/// A vector as the file has it: whether it goes to the drive, identifier, bytes (none for `xx`) and words.
struct Vector {
    to_drive: bool,
    id: u16,
    bytes: Vec<Option<u8>>,
    words: Vec<String>,
}

fn vectors() -> Vec<Vector> {
    let lines = VECTORS.lines().map(str::trim);
    let lines = lines.filter(|l| !l.is_empty() && !l.starts_with('#') && !l.starts_with('['));
    let vectors = lines.map(|line| {
        let (frame, meaning) = line
            .split_once('=')
            .unwrap_or_else(|| panic!("no =: {line}"));
        let mut pieces = frame.split_whitespace();
        let to_drive = match pieces.next() {
            Some(">") => true,
            Some("<") => false,
            _ => panic!("no direction: {line}"),
        };
        let id = pieces.next().expect("an identifier");
        let hex = |text: &str| u16::from_str_radix(text, 16).unwrap_or_else(|_| panic!("{line}"));
        Vector {
            to_drive,
            id: hex(id),
            bytes: pieces
                .map(|text| (text != "xx").then(|| u8::try_from(hex(text)).unwrap()))
                .collect(),
            words: meaning
                .split('(')
                .next()
                .unwrap_or_default()
                .split_whitespace()
                .map(String::from)
                .collect(),
        }
    });
    vectors.collect()
}

fn number(text: &str) -> i64 {
    match text.strip_prefix("0x") {
        Some(hex) => i64::from_str_radix(hex, 16).unwrap(),
        None => text.parse().unwrap(),
    }
}

/// All frames of the manual (4.8, 5, App 5 to 7), both ways.
#[test]
fn every_printed_frame() {
    let all = vectors();
    assert!(all.len() > 90, "{}", all.len());
    for vector in &all {
        let words: Vec<&str> = vector.words.iter().map(String::as_str).collect();
        let register = u8::from_str_radix(words[1], 16).unwrap();
        if vector.to_drive {
            let bytes: Vec<u8> = vector.bytes.iter().map(|b| b.expect("a byte")).collect();
            let request = match words[..] {
                ["write", _, text] => Request::Write {
                    register,
                    data: match bytes.len() {
                        3 => Data::Short(number(text) as u16),
                        _ => Data::Long(number(text) as u32),
                    },
                },
                ["read", _] => Request::Read { register },
                ["every", _, ms] => Request::Cycle {
                    register,
                    every: ms.parse().unwrap(),
                },
                ["stop", _] => Request::Stop { register },
                _ => panic!("{words:?}"),
            };
            let frame = Frame::base(vector.id, &bytes).unwrap();
            assert_eq!(Request::decode(&frame, vector.id, Dlc4::As3), Ok(request));
            assert_eq!(request.encode(vector.id), Ok(frame));
            continue;
        }
        // Each open byte is tried as 00 and as FF.
        for open in [0, 0xFF] {
            let bytes: Vec<u8> = vector.bytes.iter().map(|b| b.unwrap_or(open)).collect();
            let frame = Frame::base(vector.id, &bytes).unwrap();
            let reply = Reply::decode(&frame, vector.id).unwrap();
            assert_eq!(reply.register, register);
            assert_eq!(reply.stuff, *bytes.last().unwrap());
            let bits = match reply.data {
                Data::Short(_) => "16",
                Data::Long(_) => "32",
            };
            assert_eq!(bits, words[2]);
            if let Some(text) = words.get(3) {
                assert_eq!(reply.number(), number(text));
            }
            assert_eq!(reply.encode(vector.id), Ok(frame));
        }
    }
}

/// UNITEK dump: the table against the dump's own totals, row by row against its decimal column.
#[test]
fn the_table_is_the_dump() {
    let count = |access| REGISTERS.iter().filter(|r| r.access == access).count();
    let kinds = [Access::RO, Access::RW, Access::SP, Access::FN, Access::UK];
    assert_eq!(kinds.map(count), [96, 118, 18, 10, 14]);
    let wide: Vec<u8> = REGISTERS
        .iter()
        .filter(|r| r.width == Width::Bits32)
        .map(|r| r.number)
        .collect();
    // The 42 that the dump prints with 8 digits.
    let listed = [
        0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x11, 0x2F, 0x35, 0x40, 0x45, 0x52, 0x5A, 0x62,
        0x65, 0x67, 0x6D, 0x6E, 0x6F, 0x70, 0x72, 0x7A, 0x7B, 0x7C, 0x7D, 0x7E, 0x7F, 0x88, 0x89,
        0x8F, 0x91, 0xA5, 0xD1, 0xD2, 0xD3, 0xD4, 0xD5, 0xD6, 0xD7, 0xED, 0xF8,
    ];
    assert_eq!(wide, listed);
    for (place, register) in REGISTERS.iter().enumerate() {
        assert_eq!(usize::from(register.number), place);
        assert_eq!(register.dump & !register.mask(), 0, "{place:02X}");
    }
    // The decimal column where the top bit is set: it decides the sign (E43).
    for (number, decimal) in [
        (0x11, 3_411_949_492),
        (0x27, -1),
        (0x28, -3),
        (0x3E, -32_768),
        (0x42, -31_047),
        (0x44, -592),
        (0x54, -1),
        (0x5C, 34_489),
        (0x66, 64_206),
        (0x74, -28_226),
        (0x7A, 4_254_355_352),
        (0x80, 34_489),
        (0x86, -1_330),
        (0x98, -1_330),
        (0x9B, 64_206),
        (0x9C, -1_330),
        (0xAB, 65_000),
        (0xB7, 37_171),
        (0xBE, 32_773),
        (0xCC, -13_997),
        (0xD5, -2_031_648),
        (0xFB, -44),
        (0xFD, 64_206),
        (0xFF, -1_330),
    ] {
        let register = Register::of(number);
        assert_eq!(register.number_of(register.dump), decimal, "{number:02X}");
    }
}

#[test]
fn names_and_aliases() {
    let named = |text| Register::named(text).map(|r| r.number);
    for (text, number) in [
        ("SPEED_ACTUAL", 0x30),
        ("speed_actual", 0x30),
        ("SPEED_ACTUAL_", 0xA8),
        ("VO_Less_ N0", 0xF5),
        ("SPEED_SOLL", 0x31),
        ("KERN_STATUS", 0x40),
        ("0x31", 0x31),
        ("31", 0x31),
        ("ff", 0xFF),
    ] {
        assert_eq!(named(text), Ok(number), "{text}");
    }
    for text in ["", "3", "0x", "0x3", "031", "+1", "SPEED"] {
        assert_eq!(named(text), Err(BadName::Unknown), "{text}");
    }
    // E35, E36.
    for (text, first, second, more) in [
        ("SPEED_DELTAMA", 0x35, 0xC7, 1),
        ("MOTOR_INDUCTA", 0xB1, 0xBB, 0),
        ("LOGIC_DEFINE_", 0xBE, 0xBF, 6),
        ("DC_BUS", 0x66, 0xEB, 0),
        ("DEVICE_SERIAL", 0x62, 0x82, 0),
        ("...", 0x47, 0x81, 4),
        ("rsv", 0x00, 0xFF, 0),
    ] {
        let ambiguous = BadName::Ambiguous {
            first,
            second,
            more,
        };
        assert_eq!(named(text), Err(ambiguous), "{text}");
    }
    // An alias never hides a name.
    for (alias, number) in ALIASES {
        assert!(
            REGISTERS
                .iter()
                .all(|r| !r.name.eq_ignore_ascii_case(alias))
        );
        assert_eq!(named(alias), Ok(number));
    }
}

/// What a drive does not take (4.1, 4.4, 4.5, App 1).
#[test]
fn frames_that_a_drive_ignores() {
    let read = |text: &str, dlc4| Request::decode(&frame(text), DEFAULT_RX, dlc4);
    for (text, why) in [
        ("201#R3", Ignored::Remote),
        ("201#R", Ignored::Remote),
        ("00000201#3D4000", Ignored::Extended),
        ("202#3D4000", Ignored::OtherIdentifier),
        ("181#3D4000", Ignored::OtherIdentifier),
        ("201#", Ignored::TooShort),
        ("201#3D", Ignored::TooShort),
        ("201#3D40", Ignored::TooShort),
    ] {
        assert_eq!(read(text, Dlc4::As3), Err(why), "{text}");
    }
    assert_eq!(read("201#3D400000", Dlc4::Ignore), Err(Ignored::FourBytes));
    let asked = Ok(Request::Read { register: 0x40 });
    for text in [
        "201#3D400077",
        "201#3D40000000",
        "201#3D4000112233",
        "201#3D40001122334455",
    ] {
        assert_eq!(read(text, Dlc4::As3), asked, "{text}");
    }
    let long = Request::Write {
        register: 0xD4,
        data: Data::Long(0x4433_2211),
    };
    for text in ["201#D411223344", "201#D41122334455", "201#D411223344556677"] {
        assert_eq!(read(text, Dlc4::Ignore), Ok(long), "{text}");
    }
}

#[test]
fn frames_that_are_no_reply() {
    for (text, why) in [
        ("201#40810100", NoReply::OtherIdentifier),
        ("00000181#40810100", NoReply::OtherIdentifier),
        ("181#R4", NoReply::Remote),
        ("181#", NoReply::Length { dlc: 0 }),
        ("181#408101", NoReply::Length { dlc: 3 }),
        ("181#4081010000", NoReply::Length { dlc: 5 }),
        ("181#40810100000000", NoReply::Length { dlc: 7 }),
    ] {
        assert_eq!(Reply::decode(&frame(text), DEFAULT_TX), Err(why), "{text}");
    }
}

/// App 1: 16 bits to a register of 32, 32 bits to one of 16.
#[test]
fn widths_on_receipt() {
    let written =
        |number, data: Data, short| data.written_to(Register::of(number), 0x1122_3344, short);
    let (extend, keep) = (ShortWrite::Extend, ShortWrite::KeepHigh);
    // Signed: D4. Unsigned: 35.
    assert_eq!(written(0xD4, Data::Short(0xFFFF), extend), 0xFFFF_FFFF);
    assert_eq!(written(0xD4, Data::Short(0x7FFF), extend), 0x7FFF);
    assert_eq!(written(0x35, Data::Short(0xFFFF), extend), 0xFFFF);
    assert_eq!(written(0xD4, Data::Short(0xFFFF), keep), 0x1122_FFFF);
    assert_eq!(written(0xD4, Data::Long(5), keep), 5);
    assert_eq!(written(0x31, Data::Long(0xFFFF_8001), extend), 0x8001);
}

/// App 3 and 7, ex 10: how wide a reply is.
#[test]
fn widths_of_replies() {
    let mut properties = Properties::default();
    let sent = |number, raw, occasion, wide, properties: &Properties| {
        reply_data(Register::of(number), raw, occasion, wide, properties)
    };
    let (asked, event) = (Occasion::Asked, Occasion::Event);
    let p = &properties;
    assert_eq!(
        sent(0x40, 0x8000_3181, asked, false, p),
        Data::Short(0x3181)
    );
    assert_eq!(sent(0x40, 0x8000_B181, asked, true, p), Data::Long(0xB181));
    assert_eq!(sent(0x40, 0x3181, event, false, p), Data::Long(0x3181));
    assert_eq!(sent(0x27, 0xFFFF, asked, false, p), Data::Short(0xFFFF));
    assert_eq!(sent(0x27, 0xFFFF, asked, true, p), Data::Long(u32::MAX));
    assert_eq!(sent(0xDC, 0xFFFF, asked, true, p), Data::Long(0xFFFF));
    assert_eq!(sent(0x6D, 1, asked, false, p), Data::Long(1));
    properties.event_reply = EventReply::AsMapReply;
    let p = &properties;
    assert_eq!(sent(0x40, 0x3181, event, false, p), Data::Short(0x3181));
    let p = &Properties::fw472();
    assert_eq!(sent(0x8F, 0x20, asked, false, p), Data::Long(0x20));
}

/// UNITEK 3.1: the five printed rates, and E3.
#[test]
fn bit_timing() {
    let rates: Vec<_> = PRINTED
        .iter()
        .map(|row| {
            (
                row.nbt.0,
                row.nbt.rate(),
                row.nbt.quanta(),
                row.nbt.sample_point_permille(),
            )
        })
        .collect();
    assert_eq!(
        rates,
        [
            (0x4002, Some(BitRate::M1), 5, 800),
            (0x4025, Some(BitRate::K500), 10, 700),
            (0x4014, Some(BitRate::K625), 8, 750),
            (0x405C, Some(BitRate::K250), 20, 700),
            (0x4425, Some(BitRate::K100), 10, 700),
        ]
    );
    for row in &PRINTED {
        assert_eq!(row.nbt.rate(), Some(row.rate));
        assert_eq!(Nbt::for_rate(row.rate), Some(row.nbt));
    }
    // 3 quanta of 200 ns are no whole number of bits a second; every value gives something.
    assert_eq!(Nbt(0x4000).rate(), None);
    for value in 0..=u16::MAX {
        let nbt = Nbt(value);
        assert!(
            nbt.rate()
                .is_none_or(|rate| rate.bit_time() == Span::from_nanos(nbt.bit_nanos().into()))
        );
    }
}

/// Numbers that the manual prints with their units (ex 3, 4, 5, 6.1, App 5).
#[test]
fn printed_quantities() {
    let drive = Scaling::default();
    let raw = |number, digits, places, given, scaling| {
        to_raw(
            Register::of(number),
            Decimal { digits, places },
            given,
            scaling,
        )
        .unwrap()
    };
    for (number, digits, places, given, expected) in [
        (0x31, 10, 0, Given::Percent, 0x0CCD),
        (0x31, 100, 0, Given::Percent, 0x7FFF),
        (0x31, -100, 0, Given::Percent, 0x8001),
        (0x31, 50, 0, Given::Percent, 0x4000),
        (0x31, -50, 0, Given::Percent, 0xC000),
        (0x31, 30, 0, Given::Percent, 9830),
        (0x90, 100, 0, Given::Percent, 0x5555),
        (0x90, -100, 0, Given::Percent, 0xAAAB),
        (0x90, 150, 0, Given::Percent, 0x7FFF),
        (0x90, 50, 0, Given::Percent, 10_922),
        (0x6E, 200, 0, Given::Turns, 13_107_200),
        (0x6E, -5, 1, Given::Turns, 0xFFFF_8000),
        (0x35, 1000, 0, Given::Millis, 1000),
        (0xC6, 50, 1, Given::Ampere, 50),
    ] {
        assert_eq!(
            raw(number, digits, places, given, drive),
            expected,
            "{number:02X} {digits}"
        );
    }
    // 6.1: limit 1500 of 2000 rpm is 24575.
    let slow = Scaling {
        rpm_max: 2000,
        ..drive
    };
    assert_eq!(raw(0x34, 1500, 0, Given::Rpm, slow), 24_575);
    let text = |number, raw, given| {
        shown(Register::of(number), raw, given, drive)
            .unwrap()
            .to_string()
    };
    assert_eq!(text(0x30, 0x0CCD, Given::Percent), "10.0%");
    assert_eq!(text(0x90, 0x3FFC, Given::Percent), "75.0%");
    assert_eq!(text(0x20, 841, Given::Ampere), "10.0 A");
    assert_eq!(text(0x20, 841, Given::Percent), "200.0%");
    assert_eq!(text(0x6D, 3_000_000, Given::Turns), "45.776 turns");
    assert_eq!(text(0x6D, 0xFFFF_8000, Given::Turns), "-0.500 turns");
    assert_eq!(text(0xED, 0x0001_0064, Given::Millis), "100 ms");
    let refused = |number, digits, given| {
        to_raw(Register::of(number), Decimal::whole(digits), given, drive)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused(0x31, 101, Given::Percent),
        "the value is out of range: register 31 (SPEED_CMD) takes raw numbers from -32767 to 32767"
    );
    assert_eq!(
        refused(0x31, 1, Given::Turns),
        "register 31 (SPEED_CMD) is not counted in turns: give it in %"
    );
    assert_eq!(
        refused(0x51, 1, Given::Percent),
        "register 51 (MODE) is not counted in %: give the raw number"
    );
}

#[test]
fn properties_and_their_words() {
    for property in PROPERTIES {
        let mut set = Properties::default();
        match property.accepts {
            Accepts::Words(words) => {
                assert!(words.len() > 1);
                for word in words {
                    assert!(property.set(&mut set, Setting::Word(word)));
                }
                assert!(property.set(&mut set, Setting::Word(words[0])));
                assert!(!property.set(&mut set, Setting::Time(Span::ZERO)));
            }
            Accepts::Byte => {
                assert!(property.set(&mut set, Setting::Word("A5")));
                assert!(!property.set(&mut set, Setting::Word("+5")));
                assert!(property.set(&mut set, Setting::Word("00")));
            }
            Accepts::TimeUpTo(most) => {
                assert!(property.set(&mut set, Setting::Time(most)));
                assert!(!property.set(&mut set, Setting::Time(most + Span::from_units(1))));
                continue;
            }
        }
        assert!(
            !property.set(&mut set, Setting::Word("perhaps")),
            "{}",
            property.name
        );
        assert_eq!(
            set,
            Properties::default(),
            "{}: the default comes first",
            property.name
        );
    }
    assert_eq!(
        PROFILES.map(|name| Properties::profile(name).is_some()),
        [true; 2]
    );
}

mod guarding;

fn any_frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![Just(0x201u16), Just(0x181), 0..0x800u16];
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    prop_oneof![
        8 => (id.clone(), data).prop_map(|(id, data)| Frame::base(id, &data).unwrap()),
        1 => (id, 0..=8usize).prop_map(|(id, len)| Frame::remote(Id::base(id).unwrap(), len).unwrap()),
    ]
}

proptest! {
    /// Every frame is a request or ignored for a reason, a reply or none; and a value reads back from the frame it makes.
    #[test]
    fn frames_come_back(frame in any_frame(), rx in 1..0x800u16) {
        for dlc4 in [Dlc4::As3, Dlc4::Ignore] {
            if let Ok(request) = Request::decode(&frame, DEFAULT_RX, dlc4) {
                let sent = request.encode(rx).unwrap();
                prop_assert!(matches!(sent.dlc(), 3 | 5));
                prop_assert_eq!(Request::decode(&sent, rx, Dlc4::Ignore), Ok(request));
            }
        }
        if let Ok(reply) = Reply::decode(&frame, DEFAULT_TX) {
            prop_assert_eq!(reply.encode(DEFAULT_TX), Ok(frame));
        }
    }

    /// A raw number that is shown and given again comes within half a digit of what is shown.
    #[test]
    fn values_come_back(number: u8, raw: u32) {
        let register = Register::of(number);
        let scaling = Scaling::default();
        let raw = raw & register.mask();
        for given in Given::ALL {
            prop_assert_eq!(shown(register, raw, given, scaling).is_none(), to_raw(register, Decimal::whole(0), given, scaling).is_err());
        }
        if register.unit == Unit::Raw {
            prop_assert_eq!(usual(register.unit), None);
        }
    }
}

#[test]
fn messages_are_sentences() {
    let texts = [
        BadName::Unknown.to_string(),
        Denial::Load { permille: 704 }.to_string(),
        Denial::Never { register: 0xB0 }.to_string(),
    ];
    assert_eq!(
        texts[1],
        "the cyclic replies would take 70.4 % of the bit rate, at most 50 % are permitted: stop a cycle, or ask less often"
    );
    assert_eq!(
        texts[2],
        "a write to register B0 (FUN_SERIALBOO) can make the drive unusable; no rig file permits it"
    );
}

/// The ledger has E01 to E45 in order, each with every key, and no key is empty.
#[test]
fn the_errata_ledger_is_whole() {
    const LEDGER: &str = include_str!("../../../../corpora/manual/unitek-errata.toml");
    let entries: Vec<&str> = LEDGER.split("[[erratum]]").skip(1).collect();
    assert_eq!(entries.len(), 45);
    for (number, entry) in (1..).zip(entries) {
        let value = |key: &str| {
            let line = entry
                .lines()
                .find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "));
            line.unwrap_or_else(|| panic!("E{number:02} has no {key}"))
                .trim_matches('"')
        };
        assert_eq!(value("id"), format!("E{number:02}"));
        assert_eq!(value("document"), "unitek");
        for key in ["section", "prints", "meant", "why", "shown_by"] {
            assert!(!value(key).is_empty(), "E{number:02} {key}");
        }
    }
}
