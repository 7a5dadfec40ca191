//! The RAM of the drive, cell by cell (ND21 14.2.1).

use super::units::{DriveUnits, Scale, UnitError, Value};

/// What a master may do with a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CellAccess {
    /// The manual calls it a read only value or byte.
    Read,
    /// It can be read and written (14.2).
    Write,
    /// Reserved.
    Reserved,
}

/// One row of the memory tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The name as printed.
    pub printed: &'static str,
    /// The meaning, in English; empty where none is printed.
    pub english: &'static str,
    /// The address of the first byte.
    pub address: u16,
    /// How many bytes; in a word the high byte comes first, but see [`Scale::Hours`].
    pub size: u16,
    /// Whether the manual says two's complement; `false` where it is silent.
    pub signed: bool,
    /// What may be done with it.
    pub access: CellAccess,
    /// The bits that its figure marks with R, for read only.
    pub read_only_bits: u8,
    /// Its scale, if the manual gives one.
    pub scale: Option<Scale>,
    /// The section that says most about it.
    pub section: &'static str,
}

impl Cell {
    /// The addresses from the first to the last byte.
    #[must_use]
    pub const fn addresses(&self) -> core::ops::RangeInclusive<u16> {
        self.address..=self.address + (self.size - 1)
    }

    /// The scale of the number that begins with this cell: that of a position where it is the word of the
    /// whole turns, as the word behind it is the angle (14.5.5).
    #[must_use]
    pub const fn number(&self) -> Option<Scale> {
        match self.scale {
            Some(Scale::Turns) => Some(Scale::Position),
            scale => scale,
        }
    }

    /// The value of these bytes, in the order of their addresses. `None` if the cell has no scale or
    /// another number of bytes.
    ///
    /// # Errors
    /// The bytes are outside what the manual gives a meaning to.
    #[must_use]
    pub fn value(&self, bytes: &[u8], drive: DriveUnits) -> Option<Result<Value, UnitError>> {
        self.scale?.value(bytes, drive)
    }
}

pub(super) const SIGNED: bool = true;
pub(super) const PLAIN: bool = false;

/// One row a cell: address, bytes, `SIGNED` or not, access and the bits marked R, scale, section, name as
/// printed and as a constant (none where the cell is reserved), meaning. Makes the table and a module with
/// the addresses under these names.
macro_rules! cells {
    ($(#[$table_meta:meta])* table $table:ident; $(#[$module_meta:meta])* addresses $module:ident: $type:ty;
        $($address:literal $size:literal $signed:ident $access:ident $(R $mask:literal)?
        [$($scale:ident)?] $section:literal $printed:literal $($name:ident)? $english:literal;)+) => {
        $(#[$table_meta])*
        pub const $table: &[Cell] = &[$(Cell {
            printed: $printed,
            english: $english,
            address: $address,
            size: $size,
            signed: $signed,
            access: CellAccess::$access,
            read_only_bits: 0 $(| $mask)?,
            scale: cells!(@scale $($scale)?),
            section: $section,
        },)+];

        $(#[$module_meta])*
        pub mod $module {
            $($(
                #[doc = concat!("`", $printed, "`: ", $english, " (ND21 ", $section, ").")]
                pub const $name: $type = $address;
            )?)+
        }
    };
    (@scale) => { None };
    (@scale $scale:ident) => { Some(Scale::$scale) };
}
pub(super) use cells;

#[rustfmt::skip]
cells! {
/// Every row of the table, FD80 to FF7F without a gap, in order of addresses (ND21 14.2.1).
///
/// Where the print is in doubt:
///
/// * FF52-FF55: `ps_k1` with two bytes at FF52 overlaps `ps_delta` at FF53, and FF55 belongs to nothing
///   (E79, open). The printed sizes 2, 1 and 1 fill FF52-FF55 exactly, so here the sizes hold and
///   `ps_delta` and the reserved byte stand one address further than printed. `ps_v1` is at FF50
///   (13.3.2.2 has FF51, E71).
/// * `ps_positionL` is the rotor position, not the rotation (E78).
/// * `LKp` and `LKd` belong to the position regulator (E80).
/// * `mmax` and `msoll` are torques (E95); 14.5.2 calls both read only.
/// * `MaxTempKK`: 14.5.7.1 calls it read only with the temperature itself. 14.5.7.2 says the contrary
///   of `MaxTempMot`.
/// * `lageist` and `umdrist`: 14.5.5 does not call them read only, and 13.2.1.2 writes to `umdrist`.
/// * `Status`: bits 7 and 0 can be written (14.10), so the six R are bits 6-1 (E91, open).
/// * `Flags2`: two bits are marked R, probably those of "NOVOBUS OK!" and "NOVOBUS timeout"; here they are
///   bits 1 and 0 (E92, open).
/// * `RefV1`, `RefV2`, `Vtippen` and the `ps_v` cells are speeds for which no scale of their own is
///   printed; that of 14.5.3 is taken, because `ps_v0` is loaded with `nMax` (13.1.4).
/// * `uP`, the utilisation, has no scale in the manual.
table RAM;
/// The addresses of the RAM cells (ND21 14.2.1).
addresses ram: u16;
    0xFD80 2 PLAIN Write [] "14.2.1" "PoleJump" POLE_JUMP "jump address for the motor polarity";
    0xFD82 2 PLAIN Write [] "14.10.1" "errorcode" ERRORCODE "error code";
    0xFD84 4 PLAIN Write [] "14.2.1" "i2" I2 "";
    0xFD88 2 PLAIN Write [] "14.10.5" "EEPROMbuffer" EEPROM_BUFFER "EEPROM controller: address and byte";
    // Printed in two lines, "EEPROM control"; 14.10.5.1 has one word.
    0xFD8A 1 PLAIN Write [] "14.10.5" "EEPROMcontrol" EEPROM_CONTROL "EEPROM controller: command and state";
    0xFD8B 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFD8C 2 SIGNED Write [Speed] "13.1.4" "RefV1" REF_V1 "first speed of the referencing run";
    0xFD8E 2 SIGNED Write [Speed] "13.1.4" "RefV2" REF_V2 "second speed of the referencing run";
    0xFD90 2 SIGNED Write [Turns] "13.1.4" "RefUmdr0" REF_UMDR0 "rotation counter after a referencing run";
    0xFD92 2 PLAIN Write [Angle] "13.1.4" "RefLage0" REF_LAGE0 "rotor position after a referencing run";
    0xFD94 2 PLAIN Write [Speed] "13.1.4" "Vtippen" VTIPPEN "speed of stepping";
    0xFD96 2 PLAIN Write [] "14.2.1" "iOffset" I_OFFSET "measurement of the current, internal";
    0xFD98 2 PLAIN Write [Angle] "14.6.6" "dRESOLVER" D_RESOLVER "resolver adjustment";
    0xFD9A 1 PLAIN Write [] "13.1.9.1" "PZ" PZ "position marker of the cycle control";
    0xFD9B 1 PLAIN Write [] "14.2.1" "BZ" BZ "bit marker of the cycle control";
    0xFD9C 1 PLAIN Write [] "14.2.1" "AS_Command" AS_COMMAND "command of the cycle control";
    0xFD9D 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFD9E 2 PLAIN Write [Angle] "13.1.4" "RefLage" REF_LAGE "displacement of the zero point, referencing run";
    0xFDA0 256 PLAIN Write [] "14.10.6.6" "scope_puffer" SCOPE_PUFFER "oscilloscope: recording";
    0xFEA0 96 PLAIN Write [] "14.2.1" "stack" STACK "stack of the drive's program";
    0xFF00 1 PLAIN Write R 0x7E [] "14.4.1" "Status" STATUS "status byte";
    0xFF01 1 SIGNED Read [TorqueLimit] "14.5.2" "mmax" MMAX "maximum torque";
    0xFF02 2 SIGNED Read [Torque] "14.5.2" "msoll" MSOLL "torque, nominal value";
    0xFF04 1 SIGNED Read [MomentaryCurrent] "14.5.1.1" "iasoll" IASOLL "current of phase A, nominal value";
    0xFF05 1 SIGNED Read [MomentaryCurrent] "14.5.1.1" "ibsoll" IBSOLL "current of phase B, nominal value";
    0xFF06 1 SIGNED Read [MomentaryCurrent] "14.5.1.1" "iaist" IAIST "current of phase A, actual value";
    0xFF07 1 SIGNED Read [MomentaryCurrent] "14.5.1.1" "ibist" IBIST "current of phase B, actual value";
    0xFF08 2 SIGNED Write [Speed] "14.5.3.1" "nsoll" NSOLL "spin speed, nominal value";
    0xFF0A 2 SIGNED Read [Speed] "14.5.3.1" "nsollrampe" NSOLLRAMPE "spin speed, nominal value after the ramp";
    0xFF0C 2 SIGNED Read [Speed] "14.5.3.1" "nist" NIST "spin speed, actual value";
    0xFF0E 2 PLAIN Write [] "14.2.1" "nIntegrator" N_INTEGRATOR "integrator of the speed regulator";
    0xFF10 1 PLAIN Write [] "14.2.1" "emk" EMK "back EMF of the motor";
    0xFF11 1 PLAIN Write [] "14.2.1" "lagesollL" LAGESOLL_L "";
    0xFF12 2 SIGNED Write [Turns] "14.5.5" "umdrsoll" UMDRSOLL "rotation, nominal value";
    0xFF14 2 PLAIN Write [Angle] "14.5.5" "lagesoll" LAGESOLL "rotor position, nominal value";
    0xFF16 2 SIGNED Write [Turns] "14.5.5" "umdrist" UMDRIST "rotation, actual value";
    0xFF18 2 PLAIN Write [Angle] "14.5.5" "lageist" LAGEIST "rotor position, actual value";
    0xFF1A 2 PLAIN Write [Angle] "14.2.1" "lage0" LAGE0 "rotor position, old actual value";
    0xFF1C 2 PLAIN Reserved [] "14.2.1" "nsollAnalog" NSOLL_ANALOG "";
    0xFF1E 2 PLAIN Write [] "14.2.1" "icra" ICRA "input capture register A";
    0xFF20 2 PLAIN Write [] "14.2.1" "icra0" ICRA0 "input capture register A, old";
    0xFF22 2 PLAIN Write [] "14.7.2" "VCOoffset" VCO_OFFSET "offset of the analogue input";
    0xFF24 1 PLAIN Write [] "14.2.1" "adcsr" ADCSR "control and status of the A/D converter";
    0xFF25 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF26 1 PLAIN Read [CoolerTemperature] "14.5.7.1" "TempKK" TEMP_KK "temperature of the cooler";
    0xFF27 1 PLAIN Read [MotorSensor] "14.5.7.2" "TempMot" TEMP_MOT "temperature of the motor";
    0xFF28 2 PLAIN Reserved [] "14.2.1" "nsollDigital" NSOLL_DIGITAL "";
    0xFF2A 1 PLAIN Write [] "14.2.1" "Novobus" NOVOBUS "communication bytes";
    0xFF2B 1 PLAIN Write [] "14.2.1" "Command" COMMAND "";
    0xFF2C 4 PLAIN Write [] "14.2.1" "ParamBuffer" PARAM_BUFFER "";
    0xFF30 1 PLAIN Write [] "14.2.1" "ChecksumIn" CHECKSUM_IN "";
    0xFF31 1 PLAIN Write [] "14.2.1" "ChecksumOut" CHECKSUM_OUT "";
    0xFF32 1 PLAIN Write [] "14.10.3" "DataIn" DATA_IN "address of incoming process data";
    0xFF33 1 PLAIN Write [] "14.2.1" "DataInBuffer" DATA_IN_BUFFER "incoming process data";
    0xFF34 1 PLAIN Write [] "14.10.3" "DataOut" DATA_OUT "address of outgoing process data";
    0xFF35 1 PLAIN Write [] "14.2.1" "DataOutBuffer" DATA_OUT_BUFFER "outgoing process data";
    0xFF36 1 PLAIN Write [] "14.2.1" "BusAddr" BUS_ADDR "";
    0xFF37 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF38 1 PLAIN Write [] "14.10.6.5" "scope_status" SCOPE_STATUS "oscilloscope: status";
    0xFF39 1 PLAIN Write [ScopePeriod] "14.10.6.2" "scope_timer0" SCOPE_TIMER0 "oscilloscope: time base";
    0xFF3A 2 PLAIN Write [] "14.10.6.4" "scope_counter" SCOPE_COUNTER "oscilloscope: trigger delay";
    0xFF3C 1 PLAIN Write [] "14.10.6.4" "scope_delay" SCOPE_DELAY "oscilloscope: delay pointer";
    0xFF3D 1 PLAIN Write [] "14.10.6.6" "scope_pointer" SCOPE_POINTER "oscilloscope: newest byte, internal";
    0xFF3E 1 PLAIN Write [] "14.10.6.1" "scope_trigger" SCOPE_TRIGGER "oscilloscope: address of the trigger signal";
    0xFF3F 1 PLAIN Write [] "14.10.6.3" "scope_level" SCOPE_LEVEL "oscilloscope: trigger threshold";
    0xFF40 1 PLAIN Write [] "14.10.6.1" "scope_signal1" SCOPE_SIGNAL1 "oscilloscope: address of signal 1";
    0xFF41 1 PLAIN Write [] "14.10.6.1" "scope_signal2" SCOPE_SIGNAL2 "oscilloscope: address of signal 2";
    0xFF42 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF43 1 PLAIN Write [] "13.3.1" "ps_status" PS_STATUS "positioning control: status";
    0xFF44 2 SIGNED Write [Turns] "13.3.2.1" "ps_positionH" PS_POSITION_H "positioning control: rotation of the target";
    0xFF46 2 PLAIN Write [Angle] "13.3.2.1" "ps_positionL" PS_POSITION_L "positioning control: rotor position of the target";
    0xFF48 2 PLAIN Write [] "13.3.2.2" "ps_umdrehung" PS_UMDREHUNG "positioning control: rotation counter";
    0xFF4A 2 PLAIN Write [] "13.3.2.2" "ps_impuls" PS_IMPULS "positioning control: impulse counter";
    0xFF4C 2 PLAIN Write [Speed] "13.1.4" "ps_v0" PS_V0 "positioning control: first speed";
    0xFF4E 2 PLAIN Write [] "13.3.2.2" "ps_k0" PS_K0 "positioning control: duration of the first speed";
    0xFF50 2 PLAIN Write [Speed] "13.3.2.2" "ps_v1" PS_V1 "positioning control: second speed";
    0xFF52 2 PLAIN Write [] "13.3.2.2" "ps_k1" PS_K1 "positioning control: duration of the second speed";
    // Printed at FF53 and FF54 (E79).
    0xFF54 1 PLAIN Write [] "13.3.2.2" "ps_delta" PS_DELTA "positioning control: remaining path";
    0xFF55 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF56 1 PLAIN Read R 0xFF [] "14.4.2" "Flags" FLAGS "status byte";
    0xFF57 1 PLAIN Write R 0x03 [] "14.4.3" "Flags2" FLAGS2 "status byte";
    0xFF58 1 PLAIN Write [] "14.2.1" "Cnt2" CNT2 "internal counter";
    0xFF59 1 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF5A 2 PLAIN Write [] "14.2.1" "uP" UP "utilisation of the micro controller";
    0xFF5C 2 PLAIN Write [] "14.2.1" "RealTimeClock" REAL_TIME_CLOCK "time counter";
    0xFF5E 1 PLAIN Write [] "14.2.1" "CntBlink" CNT_BLINK "cycle counter of the display";
    0xFF5F 1 PLAIN Write [] "14.2.1" "CntRevers" CNT_REVERS "cycle counter of the reversing mode";
    0xFF60 1 PLAIN Write [] "14.3.3" "HwVersion" HW_VERSION "configuration byte";
    0xFF61 1 PLAIN Write [] "14.3.4" "HwVersion2" HW_VERSION2 "configuration byte";
    0xFF62 1 PLAIN Write [] "14.3.1" "SwVersion" SW_VERSION "configuration byte";
    0xFF63 1 PLAIN Write [] "14.3.2" "SwVersion2" SW_VERSION2 "configuration byte";
    0xFF64 1 PLAIN Read [CoolerTemperature] "14.5.7.1" "MaxTempKK" MAX_TEMP_KK "limit of the cooler's temperature";
    0xFF65 1 PLAIN Write [MotorSensor] "14.5.7.2" "MaxTempMot" MAX_TEMP_MOT "limit of the motor's temperature";
    0xFF66 1 PLAIN Write [EffectiveCurrent] "14.5.1.2" "imax" IMAX "peak current";
    0xFF67 1 PLAIN Write [EffectiveCurrent] "14.5.1.2" "i0" I0 "rated current of the motor";
    0xFF68 2 PLAIN Write [MaxSpeed] "14.5.3.2" "nMax" N_MAX "maximum speed";
    0xFF6A 2 PLAIN Reserved [] "14.2.1" "reserviert" "";
    0xFF6C 2 PLAIN Write [Ramp] "14.5.4" "nRampe+" N_RAMPE_PLUS "acceleration ramp";
    0xFF6E 2 PLAIN Write [Ramp] "14.5.4" "nRampe-" N_RAMPE_MINUS "braking ramp";
    0xFF70 1 PLAIN Write [] "14.6.4" "nKp" NKP "P-part of the speed regulator";
    0xFF71 1 PLAIN Write [] "14.6.4" "nKi" NKI "I-part of the speed regulator";
    0xFF72 1 PLAIN Write [] "14.6.5" "LKp" LKP "P-part of the position regulator";
    0xFF73 1 PLAIN Write [] "14.6.5" "LKd" LKD "D-part of the position regulator";
    0xFF74 2 PLAIN Write [Angle] "13.2.1.2" "dLage" D_LAGE "displacement of the rotor position";
    0xFF76 2 PLAIN Write [SlippingError] "14.5.6" "Slipping error" SLIPPING_ERROR "limit of the slip, with the position regulator";
    0xFF78 1 PLAIN Write [AnalogueSpeed] "14.7.2" "VCOlin" VCO_LIN "scale of the analogue and the frequency input";
    0xFF79 1 PLAIN Write [TachoFilter] "14.6.3" "nFilter" N_FILTER "tacho filter";
    0xFF7A 1 PLAIN Write [Emf] "14.6.2" "emk0" EMK0 "compensation of the back EMF";
    0xFF7B 1 PLAIN Write [] "13.1.4" "Window" WINDOW "window for in-position or speed 0";
    0xFF7C 1 PLAIN Write [] "14.7.4" "AnOut" AN_OUT "address of the signal for the analogue output";
    0xFF7D 1 PLAIN Write [] "14.7.4" "AnOutOffset" AN_OUT_OFFSET "offset of the analogue output";
    0xFF7E 1 PLAIN Write [] "14.2.1" "ReversTakt" REVERS_TAKT "cycle of the test mode";
    0xFF7F 1 PLAIN Write [] "14.7.3" "VCOlinL" VCO_LIN_L "fine scale of the frequency input";
}

/// The RAM cell of this name, exactly as printed. Reserved cells share a name and are not found.
#[must_use]
pub fn cell(name: &str) -> Option<&'static Cell> {
    named(RAM, name)
}

/// The RAM cell to which this address belongs, be it its first byte or not.
#[must_use]
pub fn cell_at(address: u16) -> Option<&'static Cell> {
    at(RAM, address)
}

/// Whether the drive changes a cell by itself as time goes on, be it read only or not: states (14.4), the positioning controller (13.3),
/// the EEPROM controller (14.10.5), the oscilloscope (14.10.6), positions (14.5.5), the markers of the cycle control (13.1.9.1), and
/// the counters and buffers of the drive's program (14.2.1).
#[must_use]
pub fn changes_by_itself(address: u16) -> bool {
    const SECTIONS: [&str; 5] = ["14.4", "13.3", "14.10.5", "14.10.6", "14.5.5"];
    const OWN: [core::ops::RangeInclusive<u16>; 6] = [
        ram::PZ..=ram::AS_COMMAND,
        ram::I2..=ram::I2 + 3,
        ram::STACK..=ram::STACK + 95,
        ram::N_INTEGRATOR..=ram::LAGE0 + 1,
        ram::ICRA..=ram::ICRA0 + 1,
        ram::CNT2..=ram::CNT_REVERS,
    ];
    OWN.iter().any(|cells| cells.contains(&address))
        || cell_at(address).is_some_and(|cell| {
            let is_section = |section: &&str| cell.section.starts_with(*section);
            SECTIONS.iter().any(is_section)
        })
}

/// The cell of this name, but for the name "reserviert" and none.
pub(super) fn named(table: &'static [Cell], name: &str) -> Option<&'static Cell> {
    if name.is_empty() || name == "reserviert" {
        return None;
    }
    table.iter().find(|cell| cell.printed == name)
}

/// The cell of a table in order of addresses that has this one.
pub(super) fn at(table: &'static [Cell], address: u16) -> Option<&'static Cell> {
    let after = table.partition_point(|cell| cell.address <= address);
    let cell = table.get(after.checked_sub(1)?)?;
    cell.addresses().contains(&address).then_some(cell)
}

#[cfg(test)]
mod tests {
    use super::super as nd21;
    use super::super::units::{DriveType, Ratio, SpeedRange};
    use super::*;

    const DRIVE: DriveUnits = DriveUnits {
        device: DriveType::Nd5610,
        range: SpeedRange::To8000,
    };

    /// ND21 14.2: 512 bytes, FD80-FF7F. No gap, no overlap.
    #[test]
    fn fills_the_memory_of_14_2() {
        let mut next = 0xFD80;
        for cell in RAM {
            assert_eq!(cell.address, next, "{}", cell.printed);
            next += cell.size;
        }
        assert_eq!(next, 0xFF80);
    }

    /// The H8 has words at even addresses only.
    #[test]
    fn words_are_even() {
        for cell in RAM.iter().filter(|cell| cell.size > 1) {
            assert_eq!(cell.address % 2, 0, "{}", cell.printed);
        }
    }

    #[test]
    fn names_are_unique() {
        for cell in RAM {
            let same = RAM.iter().filter(|other| other.printed == cell.printed);
            assert!(cell.printed == "reserviert" || same.count() == 1);
            if cell.printed != "reserviert" {
                assert_eq!(super::cell(cell.printed), Some(cell));
            }
        }
        assert_eq!(super::cell("reserviert"), None);
        assert_eq!(super::cell("tempKK"), None);
        assert_eq!(super::cell(""), None);
    }

    #[test]
    fn by_address() {
        for cell in RAM {
            for address in cell.addresses() {
                assert_eq!(cell_at(address), Some(cell));
            }
        }
        for outside in [0, 0xFD7F, 0xFF80, 0xFFFF] {
            assert_eq!(cell_at(outside), None);
        }
    }

    /// The cells that the bus end itself uses are those of the table.
    #[test]
    fn cells_of_the_bus_end() {
        for (name, address) in [
            ("errorcode", nd21::ram::ERRORCODE),
            ("DataIn", nd21::ram::DATA_IN),
            ("DataOut", nd21::ram::DATA_OUT),
            ("BusAddr", nd21::ram::BUS_ADDR),
            ("Status", nd21::ram::STATUS),
            ("Flags2", nd21::ram::FLAGS2),
            ("HwVersion", nd21::PARAMETERS),
        ] {
            assert_eq!(cell(name).unwrap().address, address, "{name}");
        }
        let status = cell("Status").unwrap();
        let writable = nd21::bits::status::BLOCK | nd21::bits::status::STOP;
        assert_eq!(status.read_only_bits, !writable);
        let last = nd21::PARAMETERS + nd21::PARAMETER_COUNT - 1;
        assert_eq!(cell_at(last), cell("VCOlinL"));
    }

    /// Every scale takes as many bytes as its cell has.
    #[test]
    fn scales_fit_their_cells() {
        for cell in RAM {
            if let Some(scale) = cell.scale {
                assert_eq!(scale.size(), cell.size, "{}", cell.printed);
                let bytes = [0x10, 0x10];
                let bytes = bytes.get(..usize::from(cell.size)).unwrap();
                assert!(cell.value(bytes, DRIVE).is_some(), "{}", cell.printed);
            }
        }
    }

    /// ND21 14.5.5: behind every word of whole turns stands the angle.
    #[test]
    fn turns_and_angle_stand_together() {
        for table in [RAM, super::super::eeprom::EEPROM] {
            for pair in table.windows(2) {
                let turns = pair[0].scale == Some(Scale::Turns);
                assert!(!turns || pair[1].scale == Some(Scale::Angle));
            }
        }
    }

    /// ND21 14.10.6.1: `iaist` = H'4C on a 5610.
    #[test]
    fn value_of_a_cell() {
        let value = cell("iaist").unwrap().value(&[0x4C], DRIVE);
        let expected = Ratio::decimal(18_544, 3).unwrap();
        assert_eq!(value, Some(Ok(Value::Exact(expected))));
        assert_eq!(cell("uP").unwrap().value(&[0, 0], DRIVE), None);
    }
}
