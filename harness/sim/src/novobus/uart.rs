//! A receiver that has lost the beginning of a byte, bit by bit (ND21 8.1: 8 data bits, odd parity, one stop bit).
//!
//! A receiver takes the first change from 1 to 0 on an idle line for a start bit. When that bit is damaged it takes a
//! later one, a data bit, for it, and reads on from there: across the end of the byte into the next. On a line that
//! carries bytes without a gap it may stay out of step for long.

use harness_proto::line::{LineError, Received};

/// Bits of a byte on the line: start, 8 data, parity, stop.
pub(crate) const BITS: u64 = 11;

/// A receiver, fed with the bits on its line.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Uart {
    /// The bit before: a start bit is a 0 behind a 1.
    last: bool,
    /// The bits read of a byte after its start bit, the first one lowest, and how many; `None` between bytes.
    reading: Option<(u16, u32)>,
}

impl Uart {
    /// A receiver on an idle line.
    pub(crate) fn idle() -> Self {
        Self {
            last: true,
            reading: None,
        }
    }

    /// Whether it waits for a start bit, as a sound receiver does between two bytes.
    pub(crate) fn in_step(&self) -> bool {
        self.last && self.reading.is_none()
    }

    /// Takes a bit; gives a byte when this was its stop bit.
    pub(crate) fn take(&mut self, bit: bool) -> Option<Received> {
        let fell = self.last && !bit;
        self.last = bit;
        let Some((bits, count)) = self.reading else {
            self.reading = fell.then_some((0, 0));
            return None;
        };
        let bits = bits | u16::from(bit) << count;
        if count < 9 {
            self.reading = Some((bits, count + 1));
            return None;
        }
        self.reading = None;
        let [byte, rest] = bits.to_le_bytes();
        let odd = (byte.count_ones() + u32::from(rest & 1)) % 2 == 1;
        let error = if !bit && bits == 0 {
            Some(LineError::Break)
        } else if !bit {
            Some(LineError::Framing)
        } else if !odd {
            Some(LineError::Parity)
        } else {
            None
        };
        Some(Received { byte, error })
    }
}

/// The bits of a byte as a transmitter sends them: start, data from the lowest up, odd parity, stop.
pub(crate) fn bits(byte: u8) -> u16 {
    let parity = u16::from(byte.count_ones().is_multiple_of(2));
    u16::from(byte) << 1 | parity << 9 | 1 << 10
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is read of bytes without a gap, the bits of a mask inverted in the first one.
    fn read(bytes: &[u8], mask: u16) -> (Vec<(u8, Option<LineError>)>, bool) {
        let mut uart = Uart::idle();
        let mut read = Vec::new();
        for (place, byte) in bytes.iter().enumerate() {
            let word = bits(*byte) ^ if place == 0 { mask } else { 0 };
            for bit in 0..BITS {
                read.extend(uart.take(word >> bit & 1 == 1));
            }
        }
        let read = read.iter().map(|r| (r.byte, r.error)).collect();
        (read, uart.in_step())
    }

    #[test]
    fn a_sound_byte_is_read_as_it_is_and_a_damaged_one_as_flips_say() {
        for byte in 0..=255 {
            assert_eq!(read(&[byte], 0), (vec![(byte, None)], true));
            let parity = Some(LineError::Parity);
            assert_eq!(read(&[byte], 1 << 9).0, [(byte, parity)]);
            assert_eq!(read(&[byte], 1 << 1).0, [(byte ^ 1, parity)]);
            let framing = read(&[byte], 1 << 10);
            assert_eq!(framing.0, [(byte, Some(LineError::Framing))]);
        }
    }

    /// From a drawing of the bits: 80 is 0 00000001 0 1. Without its start bit its bit 0 is taken for one: 40, with
    /// the next start bit in place of a stop bit. The next fall is that of a parity bit: 1 0 000000 0 1, so 01 is read
    /// out of every SYNCO from there on, and its parity fits.
    #[test]
    fn out_of_step_on_synco_for_ever() {
        let (bytes, in_step) = read(&[0x80; 6], 1);
        assert_eq!(bytes[0], (0x40, Some(LineError::Framing)));
        assert_eq!(bytes[1..], [(0x01, None); 4]);
        assert!(!in_step);
    }

    #[test]
    fn a_zero_brings_it_back_into_step() {
        let (bytes, in_step) = read(&[0x80, 0x00, 0x00, 0x00], 1);
        assert!(in_step);
        assert_eq!(bytes.last(), Some(&(0x00, None)));
        assert_eq!(read(&[0xFF], 1), (vec![], true));
    }
}
