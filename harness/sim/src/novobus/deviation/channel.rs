//! Deviations in the parameter channel (ND21 9.5, 9.6, 10).

use super::how::{Deviation, How};
use harness_proto::nd21::{PARAMETER_COUNT, PARAMETERS};
use harness_proto::novobus::bus_end::{Parameter, Place};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Kind, Reply};
use harness_proto::novobus::error_mode::Marks;
use harness_proto::novobus::memory::{Memory, in_range};
use harness_proto::novobus::output::{Output, OutputChange};

/// The table.
pub(super) static DEVIATIONS: &[Deviation] = &[
    Deviation {
        name: "checksum-not-checked",
        section: "9.6",
        about: "it takes any checking byte for right",
        behind_the_bus: false,
        how: How::Hears(|m| match m.check() {
            Some(right) => m.good(right),
            None => m.received,
        }),
    },
    Deviation {
        name: "checksum-zero-accepted",
        section: "9.6",
        about: "it takes 00 as a checking byte",
        behind_the_bus: false,
        how: How::Hears(|m| match m.check() {
            Some(1) if m.received.is(0) => m.good(1),
            _ => m.received,
        }),
    },
    Deviation {
        name: "checksum-wrong",
        section: "9.6",
        about: "its checking bytes are one too high",
        behind_the_bus: false,
        how: How::Says(|m, byte| {
            Some(if m.answers_check().is_some() {
                byte.wrapping_add(1)
            } else {
                byte
            })
        }),
    },
    Deviation {
        name: "checksum-not-negated",
        section: "9.6",
        about: "its checking byte is the sum of the answer and not the negated one",
        behind_the_bus: false,
        how: How::Says(|m, byte| Some(m.answers_check().map_or(byte, Checksum::plus))),
    },
    Deviation {
        name: "checksum-zero-sent",
        section: "9.6",
        about: "it sends 00 where its checking byte comes out as 00",
        behind_the_bus: false,
        how: How::Says(|m, byte| {
            Some(
                if m.answers_check().is_some_and(|sum| sum == Checksum::EMPTY) {
                    0
                } else {
                    byte
                },
            )
        }),
    },
    Deviation {
        name: "c2-is-read-byte",
        section: "9.5",
        about: "it takes the command byte C2, which there is not, for ReadByte",
        behind_the_bus: false,
        how: How::Mistakes(
            |m| {
                if m.place == Place::Command && m.received.byte == 0xC2 {
                    m.good(0xC0)
                } else {
                    m.received
                }
            },
            |m, byte| {
                Some(if m.place == Place::Command && m.received.byte == 0xC2 {
                    0xC2
                } else {
                    byte
                })
            },
        ),
    },
    Deviation {
        name: "read-word-high-first",
        section: "10.1",
        about: "it answers ReadWord with the high byte first",
        behind_the_bus: false,
        how: How::ReadsFrom(|place, address| reversed(place, Kind::ReadWord, address)),
    },
    Deviation {
        name: "read-long-reversed",
        section: "10.1",
        about: "it answers ReadLong with the lowest byte first",
        behind_the_bus: false,
        how: How::ReadsFrom(|place, address| reversed(place, Kind::ReadLong, address)),
    },
    Deviation {
        name: "read-long-stops-after-a-word",
        section: "10.1",
        about: "its answer to ReadLong has 00 for the last two bytes",
        behind_the_bus: false,
        how: How::Says(|m, byte| {
            Some(match m.parameter() {
                Some(Parameter {
                    kind: Kind::ReadLong,
                    reply: Reply::Data(2 | 3),
                    ..
                }) => 0,
                _ => byte,
            })
        }),
    },
    Deviation {
        name: "reads-anywhere",
        section: "10.1",
        about: "it permits reads outside the ranges",
        behind_the_bus: false,
        how: How::Permits(|kind, address| kind.reads() || in_range(kind, address)),
    },
    Deviation {
        name: "read-word-end-not-checked",
        section: "10.1",
        about: "it permits a word of which only the first byte lies in range",
        behind_the_bus: false,
        how: How::Permits(|kind, address| match kind {
            Kind::ReadWord => in_range(Kind::ReadByte, address),
            Kind::WriteWord => in_range(Kind::WriteByte, address),
            _ => in_range(kind, address),
        }),
    },
    Deviation {
        name: "fixed-bytes-not-checked",
        section: "10.1",
        about: "it takes any byte for the fixed ones of a command",
        behind_the_bus: false,
        how: How::Hears(|m| match m.parameter() {
            Some(Parameter {
                field: Field::Fixed(right),
                ..
            }) => m.good(right),
            _ => m.received,
        }),
    },
    Deviation {
        name: "writes-before-the-checksum",
        section: "10.2",
        about: "it executes WriteByte with the address, before the checking byte",
        behind_the_bus: false,
        how: How::Acts(|m, memory| {
            if let Some(Parameter {
                kind: Kind::WriteByte,
                field: Field::AddrH,
                address,
                data,
                ..
            }) = m.parameter()
                && m.step.marks == Marks::NONE
            {
                let [_, low] = address.to_be_bytes();
                memory.write(u16::from_be_bytes([m.received.byte, low]), data[0]);
            }
        }),
    },
    Deviation {
        name: "write-word-swapped",
        section: "10.2",
        about: "it writes the bytes of WriteWord in the wrong order",
        behind_the_bus: false,
        how: How::Writes(|w| Some((reversed(w.place, Kind::WriteWord, w.address), w.data))),
    },
    Deviation {
        name: "write-rom-permitted",
        section: "10.2",
        about: "it accepts writes outside the RAM, without effect",
        behind_the_bus: false,
        how: How::Permits(|kind, address| {
            matches!(kind, Kind::WriteByte | Kind::WriteWord) || in_range(kind, address)
        }),
    },
    Deviation {
        name: "writes-ignored",
        section: "10.2",
        about: "it answers WriteByte and does not write",
        behind_the_bus: false,
        how: How::Writes(|w| {
            (kind(w.place) != Some(Kind::WriteByte)).then_some((w.address, w.data))
        }),
    },
    Deviation {
        name: "and-is-or",
        section: "10.3",
        about: "it does Or where And is asked for",
        behind_the_bus: false,
        how: How::Writes(|w| {
            Some((
                w.address,
                match w.place {
                    Place::Parameter(p) if p.kind == Kind::And => w.old | p.data[0],
                    _ => w.data,
                },
            ))
        }),
    },
    Deviation {
        name: "or-is-write",
        section: "10.3",
        about: "it writes the mask where Or is asked for",
        behind_the_bus: false,
        how: How::Writes(|w| {
            Some((
                w.address,
                match w.place {
                    Place::Parameter(p) if p.kind == Kind::Or => p.data[0],
                    _ => w.data,
                },
            ))
        }),
    },
    Deviation {
        name: "bits-beyond-the-ram",
        section: "10.3",
        about: "it permits And and Or above FF7F",
        behind_the_bus: false,
        how: How::Permits(|kind, address| {
            matches!(kind, Kind::And | Kind::Or) || in_range(kind, address)
        }),
    },
    Deviation {
        name: "outputs-exchanged",
        section: "10.4",
        about: "WriteIO of GPO1 changes GPO2, and the other way round",
        behind_the_bus: false,
        how: How::Outputs(|change| {
            Some(OutputChange {
                output: match change.output {
                    Output::Gpo1 => Output::Gpo2,
                    Output::Gpo2 => Output::Gpo1,
                },
                ..change
            })
        }),
    },
    Deviation {
        name: "outputs-inverted",
        section: "10.4",
        about: "WriteIO clears what it is to set and sets what it is to clear",
        behind_the_bus: false,
        how: How::Outputs(|change| {
            Some(OutputChange {
                set: !change.set,
                ..change
            })
        }),
    },
    Deviation {
        name: "write-io-any-code",
        section: "10.4",
        about: "it takes codes above 03 for those of their two lowest bits",
        behind_the_bus: false,
        how: How::Hears(|m| match m.parameter() {
            Some(Parameter {
                field: Field::Code, ..
            }) => m.good(m.received.byte & 3),
            _ => m.received,
        }),
    },
    Deviation {
        name: "reset-ignored",
        section: "10.5",
        about: "it answers ResetH8 and keeps its memory",
        behind_the_bus: false,
        how: How::Resets(|_| ()),
    },
    Deviation {
        name: "reset-keeps-parameters",
        section: "10.5",
        about: "its parameters are not loaded from the EEPROM at a reset",
        behind_the_bus: false,
        how: How::Resets(keep_parameters),
    },
];

fn kind(place: Place) -> Option<Kind> {
    match place {
        Place::Parameter(parameter) => Some(parameter.kind),
        _ => None,
    }
}

/// For the first of the bytes that a command of this kind touches the last one, and so on.
fn reversed(place: Place, kind: Kind, address: u16) -> u16 {
    match place {
        Place::Parameter(parameter) if parameter.kind == kind => {
            // While its high byte comes in, only the low one of the address is known.
            let offset = address.wrapping_sub(parameter.address) & 0xFF;
            address - 2 * offset + u16::from(kind.width()) - 1
        }
        _ => address,
    }
}

fn keep_parameters(memory: &mut dyn Memory) {
    let cells = PARAMETERS..PARAMETERS + PARAMETER_COUNT;
    let kept: Vec<u8> = cells.clone().map(|address| memory.read(address)).collect();
    memory.reset();
    for (address, byte) in cells.zip(kept) {
        memory.write(address, byte);
    }
}
