//! Targets on a NOVOBUS ring that tell libFuzzer which protocol transitions a case goes through, and their mutator.

use harness_sim::novobus::fuzz::repair;
use harness_sim::novobus::transitions::Transition;

/// Defines `Counters`, which reports each transition to libFuzzer when it happens: one counter for each of the first `$cells` cells of the
/// matrix of protocol transitions. Pass no more cells than the target can reach: libFuzzer finds the counters by the name of the section,
/// clears all of them before each case, reads all of them after it and keeps an input that raises one of them for the first time.
#[macro_export]
macro_rules! counters {
    ($cells:expr) => {
        // `used` keeps the linker from leaving them out. Unsafe, since a section of a wrong form would harm the program; this one is an
        // array of bytes, as libFuzzer documents it.
        #[used]
        #[unsafe(link_section = "__libfuzzer_extra_counters")]
        static TRANSITIONS: [std::sync::atomic::AtomicU8; $crate::counters($cells)] =
            [const { std::sync::atomic::AtomicU8::new(0) }; $crate::counters($cells)];

        // The number of further cases in which each transition is reported.
        static LEFT: [std::sync::atomic::AtomicU16; $crate::counters($cells)] =
            [const { std::sync::atomic::AtomicU16::new($crate::NEWS) }; $crate::counters($cells)];

        #[derive(Clone, Debug, Default)]
        struct Counters;

        impl harness_sim::novobus::transitions::Notes for Counters {
            #[inline]
            fn note(&mut self, cell: harness_sim::novobus::transitions::Transition) {
                let told = cell
                    .number()
                    .is_some_and(|number| $crate::tell(&TRANSITIONS, &LEFT, number));
                if !told {
                    $crate::not_counted(cell);
                }
            }

            fn join(&mut self, _other: &Self) {}

            fn assert_possible(&self) {}
        }
    };
}

/// Ends the case of a target that reaches a cell that it cannot reach.
///
/// # Panics
/// Always.
#[cold]
pub fn not_counted(cell: Transition) {
    cell.assert_possible();
    panic!("{cell}: this target has no counter for it");
}

/// The longest command (ND21 10).
const LONGEST_COMMAND: usize = 6;

/// libFuzzer's mutation, and behind it, for every fourth seed, repaired commands; `head` bytes in front are no wire bytes. For all but a
/// few seeds an input grows by a command at most: of a long input nearly every byte comes to a drive that is in the error mode already.
pub fn mutate(data: &mut [u8], size: usize, max_size: usize, seed: u32, head: usize) -> usize {
    let most = if seed % 32 == 1 {
        max_size
    } else {
        max_size.min(size + LONGEST_COMMAND)
    };
    let size = libfuzzer_sys::fuzzer_mutate(data, size, most);
    if seed.is_multiple_of(4)
        && let Some(wire) = data[..size].get_mut(head..)
    {
        repair(wire);
    }
    size
}
