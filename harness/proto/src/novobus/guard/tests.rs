//! Tests of the table and of the gate: what is denied, and where doubt begins, each seen by itself. What drives would make of
//! all of it is the property's business (`harness/tests/guard`).

use super::{Cause, Guard, Limits};
use crate::novobus::address::RingSize;
use crate::novobus::check_sequence::CHECK_SEQUENCE;
use crate::time::Instant;

/// A guard behind the recovery and these bytes, of which the last one may be damaged; or why one of them did not pass.
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

/// ND21 14.10.5: what reads a byte passes, what writes one and programs all does not, in each form that could write it.
#[test]
fn the_eeprom_controller() {
    assert!(passes(&[0x8A, 0xFF, 0x82, 0x81, 0x8A, 0xFD, 0x8A]));
    let motion = Limits {
        motion: true,
        ..Limits::default()
    };
    for command in [0x82, 0x84] {
        let bytes: [u8; 7] = [0x8A, 0xFF, 0x82, command, 0x8A, 0xFD, command + 9];
        assert!(behind(motion, &bytes, false).is_err(), "{command:02X}");
        let eeprom = Limits {
            eeprom: true,
            ..Limits::default()
        };
        assert!(behind(eeprom, &bytes, false).is_ok(), "{command:02X}");
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
    // C0 08 of a read; behind the recovery 82 begins a write.
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
    // Address byte 00, which nobody has, and seven zeros to it.
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
