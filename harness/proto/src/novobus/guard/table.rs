//! The cells of a drive, classified by the effect of writing them: one table (ND21 14.2.1).
//!
//! The last column is for `max_speed`. It classifies a cell as harmless, as a speed, or as a cell through which a motor
//! could turn faster than the speeds that the guard bounds, or turn without them. A cell that is not in the table needs everything allowed
//! and no `max_speed`.

use super::known::Facts;
use super::limits::Need;
use crate::nd21::eeprom::ram_of;
use crate::nd21::{ee, ram};

/// What a change of a cell does to the speed of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pace {
    /// It makes no motor turn faster.
    Same,
    /// It is a speed: a whole word within `max_speed` passes.
    Speed,
    /// A motor may turn, at speeds that are within `max_speed` if these facts are known.
    Knowing(Facts),
    /// A motor could turn faster: section and reason. It does not pass where there is a `max_speed`.
    Faster(&'static str, &'static str),
}

use Pace::{Faster, Same, Speed};

const COMMUTATION: &str = "it moves the motor's commutation";
const MEASURED: &str = "the regulators work with it as a measured value";
const REGULATOR: &str =
    "it is a setting of the regulators, with which the motor can leave its nominal speed";
const POSITION: &str = "the position regulator would make up for the difference at any speed";
const INPUT: &str = "it scales or shifts the nominal value of an analogue or frequency input";
const CALCULATED: &str = "the drive has calculated it and drives by it";
const INTERNAL: &str = "it is the drive's own, and the manual does not say what a change does";
const CONFIGURATION: &str = "it selects where the nominal value comes from, the range of speeds, and modes in which the drive turns by \
     itself";

/// First and last address, what writing there needs, and what it does to the speed of a motor. In order of addresses.
#[rustfmt::skip]
const CELLS: &[(u16, u16, Need, Pace)] = &[
    (ram::POLE_JUMP, ram::POLE_JUMP + 1, Need::MOTION, Faster("14.2.1", COMMUTATION)),
    (ram::I2, ram::I2 + 3, Need::MOTION, Faster("14.2.1", INTERNAL)),
    // Address and byte of the EEPROM controller; nothing happens before its command (14.10.5).
    (ram::EEPROM_BUFFER, ram::EEPROM_BUFFER + 1, Need::NONE, Same),
    (ram::REF_V1, ram::REF_V2 + 1, Need::MOTION, Speed),
    // Counted from the reference point on; the actual and the nominal position move together (13.1.1).
    (ram::REF_UMDR0, ram::REF_LAGE0 + 1, Need::MOTION, Same),
    (ram::VTIPPEN, ram::VTIPPEN + 1, Need::MOTION, Speed),
    (ram::I_OFFSET, ram::I_OFFSET + 1, Need::MOTION, Faster("14.2.1", MEASURED)),
    (ram::D_RESOLVER, ram::D_RESOLVER + 1, Need::MOTION, Faster("14.6.6", COMMUTATION)),
    // Which of the stored positions is next (13.1.9.1).
    (ram::PZ, ram::PZ, Need::MOTION, Same),
    (ram::BZ, ram::BZ, Need::MOTION, Faster("14.2.1", INTERNAL)),
    (ram::AS_COMMAND, ram::AS_COMMAND, Need::MOTION, Faster("13.1.7", "it is the order of the cycle control, which steps and positions")),
    // The angle at which a referencing run ends (13.1.1 step 6).
    (ram::REF_LAGE, ram::REF_LAGE + 1, Need::MOTION, Same),
    // The recording. A simulated drive also takes the points of an S-ramp from there; none starts without `SwVersion2` bit 2 = 0, in which
    // nothing may be started (13.5.3).
    (ram::SCOPE_PUFFER, ram::SCOPE_PUFFER + 255, Need::MOTION, Same),
    (ram::MMAX, ram::MSOLL + 1, Need::MOTION, Faster("14.5.2", "it is a torque of the regulators")),
    (ram::IASOLL, ram::IBIST, Need::MOTION, Faster("14.5.1.1", "it is a current of the regulators")),
    (ram::NSOLL, ram::NSOLL + 1, Need::MOTION, Speed),
    (ram::NSOLLRAMPE, ram::NSOLLRAMPE + 1, Need::MOTION, Faster("14.5.3.1", "the motor would jump to it without a ramp")),
    (ram::NIST, ram::NIST + 1, Need::MOTION, Faster("14.5.3.1", MEASURED)),
    (ram::N_INTEGRATOR, ram::EMK, Need::MOTION, Faster("14.2.1", "it is a state of the regulators")),
    (ram::LAGESOLL_L, ram::LAGE0 + 1, Need::MOTION, Faster("14.5.5", POSITION)),
    (ram::ICRA, ram::VCO_OFFSET + 1, Need::MOTION, Faster("14.7.2", INPUT)),
    (ram::TEMP_KK, ram::TEMP_MOT, Need::MOTION, Same),
    // The oscilloscope only looks on (14.10.6).
    (ram::SCOPE_STATUS, ram::SCOPE_DELAY, Need::NONE, Same),
    (ram::SCOPE_TRIGGER, ram::SCOPE_SIGNAL2, Need::NONE, Same),
    // The target and the way of a positioning, which runs at `ps_v0` (13.3.2).
    (ram::PS_POSITION_H, ram::PS_IMPULS + 1, Need::MOTION, Same),
    (ram::PS_V0, ram::PS_V0 + 1, Need::MOTION, Speed),
    (ram::PS_K0, ram::PS_DELTA, Need::MOTION, Faster("13.3.2.2", CALCULATED)),
    (ram::CNT2, ram::CNT2, Need::MOTION, Faster("14.2.1", INTERNAL)),
    (ram::UP, ram::CNT_REVERS, Need::MOTION, Faster("14.2.1", INTERNAL)),
    // GPO2's meaning, the analogue output (14.3.3, 14.3.4).
    (ram::HW_VERSION, ram::HW_VERSION, Need::MOTION.and(Need::OUTPUTS), Faster("14.3.3", CONFIGURATION)),
    (ram::HW_VERSION2, ram::HW_VERSION2, Need::MOTION.and(Need::OUTPUTS), Faster("14.3.4", CONFIGURATION)),
    (ram::SW_VERSION, ram::SW_VERSION, Need::MOTION, Faster("14.3.1", CONFIGURATION)),
    (ram::SW_VERSION2, ram::SW_VERSION2, Need::MOTION, Faster("14.3.2", CONFIGURATION)),
    (ram::MAX_TEMP_KK, ram::MAX_TEMP_MOT, Need::MOTION, Same),
    (ram::IMAX, ram::I0, Need::MOTION, Faster("14.5.1.2", REGULATOR)),
    (ram::N_MAX, ram::N_MAX + 1, Need::MOTION, Speed),
    (ram::N_RAMPE_PLUS, ram::N_RAMPE_MINUS + 1, Need::MOTION, Faster("14.5.4", "a motor overshoots on a steep ramp and does not stop on a flat one")),
    (ram::NKP, ram::NKI, Need::MOTION, Faster("14.6.4", REGULATOR)),
    (ram::LKP, ram::LKD, Need::MOTION, Faster("14.6.5", REGULATOR)),
    (ram::D_LAGE, ram::D_LAGE + 1, Need::MOTION, Faster("13.2.1.2", POSITION)),
    (ram::SLIPPING_ERROR, ram::SLIPPING_ERROR + 1, Need::MOTION, Faster("14.5.6", "it is the limit at which a motor that runs away is blocked")),
    (ram::VCO_LIN, ram::VCO_LIN, Need::MOTION, Faster("14.7.2", INPUT)),
    (ram::N_FILTER, ram::N_FILTER, Need::MOTION, Faster("14.6.3", REGULATOR)),
    (ram::EMK0, ram::EMK0, Need::MOTION, Faster("14.6.2", REGULATOR)),
    // "In position" may stand at GPO2 (14.7.5).
    (ram::WINDOW, ram::WINDOW, Need::MOTION.and(Need::OUTPUTS), Same),
    (ram::AN_OUT, ram::AN_OUT_OFFSET, Need::OUTPUTS, Same),
    (ram::REVERS_TAKT, ram::REVERS_TAKT, Need::MOTION, Faster("14.3.1", "it is the cycle of the reversing test mode")),
    (ram::VCO_LIN_L, ram::VCO_LIN_L, Need::MOTION, Faster("14.7.3", INPUT)),
];

/// What a byte of the RAM needs, and what a change of it does to the speed of a motor.
pub(super) fn of_cell(address: u16) -> (Need, Pace) {
    let row = CELLS
        .iter()
        .find(|(first, last, ..)| (*first..=*last).contains(&address));
    row.map_or((Need::EVERYTHING, Same), |(.., need, pace)| (*need, *pace))
}

/// What a byte of the EEPROM does to the speed of a motor behind the next reset (ND21 14.2.2). A speed is written there byte by byte,
/// so that no whole one can be judged.
pub(super) fn of_stored(address: Option<u8>) -> Pace {
    let Some(address) = address else {
        return Faster(
            "14.10.5.3",
            "it is not known which cell of the EEPROM is meant: behind a ReadByte (81), read EEPROMcontrol until its bit 5 is 1, before \
             any disturbance, and then write EEPROMbuffer",
        );
    };
    match address {
        // Dates and names, and the stored positions, which are driven to at `ps_v0` (13.1.9).
        ee::PROG_DATUM..=0xFF | 0..ee::VERSION => Same,
        _ if address == ee::IMPULSZAHL || address == ee::IMPULSZAHL + 1 => Same,
        _ => match ram_of(address).map(of_cell) {
            Some((_, Same)) => Same,
            Some((_, Faster(section, why))) => Faster(section, why),
            Some((_, Speed)) => Faster(
                "14.2.2",
                "it is half of a speed that holds behind the next reset: write it without `max_speed`",
            ),
            _ => Faster("14.2.2", "it is a setting that holds behind the next reset"),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nd21::cells::RAM;
    use crate::nd21::units::Scale;

    /// Rows are in order and do not overlap; each cell lies in one row as a whole.
    #[test]
    fn rows_are_in_order() {
        for pair in CELLS.windows(2) {
            assert!(
                pair[0].0 <= pair[0].1 && pair[0].1 < pair[1].0,
                "{:04X}",
                pair[1].0
            );
        }
        for cell in RAM {
            let paces: alloc::vec::Vec<_> = cell.addresses().map(of_cell).collect();
            assert!(
                paces.windows(2).all(|pair| pair[0] == pair[1]),
                "{}",
                cell.printed
            );
        }
    }

    /// ND21 14.5.3: every cell that the manual gives the scale of a speed is bounded or does not pass.
    #[test]
    fn every_speed_is_bounded() {
        for cell in RAM {
            let speed = matches!(cell.scale, Some(Scale::Speed | Scale::MaxSpeed));
            let (_, pace) = of_cell(cell.address);
            assert!(
                !speed || matches!(pace, Speed | Faster(..)),
                "{}",
                cell.printed
            );
            assert!(speed || pace != Speed, "{}", cell.printed);
        }
    }

    /// What stands in the EEPROM is judged as what it is loaded into (ND21 14.2.2).
    #[test]
    fn the_eeprom_follows_the_ram() {
        assert_eq!(of_stored(Some(0x3B)), Same);
        for denied in [
            None,
            Some(ee::VERSION),
            Some(0x22),
            Some(0x28),
            Some(0x38),
            Some(ee::POLE),
            Some(ee::SELFTEST),
        ] {
            assert!(matches!(of_stored(denied), Faster(..)), "{denied:02X?}");
        }
    }
}
