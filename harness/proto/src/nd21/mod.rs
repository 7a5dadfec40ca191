//! The Novotron ND21: what its cells are, in which units, and its error codes.
//!
//! The high byte of a word stands at the lower address (the drive's H8 is big-endian). [`cells`] and
//! [`eeprom`] are the manual's tables 14.2.1 and 14.2.2; the constants here are the cells and bits that
//! other code names.

pub mod cells;
pub mod eeprom;
pub mod errors;
pub mod position;
pub mod units;

/// `errorcode`: two bytes, the code of the last error (ND21 14.10.1).
pub const ERROR_CODE: u16 = 0xFD82;
/// `DataIn`: the low byte of the address FFxx that incoming process data are written to (ND21 14.10.3).
pub const DATA_IN: u16 = 0xFF32;
/// `DataOut`: the low byte of the address FFxx that outgoing process data are read from (ND21 14.10.3).
pub const DATA_OUT: u16 = 0xFF34;
/// `BusAddr`: the address byte that the drive last passed on (ND21 9.3).
pub const BUS_ADDR: u16 = 0xFF36;
/// `Status` (ND21 14.4.1).
pub const STATUS: u16 = 0xFF00;
/// `Flags2` (ND21 14.4.3).
pub const FLAGS2: u16 = 0xFF57;
/// Bit 2 of `Flags2`: time-out monitoring is on (ND21 14.10.2).
pub const FLAGS2_MONITORING: u8 = 1 << 2;
/// The port with the digital outputs (ND21 14.7.1): GPO1 is bit 7, GPO2 bit 5.
pub const OUTPUTS: u16 = 0xFFB7;
/// Bit of GPO1 in [`OUTPUTS`].
pub const GPO1: u8 = 1 << 7;
/// Bit of GPO2 in [`OUTPUTS`].
pub const GPO2: u8 = 1 << 5;
/// Bit 0 of `Status`: the regulator is blocked (ND21 14.10, "Disable").
pub const STATUS_BLOCKED: u8 = 1;
/// Bit 7 of `Status`: the drive is stopped (ND21 14.10, "Stop").
pub const STATUS_STOPPED: u8 = 1 << 7;
/// What is written to `errorcode` to confirm an error (ND21 14.10.1).
pub const CONFIRM_ERROR: u8 = 0xAF;
/// `EE_selftest`, an EEPROM address (ND21 14.3.6).
pub const EE_SELFTEST: u8 = 0x47;
/// Bit 7 of `EE_selftest`: time-out monitoring is switched on at reset (ND21 14.10.2).
pub const EE_SELFTEST_MONITORING: u8 = 1 << 7;

/// The first parameter cell; FF60-FF7F are loaded from EEPROM 20-3F at reset (ND21 14.2.1, 14.2.2).
pub const PARAMETERS: u16 = 0xFF60;
/// The EEPROM address of the first parameter.
pub const EE_PARAMETERS: u8 = 0x20;
/// How many parameters there are.
pub const PARAMETER_COUNT: u16 = 0x20;

#[cfg(test)]
mod tests {
    use super::*;

    /// The bus end's cells stand in the tables at the same addresses (ND21 14.2.1, 14.2.2).
    #[test]
    fn the_bus_ends_cells_are_in_the_tables() {
        for (name, address) in [
            ("errorcode", ERROR_CODE),
            ("DataIn", DATA_IN),
            ("DataOut", DATA_OUT),
            ("BusAddr", BUS_ADDR),
            ("Status", STATUS),
            ("Flags2", FLAGS2),
            ("HwVersion", PARAMETERS),
        ] {
            assert_eq!(
                cells::cell(name).map(|cell| cell.address),
                Some(address),
                "{name}"
            );
        }
        let selftest = eeprom::cell("EE_selftest").map(|cell| cell.address);
        assert_eq!(selftest, Some(u16::from(EE_SELFTEST)));
    }
}
