//! The functions that a PLC selects with the mode switches (ND21 13.1.7.3, 13.1.7.5).

use super::io::{Input, Inputs};

/// One row of the two tables.
struct Row {
    function: Function,
    printed: &'static str,
    /// GPIN8, GPIN7, GPIN6, GPIN2, GPIN1.
    code: u8,
    section: &'static str,
}

/// Makes the enum and the table: name, name as printed, levels, section.
macro_rules! functions {
    ($($name:ident $printed:literal $code:literal $section:literal $about:literal;)+) => {
        /// A function of the cycle control.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Function {
            $(#[doc = concat!("`", $printed, "`: ", $about)] $name,)+
        }

        impl Function {
            /// Every function, in the order of the manual's tables.
            pub const ALL: &[Self] = &[$(Self::$name,)+];
        }

        const TABLE: &[Row] = &[$(Row {
            function: Function::$name,
            printed: $printed,
            code: $code,
            section: $section,
        },)+];
    };
}

functions! {
    StartPs "StartPS" 0b0_0000 "13.1.7.3" "starts the positioning.";
    TippenMinus "Tippen-" 0b0_0001 "13.1.7.3" "stepping in the negative direction.";
    TippenPlus "Tippen+" 0b0_0010 "13.1.7.3" "stepping in the positive direction.";
    Referenzfahrt "Referenzfahrt" 0b0_0011 "13.1.7.3" "the referencing run.";
    RdEeWrPs "RdEEWrPS" 0b0_0100 "13.1.7.3" "loads the marked position and calculates.";
    ClrPz "ClrPZ" 0b0_0101 "13.1.7.3" "sets the position marker to 0.";
    IncPz "IncPZ" 0b0_0110 "13.1.7.3" "moves the marker on.";
    DecPz "DecPZ" 0b0_0111 "13.1.7.3" "moves the marker back.";
    TeachIn "Teach In" 0b0_1000 "13.1.7.3" "stores the actual position.";
    WrEe "WrEE" 0b0_1001 "13.1.7.3" "stores the transmitted position.";
    Wr0 "Wr0" 0b0_1010 "13.1.7.3" "a 0 bit of a position.";
    Wr1 "Wr1" 0b0_1011 "13.1.7.3" "a 1 bit of a position.";
    WaitPs "WaitPS" 0b0_1100 "13.1.7.3" "waits for a calculation that the controller has started.";
    RdError "RdError" 0b0_1101 "13.1.7.3" "a bit of the error code.";
    RdPos "RdPos" 0b0_1110 "13.1.7.3" "a bit of the actual position.";
    WrPs "WrPS" 0b0_1111 "13.1.7.3" "loads the transmitted position and calculates.";
    Wr0Param "Wr0 Param" 0b1_0111 "13.1.7.5" "a 0 bit of a parameter.";
    Wr1Param "Wr1 Param" 0b1_0011 "13.1.7.5" "a 1 bit of a parameter.";
    WrNMax "Wr nMax" 0b1_1110 "13.1.7.5" "the parameter is the speed of positioning.";
    WrVtippen "Wr Vtippen" 0b1_1010 "13.1.7.5" "the parameter is the speed of stepping.";
    WrNRampe "Wr nRampe" 0b1_0110 "13.1.7.5" "the parameter is both ramps.";
    WrI "Wr i" 0b1_0010 "13.1.7.5" "the parameter is the peak and the rated current.";
    InitPs "InitPS" 0b1_1111 "13.1.7.5" "initialises the positioning controller.";
    Leitungstest "Leitungstest" 0b1_1011 "13.1.7.5" "causes the error H'602.";
}

/// The mode switches, the highest bit of a code first.
const SWITCHES: [Input; 5] = [
    Input::Gpin8,
    Input::Gpin7,
    Input::Gpin6,
    Input::Gpin2,
    Input::Gpin1,
];

/// The code that the mode switches show: GPIN8, 7, 6, 2, 1. GPIN8 counts only where it is a mode switch
/// (13.1.7.5).
#[must_use]
pub fn code(inputs: Inputs, with_gpin8: bool) -> u8 {
    SWITCHES.iter().fold(0, |code, switch| {
        let counts = with_gpin8 || *switch != Input::Gpin8;
        code << 1 | u8::from(counts && inputs.is_high(*switch))
    })
}

impl Function {
    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The name as printed.
    #[must_use]
    pub fn printed_name(self) -> &'static str {
        self.row().printed
    }

    /// The section of its table.
    #[must_use]
    pub fn section(self) -> &'static str {
        self.row().section
    }

    /// Its code: GPIN8, 7, 6, 2, 1.
    #[must_use]
    pub fn code(self) -> u8 {
        self.row().code
    }

    /// The function of this code; several codes with GPIN8 high have none.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        let row = TABLE.iter().find(|row| row.code == code)?;
        Some(row.function)
    }

    /// The mode switches and their levels for this function.
    pub fn levels(self) -> impl Iterator<Item = (Input, bool)> {
        let code = self.code();
        SWITCHES
            .into_iter()
            .zip((0..5).rev())
            .map(move |(switch, bit)| (switch, code >> bit & 1 != 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// ND21 13.1.7.3: GPIN7, GPIN6, GPIN2, GPIN1 and the function, as printed.
    const PRINTED: [&str; 16] = [
        "Low Low Low Low StartPS",
        "Low Low Low High Tippen-",
        "Low Low High Low Tippen+",
        "Low Low High High Referenzfahrt",
        "Low High Low Low RdEEWrPS",
        "Low High Low High ClrPZ",
        "Low High High Low IncPZ",
        "Low High High High DecPZ",
        "High Low Low Low Teach In",
        "High Low Low High WrEE",
        "High Low High Low Wr0",
        "High Low High High Wr1",
        "High High Low Low WaitPS",
        "High High Low High RdError",
        "High High High Low RdPos",
        "High High High High WrPS",
    ];

    /// ND21 13.1.7.5: GPIN8, GPIN7, GPIN6, GPIN2, GPIN1 and the function, as printed.
    const ADDITIONAL: [&str; 8] = [
        "High Low High High High Wr0 Param",
        "High Low Low High High Wr1 Param",
        "High High High High Low Wr nMax",
        "High High Low High Low Wr Vtippen",
        "High Low High High Low Wr nRampe",
        "High Low Low High Low Wr i",
        "High High High High High InitPS",
        "High High Low High High Leitungstest",
    ];

    fn check(line: &str, gpin8: Option<bool>, function: Function) {
        let switches = if gpin8.is_some() { 4 } else { 5 };
        let words: Vec<_> = line.splitn(switches + 1, ' ').collect();
        let printed = words[..switches].iter().map(|word| *word == "High");
        let expected: Vec<_> = gpin8.into_iter().chain(printed).collect();
        let levels: Vec<_> = function.levels().map(|(_, high)| high).collect();
        assert_eq!(levels, expected, "{line}");
        assert_eq!(function.printed_name(), words[switches]);
        let inputs = function
            .levels()
            .fold(Inputs::default(), |inputs, (switch, high)| {
                inputs.with(switch, high)
            });
        assert_eq!(code(inputs, true), function.code());
        assert_eq!(code(inputs, false), function.code() & 0xF);
        assert_eq!(Function::from_code(function.code()), Some(function));
    }

    #[test]
    fn functions_of_13_1_7_3_and_13_1_7_5() {
        let (first, second) = Function::ALL.split_at(16);
        for (line, function) in PRINTED.iter().zip(first) {
            check(line, Some(false), *function);
        }
        for (line, function) in ADDITIONAL.iter().zip(second) {
            check(line, None, *function);
        }
        assert_eq!(Function::from_code(0b1_0000), None);
    }
}
