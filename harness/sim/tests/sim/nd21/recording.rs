//! The oscilloscope in the running drive (ND21 14.10.6).

use super::common::Rig;
use harness_proto::nd21::bits::scope_status;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{scope_address, trigger_level_to_raw};
use harness_proto::time::Span;

/// The low byte of a cell's address (14.10.6.1).
fn low(address: u16) -> u8 {
    address.to_le_bytes()[0]
}

/// ND21 14.10.6.6: `nist` is recorded over a run-up, triggered where its high byte passes 8, with 46
/// measurements before (14.10.6.4); the measurements are read back in the printed order.
#[test]
fn run_up_is_recorded() {
    let mut rig = Rig::started();
    rig.write(ram::SCOPE_SIGNAL1, low(ram::NIST));
    rig.write(ram::SCOPE_SIGNAL2, low(ram::NIST));
    rig.write(ram::SCOPE_TRIGGER, low(ram::NIST));
    rig.write(ram::SCOPE_LEVEL, trigger_level_to_raw(8));
    rig.write(ram::SCOPE_TIMER0, 3);
    rig.write(ram::SCOPE_DELAY, 0x2E);
    rig.write_word(ram::SCOPE_COUNTER, 0x00D2);
    rig.write(ram::SCOPE_STATUS, 0x30);
    rig.run(Span::from_millis(50));
    assert_eq!(
        rig.byte(ram::SCOPE_STATUS),
        0x10,
        "armed: below the threshold"
    );
    rig.write_word(ram::NSOLL, 5_662);
    rig.run(Span::from_millis(300));
    assert_eq!(
        rig.byte(ram::SCOPE_STATUS),
        0x10 | scope_status::STOPPED | scope_status::TRIGGERED | scope_status::ARMED
    );
    let pointer = rig.byte(ram::SCOPE_POINTER);
    let samples: Vec<_> = (0..=255)
        .map(|n| rig.byte(scope_address(pointer, n)))
        .collect();
    assert!(samples.is_sorted(), "{samples:?}");
    assert_eq!((samples[45], samples[46]), (7, 8));
    // 432 us a measurement: 16 bits of speed each, 256 of them a unit of the high byte.
    assert_eq!(samples[46 + 16 * 5], 8 + 5);
}

/// ND21 14.10.6.2: with time base 0 the 256 measurements take 27.648 ms, whatever else the drive does.
#[test]
fn time_base_of_14_10_6_2() {
    let mut rig = Rig::started();
    rig.run(Span::from_millis(1_000));
    rig.write(ram::SCOPE_STATUS, scope_status::TRIGGERED);
    rig.write(ram::SCOPE_STATUS, scope_status::STOPPED);
    rig.write_word(ram::SCOPE_COUNTER, 0x0100);
    rig.run(Span::from_micros(50));
    rig.write(ram::SCOPE_STATUS, scope_status::TRIGGERED);
    rig.run(Span::from_micros(27_648 - 108));
    assert_eq!(rig.byte(ram::SCOPE_STATUS) & scope_status::STOPPED, 0);
    rig.run(Span::from_micros(108));
    assert_ne!(rig.byte(ram::SCOPE_STATUS) & scope_status::STOPPED, 0);
}
