//! Deviations in telegrams, addresses, process data and the line itself (ND21 8.2, 9.1 to 9.4).

use super::how::{Deviation, How, NEXT};
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::bus_end::Place;
use harness_proto::novobus::sync::{PAUSE, SYNCO};
use harness_proto::time::Span;

/// Bit 4 of a sync byte, which is 0 (ND21 9.2).
const BIT_4: u8 = 1 << 4;

/// Bit 7 of a sync byte, which is 1.
const BIT_7: u8 = 1 << 7;

/// The table.
pub(super) static DEVIATIONS: &[Deviation] = &[
    Deviation {
        name: "swallows-synco",
        section: "9.2",
        about: "it swallows SYNCO instead of passing it on",
        behind_the_bus: false,
        how: How::Says(|m, byte| (!m.at_sync(SYNCO)).then_some(byte)),
    },
    Deviation {
        name: "passes-pause-on",
        section: "9.2",
        about: "it passes PAUSE on instead of swallowing it",
        behind_the_bus: false,
        how: How::Mistakes(
            |m| {
                if m.at_sync(PAUSE) {
                    Received::good(SYNCO)
                } else {
                    m.received
                }
            },
            |m, byte| Some(if m.at_sync(PAUSE) { PAUSE } else { byte }),
        ),
    },
    Deviation {
        name: "accepts-bad-sync-bytes",
        section: "9.2",
        about: "it passes a byte on that is no sync byte where one is due",
        behind_the_bus: false,
        how: How::Mistakes(
            |m| {
                if m.bad_sync() {
                    Received::good(SYNCO)
                } else {
                    m.received
                }
            },
            |m, byte| Some(if m.bad_sync() { m.received.byte } else { byte }),
        ),
    },
    Deviation {
        name: "ignores-bit-4-of-sync-bytes",
        section: "9.2",
        about: "it takes a sync byte with bit 4 set for one without",
        behind_the_bus: false,
        how: How::Mistakes(
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
    },
    Deviation {
        name: "ignores-bit-7-of-sync-bytes",
        section: "9.2",
        about: "it takes 02 to 0F for sync bytes, as if bit 7 were set",
        behind_the_bus: false,
        how: How::Mistakes(
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
    },
    Deviation {
        name: "repeats-sync-bytes",
        section: "9.2",
        about: "it sends every sync byte with an address twice",
        behind_the_bus: false,
        how: How::Repeats(|m| {
            m.place == Place::Sync && m.received.byte & 0xF0 == SYNCO && m.received.byte > PAUSE
        }),
    },
    Deviation {
        name: "forgets-its-address",
        section: "9.2",
        about: "it never takes a telegram with a short address for its own",
        behind_the_bus: false,
        how: How::ReadsFrom(|place, address| {
            if place == Place::Sync && address == ram::BUS_ADDR {
                0x2F00
            } else {
                address
            }
        }),
    },
    Deviation {
        name: "next-drive-is-same-drive",
        section: "9.2",
        about: "it takes \"the next drive\" for \"the same drive\"",
        behind_the_bus: false,
        how: How::Mistakes(
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
    },
    Deviation {
        name: "increments-twice",
        section: "9.3",
        about: "it adds 2 to the address byte",
        behind_the_bus: false,
        how: How::Hears(|m| {
            if m.place == Place::Address {
                m.good(m.received.byte.wrapping_add(1))
            } else {
                m.received
            }
        }),
    },
    Deviation {
        name: "does-not-increment",
        section: "9.3",
        about: "it passes the address byte on unchanged",
        behind_the_bus: false,
        how: How::Hears(|m| {
            if m.place == Place::Address {
                m.good(m.received.byte.wrapping_sub(1))
            } else {
                m.received
            }
        }),
    },
    Deviation {
        name: "answers-next-address",
        section: "9.3",
        about: "it takes the address FF for its own, and not 00",
        behind_the_bus: false,
        how: How::Mistakes(
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
    },
    Deviation {
        name: "increments-seven-bits",
        section: "9.3",
        about: "it loses the carry into bit 7 of the address byte",
        behind_the_bus: false,
        how: How::Hears(|m| {
            if m.place == Place::Address && m.received.byte == 0x7F {
                m.good(0xFF)
            } else {
                m.received
            }
        }),
    },
    Deviation {
        name: "answers-late",
        section: "8.2",
        about: "it sends every byte 200 us later than a byte time after it came in",
        behind_the_bus: false,
        how: How::Late(Span::from_micros(200)),
    },
    Deviation {
        name: "forwards-without-delay",
        section: "8.2",
        about: "it passes every byte on while it still comes in, 250 us early",
        behind_the_bus: false,
        how: How::Early(Span::from_micros(250)),
    },
    Deviation {
        name: "process-data-low-first",
        section: "9.4",
        about: "it sends the low byte of its process data first",
        behind_the_bus: false,
        how: How::ReadsFrom(|place, address| {
            if place == Place::ProcessHigh && address != ram::DATA_OUT {
                address ^ 1
            } else {
                address
            }
        }),
    },
    Deviation {
        name: "process-data-in-swapped",
        section: "9.4",
        about: "it writes the process data that come in with the low byte first",
        behind_the_bus: false,
        how: How::Writes(|w| Some((w.address ^ u16::from(w.place == Place::ProcessLow), w.data))),
    },
    Deviation {
        name: "process-data-ignored",
        section: "9.4",
        about: "it does not write the process data that come in",
        behind_the_bus: false,
        how: How::Writes(|w| (w.place != Place::ProcessLow).then_some((w.address, w.data))),
    },
    Deviation {
        name: "drops-every-100th-byte",
        section: "9.1",
        about: "it does not answer every hundredth byte",
        behind_the_bus: false,
        how: How::Says(|m, byte| (m.nth % 100 != 0).then_some(byte)),
    },
    Deviation {
        name: "doubles-every-100th-byte",
        section: "9.1",
        about: "it answers every hundredth byte twice",
        behind_the_bus: false,
        how: How::Repeats(|m| m.nth % 100 == 0),
    },
    Deviation {
        name: "spoils-every-100th-byte",
        section: "9.1",
        about: "bit 0 of every hundredth byte it sends is wrong",
        behind_the_bus: false,
        how: How::Says(|m, byte| Some(byte ^ u8::from(m.nth % 100 == 0))),
    },
];
