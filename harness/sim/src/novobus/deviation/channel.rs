//! Deviations in the parameter channel (ND21 9.5, 9.6, 10).

use super::how::{Deviation, How, wrong};
use harness_proto::nd21::{PARAMETER_COUNT, PARAMETERS};
use harness_proto::novobus::bus_end::{ParameterByte, Place};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Field, Kind, Reply};
use harness_proto::novobus::error_mode::Marks;
use harness_proto::novobus::memory::{Memory, in_range};
use harness_proto::novobus::output::{Output, OutputChange};

pub(super) static DEVIATIONS: &[Deviation] = &[
    wrong(
        "checksum-not-checked",
        "9.6",
        "it takes any checking byte for right",
        How::Hears(|m| match m.check() {
            Some(right) => m.good(right),
            None => m.received,
        }),
    ),
    wrong(
        "checksum-zero-accepted",
        "9.6",
        "it takes 00 as a checking byte",
        How::Hears(|m| match m.check() {
            Some(1) if m.received.is(0) => m.good(1),
            _ => m.received,
        }),
    ),
    wrong(
        "checksum-wrong",
        "9.6",
        "its checking bytes are one too high",
        How::Says(|m, byte| {
            Some(if m.answers_check().is_some() {
                byte.wrapping_add(1)
            } else {
                byte
            })
        }),
    ),
    wrong(
        "checksum-not-negated",
        "9.6",
        "its checking byte is the sum of the answer and not the negated one",
        How::Says(|m, byte| Some(m.answers_check().map_or(byte, Checksum::plus))),
    ),
    wrong(
        "checksum-zero-sent",
        "9.6",
        "it sends 00 where its checking byte comes out as 00",
        How::Says(|m, byte| {
            Some(
                if m.answers_check().is_some_and(|sum| sum == Checksum::EMPTY) {
                    0
                } else {
                    byte
                },
            )
        }),
    ),
    wrong(
        "c2-is-read-byte",
        "9.5",
        "it takes the command byte C2, which there is not, for ReadByte",
        How::Mistakes(
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
    ),
    wrong(
        "read-word-high-first",
        "10.1",
        "it answers ReadWord with the high byte first",
        How::ReadsFrom(|place, address| reversed(place, Kind::ReadWord, address)),
    ),
    wrong(
        "read-long-reversed",
        "10.1",
        "it answers ReadLong with the lowest byte first",
        How::ReadsFrom(|place, address| reversed(place, Kind::ReadLong, address)),
    ),
    wrong(
        "read-long-stops-after-a-word",
        "10.1",
        "its answer to ReadLong has 00 for the last two bytes",
        How::Says(|m, byte| {
            Some(match m.parameter() {
                Some(ParameterByte {
                    kind: Kind::ReadLong,
                    reply: Reply::Data(2 | 3),
                    ..
                }) => 0,
                _ => byte,
            })
        }),
    ),
    wrong(
        "reads-anywhere",
        "10.1",
        "it permits reads outside the ranges",
        How::Permits(|kind, address| kind.reads() || in_range(kind, address)),
    ),
    wrong(
        "read-word-end-not-checked",
        "10.1",
        "it permits a word of which only the first byte lies in range",
        How::Permits(|kind, address| match kind {
            Kind::ReadWord => in_range(Kind::ReadByte, address),
            Kind::WriteWord => in_range(Kind::WriteByte, address),
            _ => in_range(kind, address),
        }),
    ),
    wrong(
        "fixed-bytes-not-checked",
        "10.1",
        "it takes any byte for the fixed ones of a command",
        How::Hears(|m| match m.parameter() {
            Some(ParameterByte {
                field: Field::Fixed(right),
                ..
            }) => m.good(right),
            _ => m.received,
        }),
    ),
    wrong(
        "writes-before-the-checksum",
        "10.2",
        "it executes WriteByte with the address, before the checking byte",
        How::Acts(|m, memory| {
            if let Some(ParameterByte {
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
    ),
    wrong(
        "write-word-swapped",
        "10.2",
        "it writes the bytes of WriteWord in the wrong order",
        How::Writes(|w| Some((reversed(w.place, Kind::WriteWord, w.address), w.data))),
    ),
    wrong(
        "write-rom-permitted",
        "10.2",
        "it accepts writes outside the RAM, without effect",
        How::Permits(|kind, address| {
            matches!(kind, Kind::WriteByte | Kind::WriteWord) || in_range(kind, address)
        }),
    ),
    wrong(
        "writes-ignored",
        "10.2",
        "it answers WriteByte and does not write",
        How::Writes(|w| (kind(w.place) != Some(Kind::WriteByte)).then_some((w.address, w.data))),
    ),
    wrong(
        "and-is-or",
        "10.3",
        "it does Or where And is asked for",
        How::Writes(|w| {
            Some((
                w.address,
                match w.place {
                    Place::Parameter(p) if p.kind == Kind::And => w.old | p.data[0],
                    _ => w.data,
                },
            ))
        }),
    ),
    wrong(
        "or-is-write",
        "10.3",
        "it writes the mask where Or is asked for",
        How::Writes(|w| {
            Some((
                w.address,
                match w.place {
                    Place::Parameter(p) if p.kind == Kind::Or => p.data[0],
                    _ => w.data,
                },
            ))
        }),
    ),
    wrong(
        "bits-beyond-the-ram",
        "10.3",
        "it permits And and Or above FF7F",
        How::Permits(|kind, address| {
            matches!(kind, Kind::And | Kind::Or) || in_range(kind, address)
        }),
    ),
    wrong(
        "outputs-exchanged",
        "10.4",
        "WriteIO of GPO1 changes GPO2, and the other way round",
        How::Outputs(|change| {
            Some(OutputChange {
                output: match change.output {
                    Output::Gpo1 => Output::Gpo2,
                    Output::Gpo2 => Output::Gpo1,
                },
                ..change
            })
        }),
    ),
    wrong(
        "outputs-inverted",
        "10.4",
        "WriteIO clears what it is to set and sets what it is to clear",
        How::Outputs(|change| {
            Some(OutputChange {
                set: !change.set,
                ..change
            })
        }),
    ),
    wrong(
        "write-io-any-code",
        "10.4",
        "it takes codes above 03 for those of their two lowest bits",
        How::Hears(|m| match m.parameter() {
            Some(ParameterByte {
                field: Field::Code, ..
            }) => m.good(m.received.byte & 3),
            _ => m.received,
        }),
    ),
    wrong(
        "reset-ignored",
        "10.5",
        "it answers ResetH8 and keeps its memory",
        How::Resets(|_| ()),
    ),
    wrong(
        "reset-keeps-parameters",
        "10.5",
        "its parameters are not loaded from the EEPROM at a reset",
        How::Resets(keep_parameters),
    ),
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
