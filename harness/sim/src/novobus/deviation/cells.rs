//! Deviations that show only in some cells, values, masks, addresses or repetitions (ND21 9.4, 9.6, 10, 14).

use super::how::{Deviation, How, Moment, Write, behind_the_bus, wrong};
use harness_proto::nd21::bits::status;
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::bus_end::{ParameterByte, Place};
use harness_proto::novobus::command::{Field, Kind};
use harness_proto::novobus::error_mode::Marks;
use harness_proto::novobus::memory::{Memory, in_range};
use harness_proto::time::Span;

/// The code of a wrong checking byte (ND21 14.11.14).
const WRONG_SUM: [u8; 2] = ErrorCode::NbChecksum.code().to_be_bytes();

pub(super) static DEVIATIONS: &[Deviation] = &[
    // Commands that act without a right checking byte.
    wrong(
        "writes-with-a-wrong-checksum",
        "9.6",
        "it refuses a WriteByte or WriteWord with a wrong checking byte, and writes all the same",
        How::Acts(|m, memory| {
            if let Some(p) =
                refused(m).filter(|p| matches!(p.kind, Kind::WriteByte | Kind::WriteWord))
            {
                for (offset, data) in (0..u16::from(p.kind.width())).zip(p.data) {
                    memory.write(p.address.wrapping_add(offset), data);
                }
            }
        }),
    ),
    wrong(
        "changes-bits-with-a-wrong-checksum",
        "9.6",
        "it refuses an And or Or with a wrong checking byte, and executes it all the same",
        How::Acts(|m, memory| {
            if let Some(p) = refused(m) {
                change_bits(&p, p.address, memory);
            }
        }),
    ),
    wrong(
        "resets-with-a-wrong-checksum",
        "9.6",
        "it refuses a ResetH8 with a wrong checking byte, and forgets its RAM all the same",
        How::Acts(|m, memory| {
            if refused(m).is_some_and(|p| p.kind == Kind::ResetH8) {
                memory.reset();
            }
        }),
    ),
    wrong(
        "word-written-before-the-checksum",
        "10.2",
        "it executes WriteWord with the address, before the checking byte",
        How::Acts(|m, memory| {
            if let Some(p) = m.parameter()
                && p.kind == Kind::WriteWord
                && p.field == Field::AddrH
                && m.step.marks == Marks::NONE
            {
                let address = u16::from_be_bytes([m.received.byte, p.address.to_be_bytes()[1]]);
                memory.write(address, p.data[0]);
                memory.write(address.wrapping_add(1), p.data[1]);
            }
        }),
    ),
    wrong(
        "bits-changed-before-the-checksum",
        "10.3",
        "it executes And and Or with the address, before the checking byte",
        How::Acts(|m, memory| {
            if let Some(p) = m.parameter()
                && p.field == Field::AddrInPage
                && m.step.marks == Marks::NONE
            {
                change_bits(&p, ram::STATUS | u16::from(m.received.byte), memory);
            }
        }),
    ),
    wrong(
        "checksum-bit-7-not-checked",
        "9.6",
        "it does not look at bit 7 of a checking byte",
        How::Hears(|m| checked(m, 0x80)),
    ),
    wrong(
        "checksum-low-nibble-only",
        "9.6",
        "it looks at the four lower bits of a checking byte only",
        How::Hears(|m| checked(m, 0xF0)),
    ),
    // Masks.
    wrong(
        "and-spares-bit-7",
        "10.3",
        "And does not clear bit 7",
        How::Writes(|w| {
            let data = match mask(&w, Kind::And) {
                Some(mask) => w.old & (mask | 0x80),
                None => w.data,
            };
            Some((w.address, data))
        }),
    ),
    wrong(
        "and-of-00-ignored",
        "10.3",
        "And with the mask 00 changes nothing",
        How::Writes(|w| {
            let data = match mask(&w, Kind::And) {
                Some(mask) => {
                    if mask == 0 {
                        w.old
                    } else {
                        w.data
                    }
                }
                None => w.data,
            };
            Some((w.address, data))
        }),
    ),
    wrong(
        "or-spares-bit-0",
        "10.3",
        "Or does not set bit 0",
        How::Writes(|w| {
            let data = match mask(&w, Kind::Or) {
                Some(mask) => w.old | (mask & 0xFE),
                None => w.data,
            };
            Some((w.address, data))
        }),
    ),
    wrong(
        "or-is-exclusive-or",
        "10.3",
        "Or inverts the bits that are set already",
        How::Writes(|w| {
            let data = match mask(&w, Kind::Or) {
                Some(mask) => w.old ^ mask,
                None => w.data,
            };
            Some((w.address, data))
        }),
    ),
    wrong(
        "or-carries",
        "10.3",
        "Or adds the mask to the byte",
        How::Writes(|w| {
            let data = match mask(&w, Kind::Or) {
                Some(mask) => w.old.wrapping_add(mask),
                None => w.data,
            };
            Some((w.address, data))
        }),
    ),
    // Ends of pages and ranges.
    wrong(
        "read-word-stays-in-its-page",
        "10.1",
        "ReadWord at the end of a page reads its second byte at the begin of the same page",
        How::ReadsFrom(|place, address| in_page(place, Kind::ReadWord, address)),
    ),
    wrong(
        "read-long-stays-in-its-page",
        "10.1",
        "ReadLong at the end of a page goes on at the begin of the same page",
        How::ReadsFrom(|place, address| in_page(place, Kind::ReadLong, address)),
    ),
    wrong(
        "write-word-stays-in-its-page",
        "10.2",
        "WriteWord at the end of a page writes its second byte at the begin of the same page",
        How::Writes(|w| Some((in_page(w.place, Kind::WriteWord, w.address), w.data))),
    ),
    wrong(
        "last-word-refused",
        "10.1",
        "it refuses ReadWord of the last two bytes of the RAM",
        How::Permits(|kind, address| {
            (kind, address) != (Kind::ReadWord, ram::VCO_LIN_L - 1) && in_range(kind, address)
        }),
    ),
    wrong(
        "last-long-refused",
        "10.1",
        "it refuses ReadLong of the last four bytes of the RAM",
        How::Permits(|kind, address| {
            (kind, address) != (Kind::ReadLong, ram::VCO_LIN_L - 3) && in_range(kind, address)
        }),
    ),
    wrong(
        "read-long-end-not-checked",
        "10.1",
        "it permits a ReadLong of which only the first byte lies in range",
        How::Permits(|kind, address| match kind {
            Kind::ReadLong => in_range(Kind::WriteByte, address),
            _ => in_range(kind, address),
        }),
    ),
    wrong(
        "rom-bytes-as-far-as-words",
        "10.1",
        "it permits ReadByte from 2FC0 to 2FDF, where only words can be read",
        How::Permits(|kind, address| {
            kind == Kind::ReadByte && (0x2FC0..=0x2FDF).contains(&address)
                || in_range(kind, address)
        }),
    ),
    // Process data.
    wrong(
        "process-data-latched-late",
        "9.4",
        "it takes the second byte of its process data only when the new ones have come in",
        How::Tells(|m, memory, byte| match m.place {
            Place::ProcessLow if m.step.marks.is_empty() => {
                let low = memory.read(ram::DATA_OUT).wrapping_add(1);
                memory.read(ram::STATUS | u16::from(low))
            }
            _ => byte,
        }),
    ),
    wrong(
        "process-data-only-with-commands",
        "9.4",
        "it writes the process data that come in only where parameter bytes stand behind them",
        How::Writes(|w| (w.place != Place::ProcessLow || !w.last).then_some((w.address, w.data))),
    ),
    wrong(
        "process-data-only-without-commands",
        "9.4",
        "it writes the process data that come in only where no parameter bytes stand behind them",
        How::Writes(|w| (w.place != Place::ProcessLow || w.last).then_some((w.address, w.data))),
    ),
    wrong(
        "process-data-high-byte-lost",
        "9.4",
        "it writes only the low byte of the process data that come in",
        How::Writes(|w| {
            let high = w.place == Place::ProcessLow && w.address & 1 == 0;
            (!high).then_some((w.address, w.data))
        }),
    ),
    wrong(
        "process-data-high-byte-early",
        "9.4",
        "it writes the high byte of the process data that come in before the low byte has come",
        How::Acts(|m, memory| {
            if m.place == Place::ProcessHigh && m.received.error.is_none() {
                let low = memory.read(ram::DATA_IN);
                memory.write(ram::STATUS | u16::from(low), m.received.byte);
            }
        }),
    ),
    // Cells.
    wrong(
        "ram-bit-stuck-at-1",
        "14.2.1",
        "bit 3 of the RAM cell FE5A is always 1",
        How::Reads(|peek, a| peek(a) | if a == 0xFE5A { 1 << 3 } else { 0 }),
    ),
    wrong(
        "ram-bit-stuck-at-0",
        "14.2.1",
        "bit 6 of the RAM cell FE33 is always 0",
        How::Reads(|peek, a| peek(a) & if a == 0xFE33 { !(1 << 6) } else { 0xFF }),
    ),
    wrong(
        "ram-cells-aliased",
        "14.2.1",
        "the RAM cells FE20 and FE60 are one",
        How::Reads(|peek, a| peek(if a == 0xFE60 { 0xFE20 } else { a })),
    ),
    wrong(
        "ram-bits-coupled",
        "14.2.1",
        "bit 0 of the RAM cell FE44 shows bit 0 of FE45",
        How::Reads(|peek, a| match a {
            0xFE44 => peek(a) & 0xFE | peek(0xFE45) & 1,
            _ => peek(a),
        }),
    ),
    wrong(
        "write-spoils-the-next-cell",
        "10.2",
        "a WriteByte to an address that ends with 7 inverts the cell behind it",
        How::Acts(|m, memory| {
            if let Some(p) =
                executed(m).filter(|p| p.kind == Kind::WriteByte && p.address & 0xF == 7)
            {
                let next = p.address + 1;
                let old = memory.read(next);
                memory.write(next, !old);
            }
        }),
    ),
    behind_the_bus(
        "eeprom-cells-aliased",
        "14.10.5",
        "bit 1 of an EEPROM address is taken for 0",
        How::Writes(|w| {
            let address = w.address == ram::EEPROM_BUFFER;
            Some((w.address, if address { w.data & !2 } else { w.data }))
        }),
    ),
    behind_the_bus(
        "eeprom-bit-stuck-at-1",
        "14.10.5",
        "bit 4 of every byte that it writes into its EEPROM is 1",
        How::Writes(|w| {
            let data = w.address == ram::EEPROM_BUFFER + 1;
            Some((w.address, if data { w.data | 0x10 } else { w.data }))
        }),
    ),
    behind_the_bus(
        "prog-param-copies-nothing",
        "14.10.5.4",
        "ProgParam reports at once that it is completed, and copies nothing",
        How::Writes(|w| {
            let copies = (w.address, w.data) == (ram::EEPROM_CONTROL, 0x84);
            Some((w.address, if copies { 0x10 } else { w.data }))
        }),
    ),
    // Rare events.
    wrong(
        "every-64th-write-lost",
        "10.2",
        "it answers every 64th command that writes, and does not execute it",
        How::Writes(|w| {
            let lost = w.of_a_command && w.nth % 64 == 0;
            (!lost).then_some((w.address, w.data))
        }),
    ),
    wrong(
        "every-256th-read-wrong",
        "10.1",
        "bit 0 of what every 256th command reads is wrong",
        How::Misreads(|nth, _, data| data ^ u8::from(nth % 256 == 0)),
    ),
    wrong(
        "byte-a7-written-as-a6",
        "10.2",
        "it writes A6 where A7 is to be written",
        How::Writes(|w| Some((w.address, if w.data == 0xA7 { 0xA6 } else { w.data }))),
    ),
    wrong(
        "byte-5b-read-as-5a",
        "10.1",
        "it answers 5A where a cell holds 5B",
        How::Misreads(|_, _, data| if data == 0x5B { 0x5A } else { data }),
    ),
    // What outlives a reset.
    wrong(
        "reset-keeps-nsoll",
        "10.5",
        "its nominal speed is not cleared at a reset",
        How::Resets(|memory| keep(memory, &[ram::NSOLL, ram::NSOLL + 1])),
    ),
    wrong(
        "reset-keeps-the-block",
        "10.5",
        "a software block outlives a reset",
        How::Resets(|memory| keep_status(memory, status::BLOCK)),
    ),
    wrong(
        "reset-keeps-the-stop",
        "10.5",
        "a software stop outlives a reset",
        How::Resets(|memory| keep_status(memory, status::STOP)),
    ),
];

/// Deviations that no scenario shows and a qualification does: it compares what is read with what was read before, and times with each other.
pub(super) static OF_QUALIFICATIONS: &[Deviation] = &[
    wrong(
        "compares-seven-bits-of-the-address",
        "9.3",
        "it takes the address 80 for its own as well as 00",
        How::Mistakes(
            |m| match becomes_80(m) {
                true => m.good(0xFF),
                false => m.received,
            },
            |m, byte| Some(if becomes_80(m) { 0x80 } else { byte }),
        ),
    ),
    wrong(
        "sends-checking-bytes-late",
        "8.2",
        "it sends the checking bytes of its answers 5 ms late",
        How::LateAt(|m| m.answers_check().map(|_| Span::from_millis(5))),
    ),
    wrong(
        "rom-cell-wrong-at-times",
        "10.1",
        "bit 0 of the ROM cell 2F33 is wrong where every 9th command reads it",
        How::Misreads(|nth, address, data| data ^ u8::from(address == 0x2F33 && nth % 9 == 0)),
    ),
    wrong(
        "status-without-wrong-sums",
        "14.10.1",
        "a wrong checking byte does not set the error bit of Status",
        How::Reads(|peek, address| {
            let byte = peek(address);
            let is_sum = [peek(ram::ERRORCODE), peek(ram::ERRORCODE + 1)] == WRONG_SUM;
            match address {
                ram::STATUS if is_sum => byte & !status::ERROR,
                _ => byte,
            }
        }),
    ),
    wrong(
        "errors-stop",
        "14.4.1",
        "an error sets the software stop in Status",
        How::Reads(|peek, address| match (address, peek(address)) {
            (ram::STATUS, value) if value & status::ERROR != 0 => value | status::STOP,
            (_, value) => value,
        }),
    ),
    wrong(
        "reset-keeps-the-recording",
        "10.5",
        "the recording of the oscilloscope outlives a reset",
        How::Resets(|memory| {
            let cells: Vec<u16> = own::SCOPE_BUFFER.collect();
            keep(memory, &cells);
        }),
    ),
];

/// Whether it is an address byte to which the drive adds 1 and gets 80.
fn becomes_80(m: &Moment) -> bool {
    m.place == Place::Address && m.received.is(0x7F)
}

/// A command whose checking byte has just been refused.
fn refused(m: &Moment) -> Option<ParameterByte> {
    let detected = m.step.marks.contains(Marks::DETECTED);
    m.parameter()
        .filter(|p| detected && p.field == Field::Check && m.received.error.is_none())
}

/// A command whose checking byte was right.
fn executed(m: &Moment) -> Option<ParameterByte> {
    let detected = m.step.marks.contains(Marks::DETECTED);
    m.parameter()
        .filter(|p| !detected && p.field == Field::Check)
}

fn change_bits(p: &ParameterByte, address: u16, memory: &mut dyn Memory) {
    let old = memory.read(address);
    match p.kind {
        Kind::And => memory.write(address, old & p.data[0]),
        Kind::Or => memory.write(address, old | p.data[0]),
        _ => {}
    }
}

/// The byte received, or the right checking byte where only these bits of it are wrong.
fn checked(m: &Moment, not_looked_at: u8) -> harness_proto::line::Received {
    match m.check() {
        Some(right) if (m.received.byte ^ right) & !not_looked_at == 0 => m.good(right),
        _ => m.received,
    }
}

/// The mask of a command of this kind that is executed.
fn mask(write: &Write, kind: Kind) -> Option<u8> {
    match write.place {
        Place::Parameter(p) if p.kind == kind => Some(p.data[0]),
        _ => None,
    }
}

/// For the bytes behind the end of the page in which a command of this kind begins, their places in that page.
fn in_page(place: Place, kind: Kind, address: u16) -> u16 {
    match place {
        Place::Parameter(p) if p.kind == kind => {
            // While its high byte comes in, only the low one of the address is known.
            let begins = p.address & 0xFF;
            match address & 0xFF < begins {
                true => address.wrapping_sub(0x100),
                false => address,
            }
        }
        _ => address,
    }
}

fn keep_status(memory: &mut dyn Memory, bits: u8) {
    let kept = memory.read(ram::STATUS) & bits;
    memory.reset();
    let after = memory.read(ram::STATUS);
    memory.write(ram::STATUS, after | kept);
}

fn keep(memory: &mut dyn Memory, cells: &[u16]) {
    let kept: Vec<u8> = cells.iter().map(|&cell| memory.read(cell)).collect();
    memory.reset();
    for (&cell, byte) in cells.iter().zip(kept) {
        memory.write(cell, byte);
    }
}
