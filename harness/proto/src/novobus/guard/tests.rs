//! Tests of the table and of the gate: what is denied, and where doubt begins, each seen by itself. What drives would make of
//! all of it is the property's business (`harness/novobus/src/tests/guard`).

use super::{Cause, DriveAct, Guard, Limits, Need};
use crate::nd21::ram;
use crate::novobus::address::RingSize;
use crate::novobus::check_sequence::CHECK_SEQUENCE;
use crate::time::{Instant, Span};
use alloc::vec;
use alloc::vec::Vec;

/// A guard after the recovery and these bytes, of which the last one may be damaged; or why one of them did not pass.
fn behind(limits: Limits, bytes: &[u8], damaged: bool) -> Result<Guard, Cause> {
    let size = RingSize::new(1).expect("1 to 250");
    let mut guard = Guard::new(size, limits);
    for byte in CHECK_SEQUENCE {
        guard.admit(Instant::START, byte, false).expect("recovery");
    }
    for (index, &byte) in bytes.iter().enumerate() {
        let last = index + 1 == bytes.len();
        guard
            .admit(Instant::START, byte, damaged && last)
            .map_err(|denial| denial.cause)?;
    }
    Ok(guard)
}

fn passes(bytes: &[u8]) -> bool {
    behind(Limits::default(), bytes, false).is_ok()
}

fn doubt(limits: Limits, bytes: &[u8], damaged: bool) -> bool {
    behind(limits, bytes, damaged).expect("all pass").in_doubt()
}

/// A telegram to the drive of a ring of one: `WriteByte`.
fn write(address: u16, data: u8) -> [u8; 7] {
    let [high, low] = address.to_be_bytes();
    let sum = 0x82_u8
        .wrapping_add(data)
        .wrapping_add(low)
        .wrapping_add(high);
    [0x8A, 0xFF, 0x82, data, low, high, sum.max(1)]
}

/// The steps that write a byte of the EEPROM (ND21 14.10.5.3).
fn write_eeprom(address: u8, data: u8) -> Vec<u8> {
    let steps = [
        (ram::EEPROM_BUFFER, address),
        (ram::EEPROM_BUFFER + 1, data),
        (ram::EEPROM_CONTROL, 0x82),
    ];
    steps.map(|(cell, byte)| write(cell, byte)).concat()
}

/// ND21 14.10.5: what reads a byte passes, what writes one and programs all does not.
#[test]
fn the_eeprom_controller() {
    assert!(passes(&write(ram::EEPROM_CONTROL, 0x81)));
    let [motion, eeprom] = [(true, false), (false, true)].map(|(motion, eeprom)| Limits {
        motion,
        eeprom,
        ..Limits::default()
    });
    for bytes in [
        write_eeprom(0x60, 0x82),
        write(ram::EEPROM_CONTROL, 0x84).to_vec(),
    ] {
        assert!(behind(motion, &bytes, false).is_err(), "{bytes:02X?}");
        assert!(behind(eeprom, &bytes, false).is_ok(), "{bytes:02X?}");
    }
}

/// ND21 14.10.2: what switches the watch over silences on needs a permission of its own, by whichever way.
#[test]
fn monitoring_needs_its_own_permission() {
    let refuses = Limits {
        monitoring: false,
        ..Limits::unlimited()
    };
    let allows = Limits {
        monitoring: true,
        ..refuses
    };
    // Flags2 bit 2: Or, WriteByte, a word over it and its neighbours.
    let words = [(0x56_u8, 0x0004_u16), (0x57, 0x0400)].map(|(low, data)| {
        let [upper, lower] = data.to_be_bytes();
        let sum = [0x63, lower, upper, low, 0xFF]
            .iter()
            .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        vec![0x8C, 0xFF, 0x63, lower, upper, low, 0xFF, sum]
    });
    let [over, from] = words;
    let cases = [
        vec![0x88, 0xFF, 0xA5, 0x04, 0x57, 0x01],
        write(ram::FLAGS2, 0x04).to_vec(),
        over,
        from,
        // EEPROM 47 bit 7, and a cell that may be it, with data that may be it.
        write_eeprom(0x47, 0x80),
        write(ram::EEPROM_CONTROL, 0x82).to_vec(),
        [
            &write(ram::EEPROM_BUFFER, 0x47)[..],
            &write(ram::EEPROM_CONTROL, 0x82),
        ]
        .concat(),
        // The byte that was read stands in the buffer.
        [
            &write_eeprom(0x60, 0)[..14],
            &write(ram::EEPROM_CONTROL, 0x81),
            &write(ram::EEPROM_CONTROL, 0x82),
        ]
        .concat(),
    ];
    for bytes in cases {
        let denied = behind(refuses, &bytes, false);
        let Err(Cause::NotAllowed { missing, .. }) = denied else {
            panic!("{bytes:02X?}");
        };
        assert!(missing.contains(Need::MONITORING), "{bytes:02X?}");
        assert!(behind(allows, &bytes, false).is_ok(), "{bytes:02X?}");
    }
    for bytes in [
        write_eeprom(0x47, 0x7F),
        write_eeprom(0x46, 0xFF),
        write(ram::FLAGS2, 0xFB).to_vec(),
    ] {
        assert!(behind(refuses, &bytes, false).is_ok(), "{bytes:02X?}");
    }
}

/// ND21 9.2: "next" means the drive of the address counted up. The other drive's half command would make its last byte an address.
#[test]
fn next_completes_the_command_of_the_next_drive() {
    let half = [0x88, 0xFF, 0x82, 0x01, 0x08, 0xFF];
    let other = [0x82, 0xFE, 0xC0];
    let mut bytes = [&half[..], &other].concat();
    assert!(passes(&bytes));
    bytes.extend([0xE2, 0x8A]);
    assert!(!passes(&bytes));
}

/// ND21 9.8: the check sequence makes drives forget half commands, so what follows begins a new one.
#[test]
fn the_recovery_forgets_half_commands() {
    // C0 08 of a read; after the recovery 82 begins a write.
    let mut bytes = [&[0x84, 0xFF, 0xC0, 0x08][..], &CHECK_SEQUENCE].concat();
    bytes.extend([0x8A, 0xFF, 0x82, 0x01, 0x08, 0xFF]);
    assert!(passes(&bytes));
    bytes.push(0x8A);
    assert!(!passes(&bytes));
}

/// ND21 9.7: counted up by drives in the error mode it would be the check sequence.
#[test]
fn the_shifted_check_sequence() {
    for shift in 0..=249_u8 {
        let mut bytes = [0x8A_u8, 0x00, 0xFF, 0x44, 0x72, 0x4C, 0x41];
        for byte in &mut bytes[2..] {
            *byte = byte.wrapping_sub(shift);
        }
        let denied = behind(Limits::default(), &bytes, false);
        assert!(matches!(denied, Err(Cause::CheckSequence)), "{shift}");
    }
}

/// ND21 9.7, 9.8: behind a bad sync byte and 17 zeros every drive waits for the check sequence, and what breaks it off may be tried. Where a drive
/// may be elsewhere, and with what may be a sync byte, it may not.
#[test]
fn a_broken_check_sequence() {
    let zeros = [0_u8; 17];
    let broken = |byte: u8| [&zeros[..], &[0xFF, 0x44, byte, 0x72, 0x4C, 0x41, 0x80]].concat();
    assert!(doubt(Limits::default(), &broken(0x00), false));
    assert!(doubt(Limits::default(), &broken(0x01), false));
    assert!(
        passes(&[&[0x08][..], &broken(0x7F)].concat()),
        "a bad sync byte"
    );
    assert!(!passes(&broken(0x82)), "a sync byte");
    assert!(
        !passes(&[&[0xC8][..], &broken(0x01)].concat()),
        "perhaps no bad sync byte"
    );
    assert!(
        !passes(&[&zeros[1..], &[0xFF, 0x44, 0x01]].concat()),
        "16 zeros"
    );
    assert!(passes(&[&zeros[..], &[1; 8]].concat()));
    assert!(!passes(&[&zeros[..], &[1; 9]].concat()), "too many");
    assert!(passes(&[&zeros[..], &[1; 8], &zeros, &[1; 8]].concat()));
    let whole = [&zeros[..], &[0x01, 0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80]].concat();
    assert!(doubt(Limits::default(), &whole, false), "without zeros");
    assert!(
        !passes(&[&whole[..], &[0x01]].concat()),
        "out of the error mode"
    );
}

/// ND21 9.6: no drive executes a command whose checking byte is wrong. A wrong one may, so it passes only where it may be executed.
#[test]
fn a_wrong_checking_byte_allows_nothing() {
    for (address, permitted) in [(ram::EEPROM_BUFFER, true), (ram::NSOLL, false)] {
        let mut bytes = write(address, 0x7F);
        bytes[6] = bytes[6].wrapping_add(1);
        assert_eq!(
            passes(&bytes),
            permitted,
            "{address:04X} {:?}",
            behind(Limits::default(), &bytes, false).err()
        );
        assert!(behind(Limits::unlimited(), &bytes, false).is_ok());
    }
}

#[test]
fn where_doubt_begins() {
    let none = Limits::default();
    assert!(!doubt(none, &[0x80], false));
    assert!(doubt(none, &[0x80], true), "a line error");
    let wrong = [0x88, 0xFF, 0xC0, 0x08, 0xFF, 0xC8];
    assert!(!doubt(none, &wrong[..5], false));
    assert!(doubt(none, &wrong, false), "a wrong checking byte");
    assert!(doubt(none, &[0x82, 0xFF, 0x00], false), "no command byte");
    assert!(doubt(none, &[0x22], false), "no sync byte");
    // Address byte 00, which no drive has, and seven zeros to it.
    let zeros = [0x8E, 0, 0, 0, 0, 0, 0, 0, 0];
    assert!(!doubt(none, &zeros[..8], false));
    assert!(doubt(none, &zeros, false), "eight zeros (ND21 9.7)");
    let reset = Limits {
        motion: true,
        reset: true,
        ..none
    };
    assert!(doubt(reset, &[0x86, 0xFF, 0xDD, 0x21, 0xFE], false));
}

/// ND21 10.5: what follows a reset is denied because of the reset, until a check sequence.
#[test]
fn the_reason_of_a_doubt_is_named() {
    let reset = Limits {
        motion: true,
        reset: true,
        ..Limits::default()
    };
    let sent = [0x86, 0xFF, 0xDD, 0x21, 0xFE];
    let cause = |limits, bytes: &[u8]| behind(limits, bytes, false).err();
    assert_eq!(
        cause(reset, &[&sent[..], &[0x80]].concat()),
        Some(Cause::BehindReset)
    );
    assert_eq!(
        cause(reset, &[&sent[..], &[0x00, 0x80]].concat()),
        Some(Cause::BehindReset)
    );
    assert_eq!(cause(reset, &[0x22, 0x88]), Some(Cause::InDoubt));
}

/// ND21 9.9: after a silence in the middle of something nothing passes before 40 ms are over, and behind any silence no recovery; where no drive
/// monitors time-outs, everything passes at once.
#[test]
fn behind_a_silence() {
    const TELEGRAM: [u8; 2] = [0x88, 0xFF];
    let behind = |monitored: bool, part: &[u8], silence: u64, bytes: &[u8]| {
        let mut guard = behind(Limits::default(), part, false).expect("harmless");
        if monitored {
            guard.expect_time_outs();
        }
        let later = Instant::START + Span::from_millis(silence);
        let mut admit = |byte: &u8| guard.admit(later, *byte, false);
        bytes
            .iter()
            .try_for_each(&mut admit)
            .map_err(|why| why.cause)
    };
    for (part, bytes, is_kept) in [
        (&TELEGRAM[..], &CHECK_SEQUENCE[..], true),
        (&TELEGRAM, &[0xC0], true),
        (&[0x84, 0xFF, 0xC0, 0x00], &CHECK_SEQUENCE, true),
        (&[0x84, 0xFF, 0xC0, 0x00], &TELEGRAM, true),
        (&[0x80], &CHECK_SEQUENCE, true),
        (&[0x80], &[0x88, 0x00, 0x00, 0x00], false),
    ] {
        for (silence, in_time) in [(0, false), (7, false), (20, true), (39, true), (60, false)] {
            let denied = (is_kept && in_time).then_some(Cause::BehindSilence);
            let found = behind(true, part, silence, bytes).err();
            assert_eq!(found, denied, "{part:02X?}, {silence} ms, {bytes:02X?}");
            assert_eq!(behind(false, part, silence, bytes), Ok(()), "{part:02X?}");
        }
    }
}

/// ND21 9.2, 9.9: the first drive keeps PAUSE to itself, so it is silence for those behind it.
#[test]
fn a_pause_is_silence() {
    let passes = |filler: u8| {
        let mut guard =
            behind(Limits::default(), &[0x84, 0xFF, 0xC0, 0x00], false).expect("a half");
        guard.expect_time_outs();
        let later = Instant::START + Span::from_millis(14);
        guard.admit(later, filler, false).expect("in time");
        guard.admit(later + Span::from_millis(6), 0, false).is_ok()
    };
    assert_eq!([0x80, 0x81].map(passes), [true, false]);
}

/// ND21 9.6, 9.9: drives whose time is up one after the other can send 00 and 01 behind the first two bytes of And and Or.
#[test]
fn what_time_outs_would_complete_is_judged() {
    for part in [[0x88, 0xFF, 0xA4, 0x5C], [0x88, 0xFF, 0xA5, 0x5B]] {
        let last = |monitored: bool| {
            let mut guard = behind(Limits::default(), &part[..3], false).expect("a begin");
            if monitored {
                guard.expect_time_outs();
            }
            guard.admit(Instant::START, part[3], false).is_ok()
        };
        assert_eq!([false, true].map(last), [true, false], "{part:02X?}");
    }
}

/// ND21 14.10.3: `DataIn` may point at a cell where any word may be written, so that a drive can be given back the value that it held.
#[test]
fn data_in_needs_what_the_cell_needs_that_it_points_at() {
    let points_at = |address: u16| DriveAct::WriteByte(ram::DATA_IN, address.to_be_bytes()[1]);
    let motion = Limits {
        motion: true,
        ..Limits::default()
    };
    let slow = Limits {
        max_speed: Some(100),
        ..motion
    };
    for (address, need) in [
        (ram::NSOLL, Need::MOTION),
        (ram::STATUS, Need::MOTION),
        (
            ram::FLAGS2,
            Need::MOTION.and(Need::MONITORING).and(Need::EEPROM),
        ),
        (ram::DATA_IN, Need::EVERYTHING),
        (ram::DATA_IN - 1, Need::EVERYTHING),
        (0xFF6A, Need::EVERYTHING),
    ] {
        let act = points_at(address);
        let needs = act.need();
        assert!(needs.contains(need), "{act}: {needs}");
        assert_eq!(act.passes(&motion), need == Need::MOTION, "{act}");
        assert_eq!(act.passes(&slow), address == ram::NSOLL, "{act}");
        assert!(!act.passes(&Limits::default()), "{act}");
    }
}

/// ND21 9.8: wherever drives stand, a telegram swallows at most nine of the 17 zeros, so the check sequence ends every doubt.
#[test]
fn the_check_sequence_passes_from_the_middle_of_a_telegram() {
    for begun in [
        &[0x88][..],
        &[0x88, 0xFF],
        &[0x88, 0xFF, 0xC0],
        &[0x88, 0xFF, 0xC0, 0x13, 0xFE],
        &[0x8E, 0x05, 0xC0],
    ] {
        let guard = behind(Limits::default(), &[begun, &CHECK_SEQUENCE].concat(), false);
        assert!(guard.expect("it passes").at_rest(), "{begun:02X?}");
        let short = [begun, &CHECK_SEQUENCE[1..]].concat();
        let guard = behind(Limits::default(), &short, false);
        assert!(
            guard.is_err() || guard.is_ok_and(|guard| guard.in_doubt()),
            "{begun:02X?}"
        );
    }
}
