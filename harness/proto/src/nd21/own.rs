//! What the manual leaves to the drive: cells that its own program writes. No model can say what they hold.
//!
//! A bench compares a cell that it has written only where no row of [`OWN`] names it. What any other cell holds before the first
//! write is the drive's choice too, ROM and EEPROM included, but it must not change from one read to the next.

use super::bits::{hw_version, hw_version2};
use super::cells::{CellAccess, cell_at, changes_by_itself};
use super::io::{GPO1, GPO2, OUTPUTS};
use super::{PARAMETERS, ram};
use core::ops::RangeInclusive;

/// Cells that the drive's program writes, and why a master cannot know their value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Own {
    /// The addresses, from the first to the last byte.
    pub cells: RangeInclusive<u16>,
    /// The section of the ND21 manual.
    pub section: &'static str,
    /// Why.
    pub about: &'static str,
}

const fn own(first: u16, last: u16, section: &'static str, about: &'static str) -> Own {
    Own {
        cells: first..=last,
        section,
        about,
    }
}

/// Every range of RAM and registers that the drive's program writes by itself, in order of addresses. Cells that 14.2 calls read only
/// or reserved belong to it too; [`is_own`] knows both. The buffer of the oscilloscope is RAM like any other while the oscilloscope
/// does not run ([`SCOPE`]).
#[rustfmt::skip]
pub const OWN: &[Own] = &[
    own(ram::ERRORCODE, ram::I2 + 3, "14.10.1", "the code of the last error, the load of the motor"),
    own(ram::EEPROM_BUFFER, ram::EEPROM_CONTROL, "14.10.5", "the EEPROM controller works in them"),
    own(ram::I_OFFSET, ram::I_OFFSET + 1, "14.2.1", "a measurement"),
    own(ram::PZ, ram::AS_COMMAND, "13.1.9.1", "the markers of the cycle control"),
    own(ram::STACK, ram::STACK + 95, "14.2.1", "the stack of the drive's program"),
    own(ram::STATUS, ram::STATUS, "14.4.1", "the state of the drive"),
    own(ram::N_INTEGRATOR, ram::ADCSR, "14.2.1", "regulators, measurements and positions"),
    own(ram::NOVOBUS, ram::CHECKSUM_OUT, "14.2.1", "the buffers of the bus"),
    own(ram::DATA_IN_BUFFER, ram::DATA_IN_BUFFER, "14.2.1", "a buffer of the bus"),
    own(ram::DATA_OUT_BUFFER, ram::BUS_ADDR, "14.2.1", "buffers of the bus; the address goes through BusAddr"),
    own(ram::SCOPE_STATUS, ram::SCOPE_SIGNAL2, "14.10.6", "the oscilloscope works in them"),
    own(ram::PS_STATUS, ram::PS_DELTA, "13.3", "the positioning controller works in them"),
    own(ram::FLAGS, ram::FLAGS2, "14.4", "the state of the drive"),
    own(ram::CNT2, ram::CNT_REVERS, "14.2.1", "counters"),
    own(0xFF80, 0xFFFF, "14.7.1", "registers, inputs and outputs"),
];

/// The cells of the oscilloscope (ND21 14.10.6). It writes its buffer while it runs, and only a master starts it.
pub const SCOPE: RangeInclusive<u16> = ram::SCOPE_STATUS..=ram::SCOPE_SIGNAL2;

/// The buffer of the oscilloscope (ND21 14.10.6.6).
pub const SCOPE_BUFFER: RangeInclusive<u16> = ram::SCOPE_PUFFER..=ram::STACK - 1;

/// Whether a cell is one that the oscilloscope changes while it runs, and only then.
#[must_use]
pub fn is_of_the_scope(address: u16) -> bool {
    let works_in = SCOPE.contains(&address) || SCOPE_BUFFER.contains(&address);
    works_in && address != ram::SCOPE_STATUS
}

/// RAM that no function of the drive uses while the oscilloscope stands, of which tests may write every byte with any value: part of its
/// buffer.
pub const SPARE: RangeInclusive<u16> = 0xFE10..=0xFE97;

/// The parameters (ND21 14.2.1): loaded from the EEPROM at a reset, and only read by the drive afterwards.
pub const PARAMETER_CELLS: RangeInclusive<u16> = PARAMETERS..=ram::VCO_LIN_L;

/// A part of the drive's program that writes its cells only while it works, and that a master starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Worker {
    /// The positioning controller and the referencing run (ND21 13.2, 13.3).
    Positioning,
    /// The EEPROM controller (ND21 14.10.5).
    Eeprom,
    /// The oscilloscope (ND21 14.10.6).
    Scope,
}

/// The bits of a cell that hold what the master has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The bits; 0 where the drive may write all of them at any time.
    pub bits: u8,
    /// They are the drive's own all the same once this part has been started.
    pub unless: Option<Worker>,
}

/// The bits of a cell, where a master has read `value`, that the manual does not let the drive change by itself. A drive that reports an
/// error in `Status` blocks its regulator (ND21 11.8) and may show it; one that reports a reset may show anything. A software stop is the
/// master's alone (11.8, 14.4.1).
#[must_use]
pub fn kept(address: u16, value: u8) -> Kept {
    use crate::nd21::bits::{flags2, ps_status, status};
    let kept = |bits, unless| Kept { bits, unless };
    let positioning = Some(Worker::Positioning);
    match address {
        ram::STATUS if value & status::RESET != 0 => kept(0, None),
        ram::STATUS if value & status::ERROR != 0 => kept(status::STOP, None),
        ram::STATUS => kept(status::BLOCK | status::STOP, None),
        // 14.4.3, 14.10.2: the drive ends what these bits have started, and never switches the monitoring.
        ram::FLAGS2 => kept(flags2::MONITORING, None),
        // 13.3.1: the other bits report.
        ram::PS_STATUS => kept(ps_status::CALCULATE | ps_status::START, positioning),
        ram::PS_POSITION_H..=ram::PS_DELTA => kept(0xFF, positioning),
        ram::EEPROM_BUFFER..ram::EEPROM_CONTROL => kept(0xFF, Some(Worker::Eeprom)),
        ram::SCOPE_STATUS => kept(0, None),
        // 10.4, 13.1.7.2: GPO1 and GPO2; they are the drive's where its configuration gives them another use ([`outputs_of_the_bus`]).
        OUTPUTS => kept(GPO1 | GPO2, positioning),
        _ if is_of_the_scope(address) => kept(0xFF, Some(Worker::Scope)),
        _ if is_own(address) || changes_by_itself(address) => kept(0, None),
        _ => kept(0xFF, None),
    }
}

/// The bits of [`OUTPUTS`] that only `WriteIO` sets (ND21 10.4), by what `HwVersion` and `HwVersion2` held after the last reset, which
/// activates them. The analogue output, the cycle control and the report of a completed positioning take GPO1 (14.7.4, 13.1.7.2,
/// 14.3.3), and the messages of 14.7.5 take GPO2. The layouts of `HwVersion` before and after 7/93 are both respected.
#[must_use]
pub const fn outputs_of_the_bus(hardware: u8, hardware2: u8) -> u8 {
    const OTHER_USE_OF_GPO1: u8 = 1 << 3 | 1 << 2;
    let analogue = hardware2 & hw_version2::NO_ANALOGUE_OUTPUT == 0;
    let gpo1 = if analogue || hardware & OTHER_USE_OF_GPO1 != 0 {
        0
    } else {
        GPO1
    };
    let gpo2 = if hardware & hw_version::GPO2 == hw_version::GPO2_BUS {
        GPO2
    } else {
        0
    };
    gpo1 | gpo2
}

/// Whether the drive's program may write a cell at any time, so that no model can say what it holds. ROM is not: the drive chooses what
/// stands there once.
#[must_use]
pub fn is_own(address: u16) -> bool {
    OWN.iter().any(|range| range.cells.contains(&address))
        || cell_at(address).is_some_and(|cell| cell.access != CellAccess::Write)
}

#[cfg(test)]
mod tests {
    use super::super::cells::RAM;
    use super::*;

    /// ND21 14.2.1, 14.5: what a drive changes as time goes on is its own, apart from the buffer of an oscilloscope that stands.
    #[test]
    fn what_changes_by_itself_is_own() {
        for address in 0xFD80..=0xFF7F {
            let changes = changes_by_itself(address) && !SCOPE_BUFFER.contains(&address);
            assert!(!changes || is_own(address), "{address:04X}");
        }
        let read_only = RAM.iter().filter(|cell| cell.access == CellAccess::Read);
        assert!(
            read_only
                .flat_map(super::super::cells::Cell::addresses)
                .all(is_own)
        );
    }

    /// ND21 10.1, 14.2: ROM, spare RAM, and where process data can go (14.10.3) are compared.
    #[test]
    fn what_a_master_can_test_is_not_own() {
        let tested = SPARE.chain(0x2F00..=0x2FDF);
        assert!(
            tested
                .chain([ram::DATA_IN, ram::DATA_OUT])
                .all(|cell| !is_own(cell))
        );
        assert!(SPARE.into_iter().all(|cell| SCOPE_BUFFER.contains(&cell)));
        let gains = ram::NKP..=ram::LKD;
        assert!(
            gains
                .chain([ram::N_MAX, ram::VCO_LIN_L])
                .all(|cell| !is_own(cell))
        );
        assert!([ram::MMAX, ram::STATUS, 0xFFB7].into_iter().all(is_own));
    }

    #[test]
    fn rows_are_in_order() {
        let pairs = OWN.windows(2);
        assert!(
            pairs
                .into_iter()
                .all(|two| two[0].cells.end() < two[1].cells.start())
        );
    }
}
