//! What the manual determines of `Status` and `errorcode`: the code of an error provoked by a telegram (ND21 14.11.14), and that the error
//! bit and the code go together (14.10.1).

use super::known::LONGEST_CONFIRMATION;
use harness_proto::nd21::bits::status;
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use harness_proto::time::Instant;

/// The high byte of the codes of the bus.
pub(super) const OF_THE_BUS: u8 = 0x05;

/// The low byte of the code of a time-out.
const TIME_OUT: u8 = ErrorCode::NbTimeout.code().to_be_bytes()[1];

const ERRORCODE_LOW: u16 = ram::ERRORCODE + 1;

/// The bytes of `errorcode`, as bits.
const HIGH: u8 = 1;
const LOW: u8 = 2;

/// What is known of one drive.
#[derive(Clone, Debug, Default)]
pub(super) struct ErrorMode {
    /// When the master has confirmed all errors.
    confirmed: Option<Instant>,
    /// The master has reset the drive since the attempt began.
    reset: bool,
    /// Which bytes of `errorcode` were read as 0 since the errors were confirmed.
    zeros: u8,
    /// The last byte read, if it was the high one of `errorcode`, and whether it was judged right.
    high: Option<(u8, bool)>,
    /// The low byte of the last code of the bus that was read.
    last: Option<u8>,
    /// It was read after a high byte of 0, long after the errors were confirmed.
    stays: bool,
    /// Which bytes of `errorcode` were read as 0 since `Status` had the error bit, long after the errors were confirmed.
    without_code: Option<u8>,
    /// The low byte of the code of the bus that was judged right since the errors were confirmed, and when it was read first.
    code: Option<(u8, Instant)>,
    /// Such a code, other than that of a time-out, has set the error bit, or has not.
    sets_bit: bool,
    leaves_bit: bool,
}

impl ErrorMode {
    /// An attempt begins: what the drive has shown of its kind stays.
    pub(super) fn begin(&mut self) {
        *self = Self {
            sets_bit: self.sets_bit,
            leaves_bit: self.leaves_bit,
            ..Self::default()
        };
    }

    /// The master has reset the drive (ND21 10.5).
    pub(super) fn reset(&mut self) {
        self.begin();
        self.reset = true;
    }

    /// The master has written to a cell.
    pub(super) fn write(&mut self, cell: u16, data: u8, now: Instant) {
        self.high = None;
        if cell == ram::ERRORCODE {
            *self = Self {
                confirmed: (data == CONFIRM_ERROR).then_some(now),
                reset: self.reset,
                last: self.last,
                sets_bit: self.sets_bit,
                leaves_bit: self.leaves_bit,
                ..Self::default()
            };
        }
    }

    /// Whether a byte that was read is right, where the model holds `wanted`; `None` where it is the drive's choice. The time is that of the
    /// byte, where the drive's power was on all the time.
    pub(super) fn read(
        &mut self,
        cell: u16,
        wanted: u8,
        value: u8,
        now: Option<Instant>,
    ) -> Option<bool> {
        let high = self.high.take();
        let is_zero = (wanted, value) == (0, 0);
        let late = |since: Instant| now.is_some_and(|now| now.since(since) > LONGEST_CONFIRMATION);
        match cell {
            ram::ERRORCODE => {
                self.zero(HIGH, is_zero);
                self.stays &= value == 0;
                let right = self.high_byte(wanted, value);
                self.high = Some((value, right == Some(true)));
                right
            }
            ERRORCODE_LOW => {
                self.zero(LOW, is_zero);
                let (high, judged) = high?;
                if high == 0 && wanted == 0 && self.zeros & LOW == 0 && self.is_left_over(value) {
                    let stays =
                        std::mem::replace(&mut self.stays, self.confirmed.is_some_and(late));
                    return (stays && self.stays).then_some(false);
                }
                if high == OF_THE_BUS {
                    self.last = Some(value);
                }
                if !judged || self.zeros != HIGH | LOW {
                    return None;
                }
                match self.code {
                    // Which of two codes stays is not said.
                    Some((code, _)) if code != wanted => return None,
                    None if high == OF_THE_BUS && value == wanted => {
                        self.code = now.map(|now| (value, now));
                    }
                    _ => {}
                }
                Some(value == wanted)
            }
            ram::STATUS => self.status(wanted, value, late),
            _ => None,
        }
    }

    /// A byte of `errorcode` was read, as 0 where the model holds 0, or as another value.
    fn zero(&mut self, byte: u8, is_zero: bool) {
        if self.confirmed.is_some() && is_zero {
            self.zeros |= byte;
        }
        self.without_code = self
            .without_code
            .filter(|_| is_zero)
            .map(|zeros| zeros | byte);
    }

    fn high_byte(&mut self, wanted: u8, value: u8) -> Option<bool> {
        // There is no error in the drive, and one of the bus in its model.
        if self.confirmed.is_some() && (wanted, value) == (OF_THE_BUS, 0) {
            return Some(false);
        }
        // An error of the bus is over with a check sequence, which is one in the model too; what was before the reset is lost (10.5).
        if self.reset && (wanted, value) == (0, OF_THE_BUS) {
            return Some(false);
        }
        if self.zeros != HIGH | LOW {
            return None;
        }
        if ![0, OF_THE_BUS].contains(&value) {
            // The drive has an error of its own.
            self.confirmed = None;
            self.zeros = 0;
            return None;
        }
        Some(value == wanted)
    }

    /// Whether a low byte is that of a code of the bus, and after a high byte of 0 that of none (14.11).
    fn is_left_over(&self, value: u8) -> bool {
        self.last == Some(value) && value != 0 && ErrorCode::from_code(value.into()).is_none()
    }

    /// The error bit of `Status`: there is none without a code, and the codes of the bus all set it or none does. Which errors set it is
    /// left open (11.8); a time-out always does where another one does.
    fn status(&mut self, wanted: u8, value: u8, late: impl Fn(Instant) -> bool) -> Option<bool> {
        let bit = value & status::ERROR != 0;
        let without_code = self.without_code.take();
        if bit && wanted & status::ERROR == 0 && self.confirmed.is_some_and(&late) {
            self.without_code = Some(0);
            if without_code == Some(HIGH | LOW) {
                return Some(false);
            }
        }
        let (code, since) = self.code?;
        let settles = code != TIME_OUT;
        self.sets_bit |= settles && bit;
        self.leaves_bit |= settles && !bit && late(since);
        let differs = if bit {
            settles && self.leaves_bit
        } else {
            self.sets_bit && late(since)
        };
        differs.then_some(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::time::Span;

    fn at(millis: u64) -> Instant {
        Instant::START + Span::from_millis(millis)
    }

    /// A drive, and the time in milliseconds.
    #[derive(Clone, Default)]
    struct Drive(ErrorMode, u64);

    impl Drive {
        fn read(&mut self, cell: u16, wanted: u8, value: u8) -> Option<bool> {
            self.0.read(cell, wanted, value, Some(at(self.1)))
        }

        fn confirm(&mut self) {
            self.0.write(ram::ERRORCODE, CONFIRM_ERROR, at(self.1));
        }

        /// Both bytes of `errorcode`.
        fn code(&mut self, wanted: u16, value: u16) -> [Option<bool>; 2] {
            let ([high, low], [own_high, own_low]) = (wanted.to_be_bytes(), value.to_be_bytes());
            [
                self.read(ram::ERRORCODE, high, own_high),
                self.read(ERRORCODE_LOW, low, own_low),
            ]
        }
    }

    /// ND21 14.10.1, 14.11.14: after a confirmed error the code of the bus's next one is decided, and no other code.
    #[test]
    fn codes_are_judged_behind_a_confirmation() {
        let mut drive = Drive::default();
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), None);
        drive.confirm();
        // A drive that does not delete its error is none that has deleted it.
        assert_eq!(drive.clone().read(ram::ERRORCODE, 0x05, 0x00), Some(false));
        assert_eq!(drive.read(ERRORCODE_LOW, 0, 0), None);
        assert_eq!(drive.read(ram::ERRORCODE, 0, 0), Some(true));
        assert_eq!(drive.code(0x0507, 0x0506), [Some(true), Some(false)]);
        // After other bytes it is unknown whether this is still the same code.
        assert_eq!(drive.read(ERRORCODE_LOW, 0x07, 0x06), None);
        assert_eq!(drive.code(0x0507, 0x0507), [Some(true); 2]);
        // A second error: which of both codes stays is not said.
        assert_eq!(drive.code(0x0504, 0x0507), [Some(true), None]);
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), Some(false));
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x02), None);
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), None);
    }

    /// ND21 10.5: what is not in the EEPROM is lost with a reset, and so is the code of an error of the bus. A drive may find an error of its own.
    #[test]
    fn no_code_of_the_bus_outlives_a_reset() {
        let mut drive = Drive::default();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), None);
        drive.0.reset();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), Some(false));
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x02), None);
        // An error of the bus after the reset.
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x05), None);
        drive.0.begin();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), None);
    }

    /// ND21 14.10.1: confirming an error ends the error bit with the code. A drive may take its time, and may have an error of its own.
    #[test]
    fn no_error_bit_stays_without_a_code() {
        let with_code = |first: u64, code: u16| {
            let mut drive = Drive::default();
            drive.confirm();
            drive.1 = first;
            assert_eq!(drive.read(ram::STATUS, 0x00, status::ERROR), None);
            drive.code(0, code);
            drive.read(ram::STATUS, 0x00, status::ERROR)
        };
        assert_eq!(with_code(501, 0), Some(false));
        assert_eq!(with_code(500, 0), None);
        assert_eq!(with_code(501, 0x0305), None);
        let mut drive = Drive(ErrorMode::default(), 501);
        // Nothing was confirmed: the model does not know of the error.
        drive.code(0, 0);
        assert_eq!(drive.read(ram::STATUS, 0x00, status::ERROR), None);
        drive.code(0, 0);
        assert_eq!(drive.read(ram::STATUS, 0x00, status::ERROR), None);
    }

    /// ND21 14.10.1, 14.11: confirming an error deletes both bytes of its code. 0010 is a code, 0004 is none.
    #[test]
    fn no_half_of_a_code_stays() {
        let twice = |of_the_bus: u16, then: u16, after: u64| {
            let mut drive = Drive::default();
            drive.code(of_the_bus, of_the_bus);
            drive.confirm();
            drive.1 = after;
            assert_eq!(drive.code(0, then), [None; 2]);
            drive.code(0, then)[1]
        };
        assert_eq!(twice(0x0504, 0x0004, 501), Some(false));
        assert_eq!(twice(0x0504, 0x0004, 500), None);
        assert_eq!(twice(0x0504, 0x0005, 501), None);
        assert_eq!(twice(0x0510, 0x0010, 501), None);
    }

    /// ND21 11.8, 14.10.1: "with certain errors the drive goes into an error mode". A drive that does so with one code of the bus does so
    /// with all; one that does so with the time-out alone is right too.
    #[test]
    fn all_codes_of_the_bus_set_the_error_bit_or_none() {
        let after = |drive: &mut Drive, code: u16, bit: u8| {
            drive.confirm();
            assert_eq!(drive.code(0, 0), [None, None]);
            assert_eq!(drive.code(code, code), [Some(true); 2]);
            assert_eq!(drive.read(ram::STATUS, status::ERROR, bit), None);
            drive.1 += 501;
            drive.read(ram::STATUS, status::ERROR, bit)
        };
        let mut drive = Drive::default();
        assert_eq!(after(&mut drive, 0x0507, 0), None);
        assert_eq!(after(&mut drive, 0x0508, status::ERROR), None);
        assert_eq!(after(&mut drive, 0x0507, 0), None);
        drive.0.begin();
        assert_eq!(drive.clone().read(ram::STATUS, 0, status::ERROR), None);
        assert_eq!(after(&mut drive, 0x0508, status::ERROR), None);
        drive.confirm();
        drive.code(0, 0);
        drive.code(0x0504, 0x0504);
        assert_eq!(drive.read(ram::STATUS, 0, status::ERROR), Some(false));
        let mut drive = Drive::default();
        assert_eq!(after(&mut drive, 0x0507, status::ERROR), None);
        drive.0.begin();
        assert_eq!(after(&mut drive, 0x0508, 0), Some(false));
        assert_eq!(after(&mut drive, 0x0507, status::ERROR), None);
        assert_eq!(after(&mut drive, 0x0504, 0), Some(false));
    }
}
