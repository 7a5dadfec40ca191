//! Deviations of the drive behind its bus (ND21 13, 14).

use super::how::{Deviation, FalseCell, How, behind_the_bus, wrong};
use harness_proto::nd21::bits::{flags, flags2, hw_version2, ps_status, status};
use harness_proto::nd21::units::{RAMP_OFF, SLIPPING_OFF};
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use harness_proto::novobus::error::BusError;

/// The EEPROM controller reads a byte (ND21 14.10.5.2).
const EEPROM_READ: u8 = 0x81;
/// It writes one (14.10.5.3).
const EEPROM_WRITE: u8 = 0x82;
/// What it shows when it has read a byte, and when it has written one.
const EEPROM_HAS_READ: u8 = 0x20;
const EEPROM_READY: u8 = 0x10;
const NIST_HIGH: u16 = ram::NIST;
const NIST_LOW: u16 = ram::NIST + 1;
const MSOLL_HIGH: u16 = ram::MSOLL;
const MSOLL_LOW: u16 = ram::MSOLL + 1;

const fn word(address: u16, value: fn(u16) -> u16) -> FalseCell {
    FalseCell {
        address,
        word: true,
        value,
    }
}

const fn byte(address: u16, value: fn(u16) -> u16) -> FalseCell {
    FalseCell {
        address,
        word: false,
        value,
    }
}

pub(super) static DEVIATIONS: &[Deviation] = &[
    wrong(
        "status-error-bit-missing",
        "14.4.1",
        "bit 5 of Status does not show an error",
        How::Reads(|peek, a| {
            peek(a)
                & if a == ram::STATUS {
                    !status::ERROR
                } else {
                    0xFF
                }
        }),
    ),
    wrong(
        "status-stop-bit-missing",
        "14.4.1",
        "bit 7 of Status does not show the software stop",
        How::Reads(|peek, a| {
            peek(a)
                & if a == ram::STATUS {
                    !status::STOP
                } else {
                    0xFF
                }
        }),
    ),
    behind_the_bus(
        "stop-ignored",
        "14.10",
        "it cannot be stopped over the bus",
        How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::STATUS {
                    w.data & !status::STOP
                } else {
                    w.data
                },
            ))
        }),
    ),
    behind_the_bus(
        "block-ignored",
        "14.10",
        "it cannot be blocked over the bus",
        How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::STATUS {
                    w.data & !status::BLOCK
                } else {
                    w.data
                },
            ))
        }),
    ),
    behind_the_bus(
        "flags-i2t-missing",
        "14.4.2",
        "Flags does not show that i2t limits the current",
        How::Reads(|peek, a| peek(a) & if a == ram::FLAGS { !flags::I2T } else { 0xFF }),
    ),
    behind_the_bus(
        "flags-block-missing",
        "14.4.2",
        "Flags does not show that the regulator is blocked",
        How::Reads(|peek, a| peek(a) & if a == ram::FLAGS { !flags::BLOCK } else { 0xFF }),
    ),
    behind_the_bus(
        "flags-hardware-stop-missing",
        "14.4.2",
        "Flags does not show the hardware stop",
        How::Reads(|peek, a| {
            peek(a)
                & if a == ram::FLAGS {
                    !flags::HARDWARE_STOP
                } else {
                    0xFF
                }
        }),
    ),
    behind_the_bus(
        "flags2-ok-missing",
        "14.4.3",
        "Flags2 does not show that the bus works",
        How::Reads(|peek, a| peek(a) & if a == ram::FLAGS2 { !flags2::OK } else { 0xFF }),
    ),
    behind_the_bus(
        "flags2-time-out-missing",
        "14.4.3",
        "Flags2 does not show a time-out",
        How::Reads(|peek, a| {
            peek(a)
                & if a == ram::FLAGS2 {
                    !flags2::TIMEOUT
                } else {
                    0xFF
                }
        }),
    ),
    wrong(
        "bus-errors-not-reported",
        "14.11.14",
        "an error of the bus does not come into errorcode",
        How::Reports(|_| None),
    ),
    wrong(
        "reports-parity-as-framing",
        "14.11.14",
        "it reports a parity error as a framing error",
        How::Reports(|error| {
            Some(if error == BusError::Parity {
                BusError::Framing
            } else {
                error
            })
        }),
    ),
    wrong(
        "reports-checksum-as-parameter",
        "14.11.14",
        "it reports a wrong checking byte as a wrong parameter",
        How::Reports(|error| {
            Some(if error == BusError::Checksum {
                BusError::Parameter
            } else {
                error
            })
        }),
    ),
    wrong(
        "reports-time-out-as-sync",
        "14.11.14",
        "it reports a time-out as a bad sync byte",
        How::Reports(|error| {
            Some(if error == BusError::TimeOut {
                BusError::Sync
            } else {
                error
            })
        }),
    ),
    behind_the_bus(
        "errors-not-confirmed",
        "14.10.1",
        "AF in errorcode does not delete an error",
        How::Writes(|w| {
            (w.address != ram::ERRORCODE || w.data != CONFIRM_ERROR).then_some((w.address, w.data))
        }),
    ),
    behind_the_bus(
        "eeprom-reads-inverted",
        "14.10.5",
        "what is read from its EEPROM is inverted",
        How::Reads(|peek, a| peek(a) ^ if a == ram::EEPROM_BUFFER { 0xFF } else { 0 }),
    ),
    behind_the_bus(
        "eeprom-not-written",
        "14.10.5",
        "it reads a byte of its EEPROM where it is to write one",
        How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::EEPROM_CONTROL && w.data == EEPROM_WRITE {
                    EEPROM_READ
                } else {
                    w.data
                },
            ))
        }),
    ),
    behind_the_bus(
        "eeprom-read-ends-as-a-write",
        "14.10.5",
        "it reports that a byte of its EEPROM has been read by bit 4, which reports a write",
        How::Reads(|peek, a| match (a, peek(a)) {
            (ram::EEPROM_CONTROL, EEPROM_HAS_READ) => EEPROM_READY,
            (_, held) => held,
        }),
    ),
    behind_the_bus(
        "eeprom-never-ready",
        "14.10.5",
        "its EEPROM controller reports neither by bit 4 nor by bit 5 that it has come to an end",
        How::Reads(|peek, a| match a {
            ram::EEPROM_CONTROL => peek(a) & !(EEPROM_READY | EEPROM_HAS_READ),
            _ => peek(a),
        }),
    ),
    behind_the_bus(
        "position-one-increment-off",
        "14.5.5",
        "lageist is one increment too high",
        How::Reads(|peek, a| peek(a).wrapping_add(u8::from(a == ram::LAGEIST + 1))),
    ),
    behind_the_bus(
        "speed-sign-wrong",
        "14.5.3.1",
        "nist has the wrong sign",
        How::Reads(|peek, a| {
            peek(a)
                ^ if matches!(a, NIST_HIGH | NIST_LOW) {
                    0xFF
                } else {
                    0
                }
        }),
    ),
    behind_the_bus(
        "torque-sign-wrong",
        "14.5.2",
        "msoll has the wrong sign",
        How::Reads(|peek, a| {
            peek(a)
                ^ if matches!(a, MSOLL_HIGH | MSOLL_LOW) {
                    0xFF
                } else {
                    0
                }
        }),
    ),
    behind_the_bus(
        "cooler-too-warm",
        "14.5.7.1",
        "TempKK is ten units too low, which is too warm",
        How::Reads(|peek, a| peek(a).wrapping_sub(if a == ram::TEMP_KK { 10 } else { 0 })),
    ),
    behind_the_bus(
        "positioning-never-finished",
        "13.3.1",
        "ps_status does not show that a positioning is finished",
        How::Reads(|peek, a| {
            peek(a)
                & if a == ram::PS_STATUS {
                    !ps_status::FINISHED
                } else {
                    0xFF
                }
        }),
    ),
    behind_the_bus(
        "direction-reversed",
        "14.5.3.1",
        "it turns the other way than nsoll says",
        How::Holds(&[word(ram::NSOLL, u16::wrapping_neg)]),
    ),
    behind_the_bus(
        "speed-limit-ignored",
        "14.5.3.2",
        "it turns faster than nMax",
        How::Holds(&[word(ram::N_MAX, |_| 0x7FFF)]),
    ),
    behind_the_bus(
        "ramps-ignored",
        "14.5.4",
        "it knows no ramps",
        How::Holds(&[
            word(ram::N_RAMPE_PLUS, |_| RAMP_OFF),
            word(ram::N_RAMPE_MINUS, |_| RAMP_OFF),
        ]),
    ),
    behind_the_bus(
        "ramps-half-as-steep",
        "14.5.4",
        "its ramps take twice as long",
        How::Holds(&[
            word(ram::N_RAMPE_PLUS, |ramp| ramp / 2),
            word(ram::N_RAMPE_MINUS, |ramp| ramp / 2),
        ]),
    ),
    behind_the_bus(
        "current-limit-ignored",
        "14.5.1.2",
        "its motor may have more current than imax",
        How::Holds(&[byte(ram::IMAX, |_| 0x7F)]),
    ),
    behind_the_bus(
        "i2t-never-limits",
        "14.5.1.2",
        "its motor may have the peak current for ever",
        How::Holds(&[byte(ram::I0, |_| 0x7F)]),
    ),
    behind_the_bus(
        "slipping-never",
        "14.5.6",
        "it does not notice a slipping error",
        How::Holds(&[word(ram::SLIPPING_ERROR, |_| SLIPPING_OFF)]),
    ),
    behind_the_bus(
        "window-ignored",
        "13.1.4",
        "it reports \"in position\" or speed 0 far outside the window",
        How::Holds(&[byte(ram::WINDOW, |_| 0xFF)]),
    ),
    behind_the_bus(
        "end-switches-inverted",
        "14.3.3",
        "it takes its end switches for active at the other level",
        How::Holds(&[byte(ram::HW_VERSION2, |v| {
            v ^ u16::from(hw_version2::END_SWITCH_HIGH)
        })]),
    ),
    behind_the_bus(
        "over-temperature-ignored",
        "14.5.7.1",
        "it does not notice that its cooler is too hot",
        How::Holds(&[byte(ram::MAX_TEMP_KK, |_| 0)]),
    ),
    behind_the_bus(
        "target-one-increment-off",
        "13.3.2.1",
        "it goes one increment beyond its target",
        How::Holds(&[word(ram::PS_POSITION_L, |l| l.wrapping_add(1))]),
    ),
    behind_the_bus(
        "reference-point-ignored",
        "13.1.4",
        "it takes 0 turns for the reference point, whatever RefUmdr0 says",
        How::Holds(&[word(ram::REF_UMDR0, |_| 0)]),
    ),
];
