//! The values that a walk writes to registers: both ends of what a register has room for, or of what the rig's file permits (`ranges`), 0,
//! and one that no other register gets.
//!
//! The manual prints no range of a parameter: a register holds any value (our choice), as long as the rig's file states no range.

use harness_proto::unitek::REGISTERS;
use harness_proto::unitek::guard::{Class, Limits, ValueRange, class};
use harness_proto::unitek::{Register, Width};
use std::collections::BTreeSet;

/// A value that a walk writes to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WalkedValue {
    /// The name of its kind in a report.
    pub(super) name: &'static str,
    pub(super) register: &'static Register,
    pub(super) raw: u32,
    /// Why it is not written, whatever the rig's file permits; `None` if it may be.
    pub(super) left_out: Option<&'static str>,
}

/// The values for all registers that hold what is written to them, in rounds: the last one has a value of its own for each.
pub(super) fn values(limits: &Limits) -> Vec<WalkedValue> {
    let rounds: [fn(ValueRange) -> i64; 4] = [
        |range| range.least,
        |range| range.most,
        |_| 0,
        |range| 0x1005 | i64::from(range.register) << 4,
    ];
    let mut written = BTreeSet::new();
    let mut values = Vec::new();
    for round in rounds {
        for register in REGISTERS
            .iter()
            .filter(|register| register.access.holds_writes())
        {
            let Some((name, left_out)) = kind(register.number) else {
                continue;
            };
            let mut ranges = limits.ranges.iter().copied();
            let range = ranges.find(|range| range.register == register.number);
            let range = range.unwrap_or_else(|| ValueRange::whole(register));
            let value = round(range);
            if (range.least..=range.most).contains(&value)
                && written.insert((register.number, value))
            {
                values.push(WalkedValue {
                    name,
                    register,
                    raw: bits(register, value),
                    left_out,
                });
            }
        }
    }
    values
}

/// What the values of a register are, and why none is written; `None` for a register that other inputs and the kept conversations write.
fn kind(register: u8) -> Option<(&'static str, Option<&'static str>)> {
    let acts = "they move something or switch an output at once";
    let decides = "a wrong value could damage the motor";
    match (class(register), register) {
        // Commands and the mask of events; 33 is called RW, and is an error of the regulator (E37).
        (_, 0x33 | 0x52 | 0x6E) => None,
        (Class::Motion, 0x21 | 0x36 | 0x7A | 0xBE..=0xC3 | 0xDA | 0xDB) => {
            Some(("values of set points and outputs", Some(acts)))
        }
        (Class::Harmless | Class::Motion, _) => Some(("values of parameters", None)),
        (Class::Eeprom | Class::EepromAndMotion, _) => {
            Some(("values of device and motor data", Some(decides)))
        }
        _ => None,
    }
}

/// A value as the register holds it.
fn bits(register: &Register, value: i64) -> u32 {
    let raw = value as u32;
    match register.width {
        Width::Bits16 => raw & 0xFFFF,
        Width::Bits32 => raw,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(register: u8, limits: &Limits) -> Vec<u32> {
        let values = values(limits).into_iter();
        let values = values.filter(|value| value.register.number == register);
        values.map(|value| value.raw).collect()
    }

    #[test]
    fn both_ends_of_each_register_are_written() {
        let limits = Limits::unlimited();
        // Unsigned, signed, 32 bits.
        assert_eq!(of(0x1C, &limits), [0, 0xFFFF, 0x11C5]);
        assert_eq!(of(0x76, &limits), [0x8000, 0x7FFF, 0, 0x1765]);
        assert_eq!(of(0xD4, &limits), [0x8000_0000, 0x7FFF_FFFF, 0, 0x1D45]);
    }

    /// The ends of a range that the rig's file states, and nothing beyond.
    #[test]
    fn a_range_is_kept() {
        let range = |least, most| Limits {
            ranges: vec![ValueRange {
                register: 0x76,
                least,
                most,
            }],
            ..Limits::unlimited()
        };
        assert_eq!(of(0x76, &range(-3, 200)), [0xFFFD, 200, 0]);
        assert_eq!(of(0x76, &range(5, 5)), [5]);
    }

    #[test]
    fn no_two_registers_end_with_the_same_value() {
        let values = values(&Limits::unlimited());
        let last = REGISTERS.iter().filter_map(|register| {
            let mut rounds = values.iter().rev();
            rounds.find(|value| value.register.number == register.number)
        });
        let last: Vec<_> = last.map(|value| value.raw).collect();
        let each: BTreeSet<_> = last.iter().collect();
        assert_eq!(each.len(), last.len());
    }
}
