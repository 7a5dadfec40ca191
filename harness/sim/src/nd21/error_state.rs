//! The drive's error mode: `Status` bit 5, `errorcode`, the history, the display (ND21 11.8, 14.10.1).
//!
//! Choice (E120): the history in EEPROM 10-1E, fifteen bytes without a printed form, holds the ten last
//! codes of 12 bits each, the newest first.

use super::eeprom_controller::count_in;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::status;
use harness_proto::nd21::errors::display_digits;
use harness_proto::nd21::ram;

/// Where the history stands in the EEPROM (14.2.2).
const HISTORY: core::ops::Range<usize> = 0x10..0x1F;

/// The drive is in error mode.
#[inline]
pub(super) fn is_set(cells: &Cells) -> bool {
    cells.byte(ram::STATUS) & status::ERROR != 0
}

/// An error is reported, without the error mode.
pub(super) fn note(code: u16, cells: &mut Cells) {
    cells.put_word(ram::ERRORCODE, code);
    remember(code, cells);
}

/// The drive goes into error mode.
pub(super) fn raise(code: u16, cells: &mut Cells) {
    note(code, cells);
    cells.set_bits(ram::STATUS, status::ERROR, true);
}

/// "Write H'AF in RAM cell error code" (14.10.1).
pub(super) fn confirm(cells: &mut Cells) {
    cells.put_word(ram::ERRORCODE, 0);
    cells.set_bits(ram::STATUS, status::ERROR, false);
}

/// The three digits of the 7-segment display (11.8).
pub(super) fn display(cells: &Cells) -> Option<[u8; 3]> {
    if is_set(cells) {
        display_digits(cells.word(ram::ERRORCODE))
    } else {
        None
    }
}

/// Puts a code of 12 bits in front of the others: everything moves up by three half bytes.
fn remember(code: u16, cells: &mut Cells) {
    count_in(cells.eeprom_mut(), |eeprom| {
        put_first(code, &mut eeprom[HISTORY]);
    });
}

fn put_first(code: u16, history: &mut [u8]) {
    let mut halves = [0; 30];
    for (pair, byte) in halves.chunks_mut(2).zip(history.iter()) {
        pair.copy_from_slice(&[byte >> 4, byte & 0xF]);
    }
    halves.copy_within(..27, 3);
    let [high, low] = code.to_be_bytes();
    halves[..3].copy_from_slice(&[high & 0xF, low >> 4, low & 0xF]);
    for (byte, pair) in history.iter_mut().zip(halves.chunks(2)) {
        *byte = pair[0] << 4 | pair[1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 14.2.2 (10-1E), 14.10.1: twelve bits a code, the newest first, the eleventh is lost.
    #[test]
    fn history_keeps_ten() {
        let mut cells = Cells::with_eeprom([0xEE; 256]);
        for code in 0x0301..=0x0309 {
            raise(code, &mut cells);
        }
        raise(0x0400, &mut cells);
        raise(0x0700, &mut cells);
        let expected = [
            0x70, 0x04, 0x00, 0x30, 0x93, 0x08, 0x30, 0x73, 0x06, 0x30, 0x53, 0x04, 0x30, 0x33,
            0x02,
        ];
        assert_eq!(cells.eeprom()[HISTORY], expected);
        assert_eq!((cells.eeprom()[0x0F], cells.eeprom()[0x20]), (0xEE, 0xEE));
    }

    /// ND21 11.8, 14.10.1.
    #[test]
    fn display_shows_the_code_until_it_is_confirmed() {
        let mut cells = Cells::with_eeprom([0; 256]);
        assert_eq!(display(&cells), None);
        raise(0x0508, &mut cells);
        assert_eq!(display(&cells), Some([5, 0, 8]));
        assert!(is_set(&cells));
        confirm(&mut cells);
        assert_eq!(display(&cells), None);
        assert_eq!(cells.word(ram::ERRORCODE), 0);
    }
}
