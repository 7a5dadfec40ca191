//! Deviations of the drive behind its bus (ND21 13, 14).

use super::how::{Deviation, Held, How};
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

const fn word(address: u16, value: fn(u16) -> u16) -> Held {
    Held {
        address,
        word: true,
        value,
    }
}

const fn byte(address: u16, value: fn(u16) -> u16) -> Held {
    Held {
        address,
        word: false,
        value,
    }
}

/// The table.
pub(super) static DEVIATIONS: &[Deviation] = &[
    Deviation {
        name: "status-error-bit-missing",
        section: "14.4.1",
        about: "bit 5 of Status does not show an error",
        behind_the_bus: false,
        how: How::Reads(|peek, a| {
            peek(a)
                & if a == ram::STATUS {
                    !status::ERROR
                } else {
                    0xFF
                }
        }),
    },
    Deviation {
        name: "status-stop-bit-missing",
        section: "14.4.1",
        about: "bit 7 of Status does not show the software stop",
        behind_the_bus: false,
        how: How::Reads(|peek, a| {
            peek(a)
                & if a == ram::STATUS {
                    !status::STOP
                } else {
                    0xFF
                }
        }),
    },
    Deviation {
        name: "stop-ignored",
        section: "14.10",
        about: "it cannot be stopped over the bus",
        behind_the_bus: true,
        how: How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::STATUS {
                    w.data & !status::STOP
                } else {
                    w.data
                },
            ))
        }),
    },
    Deviation {
        name: "block-ignored",
        section: "14.10",
        about: "it cannot be blocked over the bus",
        behind_the_bus: true,
        how: How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::STATUS {
                    w.data & !status::BLOCK
                } else {
                    w.data
                },
            ))
        }),
    },
    Deviation {
        name: "flags-i2t-missing",
        section: "14.4.2",
        about: "Flags does not show that i2t limits the current",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a) & if a == ram::FLAGS { !flags::I2T } else { 0xFF }),
    },
    Deviation {
        name: "flags-block-missing",
        section: "14.4.2",
        about: "Flags does not show that the regulator is blocked",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a) & if a == ram::FLAGS { !flags::BLOCK } else { 0xFF }),
    },
    Deviation {
        name: "flags-hardware-stop-missing",
        section: "14.4.2",
        about: "Flags does not show the hardware stop",
        behind_the_bus: true,
        how: How::Reads(|peek, a| {
            peek(a)
                & if a == ram::FLAGS {
                    !flags::HARDWARE_STOP
                } else {
                    0xFF
                }
        }),
    },
    Deviation {
        name: "flags2-ok-missing",
        section: "14.4.3",
        about: "Flags2 does not show that the bus works",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a) & if a == ram::FLAGS2 { !flags2::OK } else { 0xFF }),
    },
    Deviation {
        name: "flags2-time-out-missing",
        section: "14.4.3",
        about: "Flags2 does not show a time-out",
        behind_the_bus: true,
        how: How::Reads(|peek, a| {
            peek(a)
                & if a == ram::FLAGS2 {
                    !flags2::TIMEOUT
                } else {
                    0xFF
                }
        }),
    },
    Deviation {
        name: "bus-errors-not-reported",
        section: "14.11.14",
        about: "an error of the bus does not come into errorcode",
        behind_the_bus: false,
        how: How::Reports(|_| None),
    },
    Deviation {
        name: "reports-parity-as-framing",
        section: "14.11.14",
        about: "it reports a parity error as a framing error",
        behind_the_bus: false,
        how: How::Reports(|error| {
            Some(if error == BusError::Parity {
                BusError::Framing
            } else {
                error
            })
        }),
    },
    Deviation {
        name: "reports-checksum-as-parameter",
        section: "14.11.14",
        about: "it reports a wrong checking byte as a wrong parameter",
        behind_the_bus: false,
        how: How::Reports(|error| {
            Some(if error == BusError::Checksum {
                BusError::Parameter
            } else {
                error
            })
        }),
    },
    Deviation {
        name: "reports-time-out-as-sync",
        section: "14.11.14",
        about: "it reports a time-out as a bad sync byte",
        behind_the_bus: false,
        how: How::Reports(|error| {
            Some(if error == BusError::TimeOut {
                BusError::Sync
            } else {
                error
            })
        }),
    },
    Deviation {
        name: "errors-not-confirmed",
        section: "14.10.1",
        about: "AF in errorcode does not delete an error",
        behind_the_bus: true,
        how: How::Writes(|w| {
            (w.address != ram::ERRORCODE || w.data != CONFIRM_ERROR).then_some((w.address, w.data))
        }),
    },
    Deviation {
        name: "eeprom-reads-inverted",
        section: "14.10.5",
        about: "what is read from its EEPROM is inverted",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a) ^ if a == ram::EEPROM_BUFFER { 0xFF } else { 0 }),
    },
    Deviation {
        name: "eeprom-not-written",
        section: "14.10.5",
        about: "it reads a byte of its EEPROM where it is to write one",
        behind_the_bus: true,
        how: How::Writes(|w| {
            Some((
                w.address,
                if w.address == ram::EEPROM_CONTROL && w.data == EEPROM_WRITE {
                    EEPROM_READ
                } else {
                    w.data
                },
            ))
        }),
    },
    Deviation {
        name: "eeprom-read-ends-as-a-write",
        section: "14.10.5",
        about: "it reports that a byte of its EEPROM has been read by bit 4, which reports a write",
        behind_the_bus: true,
        how: How::Reads(|peek, a| match (a, peek(a)) {
            (ram::EEPROM_CONTROL, EEPROM_HAS_READ) => EEPROM_READY,
            (_, held) => held,
        }),
    },
    Deviation {
        name: "eeprom-never-ready",
        section: "14.10.5",
        about: "its EEPROM controller reports neither by bit 4 nor by bit 5 that it has come to an end",
        behind_the_bus: true,
        how: How::Reads(|peek, a| match a {
            ram::EEPROM_CONTROL => peek(a) & !(EEPROM_READY | EEPROM_HAS_READ),
            _ => peek(a),
        }),
    },
    Deviation {
        name: "position-one-increment-off",
        section: "14.5.5",
        about: "lageist is one increment too high",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a).wrapping_add(u8::from(a == ram::LAGEIST + 1))),
    },
    Deviation {
        name: "speed-sign-wrong",
        section: "14.5.3.1",
        about: "nist has the wrong sign",
        behind_the_bus: true,
        how: How::Reads(|peek, a| {
            peek(a)
                ^ if matches!(a, NIST_HIGH | NIST_LOW) {
                    0xFF
                } else {
                    0
                }
        }),
    },
    Deviation {
        name: "torque-sign-wrong",
        section: "14.5.2",
        about: "msoll has the wrong sign",
        behind_the_bus: true,
        how: How::Reads(|peek, a| {
            peek(a)
                ^ if matches!(a, MSOLL_HIGH | MSOLL_LOW) {
                    0xFF
                } else {
                    0
                }
        }),
    },
    Deviation {
        name: "cooler-too-warm",
        section: "14.5.7.1",
        about: "TempKK is ten units too low, which is too warm",
        behind_the_bus: true,
        how: How::Reads(|peek, a| peek(a).wrapping_sub(if a == ram::TEMP_KK { 10 } else { 0 })),
    },
    Deviation {
        name: "positioning-never-finished",
        section: "13.3.1",
        about: "ps_status does not show that a positioning is finished",
        behind_the_bus: true,
        how: How::Reads(|peek, a| {
            peek(a)
                & if a == ram::PS_STATUS {
                    !ps_status::FINISHED
                } else {
                    0xFF
                }
        }),
    },
    Deviation {
        name: "direction-reversed",
        section: "14.5.3.1",
        about: "it turns the other way than nsoll says",
        behind_the_bus: true,
        how: How::Holds(&[word(ram::NSOLL, u16::wrapping_neg)]),
    },
    Deviation {
        name: "speed-limit-ignored",
        section: "14.5.3.2",
        about: "it turns faster than nMax",
        behind_the_bus: true,
        how: How::Holds(&[word(ram::N_MAX, |_| 0x7FFF)]),
    },
    Deviation {
        name: "ramps-ignored",
        section: "14.5.4",
        about: "it knows no ramps",
        behind_the_bus: true,
        how: How::Holds(&[
            word(ram::N_RAMPE_PLUS, |_| RAMP_OFF),
            word(ram::N_RAMPE_MINUS, |_| RAMP_OFF),
        ]),
    },
    Deviation {
        name: "ramps-half-as-steep",
        section: "14.5.4",
        about: "its ramps take twice as long",
        behind_the_bus: true,
        how: How::Holds(&[
            word(ram::N_RAMPE_PLUS, |ramp| ramp / 2),
            word(ram::N_RAMPE_MINUS, |ramp| ramp / 2),
        ]),
    },
    Deviation {
        name: "current-limit-ignored",
        section: "14.5.1.2",
        about: "its motor may have more current than imax",
        behind_the_bus: true,
        how: How::Holds(&[byte(ram::IMAX, |_| 0x7F)]),
    },
    Deviation {
        name: "i2t-never-limits",
        section: "14.5.1.2",
        about: "its motor may have the peak current for ever",
        behind_the_bus: true,
        how: How::Holds(&[byte(ram::I0, |_| 0x7F)]),
    },
    Deviation {
        name: "slipping-never",
        section: "14.5.6",
        about: "it does not notice a slipping error",
        behind_the_bus: true,
        how: How::Holds(&[word(ram::SLIPPING_ERROR, |_| SLIPPING_OFF)]),
    },
    Deviation {
        name: "window-ignored",
        section: "13.1.4",
        about: "it reports \"in position\" or speed 0 far outside the window",
        behind_the_bus: true,
        how: How::Holds(&[byte(ram::WINDOW, |_| 0xFF)]),
    },
    Deviation {
        name: "end-switches-inverted",
        section: "14.3.3",
        about: "it takes its end switches for active at the other level",
        behind_the_bus: true,
        how: How::Holds(&[byte(ram::HW_VERSION2, |v| {
            v ^ u16::from(hw_version2::END_SWITCH_HIGH)
        })]),
    },
    Deviation {
        name: "over-temperature-ignored",
        section: "14.5.7.1",
        about: "it does not notice that its cooler is too hot",
        behind_the_bus: true,
        how: How::Holds(&[byte(ram::MAX_TEMP_KK, |_| 0)]),
    },
    Deviation {
        name: "target-one-increment-off",
        section: "13.3.2.1",
        about: "it goes one increment beyond its target",
        behind_the_bus: true,
        how: How::Holds(&[word(ram::PS_POSITION_L, |l| l.wrapping_add(1))]),
    },
    Deviation {
        name: "reference-point-ignored",
        section: "13.1.4",
        about: "it takes 0 turns for the reference point, whatever RefUmdr0 says",
        behind_the_bus: true,
        how: How::Holds(&[word(ram::REF_UMDR0, |_| 0)]),
    },
];
