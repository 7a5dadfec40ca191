//! Three drives in a ring, and a damaged byte, against the reference model.

use super::same_memory;
use crate::fault::{Flips, LinkFault};
use crate::novobus::device::Device as _;
use crate::novobus::reference;
use crate::novobus::ring::Ring;
use crate::novobus::transitions::{Notes, Reached, Watched};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::Instant;

/// The longest conversation; what lies behind is left out.
const LONGEST: usize = 256;

/// A ring of three against the reference model. The first byte of the input is the link that is damaged (0
/// to 3) and how (its high half), the second the number of the damaged byte, 0 for none.
///
/// # Panics
/// A byte on any link, a drive's memory or its error mode differs from the reference model.
pub fn ring(data: &[u8]) {
    let _transitions: Reached = ring_watched(data);
}

/// The same, with the transitions that the three drives went through.
///
/// # Panics
/// As [`ring`], or a transition is called unreachable.
#[must_use]
pub fn ring_watched<N: Notes>(data: &[u8]) -> N {
    ThreeDrives::default().watched(data)
}

/// The two models of [`ring`]. Each case begins with both as new; the room that a case took serves the next one, since a case of a few
/// bytes is short beside asking for memory.
#[derive(Debug)]
pub struct ThreeDrives<N> {
    ours: Option<Ring<Watched<N>>>,
    theirs: [reference::Drive; 3],
    /// What the reference model says that each link carries.
    expected: Vec<Vec<reference::Cell>>,
}

impl<N: Notes> Default for ThreeDrives<N> {
    fn default() -> Self {
        let ours = RingSize::new(3).ok().map(|size| {
            let mut ring = Ring::new(size, Rate::Baud38400, |_| Watched::default());
            // Marks are of no use here.
            ring.stop_recording();
            (0..4).for_each(|link| ring.record_link(link));
            // A byte is inserted or doubled at most.
            ring.reserve(LONGEST + 1);
            ring
        });
        Self {
            ours,
            theirs: Default::default(),
            expected: Vec::new(),
        }
    }
}

impl<N: Notes> ThreeDrives<N> {
    /// Plays an input of [`ring`]; gives the transitions that the three drives went through.
    ///
    /// # Panics
    /// As [`ring_watched`].
    #[must_use]
    pub fn watched(&mut self, data: &[u8]) -> N {
        let mut reached = N::default();
        let ([what, place, wire @ ..], Some(ours)) = (data, &mut self.ours) else {
            return reached;
        };
        if wire.is_empty() {
            return reached;
        }
        let wire = &wire[..wire.len().min(LONGEST)];
        ours.restart(Watched::restart);
        let (link, fault, other) = ring_fault(*what);
        let fault_of_theirs = [(link, usize::from(*place), other)];
        let mut faults = &fault_of_theirs[..0];
        if *place > 0 && usize::from(*place) <= wire.len() {
            ours.arm_link(link, u64::from(*place), fault);
            faults = &fault_of_theirs;
        }
        ours.send(Instant::START, wire);
        // The way round the ring takes a byte time a link.
        let conversation = ours.byte_time() * (wire.len() as u64 + 8);
        ours.run_until(Instant::START + conversation);
        let drives = || (0..3).rev().filter_map(|k| ours.drive(k));
        drives().for_each(|drive| reached.join(drive.reached()));
        reached.assert_possible();
        // Time-outs are no part of the reference model, be they switched off again since by a reset.
        if drives().any(|drive| drive.timed_out() || drive.drive().memory().peek(0xFF57) & 4 != 0) {
            return reached;
        }
        assert!(!ours.busy(), "a byte is still under way, sent {wire:02X?}");
        let theirs = &mut self.theirs;
        theirs.iter_mut().for_each(reference::Drive::restart_all);
        reference::run_into(&mut self.expected, theirs, wire, faults);
        same_bytes(ours, &self.expected, wire);
        for (ours, theirs) in drives().zip(theirs) {
            assert_eq!(ours.in_error(), theirs.in_error(), "sent {wire:02X?}");
            same_memory(ours.drive(), theirs);
        }
        reached
    }
}

/// Every link has carried the same bytes.
fn same_bytes<N: Notes>(ours: &Ring<Watched<N>>, expected: &[Vec<reference::Cell>], wire: &[u8]) {
    assert_eq!(expected.len(), 4, "a link behind the master and each drive");
    for (index, expected) in expected.iter().enumerate() {
        let carried = ours.carried_by(index).expect("one of four links");
        let arrived = carried.filter_map(|byte| byte.arrival());
        let received = arrived.map(|byte| reference::Cell {
            byte: byte.byte,
            error: byte.error.is_some(),
        });
        if !received.clone().eq(expected.iter().copied()) {
            let received: Vec<_> = received.collect();
            assert_eq!(received, *expected, "link {index}, sent {wire:02X?}");
        }
    }
}

/// The damaged link of [`ring`], and what happens on it, in the words of both models.
fn ring_fault(what: u8) -> (usize, LinkFault, reference::Fault) {
    let link = usize::from(what & 3);
    match what >> 4 {
        kind @ 0..8 => {
            let data = 1 << kind;
            let flips = Flips {
                data,
                ..Flips::default()
            };
            let other = reference::Fault::Flip(data, false, false);
            (link, LinkFault::Flip(flips), other)
        }
        8 => (link, LinkFault::Drop, reference::Fault::Drop),
        9 => (link, LinkFault::Duplicate, reference::Fault::Duplicate),
        kind => {
            let other = reference::Fault::Insert(kind);
            (link, LinkFault::Insert(kind), other)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// What a case leaves behind is gone before the next one: the ring is as new, and the next case goes as it goes alone.
        #[test]
        fn a_case_leaves_nothing_behind(
            first in prop::collection::vec(any::<u8>(), 0..60),
            second in prop::collection::vec(any::<u8>(), 0..60),
        ) {
            let mut drives = ThreeDrives::<Reached>::default();
            let new = format!("{:?}", drives.ours);
            let _transitions = drives.watched(&first);
            prop_assert_eq!(drives.watched(&second), ring_watched(&second));
            let ours = drives.ours.as_mut().expect("a ring of three");
            ours.restart(Watched::restart);
            prop_assert_eq!(format!("{:?}", drives.ours), new);
            for drive in &mut drives.theirs {
                drive.restart_all();
                prop_assert_eq!(format!("{drive:?}"), format!("{:?}", reference::Drive::new()));
            }
        }
    }
}
