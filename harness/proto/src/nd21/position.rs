//! The format of a stored position: 1 mode bit and 31 bits of two's complement (ND21 13.1.9).
//!
//! Bits 30-16 are whole revolutions, bits 15-0 the angle, 65536 increments to a turn; the two's
//! complement is that of all 31 bits together.

use super::units::{INCREMENTS_PER_TURN, Ratio, Reason, UnitError, turns_from_raw, turns_to_raw};

/// How many positions the EEPROM holds (ND21 13.1.9).
pub const POSITIONS: u8 = 40;

/// The EEPROM address of position 0 (ND21 13.1.9).
const FIRST: u8 = 0x60;
/// The bytes of a position.
const SIZE: u8 = 4;
/// Bit 31.
const RELATIVE: u32 = 1 << 31;

/// What a position is measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PositionMode {
    /// Bit 31 = 0: a distance from the zero point.
    Absolute,
    /// Bit 31 = 1: a path.
    Relative,
}

/// A position in the format of 13.1.9, of -16384 turns to less than 16384.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Position {
    mode: PositionMode,
    increments: i32,
}

impl Position {
    /// The least number of increments: -16384 turns.
    pub const MIN: i32 = -(1 << 30);
    /// The greatest number of increments: one less than 16384 turns.
    pub const MAX: i32 = (1 << 30) - 1;

    /// Creates a position from increments, 65536 to a turn.
    ///
    /// # Errors
    /// Outside [`Self::MIN`] to [`Self::MAX`].
    pub fn new(mode: PositionMode, increments: i32) -> Result<Self, UnitError> {
        let reason = if increments < Self::MIN {
            Reason::Below(Ratio::whole(Self::MIN))
        } else if increments > Self::MAX {
            Reason::Above(Ratio::whole(Self::MAX))
        } else {
            return Ok(Self { mode, increments });
        };
        Err(UnitError {
            quantity: "position in increments",
            section: "13.1.9",
            received: Ratio::whole(increments),
            reason,
        })
    }

    /// Creates the position nearest to `turns`; a half increment is rounded away from 0.
    ///
    /// # Errors
    /// Less than -16384 turns, or nearer to 16384 than to the greatest position.
    pub fn from_turns(mode: PositionMode, turns: Ratio) -> Result<Self, UnitError> {
        let increments = turns_to_raw(turns).ok();
        let position = increments.and_then(|increments| Self::new(mode, increments).ok());
        position.ok_or(UnitError {
            quantity: "position in turns",
            section: "13.1.9",
            received: turns,
            reason: if turns < Ratio::ZERO {
                Reason::Below(turns_from_raw(Self::MIN))
            } else {
                Reason::Above(turns_from_raw(Self::MAX))
            },
        })
    }

    /// Whether it is absolute or relative.
    #[must_use]
    pub const fn mode(self) -> PositionMode {
        self.mode
    }

    /// The increments, 65536 to a turn.
    #[must_use]
    pub const fn increments(self) -> i32 {
        self.increments
    }

    /// The turns: whole ones and the rest.
    #[must_use]
    pub const fn turns(self) -> Ratio {
        turns_from_raw(self.increments)
    }

    /// Whole revolutions, -16384 to 16383, and the angle of one revolution: bits 30-16 and 15-0.
    #[must_use]
    pub const fn parts(self) -> (i32, u16) {
        let turn = INCREMENTS_PER_TURN.cast_signed();
        let [_, _, high, low] = self.increments.to_be_bytes();
        (
            self.increments.div_euclid(turn),
            u16::from_be_bytes([high, low]),
        )
    }

    /// The double word.
    #[must_use]
    pub const fn encode(self) -> u32 {
        let mode = match self.mode {
            PositionMode::Absolute => 0,
            PositionMode::Relative => RELATIVE,
        };
        mode | self.increments.cast_unsigned() & !RELATIVE
    }

    /// The position of a double word; every one stands for a position.
    #[must_use]
    pub const fn decode(word: u32) -> Self {
        Self {
            mode: if word & RELATIVE == 0 {
                PositionMode::Absolute
            } else {
                PositionMode::Relative
            },
            // Bit 30 is the sign: moved to bit 31 and back, it fills both.
            increments: (word << 1).cast_signed() >> 1,
        }
    }

    /// The four bytes in the order of their addresses.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 4] {
        self.encode().to_be_bytes()
    }

    /// The position of four bytes in the order of their addresses.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 4]) -> Self {
        Self::decode(u32::from_be_bytes(bytes))
    }
}

/// The EEPROM address of the first byte of position `n` (ND21 13.1.9): 60 + 4 n; the rows printed for
/// 36 to 39 repeat those of 28 to 31 (E62). `None` from position 40 on (ND21 13.1.9.1).
#[must_use]
pub const fn eeprom_address(n: u8) -> Option<u8> {
    if n < POSITIONS {
        Some(FIRST + SIZE * n)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::PositionMode::{Absolute, Relative};
    use super::*;

    /// The twelve worked examples of ND21 13.1.9: turns as a fraction, then the word. The last is
    /// printed as "Distance = 100 revolutions" and is -100 (E64).
    const EXAMPLES: [(PositionMode, i64, i64, u32); 12] = [
        (Absolute, 1_025, 100, 0x000A_4000),
        (Absolute, -1_025, 100, 0x7FF5_C000),
        (Relative, 50, 360, 0x8000_238E),
        (Relative, -50, 360, 0xFFFF_DC72),
        (Absolute, 65, 10, 0x0006_8000),
        (Absolute, -65, 10, 0x7FF9_8000),
        (Absolute, 100, 1, 0x0064_0000),
        (Absolute, -100, 1, 0x7F9C_0000),
        (Relative, 65, 10, 0x8006_8000),
        (Relative, -65, 10, 0xFFF9_8000),
        (Relative, 100, 1, 0x8064_0000),
        (Relative, -100, 1, 0xFF9C_0000),
    ];

    #[test]
    fn examples_of_13_1_9() {
        for (mode, numerator, denominator, word) in EXAMPLES {
            let turns = Ratio::new(numerator, denominator).unwrap();
            let position = Position::from_turns(mode, turns).unwrap();
            assert_eq!(position.encode(), word, "{turns}");
            assert_eq!(Position::decode(word), position, "{word:08X}");
        }
    }

    /// The steps of the first four examples of ND21 13.1.9.
    #[test]
    fn bytes_and_parts_of_13_1_9() {
        let first = Position::from_bytes([0x00, 0x0A, 0x40, 0x00]);
        assert_eq!(first.parts(), (10, 16_384));
        assert_eq!(first.turns(), Ratio::new(1_025, 100).unwrap());
        let second = Position::from_bytes([0x7F, 0xF5, 0xC0, 0x00]);
        assert_eq!(second.increments(), -0x000A_4000);
        assert_eq!(second.parts(), (-11, 0xC000));
        let third = Position::from_bytes([0x80, 0x00, 0x23, 0x8E]);
        assert_eq!(third.parts(), (0, 9_102));
        assert_eq!(third.mode(), Relative);
        assert_eq!(third.to_bytes(), [0x80, 0x00, 0x23, 0x8E]);
        let fourth = Position::decode(0x7FFF_DC72 | RELATIVE);
        assert_eq!(fourth.increments(), -0x0000_238E);
    }

    /// ND21 13.1.9: as printed, the last example would be +100 revolutions twice (E64).
    #[test]
    fn last_example_is_misprinted_e64() {
        let hundred = Position::from_turns(Relative, Ratio::whole(100)).unwrap();
        assert_eq!(hundred.encode(), 0x8064_0000);
        assert_eq!(Position::decode(0xFF9C_0000).turns(), Ratio::whole(-100));
    }

    #[test]
    fn ends() {
        let turns = |n| Position::from_turns(Absolute, Ratio::whole(n));
        assert_eq!(turns(-16_384).unwrap().encode(), 0x4000_0000);
        assert_eq!(turns(-16_384).unwrap().parts(), (-16_384, 0));
        assert!(turns(16_384).is_err());
        assert!(turns(-16_385).is_err());
        let error = turns(40_000).unwrap_err();
        assert_eq!(error.reason, Reason::Above(turns_from_raw(Position::MAX)));
        let error = turns(-40_000).unwrap_err();
        assert_eq!(error.reason, Reason::Below(Ratio::whole(-16_384)));
        let most = Position::new(Relative, Position::MAX).unwrap();
        assert_eq!(most.encode(), 0xBFFF_FFFF);
        assert_eq!(most.parts(), (16_383, 0xFFFF));
        assert!(Position::new(Relative, Position::MAX + 1).is_err());
        assert!(Position::new(Relative, Position::MIN - 1).is_err());
    }

    #[test]
    fn every_word_comes_back() {
        let mut word: u32 = 0;
        for _ in 0..100_000 {
            assert_eq!(Position::decode(word).encode(), word);
            word = word.wrapping_add(0x9E37_79B1);
        }
    }

    /// The table of ND21 13.1.9, with the addresses of 36 to 39 by the rule (E62).
    #[test]
    fn addresses_of_13_1_9() {
        for (n, address) in [
            (0, 0x60),
            (7, 0x7C),
            (8, 0x80),
            (16, 0xA0),
            (28, 0xD0),
            (31, 0xDC),
            (32, 0xE0),
            (35, 0xEC),
            (36, 0xF0),
            (39, 0xFC),
        ] {
            assert_eq!(eeprom_address(n), Some(address));
        }
        assert_eq!(eeprom_address(40), None);
        assert_eq!(eeprom_address(u8::MAX), None);
    }
}
