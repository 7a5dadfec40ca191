//! What the drive knows of itself: serial number, hours, dates, and settings that are plain numbers.

use super::{Ratio, Reason, UnitError, check};

const SERIAL_WHAT: (&str, &str) = ("serial number", "14.8.1");
const DATE_WHAT: (&str, &str) = ("date", "14.8.3");
const POLES_WHAT: (&str, &str) = ("number of motor poles", "14.6.7");
const ENCODER_WHAT: (&str, &str) = ("encoder impulses per rotation", "14.7.1.1");

/// The year of a date whose year field is 0.
const FIRST_YEAR: u16 = 1993;

/// `EE_Seriennummer`: the serial number from EEPROM 01, 02, 03, six digits, the highest first (ND21
/// 14.8.1).
///
/// # Errors
/// Half a byte that is no decimal digit.
pub fn serial_number_from_bytes(bytes: [u8; 3]) -> Result<u32, UnitError> {
    let [a, b, c] = bytes;
    let word = u32::from_be_bytes([0, a, b, c]);
    let mut number = 0;
    for i in (0..6).rev() {
        let digit = word >> (4 * i) & 0xF;
        if digit > 9 {
            let received = Ratio::of(i64::from(word), 1);
            return Err(UnitError::new(SERIAL_WHAT, received, Reason::NotDecimal));
        }
        number = number * 10 + digit;
    }
    Ok(number)
}

/// The three bytes of a serial number (ND21 14.8.1).
///
/// # Errors
/// More than 999999.
pub fn serial_number_to_bytes(number: u32) -> Result<[u8; 3], UnitError> {
    if number > 999_999 {
        let reason = Reason::Above(Ratio::whole(999_999));
        let received = Ratio::of(i64::from(number), 1);
        return Err(UnitError::new(SERIAL_WHAT, received, reason));
    }
    let (mut rest, mut word) = (number, 0);
    for i in 0..6 {
        word |= (rest % 10) << (4 * i);
        rest /= 10;
    }
    let [_, a, b, c] = word.to_be_bytes();
    Ok([a, b, c])
}

/// `EE_BetriebStd`, `EE_SperreStd`: hours, 0 to 65535, from the two bytes in the order of their
/// addresses. Other than in every other word of the drive the high byte is the second (ND21 14.8.2).
#[must_use]
pub const fn operating_hours_from_bytes(bytes: [u8; 2]) -> u16 {
    u16::from_le_bytes(bytes)
}

/// The two bytes of a number of hours, in the order of their addresses (ND21 14.8.2).
#[must_use]
pub const fn operating_hours_to_bytes(hours: u16) -> [u8; 2] {
    hours.to_le_bytes()
}

/// A day of the calendar from 1993 to 2120 (ND21 14.8.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Date {
    year: u16,
    month: u8,
    day: u8,
}

impl Date {
    /// A day. `None` if the calendar has no such day or its year does not fit the word.
    #[must_use]
    pub const fn new(year: u16, month: u8, day: u8) -> Option<Self> {
        let leap = year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
        let days = match month {
            1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
            4 | 6 | 9 | 11 => 30,
            2 if leap => 29,
            2 => 28,
            _ => 0,
        };
        if year < FIRST_YEAR || year > FIRST_YEAR + 0x7F || day == 0 || day > days {
            return None;
        }
        Some(Self { year, month, day })
    }

    /// `EE_InitDatum`, `EE_ProgDatum`: bits 0-4 are the day, 5-8 the month, 9-15 the year less 1993
    /// (ND21 14.8.3, 14.8.4; what 1993 is added to is misprinted, E101).
    ///
    /// # Errors
    /// No such day; an erased word (H'FFFF or H'0000) is none.
    pub fn from_raw(word: u16) -> Result<Self, UnitError> {
        let [_, day] = (word & 0x1F).to_be_bytes();
        let [_, month] = (word >> 5 & 0xF).to_be_bytes();
        let received = Ratio::whole(i32::from(word));
        Self::new(FIRST_YEAR + (word >> 9), month, day).ok_or(UnitError::new(
            DATE_WHAT,
            received,
            Reason::NoSuchDate,
        ))
    }

    /// The word of this day (ND21 14.8.3).
    #[must_use]
    pub const fn to_raw(self) -> u16 {
        (self.year - FIRST_YEAR) << 9 | (self.month as u16) << 5 | self.day as u16
    }

    /// The year, 1993 to 2120.
    #[must_use]
    pub const fn year(self) -> u16 {
        self.year
    }

    /// The month, 1 to 12.
    #[must_use]
    pub const fn month(self) -> u8 {
        self.month
    }

    /// The day, 1 to 31.
    #[must_use]
    pub const fn day(self) -> u8 {
        self.day
    }
}

/// `EE_pole`: the number of motor poles, which is the raw value itself: 2, 4, 6, 8, 10 or 12 (ND21
/// 14.6.7).
///
/// # Errors
/// Any other number.
pub fn motor_poles(raw: u8) -> Result<u8, UnitError> {
    check(POLES_WHAT, i32::from(raw), 2, 12)?;
    if !raw.is_multiple_of(2) {
        let received = Ratio::whole(i32::from(raw));
        return Err(UnitError::new(POLES_WHAT, received, Reason::Odd));
    }
    Ok(raw)
}

/// `EE_impulszahl`: the impulses per rotation of the encoder emulation, which is the raw value itself,
/// 1 to 1024 (ND21 14.7.1.1).
///
/// # Errors
/// Any other number.
pub fn encoder_impulses(raw: u16) -> Result<u16, UnitError> {
    check(ENCODER_WHAT, i32::from(raw), 1, 0x400)?;
    Ok(raw)
}

/// `ikp`, the P-part of the current regulators, 0 to 1023: the low 8 bits are `a_mpr1`, the high two
/// are bits 7 and 6 of `a_mpr98` (ND21 14.6.1).
#[must_use]
pub const fn current_regulator_p_part(a_mpr1: u8, a_mpr98: u8) -> u16 {
    u16::from_be_bytes([a_mpr98 >> 6, a_mpr1])
}

/// `iki`, the I-part of the current regulators, 0 to 1023: the low 8 bits are `a_mpr2`, the high two
/// are bits 5 and 4 of `a_mpr98` (ND21 14.6.1).
#[must_use]
pub const fn current_regulator_i_part(a_mpr2: u8, a_mpr98: u8) -> u16 {
    u16::from_be_bytes([a_mpr98 >> 4 & 3, a_mpr2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 14.8.1: BCD, high byte at 01.
    #[test]
    fn serial_number_of_14_8_1() {
        assert_eq!(serial_number_from_bytes([0x01, 0x23, 0x45]), Ok(12_345));
        assert_eq!(serial_number_to_bytes(12_345), Ok([0x01, 0x23, 0x45]));
        assert_eq!(serial_number_from_bytes([0x99; 3]), Ok(999_999));
        for bytes in [[0xFF; 3], [0, 0, 0x0A], [0xA0, 0, 0]] {
            let error = serial_number_from_bytes(bytes).unwrap_err();
            assert_eq!(error.reason, Reason::NotDecimal);
        }
        assert!(serial_number_to_bytes(1_000_000).is_err());
        for number in (0..1_000_000).step_by(997) {
            let bytes = serial_number_to_bytes(number).unwrap();
            assert_eq!(serial_number_from_bytes(bytes), Ok(number));
        }
    }

    /// ND21 14.8.2: "Word, high value byte in H'06" of H'05, H'06.
    #[test]
    fn operating_hours_of_14_8_2() {
        assert_eq!(operating_hours_from_bytes([0x34, 0x12]), 0x1234);
        assert_eq!(operating_hours_to_bytes(0x1234), [0x34, 0x12]);
    }

    /// ND21 14.8.3, and 1993 added to the year field (E101).
    #[test]
    fn dates_of_14_8_3() {
        let date = Date::from_raw(3 << 9 | 1 << 5 | 31).unwrap();
        assert_eq!((date.year(), date.month(), date.day()), (1996, 1, 31));
        for word in 0..=u16::MAX {
            if let Ok(date) = Date::from_raw(word) {
                assert_eq!(date.to_raw(), word);
            }
        }
        let first = Date::new(1993, 1, 1).unwrap();
        let last = Date::new(2120, 12, 31).unwrap();
        assert_eq!((first.to_raw(), last.to_raw()), (0x0021, 0xFF9F));
        // 128 years, 31 of them leap years: every fourth from 1996, without 2100.
        let days = (0..=u16::MAX).filter(|&word| Date::from_raw(word).is_ok());
        assert_eq!(days.count(), 128 * 365 + 31);
        for (year, month, day) in [
            (1992, 1, 1),
            (2121, 1, 1),
            (1995, 2, 29),
            (2100, 2, 29),
            (1996, 4, 31),
            (1996, 13, 1),
            (1996, 0, 1),
            (1996, 1, 0),
        ] {
            assert_eq!(Date::new(year, month, day), None, "{year}-{month}-{day}");
        }
        assert!(Date::new(1996, 2, 29).is_some());
        assert!(Date::from_raw(0).is_err());
        assert!(Date::from_raw(0xFFFF).is_err());
    }

    /// ND21 14.6.7: H'02, H'04, H'06, H'08, H'0A, H'0C.
    #[test]
    fn motor_poles_of_14_6_7() {
        let accepted = (0..=u8::MAX).filter(|&raw| motor_poles(raw).is_ok());
        assert!(accepted.eq([0x02, 0x04, 0x06, 0x08, 0x0A, 0x0C]));
        assert_eq!(motor_poles(3).unwrap_err().reason, Reason::Odd);
    }

    /// ND21 14.7.1.1: H'0001 to H'0400.
    #[test]
    fn encoder_impulses_of_14_7_1_1() {
        assert!(encoder_impulses(0).is_err());
        assert_eq!(encoder_impulses(1), Ok(1));
        assert_eq!(encoder_impulses(0x400), Ok(1_024));
        assert!(encoder_impulses(0x401).is_err());
    }

    /// ND21 14.6.1: ten bits each, from three bytes.
    #[test]
    fn current_regulator_of_14_6_1() {
        assert_eq!(current_regulator_p_part(0x12, 0b1001_0000), 0x212);
        assert_eq!(current_regulator_i_part(0x34, 0b1001_0000), 0x134);
        assert_eq!(current_regulator_p_part(0xFF, 0xFF), 0x3FF);
        assert_eq!(current_regulator_i_part(0xFF, 0xFF), 0x3FF);
    }
}
