//! Drives in a row that all add 1 (ND21 9.7): their state follows from the bytes and their place.
//!
//! Each drive adds 1 to a byte until one receives the FF that begins a check sequence. That drive and all behind it pass the FF on. They
//! wait for the next byte of the sequence, and those ahead of them for an FF. The next byte climbs until it is what a drive waits for,
//! which again all drives behind it receive. So the place from which on drives are in a check sequence, and the number of its bytes
//! that they have received, tell the state of the whole row.

use super::ErrorMode;
use crate::novobus::check_sequence::{SEQUENCE, SequenceWatch};

/// What a row of drives keeps that add 1 to each byte and look for the check sequence (ND21 9.7, 9.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Climb {
    /// Drives this many places behind the first, and all behind them, have received `matched` bytes of a check sequence; the others none.
    from: u8,
    matched: u8,
    /// Good zeros in a row that the first drive has received. The others receive none: what a drive passes on is 1 more than it
    /// received, or a byte of the check sequence.
    zeros: u8,
}

/// A place that no row has: a ring has at most 250 drives (ND21 8.4).
const NOWHERE: u8 = u8::MAX;

impl Climb {
    /// The first drive, counted in places from the first of the row, that received the last byte as a byte of a check sequence. Each drive
    /// ahead of it added 1; it and all behind it passed the byte on.
    #[must_use]
    #[inline]
    pub const fn from(self) -> u8 {
        self.from
    }

    /// What drives at or behind [`Self::from`] received last.
    #[must_use]
    #[inline]
    pub fn in_sequence(self) -> u8 {
        SEQUENCE[usize::from(self.matched.saturating_sub(1))]
    }

    /// Whether the last byte began a check sequence, which a drive at or behind [`Self::from`] remarks (`@`, ND21 9.8).
    #[must_use]
    #[inline]
    pub const fn began_sequence(self) -> bool {
        self.matched == 1
    }

    /// Takes a good byte that the first drive receives; `None` for one that ends a check sequence at some drive.
    #[must_use]
    pub fn receive(self, byte: u8) -> Option<Self> {
        let awaited = SEQUENCE[usize::from(self.matched)];
        let arrives = byte.checked_add(self.from);
        let (from, matched) = match arrives.and_then(|arrives| awaited.checked_sub(arrives)) {
            Some(more) => (self.from + more, self.matched + 1),
            None => (SEQUENCE[0] - byte, 1),
        };
        (usize::from(matched) < SEQUENCE.len()).then_some(Self {
            from,
            matched,
            zeros: match byte {
                0 => self.zeros.saturating_add(1),
                _ => 0,
            },
        })
    }

    /// The same of the row that begins `places` behind.
    #[must_use]
    #[inline]
    pub fn behind(self, places: u8) -> Self {
        Self {
            from: self.from.saturating_sub(places),
            zeros: if places == 0 { self.zeros } else { 0 },
            ..self
        }
    }

    /// The same of the row that begins `places` ahead.
    #[must_use]
    #[inline]
    pub fn ahead(self, places: u8) -> Self {
        Self {
            from: self.from.saturating_add(places),
            ..self
        }
    }

    /// How many bytes of a check sequence the first drive has received.
    const fn of_first(self) -> u8 {
        if self.from == 0 { self.matched } else { 0 }
    }

    /// The same of a row that begins one drive ahead, with a drive that keeps `leader`; `None` where that drive is none of the row. A drive
    /// that adds 1 has not sent a zero.
    pub(in crate::novobus) fn led_by(self, leader: Self) -> Option<Self> {
        let row = self.ahead(1);
        let fits = self.zeros == 0 && row.of_first() == leader.of_first();
        fits.then_some(Self {
            zeros: leader.zeros,
            ..row
        })
    }
}

impl ErrorMode {
    /// What a row of this drive alone keeps; `None` until it adds 1, and for wrong drives that count zeros in another way.
    pub(in crate::novobus) fn climb(&self) -> Option<Climb> {
        let matched = self.watch.matched();
        let from = if matched == 0 { NOWHERE } else { 0 };
        (self.increments() && self.rules.zeros_in_a_row).then_some(Climb {
            from,
            matched,
            zeros: self.zeros_received,
        })
    }

    /// Makes up for bytes that were passed on without it, where it is the first of a row that keeps `climb`.
    #[cold]
    pub(in crate::novobus) fn has_climbed(&mut self, climb: Climb) {
        self.watch = SequenceWatch::after(climb.of_first());
        self.in_sequence = climb.of_first() > 0;
        self.zeros_received = climb.zeros;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::Received;
    use crate::novobus::error_mode::Rules;
    use crate::novobus::properties::BrokenSequence;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    /// A row whose drives have all begun to add 1.
    fn row(drives: u8) -> Vec<ErrorMode> {
        let mut all = Vec::new();
        for _ in 0..drives {
            let mut mode = ErrorMode::enter(Received::good(0), Rules::MANUAL);
            while !mode.increments() {
                let _zero = mode.receive(Received::good(0), BrokenSequence::Answered);
            }
            let _other = mode.receive(Received::good(1), BrokenSequence::Answered);
            all.push(mode);
        }
        all
    }

    proptest! {
        /// ND21 9.7, 9.8: what a climb tells of a row is what each of its drives does by itself.
        #[test]
        fn a_climb_is_what_each_drive_does(
            drives in 1_u8..=250,
            bytes in prop::collection::vec(
                (0_u8..=250, prop_oneof![any::<u8>(), prop::sample::select(&SEQUENCE[..]), Just(0)]),
                0..60,
            ),
        ) {
            let mut each = row(drives);
            let mut climb = each[0].climb().expect("it adds 1");
            let mut together = each.clone();
            for (ahead, byte) in bytes {
                // What the first drives add up to a byte of the sequence, too.
                let byte = byte.wrapping_sub(ahead);
                let mut on_link = byte;
                let mut received = Vec::new();
                let mut ended = false;
                for mode in &mut each {
                    received.push(on_link);
                    let sequence = mode.sequence();
                    on_link = mode.receive(Received::good(on_link), BrokenSequence::Answered).byte;
                    ended |= sequence == 4 && on_link == SEQUENCE[4];
                }
                let Some(next) = climb.receive(byte) else {
                    // Or it would have ended in a longer row.
                    prop_assert_eq!(climb.matched, 4);
                    return Ok(());
                };
                prop_assert!(!ended);
                climb = next;
                for ((number, mode), received) in (0..).zip(&mut together).zip(received) {
                    mode.has_climbed(climb.behind(number));
                    let expected = match number >= climb.from() {
                        true => climb.in_sequence(),
                        false => byte.wrapping_add(number),
                    };
                    prop_assert_eq!(received, expected, "drive {}", number);
                }
                prop_assert_eq!(&together, &each);
            }
        }
    }
}
