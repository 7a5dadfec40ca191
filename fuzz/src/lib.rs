//! What the targets share: libFuzzer's extra counters, fed with the protocol transitions of a case, and the mutator that
//! repairs commands.

use harness_sim::fuzz::{ThreeDrives, repair};
use harness_sim::transitions::{Notes, REACHABLE, Transition};
use std::cell::RefCell;
use std::sync::atomic::{AtomicU8, Ordering};

// libFuzzer takes the counters in steps of eight bytes.
const COUNTERS: usize = REACHABLE.next_multiple_of(8);

/// One counter a cell of the matrix of protocol transitions that can be reached. libFuzzer finds them by the name of the section, sets them
/// to 0 before each case, reads all of them behind it and keeps an input that makes one of them rise for the first time. `used` keeps the
/// linker from leaving them out.
// Unsafe, since a section of a wrong form would harm the program; this one is an array of bytes, as libFuzzer documents it.
#[used]
#[unsafe(link_section = "__libfuzzer_extra_counters")]
static TRANSITIONS: [AtomicU8; COUNTERS] = [const { AtomicU8::new(0) }; COUNTERS];

/// Tells libFuzzer which transitions a case goes through, each when it happens.
#[derive(Debug, Default)]
pub struct Counters;

impl Notes for Counters {
    #[inline]
    fn note(&mut self, cell: Transition) {
        match cell.number().and_then(|number| TRANSITIONS.get(number)) {
            Some(counter) => counter.store(1, Ordering::Relaxed),
            None => cell.assert_possible(),
        }
    }

    fn join(&mut self, _other: &Self) {}

    fn assert_possible(&self) {}
}

thread_local! {
    static THREE_DRIVES: RefCell<ThreeDrives<Counters>> = RefCell::default();
}

/// The body of the target `ring`, each case on the two models of the one before.
pub fn ring(data: &[u8]) -> Counters {
    THREE_DRIVES.with_borrow_mut(|drives| drives.watched(data))
}

/// libFuzzer's mutation, and behind it, for three seeds of four, repaired commands; `head` bytes in front are no wire bytes.
pub fn mutate(data: &mut [u8], size: usize, max_size: usize, seed: u32, head: usize) -> usize {
    let size = libfuzzer_sys::fuzzer_mutate(data, size, max_size);
    if !seed.is_multiple_of(4)
        && let Some(wire) = data[..size].get_mut(head..)
    {
        repair(wire);
    }
    size
}
