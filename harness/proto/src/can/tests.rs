//! The wire length against a coder that builds the whole bit string, and the text form of frames.

use super::*;
use proptest::prelude::*;
use std::string::{String, ToString};
use std::vec::Vec;

/// ISO 11898-1, written apart: all bits of a frame as characters, the CRC by long division, then the stuffing.
mod independent {
    use super::*;

    pub(super) fn bits(extended: bool, id: u32, remote: bool, dlc: usize, data: &[u8]) -> String {
        let rtr = if remote { "1" } else { "0" };
        let mut bits = String::from("0");
        if extended {
            let id = std::format!("{id:029b}");
            bits += &std::format!("{}11{}{rtr}00", &id[..11], &id[11..]);
        } else {
            bits += &std::format!("{id:011b}{rtr}00");
        }
        bits += &std::format!("{dlc:04b}");
        for byte in data {
            bits += &std::format!("{byte:08b}");
        }
        bits.clone() + &remainder(&bits)
    }

    /// The remainder of the bits, with 15 zeros behind them, divided by x15+x14+x10+x8+x7+x4+x3+1.
    pub(super) fn remainder(bits: &str) -> String {
        let divisor = b"1100010110011001";
        let mut row: Vec<u8> = bits.bytes().chain([b'0'; 15]).collect();
        for start in 0..bits.len() {
            if row[start] == b'1' {
                for (bit, d) in row[start..].iter_mut().zip(divisor) {
                    *bit = if *bit == *d { b'0' } else { b'1' };
                }
            }
        }
        String::from_utf8(row[bits.len()..].to_vec()).expect("digits")
    }

    /// After five equal bits on the wire, the opposite bit.
    pub(super) fn stuffed(bits: &str) -> String {
        let mut wire = String::new();
        for bit in bits.chars() {
            wire.push(bit);
            if wire.ends_with("00000") {
                wire.push('1');
            } else if wire.ends_with("11111") {
                wire.push('0');
            }
        }
        wire
    }

    pub(super) fn wire_bits(frame: &Frame) -> usize {
        let id = frame.id();
        let bits = bits(
            id.is_extended(),
            id.number(),
            frame.is_remote(),
            frame.dlc(),
            frame.data(),
        );
        // CRC delimiter, acknowledge slot and delimiter, end of frame, intermission.
        stuffed(&bits).len() + "1".len() + "01".len() + "1111111".len() + "111".len()
    }
}

fn any_id() -> impl Strategy<Value = Id> {
    prop_oneof![
        (0..=Id::MAX_BASE).prop_map(|id| Id::base(id).unwrap()),
        (0..=Id::MAX_EXTENDED).prop_map(|id| Id::extended(id).unwrap()),
    ]
}

fn any_frame() -> impl Strategy<Value = Frame> {
    // Bytes with long runs are as frequent as others: they are what is stuffed.
    let byte = prop_oneof![
        Just(0),
        Just(0xFF),
        Just(0x0F),
        Just(0xF8),
        Just(0x78),
        any::<u8>()
    ];
    prop_oneof![
        4 => (any_id(), prop::collection::vec(byte, 0..=8))
            .prop_map(|(id, data)| Frame::new(id, &data).unwrap()),
        1 => (any_id(), 0..=8usize).prop_map(|(id, len)| Frame::remote(id, len).unwrap()),
    ]
}

/// The check value of the catalogue of CRCs (CRC-15/CAN of the digits 1 to 9 is 059E), by both coders.
#[test]
fn crc_of_the_catalogue() {
    let (mut coder, mut single) = (Coder::default(), Coder::default());
    let mut bits = String::new();
    for digit in b"123456789" {
        coder.push(u32::from(*digit), 8);
        // Bit by bit the same.
        (0..8)
            .rev()
            .for_each(|place| single.push(u32::from(*digit) >> place & 1, 1));
        bits += &std::format!("{digit:08b}");
    }
    assert_eq!((coder.crc, single.crc), (0x059E, 0x059E));
    assert_eq!((coder.bits, coder.stuffed), (single.bits, single.stuffed));
    assert_eq!(independent::remainder(&bits), "000010110011110");
}

/// ISO 11898-1: a frame without runs has no stuff bits; the longest one has a stuff bit for every four bits after the first.
#[test]
fn shortest_and_longest() {
    let lengths = |frame: &Frame| (frame.wire_bits(), independent::wire_bits(frame));
    // UNITEK section 1: 3 bytes take 142 to 170 us at 500 kbit/s, and 6 bytes 190 to 230.
    for (bytes, least, most) in [(3, 71, 85), (6, 95, 115)] {
        assert_eq!(Frame::worst_wire_bits(false, bytes), most);
        assert_eq!(47 + 8 * bytes, least);
    }
    assert_eq!(Frame::worst_wire_bits(false, 0), 55);
    assert_eq!(Frame::worst_wire_bits(false, 8), 135);
    assert_eq!(Frame::worst_wire_bits(true, 8), 160);
    // Start bit and identifier 0 and both reserved bits: 18 zeros in front of the length code.
    let zeros = Frame::base(0, &[]).unwrap();
    assert_eq!(zeros.crc(), 0);
    // 34 zeros: a stuff bit behind the first five, then behind every four and each stuff bit's own run of one.
    assert_eq!(lengths(&zeros), (34 + 6 + 13, 53));
    assert_eq!(zeros.bits_to_acknowledge() + END_BITS, zeros.wire_bits());
}

/// ISO 11898-1: the dominant bit wins, so the lower identifier, data before remote, 11 bits before 29.
#[test]
fn arbitration_is_the_order_of_the_bits() {
    let order = [
        "000#",
        "000#R",
        "00000000#",
        "0003FFFF#R",
        "00040000#R2",
        "180#FF",
        "181#00",
        "181#R",
        "06040000#",
        "201#3D4000",
        "7FF#R",
        "1FFFFFFF#R8",
    ];
    // 00040000 has the base identifier 001: behind all of base identifier 000.
    let frames: Vec<Frame> = order.iter().map(|f| f.parse().unwrap()).collect();
    for pair in frames.windows(2) {
        assert!(pair[0].arbitration() < pair[1].arbitration(), "{pair:?}");
    }
}

/// ISO 11898-1: where two senders of the same identifier differ.
#[test]
fn first_difference_on_the_wire() {
    let bits = |a: &str, b: &str| {
        let (a, b): (Frame, Frame) = (a.parse().unwrap(), b.parse().unwrap());
        assert_eq!(a.bits_to_difference(&b), b.bits_to_difference(&a));
        a.bits_to_difference(&b)
    };
    assert_eq!(bits("181#40810100", "181#40810100"), None);
    // Start bit, 11 bits with a stuff bit behind their five zeros, RTR, IDE, r0; length codes 0100 and 0110 differ in the third bit.
    assert_eq!(bits("181#40810100", "181#408101000000"), Some(19));
}

#[test]
fn text_of_candump() {
    for text in [
        "201#3D4000",
        "201#",
        "000#0011223344556677",
        "201#R",
        "201#R8",
        "00000201#3D4000",
        "1FFFFFFF#R1",
    ] {
        assert_eq!(text.parse::<Frame>().unwrap().to_string(), text);
    }
    let same = |text: &str| text.parse::<Frame>().unwrap().to_string();
    assert_eq!(same("1ff#ab.cd.ef"), "1FF#ABCDEF");
    assert_eq!(same("201#r0"), "201#R");
}

#[test]
fn text_that_is_no_frame() {
    for (text, why) in [
        ("", BadFrame::NoSeparator),
        ("201", BadFrame::NoSeparator),
        ("#00", BadFrame::IdentifierDigits),
        ("+01#00", BadFrame::IdentifierDigits),
        ("0201#00", BadFrame::IdentifierDigits),
        ("2g1#00", BadFrame::IdentifierDigits),
        ("800#00", BadFrame::Identifier { number: 0x800 }),
        (
            "20000000#",
            BadFrame::Identifier {
                number: 0x2000_0000,
            },
        ),
        ("201#0", BadFrame::DataDigits),
        ("201#0.0", BadFrame::DataDigits),
        ("201#.00", BadFrame::DataDigits),
        ("201#00.", BadFrame::DataDigits),
        ("201##100", BadFrame::DataDigits),
        ("201#é0", BadFrame::DataDigits),
        ("201#112233445566778899", BadFrame::TooLong { len: 9 }),
        ("201#R9", BadFrame::TooLong { len: 9 }),
        ("201#R10", BadFrame::RemoteLength),
        ("201#R-", BadFrame::RemoteLength),
    ] {
        assert_eq!(text.parse::<Frame>(), Err(why), "{text}");
    }
}

#[test]
fn rates() {
    for (rate, nanos) in [
        (BitRate::M1, 1_000),
        (BitRate::K625, 1_600),
        (BitRate::K500, 2_000),
        (BitRate::K250, 4_000),
        (BitRate::K100, 10_000),
    ] {
        assert_eq!(rate.bit_time(), Span::from_nanos(nanos));
        assert_eq!(
            BitRate::from_bits_per_second(rate.bits_per_second()),
            Some(rate)
        );
    }
    assert_eq!(BitRate::K625.to_string(), "625 kbit/s");
    for none in [0, 1_000_001, 83_333, 7] {
        assert_eq!(BitRate::from_bits_per_second(none), None, "{none}");
    }
}

proptest! {
    #[test]
    fn wire_length_as_the_independent_coder(frame in any_frame()) {
        let bits = frame.wire_bits();
        prop_assert_eq!(bits as usize, independent::wire_bits(&frame));
        let bytes = frame.data().len();
        prop_assert!(bits <= Frame::worst_wire_bits(frame.id().is_extended(), bytes));
    }

    #[test]
    fn difference_as_the_independent_coder(id in 0..=Id::MAX_BASE, a in any::<[u8; 4]>(), b in any::<[u8; 4]>()) {
        let wire = |data: &[u8]| {
            let bits = independent::bits(false, id.into(), false, 4, data);
            independent::stuffed(&bits)
        };
        let (left, right) = (wire(&a), wire(&b));
        let first = left.chars().zip(right.chars()).position(|(l, r)| l != r);
        let frame = |data: &[u8]| Frame::base(id, data).unwrap();
        let bits = frame(&a).bits_to_difference(&frame(&b));
        prop_assert_eq!(bits, first.map(|place| place as u32 + 1).filter(|_| a != b));
    }

    #[test]
    fn frames_read_what_they_print(frame in any_frame()) {
        prop_assert_eq!(frame.to_string().parse::<Frame>(), Ok(frame));
    }

    #[test]
    fn any_text_is_a_frame_or_an_error(text in "[0-9A-Fa-fRr#.xé ]{0,24}") {
        if let Ok(frame) = text.parse::<Frame>() {
            prop_assert_eq!(frame.to_string().parse::<Frame>(), Ok(frame));
        }
    }
}
