//! The EEPROM of the drive, cell by cell (ND21 14.2.2), and the RAM cells that are loaded from it.

use super::cells::{Cell, CellAccess, PLAIN, SIGNED, at, cells, named};
use super::units::Scale;

#[rustfmt::skip]
cells! {
/// Every row of the table, 00 to FF without a gap, in order of addresses (ND21 14.2.2).
///
/// Where the print is in doubt:
///
/// * `EE_Version`, `EE_selftest`: 14.3.5 and 14.3.6 call them `EEVersion` and `EESelftest`.
/// * `EE_SperreStd`: "block residual hours" here, "time blocked" in 14.8.2.
/// * `EE_BetriebStd`, `EE_SperreStd`: the high byte is the second (14.8.2).
/// * 04 and 10-1E have no name; 10-1E is "reserviert für Error history".
/// * `EE_Ablauf` holds the forty positions of 13.1.9, see
///   [`position::eeprom_address`](super::position::eeprom_address). 12.5 ends the EEPROM at 7F (E44).
///
/// `EE_Seriennummer`, the hours and `EE_InitDatum` "can be read out" (14.8) and are [`CellAccess::Read`];
/// Every program that changes the EEPROM must write `EE_ProgDatum` (14.8.4).
table EEPROM;
/// The addresses of the EEPROM cells (ND21 14.2.2).
addresses ee: u8;
    0x00 1 PLAIN Reserved [] "14.2.2" "EE_LA" LA "";
    0x01 3 PLAIN Read [SerialNumber] "14.8.1" "EE_Seriennummer" SERIENNUMMER "serial number";
    0x04 1 PLAIN Reserved [] "14.2.2" "" "";
    0x05 2 PLAIN Read [Hours] "14.8.2" "EE_BetriebStd" BETRIEB_STD "operating hours";
    0x07 1 PLAIN Reserved [] "14.2.2" "reserviert" "";
    0x08 2 PLAIN Read [Hours] "14.8.2" "EE_SperreStd" SPERRE_STD "hours blocked";
    0x0A 2 PLAIN Read [Date] "14.8.3" "EE_InitDatum" INIT_DATUM "date of the first start";
    0x0C 1 PLAIN Read [] "14.3.5" "EE_Version" VERSION "configuration byte";
    0x0D 3 PLAIN Reserved [] "14.2.2" "reserviert" "00";
    0x10 15 PLAIN Reserved [] "14.2.2" "reserviert" "for a history of errors";
    0x1F 1 PLAIN Write [] "14.2.2" "EE_parity" PARITY "test byte of the EEPROM";
    0x20 32 PLAIN Write [] "14.2.2" "EE_RAM" RAM "mirror of RAM FF60-FF7F, the parameters";
    0x40 1 PLAIN Write [] "14.2.2" "EE_a_param3" A_PARAM3 "ASIC setting";
    0x41 1 PLAIN Write [] "14.6.1" "EE_a_mpr1" A_MPR1 "ASIC setting";
    0x42 1 PLAIN Write [] "14.6.1" "EE_a_mpr2" A_MPR2 "ASIC setting";
    0x43 1 PLAIN Write [] "14.6.1" "EE_a_mpr98" A_MPR98 "ASIC adjustment";
    0x44 2 PLAIN Write [EncoderImpulses] "14.7.1.1" "EE_impulszahl" IMPULSZAHL "encoder emulation";
    0x46 1 PLAIN Write [MotorPoles] "14.6.7" "EE_pole" POLE "number of motor poles";
    0x47 1 PLAIN Write [] "14.3.6" "EE_selftest" SELFTEST "configuration byte";
    0x48 2 SIGNED Write [Speed] "13.1.4" "EE_RefV1" REF_V1 "first speed of the referencing run";
    0x4A 2 SIGNED Write [Speed] "13.1.4" "EE_RefV2" REF_V2 "second speed of the referencing run";
    0x4C 2 SIGNED Write [Turns] "13.1.4" "EE_RefUmdr0" REF_UMDR0 "reference point: rotation counter";
    0x4E 2 PLAIN Write [Angle] "13.1.4" "EE_RefLage0" REF_LAGE0 "reference point: rotor position";
    0x50 2 PLAIN Write [Speed] "13.1.4" "EE_Vtippen" VTIPPEN "speed of stepping";
    0x52 2 PLAIN Write [Angle] "14.6.6" "EE_dRESOLVER" D_RESOLVER "resolver adjustment";
    0x54 2 PLAIN Write [Angle] "13.1.4" "EE_RefLage" REF_LAGE "displacement of the zero point, referencing run";
    0x56 1 PLAIN Write [] "14.2.2" "EE_nd2204" ND2204 "ASIC setting";
    0x57 1 PLAIN Reserved [] "14.2.2" "reserviert" "";
    0x58 2 PLAIN Write [Date] "14.8.4" "EE_ProgDatum" PROG_DATUM "date of the last change of parameters";
    0x5A 2 PLAIN Write [] "14.2.2" "EE_ProgName" PROG_NAME "";
    0x5C 4 PLAIN Reserved [] "14.2.2" "EE_Kunde" KUNDE "for the customer";
    0x60 160 PLAIN Write [] "13.1.9" "EE_Ablauf" ABLAUF "cycle control: positions 0 to 39";
}

/// A run of EEPROM bytes and the RAM cells that are loaded with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadedRange {
    /// The first EEPROM address.
    pub eeprom: u8,
    /// The RAM address that it belongs to.
    pub ram: u16,
    /// How many bytes.
    pub size: u8,
    /// The section that says so.
    pub section: &'static str,
}

/// Which bytes of the EEPROM belong to which RAM cells, in order of EEPROM addresses. The first is the
/// parameters: FF60-FF7F come from 20-3F. The others are the pairs of ND21 13.1.4 and 14.6.6; only of
/// `Vtippen` does the print say that it is loaded after switching on.
pub const LINKS: &[LoadedRange] = &[
    link(0x20, 0xFF60, 0x20, "14.2.2"),
    link(0x48, 0xFD8C, 2, "13.1.4"),
    link(0x4A, 0xFD8E, 2, "13.1.4"),
    link(0x4C, 0xFD90, 2, "13.1.4"),
    link(0x4E, 0xFD92, 2, "13.1.4"),
    link(0x50, 0xFD94, 2, "13.1.4"),
    link(0x52, 0xFD98, 2, "14.6.6"),
    link(0x54, 0xFD9E, 2, "13.1.4"),
];

const fn link(eeprom: u8, ram: u16, size: u8, section: &'static str) -> LoadedRange {
    LoadedRange {
        eeprom,
        ram,
        size,
        section,
    }
}

/// The RAM address of the byte that belongs to this EEPROM address.
#[must_use]
pub fn ram_of(eeprom: u8) -> Option<u16> {
    LINKS.iter().find_map(|link| {
        let offset = eeprom.checked_sub(link.eeprom)?;
        (offset < link.size).then(|| link.ram + u16::from(offset))
    })
}

/// The EEPROM address of the byte that belongs to this RAM address.
#[must_use]
pub fn eeprom_of(ram: u16) -> Option<u8> {
    LINKS.iter().find_map(|link| {
        let offset = u8::try_from(ram.checked_sub(link.ram)?).ok()?;
        (offset < link.size).then(|| link.eeprom + offset)
    })
}

/// The EEPROM cell of this name, exactly as printed. Reserved cells without a name of their own are not
/// found.
#[must_use]
pub fn cell(name: &str) -> Option<&'static Cell> {
    named(EEPROM, name)
}

/// The EEPROM cell to which this address belongs, be it its first byte or not; there is always one.
#[must_use]
pub fn cell_at(address: u8) -> Option<&'static Cell> {
    at(EEPROM, u16::from(address))
}

#[cfg(test)]
mod tests {
    use super::super as nd21;
    use super::super::cells;
    use super::super::position::{POSITIONS, eeprom_address};
    use super::*;

    /// ND21 14.2: 256 bytes, 00-FF. No gap, no overlap.
    #[test]
    fn fills_the_memory_of_14_2() {
        let mut next = 0;
        for cell in EEPROM {
            assert_eq!(cell.address, next, "{}", cell.printed);
            next += cell.size;
        }
        assert_eq!(next, 0x100);
        for address in 0..=u8::MAX {
            let cell = cell_at(address).unwrap();
            assert!(cell.addresses().contains(&u16::from(address)));
        }
    }

    #[test]
    fn by_name() {
        for cell in EEPROM {
            if !["", "reserviert"].contains(&cell.printed) {
                assert_eq!(super::cell(cell.printed), Some(cell));
            }
        }
        assert_eq!(super::cell("reserviert"), None);
        assert_eq!(super::cell(""), None);
    }

    #[test]
    fn scales_fit_their_cells() {
        for cell in EEPROM {
            if let Some(scale) = cell.scale {
                assert_eq!(scale.size(), cell.size, "{}", cell.printed);
            }
        }
    }

    /// ND21 14.2.2, and the EEPROM addresses that chapter 14 prints beside those of the RAM.
    #[test]
    fn parameters_of_14_2_2() {
        for (name, address) in [
            ("HwVersion", 0x20),
            ("HwVersion2", 0x21),
            // 14.3.1 prints "EPROM" (E81).
            ("SwVersion", 0x22),
            ("SwVersion2", 0x23),
            ("MaxTempKK", 0x24),
            ("MaxTempMot", 0x25),
            ("imax", 0x26),
            ("i0", 0x27),
            ("nMax", 0x28),
            ("nRampe+", 0x2C),
            ("nRampe-", 0x2E),
            ("nKp", 0x30),
            ("nKi", 0x31),
            ("LKp", 0x32),
            ("LKd", 0x33),
            ("Slipping error", 0x36),
            ("VCOlin", 0x38),
            // 14.6.3 prints H'FF39 (E98).
            ("nFilter", 0x39),
            ("emk0", 0x3A),
            ("AnOut", 0x3C),
            ("AnOutOffset", 0x3D),
            ("VCOlinL", 0x3F),
            ("RefV1", 0x48),
            ("RefV2", 0x4A),
            ("RefUmdr0", 0x4C),
            ("RefLage0", 0x4E),
            ("Vtippen", 0x50),
            ("dRESOLVER", 0x52),
            ("RefLage", 0x54),
        ] {
            let ram = cells::cell(name).unwrap().address;
            assert_eq!(eeprom_of(ram), Some(address), "{name}");
            assert_eq!(ram_of(address), Some(ram), "{name}");
        }
        assert_eq!(ram_of(0x1F), None);
        assert_eq!(ram_of(0x40), None);
        assert_eq!(eeprom_of(0xFF5F), None);
        assert_eq!(eeprom_of(0xFF80), None);
        for ram in 0..=u16::MAX {
            if let Some(eeprom) = eeprom_of(ram) {
                assert_eq!(ram_of(eeprom), Some(ram));
            }
        }
    }

    /// The mirrors have the names of what they mirror: ND21 13.1.4, 14.6.6.
    #[test]
    fn mirrors_have_the_same_name_and_scale() {
        for link in LINKS.iter().filter(|link| link.size == 2) {
            let mirror = cell_at(link.eeprom).unwrap();
            let original = cells::cell_at(link.ram).unwrap();
            assert_eq!(mirror.printed.strip_prefix("EE_"), Some(original.printed));
            assert_eq!(
                (mirror.scale, mirror.signed, mirror.size),
                (original.scale, original.signed, original.size)
            );
        }
    }

    /// The addresses that the bus end itself uses are those of the table.
    #[test]
    fn addresses_of_the_bus_end() {
        assert_eq!(
            cell("EE_selftest").unwrap().address,
            u16::from(nd21::ee::SELFTEST)
        );
        let parameters = cell("EE_RAM").unwrap();
        assert_eq!(parameters.address, u16::from(nd21::EE_PARAMETERS));
        assert_eq!(parameters.size, nd21::PARAMETER_COUNT);
        assert_eq!(ram_of(nd21::EE_PARAMETERS), Some(nd21::PARAMETERS));
    }

    /// ND21 13.1.9: the forty positions fill `EE_Ablauf` (E62).
    #[test]
    fn positions_fill_the_cycle_control() {
        let block = cell("EE_Ablauf").unwrap();
        assert_eq!(u16::from(POSITIONS) * 4, block.size);
        assert_eq!(eeprom_address(0).map(u16::from), Some(block.address));
        let last = eeprom_address(POSITIONS - 1).unwrap();
        assert_eq!(u16::from(last) + 3, *block.addresses().end());
    }
}
