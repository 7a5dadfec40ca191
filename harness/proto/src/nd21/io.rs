//! Digital inputs and outputs: where the drive shows them (ND21 5.3, 14.7.1).

use super::errors::ErrorCode;

/// A digital input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Input {
    /// Mode switch.
    Gpin1,
    /// Mode switch.
    Gpin2,
    /// Start; with low the drive is stopped.
    Gpin3,
    /// Reference switch.
    Gpin4,
    /// Release; with low the regulator is blocked.
    Gpin5,
    /// Mode switch.
    Gpin6,
    /// Mode switch, or the frequency input.
    Gpin7,
    /// Mode switch, or the direction of the frequency input.
    Gpin8,
    /// End switch, positive.
    EschP,
    /// End switch, negative.
    EschN,
}

/// Where a GPIN is shown (ND21 14.7.1).
struct InputRow {
    input: Input,
    name: &'static str,
    pin: u8,
    /// Address and bit; the bit is 1 at 0 V. None for the end switches, which have a code of their own.
    shown: Option<(u16, u8)>,
}

/// The port with GPIN1 to GPIN4 and the end switches.
pub const PORT_2: u16 = 0xFFB3;
/// The port with the digital outputs; a bit is 0 at 0 V.
pub const OUTPUTS: u16 = 0xFFB7;
/// Bit of GPO1 in [`OUTPUTS`].
pub const GPO1: u8 = 1 << 7;
/// Bit of GPO2 in [`OUTPUTS`].
pub const GPO2: u8 = 1 << 5;
/// The port with GPIN7 and GPIN8.
const PORT_6: u16 = 0xFFBB;
/// The port with GPIN5 and GPIN6.
const PORT_7: u16 = 0xFFBE;

/// The table of ND21 14.7.1, in order of [`Input`].
#[rustfmt::skip]
const PLACES: [InputRow; 10] = [
    InputRow { input: Input::Gpin1, name: "GPIN1", pin: 21, shown: Some((PORT_2, 4)) },
    InputRow { input: Input::Gpin2, name: "GPIN2", pin:  6, shown: Some((PORT_2, 5)) },
    InputRow { input: Input::Gpin3, name: "GPIN3", pin: 22, shown: Some((PORT_2, 6)) },
    InputRow { input: Input::Gpin4, name: "GPIN4", pin:  7, shown: Some((PORT_2, 7)) },
    InputRow { input: Input::Gpin5, name: "GPIN5", pin: 24, shown: Some((PORT_7, 3)) },
    InputRow { input: Input::Gpin6, name: "GPIN6", pin:  8, shown: Some((PORT_7, 7)) },
    InputRow { input: Input::Gpin7, name: "GPIN7", pin: 10, shown: Some((PORT_6, 0)) },
    InputRow { input: Input::Gpin8, name: "GPIN8", pin: 25, shown: Some((PORT_6, 2)) },
    InputRow { input: Input::EschP, name: "ESCHP", pin: 34, shown: None },
    InputRow { input: Input::EschN, name: "ESCHN", pin:  3, shown: None },
];

/// Bits 3 to 0 of [`PORT_2`] for the end switches (N, P): N alone, P alone and both at 5 to 24 V
/// (ND21 14.7.1).
const END_SWITCH_CODES: [[u8; 2]; 2] = [[0b1100, 0b1011], [0b1010, 0b1110]];

impl Input {
    /// Every input.
    pub const ALL: [Self; 10] = [
        Self::Gpin1,
        Self::Gpin2,
        Self::Gpin3,
        Self::Gpin4,
        Self::Gpin5,
        Self::Gpin6,
        Self::Gpin7,
        Self::Gpin8,
        Self::EschP,
        Self::EschN,
    ];

    const fn place(self) -> &'static InputRow {
        &PLACES[self as usize]
    }

    /// The name as printed: `GPIN1` to `GPIN8`, `ESCHP`, `ESCHN`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.place().name
    }

    /// Its pin in plug X3.
    #[must_use]
    pub const fn pin(self) -> u8 {
        self.place().pin
    }

    /// The port in which the drive shows it (14.7.1).
    #[must_use]
    pub fn port(self) -> u16 {
        self.place().shown.map_or(PORT_2, |(address, _)| address)
    }

    /// Whether it is at 5 to 24 V where its [port](Self::port) holds `byte`; `None` where the code of an internal error stands in the
    /// place of the end switches (14.7.1).
    #[must_use]
    pub fn level_in(self, byte: u8) -> Option<bool> {
        if let Some((_, bit)) = self.place().shown {
            return Some(byte >> bit & 1 == 0);
        }
        let levels = [[0, 0], [0, 1], [1, 0], [1, 1]];
        let [n, p] = levels
            .into_iter()
            .find(|[n, p]| END_SWITCH_CODES[*n][*p] == byte & 0x0F)?;
        Some(match self {
            Self::EschN => n == 1,
            _ => p == 1,
        })
    }

    /// The input of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let place = PLACES.iter().find(|place| place.name == name)?;
        Some(place.input)
    }
}

/// The levels of all inputs. Nothing is connected at first: 0 V everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs(u16);

impl Inputs {
    /// Whether this input is at 5 to 24 V.
    #[must_use]
    pub const fn is_high(self, input: Input) -> bool {
        self.0 >> input as u16 & 1 != 0
    }

    /// The same levels with this input high or low.
    #[must_use]
    pub const fn with(self, input: Input, high: bool) -> Self {
        let bit = 1 << input as u16;
        Self(if high { self.0 | bit } else { self.0 & !bit })
    }

    /// The bytes in which the drive shows the inputs: address, byte, and which bits of it they are. An
    /// internal error's code stands in place of that of the end switches (14.7.1).
    #[must_use]
    pub fn ports(self, error: Option<ErrorCode>) -> [(u16, u8, u8); 3] {
        let mut ports = [(PORT_2, 0, 0x0F), (PORT_7, 0, 0), (PORT_6, 0, 0)];
        for place in &PLACES {
            for (address, byte, mask) in &mut ports {
                if let Some((at, bit)) = place.shown
                    && at == *address
                {
                    *mask |= 1 << bit;
                    *byte |= u8::from(!self.is_high(place.input)) << bit;
                }
            }
        }
        let n = usize::from(self.is_high(Input::EschN));
        let p = usize::from(self.is_high(Input::EschP));
        ports[0].1 |= error.and_then(pal_code).unwrap_or(END_SWITCH_CODES[n][p]);
        ports
    }
}

/// The four bits with which the drive's logic reports an internal error: 0 for 300 to 9 for 309. The
/// manual does not print them; but the codes of the end switches are 10 for `EndSchaltP` (310), 11 for
/// `EndSchaltN` (311) and 14 for `EndSchalter` (314), so the numbers are taken to go on downwards
/// (E119).
#[must_use]
pub fn pal_code(error: ErrorCode) -> Option<u8> {
    let [_, low] = error.code().to_be_bytes();
    (error.section() == "14.11.12" && low <= 9).then_some(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_stand_in_order() {
        for (place, input) in PLACES.iter().zip(Input::ALL) {
            assert_eq!(place.input, input);
            assert_eq!(Input::from_name(place.name), Some(input));
        }
    }

    /// ND21 14.7.1: at 0 V the bit of a GPIN reads 1.
    #[test]
    fn inputs_of_14_7_1() {
        let none = Inputs::default();
        assert_eq!(
            none.ports(None),
            [
                (0xFFB3, 0xFC, 0xFF),
                (0xFFBE, 0x88, 0x88),
                (0xFFBB, 0x05, 0x05)
            ]
        );
        for (input, address, bit) in [
            (Input::Gpin1, 0xFFB3, 4),
            (Input::Gpin2, 0xFFB3, 5),
            (Input::Gpin3, 0xFFB3, 6),
            (Input::Gpin4, 0xFFB3, 7),
            (Input::Gpin5, 0xFFBE, 3),
            (Input::Gpin6, 0xFFBE, 7),
            (Input::Gpin7, 0xFFBB, 0),
            (Input::Gpin8, 0xFFBB, 2),
        ] {
            let ports = none.with(input, true).ports(None);
            let before = none.ports(None);
            for (after, before) in ports.iter().zip(before) {
                let changed = if before.0 == address { 1 << bit } else { 0 };
                assert_eq!(after.1, before.1 ^ changed, "{input:?}");
            }
        }
    }

    /// ND21 14.7.1, the table of the end switches: N, P, then bits 0, 1, 2, 3.
    #[test]
    fn end_switches_of_14_7_1() {
        for (n, p, bits) in [
            (0, 0, [0, 0, 1, 1]),
            (1, 0, [0, 1, 0, 1]),
            (0, 1, [1, 1, 0, 1]),
            (1, 1, [0, 1, 1, 1]),
        ] {
            let inputs = Inputs::default()
                .with(Input::EschN, n == 1)
                .with(Input::EschP, p == 1);
            let code = inputs.ports(None)[0].1 & 0xF;
            for (i, bit) in bits.iter().enumerate() {
                assert_eq!(code >> i & 1, *bit, "N {n} P {p} bit {i}");
            }
        }
    }

    /// What the ports show is what is read from them (14.7.1).
    #[test]
    fn every_level_is_read_back() {
        for levels in 0..1024 {
            let inputs = Inputs(levels);
            let ports = inputs.ports(None);
            for input in Input::ALL {
                let port = ports.iter().find(|(address, ..)| *address == input.port());
                let byte = port.expect("a port").1;
                assert_eq!(
                    input.level_in(byte),
                    Some(inputs.is_high(input)),
                    "{input:?}"
                );
            }
        }
        assert_eq!(Input::EschP.level_in(0x04), None);
    }

    /// ND21 14.7.1, 14.11.12: an internal error overwrites the code of the end switches.
    #[test]
    fn errors_overwrite_the_end_switches() {
        let ports = Inputs::default().ports(Some(ErrorCode::ZkUeberSp));
        assert_eq!(ports[0].1 & 0xF, 4);
        let ports = Inputs::default().ports(Some(ErrorCode::NbSync));
        assert_eq!(ports[0].1 & 0xF, 0b1100);
        assert_eq!(pal_code(ErrorCode::EndSchaltP), None);
    }
}
