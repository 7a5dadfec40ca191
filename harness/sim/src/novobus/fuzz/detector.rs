//! One drive's end of the bus against the reference model.

use super::same_memory;
use crate::fuzz::LONGEST;
use crate::novobus::device::Device as _;
use crate::novobus::reference;
use crate::novobus::transitions::{Notes, Reached, Watched};
use harness_proto::line::{LineError, Received};
use harness_proto::time::Instant;

/// One drive's end of the bus against the reference model, byte by byte (ND21 9.1-9.8). The first byte of
/// the input is the number of the byte that arrives with wrong parity, 0 for none; the rest goes over the
/// wire.
///
/// # Panics
/// The two models give different answers, or disagree on the error mode or the memory.
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
            let wire = &wire[..wire.len().min(LONGEST)];
            // Split the input at the damaged byte, so that the loops over good bytes need no test for it.
            let front = usize::from(damaged).checked_sub(1).unwrap_or(wire.len());
            let (front, rest) = wire.split_at(front.min(wire.len()));
            let (bad, behind) = rest.split_at(rest.len().min(1));
            in_step::<false, N>(ours, theirs, front);
            // Most cases have no damaged byte.
            if !bad.is_empty() {
                in_step::<true, N>(ours, theirs, bad);
                in_step::<false, N>(ours, theirs, behind);
            }
            same_memory(ours.drive(), theirs);
        }
        ours.reached().assert_possible();
        ours.take_reached()
    }
}

/// Plays bytes that arrive good or with wrong parity.
#[inline(never)]
fn in_step<const BAD: bool, N: Notes>(
    ours: &mut Watched<N>,
    theirs: &mut reference::Drive,
    bytes: &[u8],
) {
    for (place, &byte) in bytes.iter().enumerate() {
        let received = if BAD {
            Received::bad(byte, LineError::Parity)
        } else {
            Received::good(byte)
        };
        // No time passes: a case may switch the monitoring of time-outs on, which are no part of the reference model, and none comes.
        let step = ours.receive(Instant::START, received);
        let expected = theirs.receive(reference::Cell { byte, error: BAD });
        if step.byte != expected {
            differ(&bytes[..=place], step.byte, expected);
        }
        if ours.in_error() != theirs.in_error() {
            differ(&bytes[..=place], ours.in_error(), theirs.in_error());
        }
    }
}

/// The two models do or are not the same at a byte. Apart from the loop, which would else keep all of this where a message can be made of it.
#[cold]
#[inline(never)]
fn differ<T: std::fmt::Debug>(bytes: &[u8], ours: T, theirs: T) {
    panic!("the last of {bytes:02X?}: {ours:02X?}, the reference model {theirs:02X?}");
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
                crate::novobus::fuzz::repair(wire);
            }
            let _transitions: Reached = detector.watched(&first);
            prop_assert_eq!(detector.watched(&second), detector_watched::<Reached>(&second));
            detector.ours.restart();
            detector.theirs.restart_all();
            prop_assert_eq!(format!("{detector:?}"), new);
        }
    }
}
