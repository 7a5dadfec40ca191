//! The codec against telegrams typed from the standard's rules, and for any octets.

use super::dp::*;
use super::fdl::*;
use super::rate::*;
use crate::decode::Decoded;
use crate::line::{Format, Parity};
use proptest::prelude::*;
use std::format;
use std::vec::Vec;

fn octets(text: &str) -> Buffer {
    let bytes: Vec<u8> = text
        .split_whitespace()
        .map(|octet| u8::from_str_radix(octet, 16).unwrap())
        .collect();
    Buffer::of(&bytes).unwrap()
}

fn telegram(text: &str) -> Pdu {
    let all = octets(text);
    match Telegram::decode(&all) {
        Decoded::Value { value, used } => {
            assert_eq!(used, all.len(), "{text}");
            assert_eq!(value.encode(), all, "{text}");
            *value.pdu().unwrap_or_else(|| panic!("{text}"))
        }
        other => panic!("{text}: {other:?}"),
    }
}

fn reason(text: &str) -> (Malformed, usize) {
    match Telegram::decode(&octets(text)) {
        Decoded::Bad { reason, offset } => (reason, offset),
        other => panic!("{text}: {other:?}"),
    }
}

/// EN 1: six rates, 8E1, whole in thirds of a nanosecond.
#[test]
fn rates() {
    for rate in BusRate::ALL {
        let bits = rate.bits_per_second();
        assert_eq!(rate.bit_time().units() * u64::from(bits), 3_000_000_000);
        assert_eq!(rate.format().octet_time(), rate.octet_time());
        assert_eq!(Format::from(rate).parity, Parity::Even);
        assert_eq!(BusRate::from_name(rate.name()), Some(rate));
        assert_eq!(BusRate::from_bits_per_second(bits), Some(rate));
    }
    assert_eq!(BusRate::from_bits_per_second(45_450), None);
    assert_eq!(
        BusRate::ALL.map(BusRate::max_tsdr_bits),
        [60, 60, 60, 60, 100, 150]
    );
}

/// EN 2: the whole telegrams of a start, master 2, slave 8.
#[test]
fn telegrams_of_a_start() {
    let status = telegram("10 08 02 49 53 16");
    assert_eq!((status.da(), status.sa()), (8, 2));
    assert_eq!(status.fc().function(), Some(FcFunction::FdlStatus));
    let reply = telegram("10 02 08 00 0A 16");
    assert_eq!(reply.fc().status(), Some(FcStatus::Ok));
    let request = telegram("68 05 05 68 88 82 6C 3C 3E F0 16");
    assert_eq!((request.dsap(), request.ssap()), (Some(60), Some(62)));
    assert_eq!(Service::of(request.dsap()), Some(Service::SlaveDiag));
    assert_eq!(
        request.fc(),
        FrameControl::request(FcFunction::SrdLow, Sequence::First)
    );
    assert!(request.data().is_empty());
    let diagnosis = telegram("68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16");
    let diagnosis = Diagnosis::decode(diagnosis.data()).unwrap();
    assert!(diagnosis.has(Diagnosis::NOT_READY) && diagnosis.has_mode(Diagnosis::PRM_REQ));
    assert_eq!((diagnosis.master, diagnosis.ident), (None, 0x7531));
    assert_eq!(
        diagnosis.names().collect::<Vec<_>>(),
        ["Station_Not_Ready", "Prm_Req"]
    );
    let prm = telegram("68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16");
    assert_eq!(SetPrm::decode(prm.data()), Some(SetPrm::lock(0x7531)));
    let cfg = telegram("68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16");
    assert_eq!((cfg.fc().fcb(), cfg.fc().fcv()), (true, true));
    assert_eq!(cfg.data(), [0xF3, 0xF1]);
    let early = telegram("10 02 08 03 0D 16");
    assert_eq!(early.fc().status(), Some(FcStatus::Rs));
    let built = Pdu::with_saps(
        8,
        2,
        FrameControl::request(FcFunction::SrdLow, Sequence::Counted(false)),
        Some(61),
        Some(62),
        &SetPrm::lock(0x7531).encode().unwrap(),
    );
    assert_eq!(built, Ok(prm));
    for (text, expected) in [
        ("E5", Telegram::Confirmation),
        ("DC 02 03", Telegram::Token { da: 2, sa: 3 }),
    ] {
        let all = octets(text);
        assert_eq!(Telegram::decode(&all).value(), Some(expected));
        assert_eq!(expected.encode(), all);
    }
}

/// EN 1: each rule that makes octets no telegram, at the octet that settles it.
#[test]
fn reasons() {
    for (text, expected) in [
        ("11", (Malformed::Start, 0)),
        ("68 03", (Malformed::Length, 1)),
        ("68 FA", (Malformed::Length, 1)),
        ("68 05 06", (Malformed::LengthRepeated, 2)),
        ("68 05 05 67", (Malformed::StartRepeated, 3)),
        ("10 08 7F", (Malformed::Source, 2)),
        ("10 08 02 C9", (Malformed::Control, 3)),
        ("10 88", (Malformed::SapMissing, 1)),
        ("10 08 82", (Malformed::SapMissing, 2)),
        ("68 04 04 68 88 82", (Malformed::SapMissing, 5)),
        ("68 05 05 68 88 82 6C 7C", (Malformed::Sap, 7)),
        ("68 05 05 68 88 82 6C 3C BE", (Malformed::Sap, 8)),
        ("10 08 02 49 54", (Malformed::CheckSum, 4)),
        ("10 08 02 49 53 17", (Malformed::End, 5)),
    ] {
        assert_eq!(reason(text), expected, "{text}");
    }
    let lengths = [
        ("68 04 04 68 08 02 6C 00 76 16", 1),
        ("A2 08 02 7D 01 02 03 04 05 06 07 08 AB 16", 8),
    ];
    for (text, length) in lengths {
        assert_eq!(telegram(text).data().len(), length);
    }
    let longest = Pdu::new(8, 2, FrameControl(0x7D), &[0xFF; MAX_PAYLOAD]).unwrap();
    assert_eq!(Telegram::Pdu(longest).encode().len(), MAX_TELEGRAM);
    for bad in [
        Pdu::new(128, 2, FrameControl(0x7D), &[]).err(),
        Pdu::new(8, 127, FrameControl(0x7D), &[]).err(),
        Pdu::new(8, 2, FrameControl(0x80), &[]).err(),
        Pdu::with_saps(8, 2, FrameControl(0x7D), Some(64), None, &[]).err(),
        Pdu::new(8, 2, FrameControl(0x7D), &[0; MAX_PAYLOAD + 1]).err(),
        Pdu::new(8, 2, FrameControl(0x7D), &[0; 300]).err(),
    ] {
        assert!(bad.is_some());
    }
}

/// EN 1: a start runs 6x 5x 7x 5x, and a record tells new requests from repeated ones.
#[test]
fn pdu_count_bits() {
    let mut sequence = Sequence::None;
    let mut fcb = Fcb::default();
    for expected in [0x6D, 0x5D, 0x7D, 0x5D, 0x7D] {
        sequence = sequence.next();
        let control = FrameControl::request(FcFunction::SrdHigh, sequence);
        assert_eq!(control.0, expected);
        assert!(!fcb.repeats(2, control));
        // The first of a sequence is always new.
        assert_eq!(fcb.repeats(2, control), expected != 0x6D);
    }
    // After 6x the record holds FCB = 1: 7x repeats it.
    assert!(!fcb.repeats(2, FrameControl(0x6D)));
    assert!(fcb.repeats(2, FrameControl(0x7D)));
    // Another master: new, and there is one record.
    assert!(!fcb.repeats(3, FrameControl(0x7D)));
    assert!(!fcb.repeats(2, FrameControl(0x7D)));
    assert!(!fcb.repeats(2, FrameControl(0x4D)));
    assert!(!fcb.repeats(2, FrameControl(0x7D)));
    fcb.forget();
    assert!(!fcb.repeats(2, FrameControl(0x7D)));
}

/// EN 1: the function codes of the table, and no others.
#[test]
fn functions() {
    let known: Vec<u8> = (0..16)
        .filter(|code| FrameControl(0x40 | code).function().is_some())
        .collect();
    assert_eq!(known, [3, 4, 5, 6, 9, 12, 13, 14, 15]);
    assert_eq!(FrameControl(0x09).function(), None);
    assert_eq!(FrameControl(0x48).status(), None);
    assert_eq!(FrameControl(0x2A).status(), Some(FcStatus::DataHigh));
}

/// EN 2: the configuration bytes of the GSD.
#[test]
fn configuration() {
    for (octet, count) in [(0xF3, 4), (0xF1, 2), (0xF5, 6)] {
        let byte = CfgByte::decode(octet).unwrap();
        let parts = (
            byte.inputs,
            byte.outputs,
            byte.words,
            byte.whole,
            byte.count,
        );
        assert_eq!(parts, (true, true, true, true, count));
        assert_eq!(byte.octets(), 2 * usize::from(count));
    }
    for octet in 0..=255 {
        match CfgByte::decode(octet) {
            Some(byte) => assert_eq!(byte.encode(), Some(octet)),
            None => assert_eq!(octet & 0x30, 0),
        }
    }
    assert_eq!(
        format!("{}", CfgByte::decode(0xF3).unwrap()),
        "4 words, inputs and outputs, consistent as a whole"
    );
}

/// EN 2: groups and the watchdog.
#[test]
fn commands_and_parameters() {
    let freeze = GlobalControl::decode(&[0x08, 0x02]).unwrap();
    assert!(freeze.has(GlobalControl::FREEZE) && freeze.is_for(0x06) && !freeze.is_for(0x01));
    assert!(GlobalControl::decode(&[0, 0]).unwrap().is_for(0));
    assert_eq!(GlobalControl::decode(&[0]), None);
    // profirust: 300 ms as 01 1E.
    let prm = SetPrm::decode(&[0x88, 0x01, 0x1E, 0x0B, 0x75, 0x31, 0x00, 0xAA]).unwrap();
    assert_eq!(prm.watchdog_tens_of_ms(), Some(30));
    assert_eq!(prm.user, [0xAA]);
    assert_eq!(SetPrm::lock(1).watchdog_tens_of_ms(), None);
    assert_eq!(SetPrm::decode(&[0; 6]), None);
    let lost = Diagnosis {
        status: [0x08, 0x04, 0],
        master: Some(2),
        ident: 0x7531,
        extension: Some(4),
    };
    assert_eq!(
        &*lost.encode(),
        [0x08, 0x04, 0x00, 0x02, 0x75, 0x31, 0x02, 0x04]
    );
    assert_eq!(Diagnosis::decode(&lost.encode()), Some(lost));
    assert_eq!(Diagnosis::decode(&[0; 7]), None);
}

fn any_telegram() -> impl Strategy<Value = Telegram> {
    let sap = || prop::option::of(0..=LAST_SAP);
    let addresses = (0..=BROADCAST, 0..=LAST_ADDRESS, 0u8..0x80, sap(), sap());
    let pdu = (
        addresses,
        prop::collection::vec(any::<u8>(), 0..=244),
        any::<bool>(),
    );
    let pdu = pdu.prop_map(|((da, sa, fc, dsap, ssap), data, fixed)| {
        let pdu = Pdu::with_saps(da, sa, FrameControl(fc), dsap, ssap, &data).unwrap();
        Telegram::Pdu(if fixed { pdu.in_fixed_form() } else { pdu })
    });
    prop_oneof![
        8 => pdu,
        1 => (any::<u8>(), any::<u8>()).prop_map(|(da, sa)| Telegram::Token { da, sa }),
        1 => Just(Telegram::Confirmation),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A telegram is what its octets say; every proper prefix is the beginning of one; octets behind it do not count.
    #[test]
    fn round_trip(telegram in any_telegram(), behind in prop::collection::vec(any::<u8>(), 0..4)) {
        let all = telegram.encode();
        for end in 0..all.len() {
            prop_assert_eq!(Telegram::decode(&all[..end]), Decoded::NeedMore);
        }
        let mut longer = all.to_vec();
        longer.extend(&behind);
        let expected = Decoded::Value { value: telegram, used: all.len() };
        prop_assert_eq!(Telegram::decode(&longer), expected);
    }

    /// Any octets give one of the three answers, and more octets never change an answer that is not "need more".
    #[test]
    fn any_octets(start in prop::sample::select(&[SD1, SD2, SD3, SD4, SC, 0][..]), mut rest in prop::collection::vec(any::<u8>(), 0..40), length in 0u8..20) {
        if start == SD2 && rest.len() > 3 {
            rest[..3].copy_from_slice(&[length, length, SD2]);
        }
        rest.insert(0, start);
        let mut settled = Decoded::NeedMore;
        for end in 0..=rest.len() {
            let now = Telegram::decode(&rest[..end]);
            if let Decoded::Bad { offset, .. } = now {
                prop_assert!(offset < end);
            }
            if settled != Decoded::NeedMore {
                prop_assert_eq!(&now, &settled);
            }
            settled = now;
        }
    }

    /// One flipped bit of SD1, SD2 or SD3 gives no telegram of the same length: FCS, the lengths or the start catch it.
    #[test]
    fn one_flipped_bit(telegram in any_telegram(), place in any::<prop::sample::Index>(), bit in 0..8) {
        prop_assume!(telegram.pdu().is_some());
        let mut all = telegram.encode().to_vec();
        let place = place.index(all.len());
        all[place] ^= 1u8 << bit;
        match Telegram::decode(&all) {
            Decoded::Value { used, .. } => prop_assert_ne!(used, all.len()),
            Decoded::NeedMore | Decoded::Bad { .. } => {}
        }
    }
}
