//! Reads from what the master receives which drive saw a fault (ND21 9.7).

use harness_proto::line::Received;
use harness_proto::novobus::sync::SYNCO;

/// Zeros in a row that no telegram holds: one more than the seven of ND21 9.7 would be sure, but the
/// last drive of a broken ring sends just seven (the figure of 9.9).
const ZEROS: usize = 7;
/// How often an address must repeat before it counts: it comes "for ever".
const REPEATS: usize = 4;
/// How often an address repeats at most that is wrong because the master sends zeros itself: from the eighth of its 17 zeros on, a drive
/// takes those before it for ones in the error mode (the figure of ND21 9.8).
pub(crate) const FALSE: usize = 10;
/// Maximum number of zeros in front of an address (ND21 9.7).
pub(crate) const MAX_ZEROS: usize = 25;

/// A drive that the ring spells out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Location {
    /// Its number.
    pub drive: u8,
    /// The zeros in front of its address; `None` for drive 0, whose address is a zero itself.
    pub zeros: Option<u64>,
    /// The address has come more often than the zeros of a check sequence can make a wrong one come.
    pub sure: bool,
}

/// The drive that the ring spells out, from what was received since the last check sequence.
#[must_use]
pub(crate) fn locate(received: &[Received], drives: u8) -> Option<Location> {
    let last = received.last()?;
    let repeats = received
        .iter()
        .rev()
        .take_while(|byte| *byte == last)
        .count();
    if last.error.is_some() || repeats < REPEATS {
        return None;
    }
    if last.byte == 0 {
        return (repeats > MAX_ZEROS).then_some(Location {
            drive: 0,
            zeros: None,
            sure: true,
        });
    }
    if last.byte >= drives {
        return None;
    }
    // The addresses climb where a drive further down is done with its 17 zeros before the others: the addressed one is, as it
    // notices the first zero at once (9.7), and so are those after a time-out: 00 00 01 02 02 (9.9).
    let mut before = &received[..received.len() - repeats];
    let mut lowest = last.byte;
    while let [rest @ .., byte] = before
        && byte.error.is_none()
        && (1..=lowest).contains(&byte.byte)
    {
        lowest = byte.byte;
        before = rest;
    }
    let zeros = before.iter().rev().take_while(|byte| byte.is(0)).count();
    // SYNCO after the seven zeros of a telegram is no address, although some rings have a drive 128.
    let fewest = if last.byte == SYNCO { ZEROS + 1 } else { ZEROS };
    (zeros >= fewest).then_some(Location {
        drive: last.byte,
        zeros: Some(zeros as u64),
        sure: repeats > FALSE,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn located(text: &str, drives: u8) -> Option<Location> {
        let byte = |word| u8::from_str_radix(word, 16).expect("a byte");
        let received: Vec<_> = text.split(' ').map(byte).map(Received::good).collect();
        locate(&received, drives)
    }

    /// Drive 2 of 3 detects an error at the command byte for drive 0, which notices the zero at once and is done with its 17
    /// zeros four bytes before drive 1.
    #[test]
    fn addresses_that_climb() {
        let zeros = "00 ".repeat(16);
        let drive = |drive| {
            Some(Location {
                drive,
                zeros: Some(16),
                sure: false,
            })
        };
        assert_eq!(
            located(&format!("88 00 88 {zeros}01 01 01 01 02 02 02 02"), 3),
            drive(2)
        );
        assert_eq!(located(&format!("88 {zeros}02 02 02 02"), 3), drive(2));
        assert_eq!(located(&format!("88 {zeros}02 02 01 01 01 01"), 3), None);
    }

    /// The figure of 9.8: drive 97 takes the master's zeros for those of a drive in the error mode, and 62 comes in place of 61.
    #[test]
    fn zeros_of_a_check_sequence() {
        let ring = |right: usize, wrong: usize| {
            let (right, more) = ("61 ".repeat(right), "62 ".repeat(wrong));
            let text = format!("88 {}{right}{more}", "00 ".repeat(19));
            located(text.trim_end(), 100).map(|location| (location.drive, location.sure))
        };
        assert_eq!(ring(3, 0), None);
        assert_eq!(ring(10, 0), Some((97, false)));
        assert_eq!(ring(11, 0), Some((97, true)));
        assert_eq!(ring(11, 10), Some((98, false)));
    }
}
