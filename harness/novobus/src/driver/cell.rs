//! Cells of drives: read, written, shown.

use super::{Axis, Error, OpenRings};
use crate::language::argument::{MemoryKind, MemoryRange};
use crate::language::scale::shown;
use harness_proto::nd21::bits;
use harness_proto::nd21::units::{DriveUnits, Value};
use harness_proto::novobus::command::Kind;
use harness_proto::novobus::memory::in_range;
use serde_json::json;

/// Reads the bytes of a cell; a word and a double word at one instant, where the bus can.
pub(crate) fn read(
    bus: &OpenRings<'_>,
    axis: Axis,
    location: &MemoryRange,
) -> Result<Vec<u8>, Error> {
    let address = location.address();
    if location.memory == MemoryKind::Eeprom {
        return bus.read_eeprom_bytes(axis, low(address), location.size);
    }
    match location.size {
        2 if whole(Kind::ReadWord, address) => {
            Ok(bus.read_word(axis, address)?.to_be_bytes().to_vec())
        }
        4 if whole(Kind::ReadLong, address) => match bus.read_long(axis, address) {
            // Some drives answer with three bytes (10.1).
            Err(Error::Open(_)) => bus.read_bytes(axis, address, 4),
            long => Ok(long?.to_be_bytes().to_vec()),
        },
        size => bus.read_bytes(axis, address, size),
    }
}

/// Writes bytes from the address of a cell on, word by word where the bus can.
pub(crate) fn write(
    bus: &OpenRings<'_>,
    axis: Axis,
    location: &MemoryRange,
    bytes: &[u8],
) -> Result<(), Error> {
    let mut address = location.address();
    if location.memory == MemoryKind::Eeprom {
        for (address, byte) in (low(address)..=u8::MAX).zip(bytes) {
            bus.write_eeprom(axis, address, *byte)?;
        }
        return Ok(());
    }
    let mut rest = bytes;
    while let [first, behind @ ..] = rest {
        match behind {
            [second, behind @ ..] if whole(Kind::WriteWord, address) => {
                bus.write_word(axis, address, u16::from_be_bytes([*first, *second]))?;
                rest = behind;
                address = address.saturating_add(2);
            }
            _ => {
                bus.write_byte(axis, address, *first)?;
                rest = behind;
                address = address.saturating_add(1);
            }
        }
    }
    Ok(())
}

/// Whether a command takes all of its bytes from this address on; the H8 has words at even ones only.
fn whole(kind: Kind, address: u16) -> bool {
    address.is_multiple_of(2) && in_range(kind, address)
}

fn low(address: u16) -> u8 {
    let [_, low] = address.to_be_bytes();
    low
}

pub(crate) struct CellFound<'a> {
    pub(crate) axis: Axis,
    pub(crate) location: &'a MemoryRange,
    /// The bytes, in the order of their addresses.
    pub bytes: Vec<u8>,
    pub(crate) units: DriveUnits,
}

impl CellFound<'_> {
    /// The bytes as hexadecimal digits.
    pub(crate) fn raw(&self) -> String {
        hex(&self.bytes)
    }

    fn decoded(&self) -> Option<Value> {
        self.location.scale?.value(&self.bytes, self.units)?.ok()
    }

    /// The value with its unit; empty for bytes without a scale.
    pub(crate) fn value(&self) -> String {
        match (self.location.scale, self.decoded()) {
            (None, _) => String::new(),
            (Some(scale), Some(value)) => shown(value, scale),
            (Some(_), None) => "no meaning".to_owned(),
        }
    }

    /// The value without its unit, for tools.
    pub(crate) fn number(&self) -> serde_json::Value {
        match (self.location.scale, self.decoded()) {
            (_, Some(Value::Exact(number))) => json!(number.to_f64()),
            (_, Some(Value::Approximate(number))) => json!(number),
            (Some(scale), Some(value)) => json!(shown(value, scale)),
            _ => serde_json::Value::Null,
        }
    }

    /// The unit; empty if there is none.
    pub(crate) fn unit(&self) -> &'static str {
        self.location.scale.map_or("", |scale| scale.unit())
    }

    /// The names of the bits that are set (13.3.1, 14.4).
    pub(crate) fn bits(&self) -> Vec<&'static str> {
        match (self.location.memory, &self.bytes[..]) {
            (MemoryKind::Ram, [byte]) => bits::set_in(self.location.address(), *byte).collect(),
            _ => Vec::new(),
        }
    }

    /// Value or bits, for people; empty where there is nothing to say beside the bytes.
    pub(crate) fn words(&self) -> String {
        let bits = self.bits();
        if bits.is_empty() {
            self.value()
        } else {
            bits.join(", ")
        }
    }

    /// Bytes with value or bits: `0652 (428.44 rpm)`.
    pub(crate) fn text(&self) -> String {
        let words = self.words();
        if words.is_empty() {
            self.raw()
        } else {
            format!("{} ({words})", self.raw())
        }
    }
}

/// Reads a cell with what its scale depends on.
pub(crate) fn find<'a>(
    bus: &OpenRings<'_>,
    (axis, units): (Axis, DriveUnits),
    location: &'a MemoryRange,
) -> Result<CellFound<'a>, Error> {
    Ok(CellFound {
        axis,
        location,
        bytes: read(bus, axis, location)?,
        units,
    })
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}
