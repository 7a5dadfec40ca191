//! The dissector for Wireshark, with its tables made from the register table.

use harness_proto::unitek::register::{Register, Unit};
use harness_proto::unitek::words::{Bit, ERRORS, IO, MODE, STATUS};
use harness_proto::unitek::{REGISTERS, Width};
use std::fmt::Write as _;

/// The dissector, with a place for each table.
const TEMPLATE: &str = include_str!("unitek.lua");

/// Words of which bits are shown by name, as the dissector calls them.
const WORDS: [(&str, &[Bit]); 4] = [
    ("status", STATUS),
    ("errors", ERRORS),
    ("io", IO),
    ("mode", MODE),
];

#[must_use]
pub(crate) fn dissector() -> String {
    let mut registers = String::new();
    for register in &REGISTERS {
        // Writing to a String cannot fail.
        let _infallible = writeln!(registers, "    {}", row(register));
    }
    let mut words = String::new();
    for (name, bits) in WORDS {
        let bits = bits
            .iter()
            .map(|bit| format!("[{}] = {:?}", bit.number, bit.name));
        let bits: Vec<_> = bits.collect();
        let _infallible = writeln!(words, "    {name} = {{ {} }},", bits.join(", "));
    }
    TEMPLATE
        .replace("@REGISTERS@\n", &registers)
        .replace("@BITS@\n", &words)
}

fn row(register: &Register) -> String {
    let Register {
        number,
        name,
        width,
        signed,
        unit,
        ..
    } = register;
    let bits = match width {
        Width::Bits16 => 16,
        Width::Bits32 => 32,
    };
    format!(
        "[0x{number:02X}] = {{ {name:?}, {bits}, {signed}, {:?} }},",
        unit_name(*unit)
    )
}

/// The unit as the dissector calls it.
const fn unit_name(unit: Unit) -> &'static str {
    match unit {
        Unit::Speed => "speed",
        Unit::Torque => "torque",
        Unit::Rpm => "rpm",
        Unit::Millis => "ms",
        Unit::Ramp => "ramp",
        Unit::Position => "turns",
        Unit::DeciAmpere => "deciampere",
        Unit::Status => "status",
        Unit::Errors => "errors",
        Unit::Io => "io",
        Unit::Mode => "mode",
        // Currents need the scale of the drive (App 7).
        Unit::Current | Unit::Raw | Unit::Identifier | Unit::BitTiming | Unit::Flag => "raw",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_and_every_named_bit_is_in_it() {
        let text = dissector();
        assert!(!text.contains('@'), "a table is missing");
        for register in &REGISTERS {
            assert!(text.contains(&row(register)), "{:02X}", register.number);
        }
        assert!(text.contains("[0x30] = { \"SPEED_ACTUAL\", 16, true, \"speed\" },"));
        assert!(text.contains("[13] = \"Tol\""));
    }
}
