//! One drive's end of the bus against the reference model.

use super::{LONGEST, same_memory};
use crate::device::Device as _;
use crate::reference;
use crate::transitions::{Notes, Reached, Watched};
use harness_proto::line::{LineError, Received};
use harness_proto::time::Instant;

/// One drive's end of the bus against the reference model, byte by byte (ND21 9.1-9.8). The first byte of
/// the input is the number of the byte that arrives with wrong parity, 0 for none; the rest goes over the
/// wire.
///
/// # Panics
/// The two models answer otherwise, or disagree on the error mode or the memory.
pub fn detector(data: &[u8]) {
    let _transitions: Reached = detector_watched(data);
}

/// The same, with the transitions that the drive went through.
///
/// # Panics
/// As [`detector`], or a transition is called unreachable.
#[must_use]
pub fn detector_watched<N: Notes>(data: &[u8]) -> N {
    Detector::default().watched(data)
}

/// The two models of [`detector`]. Each case begins with both as new, where they stand: to make and to move them takes longer than a case of
/// a few bytes.
#[derive(Debug, Default)]
pub struct Detector<N> {
    ours: Watched<N>,
    theirs: reference::Drive,
}

impl<N: Notes> Detector<N> {
    /// Plays an input of [`detector`]; gives the transitions that the drive went through.
    ///
    /// # Panics
    /// As [`detector_watched`].
    #[must_use]
    pub fn watched(&mut self, data: &[u8]) -> N {
        let Self { ours, theirs } = self;
        ours.restart();
        theirs.restart_all();
        if let Some((&damaged, wire)) = data.split_first() {
            in_step(ours, theirs, damaged, &wire[..wire.len().min(LONGEST)]);
        }
        ours.reached().assert_possible();
        ours.take_reached()
    }
}

fn in_step<N: Notes>(
    ours: &mut Watched<N>,
    theirs: &mut reference::Drive,
    damaged: u8,
    wire: &[u8],
) {
    for (number, &byte) in (1_usize..).zip(wire) {
        let bad = number == usize::from(damaged);
        let received = if bad {
            Received::bad(byte, LineError::Parity)
        } else {
            Received::good(byte)
        };
        // Where no time-out is monitored no time matters.
        let step = ours.receive(Instant::START, received);
        let expected = theirs.receive(reference::Cell { byte, error: bad });
        if step.byte != expected {
            differ(number, wire, step.byte, expected);
        }
        if ours.in_error() != theirs.in_error() {
            differ(number, wire, ours.in_error(), theirs.in_error());
        }
        // Time-outs are no part of the reference model: a case that switches them on ends here.
        if ours.drive().memory().peek(0xFF57) & 4 != 0 {
            return;
        }
    }
    same_memory(ours.drive(), theirs);
}

/// The two models do or are not the same at a byte. Apart from the loop, which would else keep all of this where a message can be made of it.
#[cold]
#[inline(never)]
fn differ<T: std::fmt::Debug>(number: usize, wire: &[u8], ours: T, theirs: T) {
    panic!("byte {number} of {wire:02X?}: {ours:02X?}, the reference model {theirs:02X?}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// What a case leaves behind is gone before the next one: both models are as new, and the next case goes as it goes alone.
        #[test]
        fn a_case_leaves_nothing_behind(
            first in prop::collection::vec(any::<u8>(), 0..60),
            second in prop::collection::vec(any::<u8>(), 0..60),
        ) {
            let mut detector = Detector::<Reached>::default();
            let new = format!("{detector:?}");
            let mut first = first;
            if let [_, wire @ ..] = &mut first[..] {
                crate::fuzz::repair(wire);
            }
            let _transitions: Reached = detector.watched(&first);
            prop_assert_eq!(detector.watched(&second), detector_watched::<Reached>(&second));
            detector.ours.restart();
            detector.theirs.restart_all();
            prop_assert_eq!(format!("{detector:?}"), new);
        }
    }
}
