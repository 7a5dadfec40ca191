//! The error codes of the drive (ND21 14.11).
//!
//! The manual gives each code a name and no other meaning; what the names say is here in English.

use alloc::format;
use alloc::string::String;
use core::fmt;

/// One row a code, under the section that lists it: the variant, the code, the name as printed, the
/// meaning.
macro_rules! error_codes {
    ($($section:literal { $($variant:ident $code:literal $name:literal $meaning:literal;)+ })+) => {
        /// A code of the cell `errorcode` (ND21 14.11).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum ErrorCode {
            $($(
                #[doc = concat!("`", $name, "`, ", stringify!($code), ": ", $meaning)]
                $variant = $code,
            )+)+
        }

        impl ErrorCode {
            /// All of them, in order of their codes.
            pub const ALL: &[Self] = &[$($(Self::$variant,)+)+];

            /// The name that the manual prints.
            #[must_use]
            pub const fn printed_name(self) -> &'static str {
                match self {
                    $($(Self::$variant => $name,)+)+
                }
            }

            /// The section that lists it.
            #[must_use]
            pub const fn section(self) -> &'static str {
                match self {
                    $($(Self::$variant)|+ => $section,)+
                }
            }

            /// What the name says, in English.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self {
                    $($(Self::$variant => $meaning,)+)+
                }
            }
        }
    };
}

/// The code that the PLC function `Leitungstest` causes (ND21 13.1.7.5). 14.11.15 does not list it
/// (E60, open), so it is no [`ErrorCode`].
pub const LINE_TEST: u16 = 0x0602;

// P44 (H'0044) is not printed, and of ports 5 and 8 only bits 0-2 and 0-6 are.
error_codes! {
    "14.11.1" {
        P10 0x0010 "P10" "Bit 0 of port 1 of the micro controller.";
        P11 0x0011 "P11" "Bit 1 of port 1 of the micro controller.";
        P12 0x0012 "P12" "Bit 2 of port 1 of the micro controller.";
        P13 0x0013 "P13" "Bit 3 of port 1 of the micro controller.";
        P14 0x0014 "P14" "Bit 4 of port 1 of the micro controller.";
        P15 0x0015 "P15" "Bit 5 of port 1 of the micro controller.";
        P16 0x0016 "P16" "Bit 6 of port 1 of the micro controller.";
        P17 0x0017 "P17" "Bit 7 of port 1 of the micro controller.";
        P20 0x0020 "P20" "Bit 0 of port 2 of the micro controller.";
        P21 0x0021 "P21" "Bit 1 of port 2 of the micro controller.";
        P22 0x0022 "P22" "Bit 2 of port 2 of the micro controller.";
        P23 0x0023 "P23" "Bit 3 of port 2 of the micro controller.";
        P24 0x0024 "P24" "Bit 4 of port 2 of the micro controller.";
        P25 0x0025 "P25" "Bit 5 of port 2 of the micro controller.";
        P26 0x0026 "P26" "Bit 6 of port 2 of the micro controller.";
        P27 0x0027 "P27" "Bit 7 of port 2 of the micro controller.";
        P30 0x0030 "P30" "Bit 0 of port 3 of the micro controller.";
        P31 0x0031 "P31" "Bit 1 of port 3 of the micro controller.";
        P32 0x0032 "P32" "Bit 2 of port 3 of the micro controller.";
        P33 0x0033 "P33" "Bit 3 of port 3 of the micro controller.";
        P34 0x0034 "P34" "Bit 4 of port 3 of the micro controller.";
        P35 0x0035 "P35" "Bit 5 of port 3 of the micro controller.";
        P36 0x0036 "P36" "Bit 6 of port 3 of the micro controller.";
        P37 0x0037 "P37" "Bit 7 of port 3 of the micro controller.";
        P40 0x0040 "P40" "Bit 0 of port 4 of the micro controller.";
        P41 0x0041 "P41" "Bit 1 of port 4 of the micro controller.";
        P42 0x0042 "P42" "Bit 2 of port 4 of the micro controller.";
        P43 0x0043 "P43" "Bit 3 of port 4 of the micro controller.";
        P45 0x0045 "P45" "Bit 5 of port 4 of the micro controller.";
        P46 0x0046 "P46" "Bit 6 of port 4 of the micro controller.";
        P47 0x0047 "P47" "Bit 7 of port 4 of the micro controller.";
        P50 0x0050 "P50" "Bit 0 of port 5 of the micro controller.";
        P51 0x0051 "P51" "Bit 1 of port 5 of the micro controller.";
        P52 0x0052 "P52" "Bit 2 of port 5 of the micro controller.";
        P60 0x0060 "P60" "Bit 0 of port 6 of the micro controller.";
        P61 0x0061 "P61" "Bit 1 of port 6 of the micro controller.";
        P62 0x0062 "P62" "Bit 2 of port 6 of the micro controller.";
        P63 0x0063 "P63" "Bit 3 of port 6 of the micro controller.";
        P64 0x0064 "P64" "Bit 4 of port 6 of the micro controller.";
        P65 0x0065 "P65" "Bit 5 of port 6 of the micro controller.";
        P66 0x0066 "P66" "Bit 6 of port 6 of the micro controller.";
        P67 0x0067 "P67" "Bit 7 of port 6 of the micro controller.";
        P70 0x0070 "P70" "Bit 0 of port 7 of the micro controller.";
        P71 0x0071 "P71" "Bit 1 of port 7 of the micro controller.";
        P72 0x0072 "P72" "Bit 2 of port 7 of the micro controller.";
        P73 0x0073 "P73" "Bit 3 of port 7 of the micro controller.";
        P74 0x0074 "P74" "Bit 4 of port 7 of the micro controller.";
        P75 0x0075 "P75" "Bit 5 of port 7 of the micro controller.";
        P76 0x0076 "P76" "Bit 6 of port 7 of the micro controller.";
        P77 0x0077 "P77" "Bit 7 of port 7 of the micro controller.";
        P80 0x0080 "P80" "Bit 0 of port 8 of the micro controller.";
        P81 0x0081 "P81" "Bit 1 of port 8 of the micro controller.";
        P82 0x0082 "P82" "Bit 2 of port 8 of the micro controller.";
        P83 0x0083 "P83" "Bit 3 of port 8 of the micro controller.";
        P84 0x0084 "P84" "Bit 4 of port 8 of the micro controller.";
        P85 0x0085 "P85" "Bit 5 of port 8 of the micro controller.";
        P86 0x0086 "P86" "Bit 6 of port 8 of the micro controller.";
        P90 0x0090 "P90" "Bit 0 of port 9 of the micro controller.";
        P91 0x0091 "P91" "Bit 1 of port 9 of the micro controller.";
        P92 0x0092 "P92" "Bit 2 of port 9 of the micro controller.";
        P93 0x0093 "P93" "Bit 3 of port 9 of the micro controller.";
        P94 0x0094 "P94" "Bit 4 of port 9 of the micro controller.";
        P95 0x0095 "P95" "Bit 5 of port 9 of the micro controller.";
        P96 0x0096 "P96" "Bit 6 of port 9 of the micro controller.";
        P97 0x0097 "P97" "Bit 7 of port 9 of the micro controller.";
    }
    "14.11.2" {
        EepromRdwr 0x0100 "EEPROMrdwr" "EEPROM: reading and writing.";
        EepromVoid 0x0101 "EEPROMvoid" "EEPROM: empty.";
        EepromParity 0x0102 "EEPROMparity" "EEPROM: parity.";
        EepromWr 0x0103 "EPROMwr" "EEPROM: writing; the print says EPROM (E110).";
        EepromBus 0x0104 "EEPROMbus" "EEPROM: its bus.";
    }
    "14.11.3" {
        TempMot 0x0110 "TempMot" "A/D converter: motor temperature.";
        TempKk 0x0111 "TempKK" "A/D converter: cooler temperature.";
        StromA 0x0112 "Strom A" "A/D converter: current of phase A.";
        StromB 0x0113 "Strom B" "A/D converter: current of phase B.";
        BitSplitting 0x0114 "BitSplitting" "A/D converter: bit splitting.";
        BitSplittingA 0x0115 "BitSplittingA" "A/D converter: bit splitting, phase A.";
        BitSplittingB 0x0116 "BitSplittingB" "A/D converter: bit splitting, phase B.";
    }
    "14.11.4" {
        AnInput0V 0x0120 "AnInput0V" "Analogue input: 0 V.";
        AnInput10V 0x0121 "AnInput10V" "Analogue input: 10 V.";
        AnInput12V 0x0122 "AnInput12V" "Analogue input: 12 V.";
    }
    "14.11.5" {
        ResolverIc 0x0130 "ResolverIC" "Resolver: its circuit.";
        RslvUeberw 0x0131 "RslvUeberw" "Resolver: its monitoring.";
        RamSt 0x0132 "RAMSt" "Resolver: `RAMSt`.";
        RslvJustage 0x0133 "RslvJustage" "Resolver: its adjustment.";
        ResolvKabel 0x0134 "ResolvKabel" "Resolver: its cable.";
        Rslv 0x0135 "Rslv" "Resolver.";
    }
    "14.11.6" {
        WdogHw 0x0140 "WdogHw" "Watchdog: hardware.";
        IntWdog 0x0141 "IntWdog" "Watchdog: internal.";
    }
    "14.11.7" {
        AsicFr 0x0150 "ASICfr" "ASIC: `fr`.";
        AsicRead0 0x0151 "ASICread0" "ASIC: reading 0.";
        AsicRdwr 0x0152 "ASICrdwr" "ASIC: reading and writing.";
        AsicType 0x0153 "ASICtype" "ASIC: its type.";
        AsicRam 0x0154 "ASICram" "ASIC: its RAM.";
    }
    "14.11.8" {
        PhaseAbc 0x0160 "PhaseABC" "Modulator: all phases.";
        PhaseA 0x0161 "PhaseA" "Modulator: phase A.";
        PhaseB 0x0162 "PhaseB" "Modulator: phase B.";
        PhaseC 0x0163 "PhaseC" "Modulator: phase C.";
    }
    "14.11.9" {
        Pc 0x0201 "PC" "Cycle: program counter.";
        It 0x0202 "IT" "Cycle: interrupt.";
        Reset 0x0203 "reset" "Cycle: reset.";
    }
    "14.11.10" {
        Sp 0x0210 "SP" "Register of the micro controller: stack pointer.";
        Syscr 0x0211 "SYSCR" "Register of the micro controller: `SYSCR`.";
        Ier 0x0212 "IER" "Register of the micro controller: `IER`.";
        Iscr 0x0213 "ISCR" "Register of the micro controller: `ISCR`.";
        Tmr0 0x0214 "TMR0" "Register of the micro controller: `TMR0`.";
        Tmr1 0x0215 "TMR1" "Register of the micro controller: `TMR1`.";
        Frc 0x0216 "FRC" "Register of the micro controller: `FRC`.";
        Ccr 0x0217 "CCR" "Register of the micro controller: `CCR`.";
        Ram 0x0218 "RAM" "RAM of the micro controller.";
        R0 0x0220 "R0" "Register of the micro controller: `R0`.";
        R1 0x0221 "R1" "Register of the micro controller: `R1`.";
        R2 0x0222 "R2" "Register of the micro controller: `R2`.";
        R3 0x0223 "R3" "Register of the micro controller: `R3`.";
    }
    "14.11.11" {
        Imax 0x0250 "imax" "Motor current: peak current.";
        Ia 0x0251 "ia" "Motor current: phase A.";
        Ib 0x0252 "ib" "Motor current: phase B.";
        Ic 0x0253 "ic" "Motor current: phase C.";
    }
    "14.11.12" {
        Pal 0x0300 "PAL" "PAL.";
        PalFrgabe 0x0301 "PALfrgabe" "PAL: enabling.";
        Supply5V 0x0302 "5V" "PAL: supply of 5 V.";
        Supply15V 0x0303 "15V" "PAL: supply of 15 V.";
        ZkUeberSp 0x0304 "ZkUeberSp" "PAL: over-voltage of the intermediate circuit.";
        ZkUnterSp 0x0305 "ZkUnterSp" "PAL: under-voltage of the intermediate circuit.";
        Wdog 0x0306 "Wdog" "PAL: watchdog.";
        Endstufe 0x0307 "Endstufe" "PAL: end amplifier.";
        UeberStrom 0x0308 "UeberStrom" "PAL: over-current.";
        Resolver 0x0309 "Resolver" "PAL: resolver.";
        EndSchaltP 0x0310 "EndSchaltP" "PAL: end switch P.";
        EndSchaltN 0x0311 "EndSchaltN" "PAL: end switch N.";
        EndSchalter 0x0314 "EndSchalter" "PAL: end switches.";
    }
    "14.11.13" {
        OverTempKk 0x0400 "OverTempKK" "Temperature of the cooler.";
        OverTempMot 0x0401 "OverTempMot" "Temperature of the motor.";
        OverTempKkSecond 0x0410 "OverTempKK_" "Temperature of the cooler, the second of that name.";
    }
    "14.11.14" {
        SciOverrun 0x0501 "SCIoverrun" "Serial interface: a byte was not fetched in time.";
        SciParity 0x0502 "SCIparity" "Serial interface: parity.";
        SciFraming 0x0503 "SCIframing" "Serial interface: no stop bit.";
        NbSync 0x0504 "NBsync" "NOVOBUS: not a sync byte.";
        NbCommand 0x0505 "NBcommand" "NOVOBUS: not a command.";
        NbParam 0x0506 "NBparam" "NOVOBUS: a parameter out of range.";
        NbChecksum 0x0507 "NBchecksum" "NOVOBUS: check sum.";
        NbTimeout 0x0508 "NBtimeout" "NOVOBUS: time-out.";
        Bextern 0x0509 "Bextern" "Serial interface: `Bextern`.";
        NbData 0x0510 "NBdata" "NOVOBUS: data.";
    }
    "14.11.15" {
        Ps 0x0600 "PS" "Positioning controller: overflow (13.4).";
        DisPs 0x0601 "DisPS" "Positioning controller: not released (13.4).";
    }
    "14.11.16" {
        Schleppfehler 0x0700 "Schleppfehler" "Slipping error (14.5.6).";
        Strom0 0x0701 "Strom0" "Monitoring of the current regulator (14.3.1).";
    }
    "14.11.17" {
        ImpulsEingang 0x0800 "ImpulsEingang" "Impulse input (14.3.2).";
    }
}

impl ErrorCode {
    /// The value of the cell `errorcode`.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }

    /// The error with this code. `None` for a code that 14.11 does not list, such as 0, no error (ND21
    /// 13.1.7.4), and [`LINE_TEST`].
    #[must_use]
    pub fn from_code(code: u16) -> Option<Self> {
        let found = Self::ALL.binary_search_by_key(&code, |error| error.code());
        found.ok().and_then(|i| Self::ALL.get(i).copied())
    }

    /// The three digits that the 7-segment display shows (ND21 11.8), each 0 to 9.
    #[must_use]
    pub fn digits(self) -> [u8; 3] {
        display_digits(self.code()).unwrap_or_default()
    }
}

/// The three digits, each 0 to 15, that the 7-segment display shows of an error code: its 12 bits (ND21
/// 11.8, 14.10.1). `None` if the code has more bits.
#[must_use]
pub const fn display_digits(code: u16) -> Option<[u8; 3]> {
    let [high, low] = code.to_be_bytes();
    if high > 0xF {
        return None;
    }
    Some([high, low >> 4, low & 0xF])
}

/// An error code with its printed name.
#[must_use]
pub fn in_words(code: u16) -> String {
    match (ErrorCode::from_code(code), display_digits(code)) {
        (Some(error), _) => format!("{error}: {}", error.meaning()),
        (None, _) => format!("{code:04X}"),
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X} {}", self.code(), self.printed_name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn codes_ascend_and_come_back() {
        for pair in ErrorCode::ALL.windows(2) {
            assert!(pair[0].code() < pair[1].code(), "{} {}", pair[0], pair[1]);
        }
        let listed = (0..=u16::MAX).filter_map(ErrorCode::from_code);
        assert!(listed.eq(ErrorCode::ALL.iter().copied()));
        for error in ErrorCode::ALL {
            assert_eq!(ErrorCode::from_code(error.code()), Some(*error));
        }
        assert_eq!(ErrorCode::from_code(LINE_TEST), None);
        assert_eq!(ErrorCode::from_code(0), None);
    }

    /// ND21 14.11: how many codes each section lists.
    #[test]
    fn sections_of_14_11() {
        for (section, count) in [
            ("14.11.1", 65),
            ("14.11.2", 5),
            ("14.11.3", 7),
            ("14.11.4", 3),
            ("14.11.5", 6),
            ("14.11.6", 2),
            ("14.11.7", 5),
            ("14.11.8", 4),
            ("14.11.9", 3),
            ("14.11.10", 13),
            ("14.11.11", 4),
            ("14.11.12", 13),
            ("14.11.13", 3),
            ("14.11.14", 10),
            ("14.11.15", 2),
            ("14.11.16", 2),
            ("14.11.17", 1),
        ] {
            let listed = ErrorCode::ALL
                .iter()
                .filter(|error| error.section() == section);
            assert_eq!(listed.count(), count, "{section}");
        }
    }

    /// ND21 14.11.1: the code of a port's bit repeats the digits of its name.
    #[test]
    fn port_codes_of_14_11_1() {
        for error in ErrorCode::ALL {
            if error.section() == "14.11.1" {
                let [zero, port, bit] = error.digits();
                assert_eq!(zero, 0);
                assert_eq!(
                    error.printed_name(),
                    alloc::format!("P{port}{bit}"),
                    "{error}"
                );
            }
        }
    }

    /// ND21 11.8, 14.10.1: three digits of 12 bits; every listed code has decimal digits only.
    #[test]
    fn display_of_11_8() {
        assert_eq!(ErrorCode::NbTimeout.digits(), [5, 0, 8]);
        assert_eq!(ErrorCode::EndSchalter.digits(), [3, 1, 4]);
        assert_eq!(display_digits(LINE_TEST), Some([6, 0, 2]));
        assert_eq!(display_digits(0x1000), None);
        for error in ErrorCode::ALL {
            assert!(error.digits().iter().all(|&digit| digit <= 9), "{error}");
            let [a, b, c] = error.digits().map(u16::from);
            assert_eq!(a << 8 | b << 4 | c, error.code());
        }
    }

    /// The codes that other chapters name: ND21 13.4, 14.3.1, 14.5.6.
    #[test]
    fn codes_of_other_chapters() {
        for (error, shown) in [
            (ErrorCode::Ps, "0600 PS"),
            (ErrorCode::DisPs, "0601 DisPS"),
            (ErrorCode::Strom0, "0701 Strom0"),
            (ErrorCode::Schleppfehler, "0700 Schleppfehler"),
        ] {
            assert_eq!(error.to_string(), shown);
        }
    }
}
