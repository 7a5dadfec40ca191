//! The EEPROM of an ND21 that was never configured: the drive can be switched on and its motor turned.
//!
//! The manual prints no parameter set. This one is for a 5610 with the motor of [`super::PlantParameters`]: nominal
//! value from NOVOBUS, position regulator on (`SwVersion` 43), GPO2 shows "in position" (`HwVersion` C4), end
//! switches active high, so that none is needed. With nothing in plug X3 such a drive is blocked.

use super::eeprom_controller::set_parity;
use harness_proto::nd21::ee;

/// EEPROM address and bytes; everything else is 00.
#[rustfmt::skip]
const CELLS: &[(u8, &[u8])] = &[
    (ee::SERIENNUMMER, &[0x00, 0x00, 0x01]),
    // 1 January 1996, the month of the manual (14.8.3).
    (ee::INIT_DATUM,   &[0x06, 0x21]),
    // The parameters: HwVersion, HwVersion2, SwVersion, SwVersion2 ...
    (0x20, &[0xC4, 0xFF, 0x43, 0xFF]),
    // MaxTempKK 85 °C, MaxTempMot (no sensor), imax 20 Aeff, i0 10 Aeff,
    (0x24, &[0x54, 0xFF, 0x74, 0x3A]),
    // nMax 3000 rpm, nothing, ramps of 1027 rad/s2 each,
    (0x28, &[0x2C, 0x3D, 0x00, 0x00, 0x00, 0x10, 0x00, 0x10]),
    // nKp, nKi, LKp, LKd, dLage, slipping error of one turn,
    (0x30, &[0x20, 0x10, 0x40, 0x08, 0x00, 0x00, 0x01, 0x00]),
    // VCOlin 3000 rpm at 10 V, no tacho filter, emk0 180 V, Window, AnOut nist, offset, ReversTakt, VCOlinL.
    (0x38, &[0x32, 0x00, 0x46, 0x10, 0x0C, 0x00, 0x25, 0x00]),
    (ee::IMPULSZAHL,   &[0x04, 0x00]),
    (ee::POLE,         &[0x06]),
    // RefV1 200 rpm, RefV2 -50 rpm.
    (ee::REF_V1,       &[0x02, 0xF3]),
    (ee::REF_V2,       &[0xFF, 0x43]),
    // RefUmdr0 0, RefLage0 180 degrees: the angle of the reference position itself.
    (ee::REF_LAGE0,    &[0x80, 0x00]),
    // Vtippen 100 rpm.
    (ee::VTIPPEN,      &[0x01, 0x79]),
    (ee::PROG_DATUM,   &[0x06, 0x21]),
];

/// The EEPROM as delivered.
#[must_use]
pub fn eeprom() -> [u8; 256] {
    let mut eeprom = [0; 256];
    for (address, bytes) in CELLS {
        let first = usize::from(*address);
        if let Some(place) = eeprom.get_mut(first..first + bytes.len()) {
            place.copy_from_slice(bytes);
        }
    }
    set_parity(&mut eeprom);
    eeprom
}
