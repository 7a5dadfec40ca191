//! Random drives and random bytes.

use super::{
    FoundDrive, GO, MOST, OVERSHOOT, and, bench, byte, limits, or, order_by_plc, telegram, watch,
    word,
};
use crate::gate::GuardsRings as _;
use harness_bench::link::{Line, Octets, Trouble};
use harness_proto::nd21::bits::status;
use harness_proto::nd21::ram;
use proptest::collection::vec;
use proptest::prelude::*;

fn left() -> impl Strategy<Value = FoundDrive> {
    let configuration = (
        prop_oneof![3 => Just(0xC4_u8), 1 => Just(0xCC), 1 => Just(0x44), 1 => Just(0x4C)],
        prop_oneof![3 => Just(0xFF_u8), 1 => Just(0xED)],
        prop_oneof![5 => Just(0x43_u8), 1 => Just(0x40), 1 => Just(0x42), 1 => Just(0xC3), 1 => Just(0x03)],
        prop_oneof![4 => Just(0xFF_u8), 1 => Just(0x7F), 1 => Just(0xFB), 1 => Just(0xFD)],
    );
    let speed = || prop_oneof![2 => -1_100..1_100_i16, 1 => any::<i16>()];
    let cell = prop_oneof![
        (Just(ram::NSOLL), speed()),
        (Just(ram::PS_V0), speed()),
        (Just(ram::PS_POSITION_H), any::<i16>()),
        (Just(ram::PS_UMDREHUNG), 0..100_i16),
    ]
    .prop_map(|(address, word)| (address, word.cast_unsigned()));
    let data_in = prop_oneof![6 => Just(0x08_u8), 1 => Just(0x78), 1 => Just(0x62), 1 => Just(0x4C), 1 => any::<u8>().prop_map(|low| low & 0x7E)];
    (
        configuration,
        [speed(), speed()],
        speed(),
        vec(cell, 0..3),
        data_in,
        -10_000..10_000_i32,
        any::<u8>(),
    )
        .prop_map(
            |(configuration, ref_speeds, vtippen, cells, data_in, analogue, inputs)| FoundDrive {
                configuration: configuration.into(),
                ref_speeds,
                vtippen,
                cells,
                data_in: if data_in == 0x36 || data_in == 0x32 {
                    8
                } else {
                    data_in
                },
                analogue,
                inputs,
                ..FoundDrive::default()
            },
        )
}

/// Commands to cells that matter and to any.
fn order() -> impl Strategy<Value = Vec<u8>> {
    const NAMED: [u16; 24] = [
        ram::STATUS,
        ram::NSOLL,
        ram::PS_V0,
        ram::PS_STATUS,
        ram::FLAGS2,
        ram::REF_V1,
        ram::REF_V2,
        ram::VTIPPEN,
        ram::N_MAX,
        ram::DATA_IN,
        ram::ERRORCODE,
        ram::EEPROM_BUFFER,
        ram::EEPROM_CONTROL,
        ram::PS_POSITION_H,
        ram::PS_UMDREHUNG,
        ram::VCO_LIN,
        ram::SW_VERSION,
        ram::SW_VERSION2,
        ram::HW_VERSION,
        ram::D_LAGE,
        ram::UMDRSOLL,
        ram::D_RESOLVER,
        ram::LKP,
        ram::PS_K0,
    ];
    let address = prop_oneof![
        6 => prop::sample::select(&NAMED[..]),
        1 => prop::sample::select(&NAMED[..]).prop_map(|address| address - 1),
        1 => prop::sample::select(&NAMED[..]).prop_map(|address| address + 1),
        1 => 0xFD80..=0xFF7F_u16,
    ];
    let data = prop_oneof![
        4 => -1_100..1_100_i16,
        1 => any::<i16>(),
        1 => prop::sample::select(&[0x0008_i16, 0x0080, 0x0010, 0x0040, 0x0050, 0x0081, 0x0082, 0x0084, 0x00AF, 0x0001, 0x007E][..]),
    ]
    .prop_map(i16::cast_unsigned);
    let free = (0..8_u8, address, data).prop_map(|(kind, address, data)| match kind {
        0 | 1 => byte(address, data as u8),
        2..=4 => word(address, data),
        5 => or(address, data as u8),
        6 => and(address, data as u8),
        _ => vec![0x85, 0xFF, (data >> 8) as u8, data as u8],
    });
    let named = prop::sample::select(vec![
        and(ram::STATUS, GO),
        or(ram::STATUS, status::BLOCK),
        or(ram::STATUS, status::STOP),
        word(ram::NSOLL, 0),
        word(ram::PS_V0, 500),
        word(ram::REF_V1, 500),
        word(ram::REF_V2, 0xFF80),
        byte(ram::PS_STATUS, 1),
        or(ram::FLAGS2, 0x08),
        or(ram::FLAGS2, 0x80),
        and(ram::FLAGS2, 0x17),
        or(ram::PS_STATUS, 0x40),
        or(ram::PS_STATUS, 0x10),
        byte(ram::ERRORCODE, 0xAF),
        byte(ram::DATA_IN, 8),
        byte(ram::EEPROM_BUFFER, 0x22),
        byte(ram::EEPROM_BUFFER + 1, 0x40),
        byte(ram::EEPROM_CONTROL, 0x82),
        telegram(&[0xDD, 0x21]),
    ]);
    prop_oneof![3 => named, 2 => free]
}

/// What makes motors turn, as the driver does it: an error is confirmed and the drive released; a positioning, a referencing run.
fn run() -> impl Strategy<Value = Vec<u8>> {
    let go = || [byte(ram::ERRORCODE, 0xAF), and(ram::STATUS, GO)].concat();
    let waits = vec![0x80; 30];
    prop_oneof![
        3 => Just(go()),
        1 => Just([word(ram::NSOLL, 0), go()].concat()),
        1 => Just([byte(ram::PS_STATUS, 1), word(ram::PS_POSITION_H, 16), or(ram::FLAGS2, 0x08), waits.clone(), or(ram::PS_STATUS, 0x10)].concat()),
        1 => Just([word(ram::PS_UMDREHUNG, 16), or(ram::PS_STATUS, 0x40), waits, or(ram::PS_STATUS, 0x10)].concat()),
        1 => Just(or(ram::FLAGS2, 0x80)),
        1 => (-1_100..1_100_i16).prop_map(|speed| word(ram::NSOLL, speed.cast_unsigned())),
    ]
}

/// Orders, cut and damaged now and then, with short addresses and recoveries between them.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        12 => run(),
        12 => order(),
        // The same drive by its short address.
        2 => order().prop_map(|mut bytes| {
            if bytes.len() > 1 {
                bytes[0] |= 0x20;
                bytes.remove(1);
            }
            bytes
        }),
        // Over two telegrams.
        2 => (order(), index()).prop_filter_map("process data", |(bytes, at)| {
            let net = bytes.get(2..).filter(|_| bytes[0] & 1 == 0)?;
            let (first, second) = net.split_at(at.index(net.len()));
            let one = |net: &[u8]| [&[0x80 | (net.len() as u8) << 1, 0xFF][..], net].concat();
            Some([one(first), one(second)].concat())
        }),
        1 => (order(), index()).prop_map(|(mut bytes, at)| {
            bytes.truncate(at.index(bytes.len()));
            bytes
        }),
        1 => (order(), index(), any::<u8>()).prop_map(|(mut bytes, at, by)| {
            let at = at.index(bytes.len());
            bytes[at] ^= by;
            bytes
        }),
        1 => vec(any::<u8>(), 1..9),
        1 => Just([&[0; 17][..], &[0xFF, 0x44, 0x72, 0x4C, 0x41]].concat()),
    ]
}

/// A nominal speed within the limit, over which the regulator shoots by 3.2 %: the limit is one of nominal speeds.
#[test]
fn a_regulator_overshoots() {
    let left = FoundDrive {
        configuration: [0x44, 0xFF, 0x43, 0x7F],
        ref_speeds: [0, 0],
        vtippen: 0,
        cells: vec![(ram::NSOLL, 0xFDD0)],
        data_in: 8,
        analogue: 0,
        inputs: 0,
        ..FoundDrive::default()
    };
    let mut line = bench(&left, limits());
    let mut most = watch(&mut line, 20);
    order_by_plc(&mut line, &left);
    line.send_octets(
        0,
        &[byte(ram::ERRORCODE, 0xAF), and(ram::STATUS, GO)].concat(),
    );
    most = most.max(watch(&mut line, 360));
    assert_eq!(line.trouble(), None);
    assert!(
        most > f64::from(MOST) && most <= f64::from(MOST) + OVERSHOOT,
        "{most} rpm"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever another program has left, whatever is at the inputs, whatever passes: the motor keeps the limit.
    #[test]
    fn no_motor_turns_faster(left in left(), pieces in vec(piece(), 1..14)) {
        let mut line = bench(&left, limits());
        let mut most = watch(&mut line, 20);
        let mut sent = Vec::new();
        for bytes in pieces {
            order_by_plc(&mut line, &left);
            line.send_octets(0, &bytes);
            match line.trouble() {
                Some(Trouble::Denied(_)) => {
                    line.reset_after_denial();
                    line.synchronise();
                }
                _ => sent.push(bytes),
            }
            most = most.max(watch(&mut line, 60));
        }
        most = most.max(watch(&mut line, 300));
        prop_assert!(most <= f64::from(MOST) + OVERSHOOT, "{most} rpm by {sent:02X?}");
    }
}
