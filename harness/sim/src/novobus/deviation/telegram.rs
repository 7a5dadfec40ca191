//! Deviations in telegrams, addresses, process data and the line itself (ND21 8.2, 9.1 to 9.4).

use super::how::{Deviation, How, NEXT, wrong};
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::bus_end::Place;
use harness_proto::novobus::sync::{PAUSE, SYNCO};
use harness_proto::time::Span;

/// Bit 4 of a sync byte, which is 0 (ND21 9.2).
const BIT_4: u8 = 1 << 4;

/// Bit 7 of a sync byte, which is 1.
const BIT_7: u8 = 1 << 7;

pub(super) static DEVIATIONS: &[Deviation] = &[
    wrong(
        "swallows-synco",
        "9.2",
        "it swallows SYNCO instead of passing it on",
        How::Says(|m, byte| (!m.at_sync(SYNCO)).then_some(byte)),
    ),
    wrong(
        "passes-pause-on",
        "9.2",
        "it passes PAUSE on instead of swallowing it",
        How::Mistakes(
            |m| {
                if m.at_sync(PAUSE) {
                    Received::good(SYNCO)
                } else {
                    m.received
                }
            },
            |m, byte| Some(if m.at_sync(PAUSE) { PAUSE } else { byte }),
        ),
    ),
    wrong(
        "accepts-bad-sync-bytes",
        "9.2",
        "it passes a byte on that is no sync byte where one is due",
        How::Mistakes(
            |m| {
                if m.bad_sync() {
                    Received::good(SYNCO)
                } else {
                    m.received
                }
            },
            |m, byte| Some(if m.bad_sync() { m.received.byte } else { byte }),
        ),
    ),
    wrong(
        "ignores-bit-4-of-sync-bytes",
        "9.2",
        "it takes a sync byte with bit 4 set for one without",
        How::Mistakes(
            |m| {
                if m.place == Place::Sync {
                    m.good(m.received.byte & !BIT_4)
                } else {
                    m.received
                }
            },
            |m, byte| {
                Some(if m.place == Place::Sync && byte != 0 {
                    m.received.byte
                } else {
                    byte
                })
            },
        ),
    ),
    wrong(
        "ignores-bit-7-of-sync-bytes",
        "9.2",
        "it takes 02 to 0F for sync bytes, as if bit 7 were set",
        How::Mistakes(
            |m| match (m.place, m.received.byte) {
                (Place::Sync, 0x02..=0x0F) => m.good(m.received.byte | BIT_7),
                _ => m.received,
            },
            |m, byte| {
                Some(if m.place == Place::Sync && byte != 0 {
                    m.received.byte
                } else {
                    byte
                })
            },
        ),
    ),
    wrong(
        "repeats-sync-bytes",
        "9.2",
        "it sends every sync byte with an address twice",
        How::Repeats(|m| {
            m.place == Place::Sync && m.received.byte & 0xF0 == SYNCO && m.received.byte > PAUSE
        }),
    ),
    wrong(
        "forgets-its-address",
        "9.2",
        "it never takes a telegram with a short address for its own",
        How::ReadsFrom(|place, address| {
            if place == Place::Sync && address == ram::BUS_ADDR {
                0x2F00
            } else {
                address
            }
        }),
    ),
    wrong(
        "next-drive-is-same-drive",
        "9.2",
        "it takes \"the next drive\" for \"the same drive\"",
        How::Mistakes(
            |m| {
                if m.next_drive() {
                    m.good(m.received.byte & !NEXT)
                } else {
                    m.received
                }
            },
            |m, byte| {
                Some(if m.next_drive() && byte != 0 {
                    m.received.byte
                } else {
                    byte
                })
            },
        ),
    ),
    wrong(
        "increments-twice",
        "9.3",
        "it adds 2 to the address byte",
        How::Hears(|m| {
            if m.place == Place::Address {
                m.good(m.received.byte.wrapping_add(1))
            } else {
                m.received
            }
        }),
    ),
    wrong(
        "does-not-increment",
        "9.3",
        "it passes the address byte on unchanged",
        How::Hears(|m| {
            if m.place == Place::Address {
                m.good(m.received.byte.wrapping_sub(1))
            } else {
                m.received
            }
        }),
    ),
    wrong(
        "answers-next-address",
        "9.3",
        "it takes the address FF for its own, and not 00",
        How::Mistakes(
            |m| {
                if m.place == Place::Address {
                    m.good(m.received.byte.wrapping_add(1))
                } else {
                    m.received
                }
            },
            |m, byte| {
                Some(if m.place == Place::Address && m.received.error.is_none() {
                    m.received.byte.wrapping_add(1)
                } else {
                    byte
                })
            },
        ),
    ),
    wrong(
        "increments-seven-bits",
        "9.3",
        "it loses the carry into bit 7 of the address byte",
        How::Hears(|m| {
            if m.place == Place::Address && m.received.byte == 0x7F {
                m.good(0xFF)
            } else {
                m.received
            }
        }),
    ),
    wrong(
        "answers-late",
        "8.2",
        "it sends every byte 200 us later than a byte time after it came in",
        How::Late(Span::from_micros(200)),
    ),
    wrong(
        "forwards-without-delay",
        "8.2",
        "it passes every byte on while it still comes in, 250 us early",
        How::Early(Span::from_micros(250)),
    ),
    wrong(
        "process-data-low-first",
        "9.4",
        "it sends the low byte of its process data first",
        How::ReadsFrom(|place, address| {
            if place == Place::ProcessHigh && address != ram::DATA_OUT {
                address ^ 1
            } else {
                address
            }
        }),
    ),
    wrong(
        "process-data-in-swapped",
        "9.4",
        "it writes the process data that come in with the low byte first",
        How::Writes(|w| Some((w.address ^ u16::from(w.place == Place::ProcessLow), w.data))),
    ),
    wrong(
        "process-data-ignored",
        "9.4",
        "it does not write the process data that come in",
        How::Writes(|w| (w.place != Place::ProcessLow).then_some((w.address, w.data))),
    ),
    wrong(
        "drops-every-100th-byte",
        "9.1",
        "it does not answer every hundredth byte",
        How::Says(|m, byte| (m.nth % 100 != 0).then_some(byte)),
    ),
    wrong(
        "doubles-every-100th-byte",
        "9.1",
        "it answers every hundredth byte twice",
        How::Repeats(|m| m.nth % 100 == 0),
    ),
    wrong(
        "spoils-every-100th-byte",
        "9.1",
        "bit 0 of every hundredth byte it sends is wrong",
        How::Says(|m, byte| Some(byte ^ u8::from(m.nth % 100 == 0))),
    ),
];
