//! What the targets share: libFuzzer's extra counters, fed with what a case goes through.

mod noting;
#[cfg(feature = "novobus")]
mod transitions;

pub use noting::{FEATURES, note};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU8, AtomicU16};
#[cfg(feature = "novobus")]
pub use transitions::{mutate, not_counted};

/// Number of counters for `cells` cells: libFuzzer reads them in steps of eight bytes.
pub const fn counters(cells: usize) -> usize {
    cells.next_multiple_of(8)
}

/// Number of cases in which a transition is reported to libFuzzer. It keeps an input only for a new transition, so reporting
/// those of nearly every case would only cost time.
pub const NEWS: u16 = 4_096;

/// Raises the counter with this number, once a case, while `left` reports remain for it; `false` if there is no such counter.
#[inline]
pub fn tell<const N: usize>(
    counters: &[AtomicU8; N],
    left: &[AtomicU16; N],
    number: usize,
) -> bool {
    let (Some(counter), Some(left)) = (counters.get(number), left.get(number)) else {
        return false;
    };
    let cases = left.load(Relaxed);
    if cases > 0 && counter.load(Relaxed) == 0 {
        counter.store(1, Relaxed);
        left.store(cases - 1, Relaxed);
    }
    true
}

/// A target that gives the number of each cell that a case reaches to a function: `$cells` counters for libFuzzer.
#[macro_export]
macro_rules! cell_counters {
    ($cells:expr, $body:expr) => {
        // As in `counters`.
        #[used]
        #[unsafe(link_section = "__libfuzzer_extra_counters")]
        static CELLS: [std::sync::atomic::AtomicU8; $crate::counters($cells)] =
            [const { std::sync::atomic::AtomicU8::new(0) }; $crate::counters($cells)];
        static LEFT: [std::sync::atomic::AtomicU16; $crate::counters($cells)] =
            [const { std::sync::atomic::AtomicU16::new($crate::NEWS) }; $crate::counters($cells)];
        libfuzzer_sys::fuzz_target!(|data: &[u8]| $body(data, &mut |cell: usize| {
            assert!(
                $crate::tell(&CELLS, &LEFT, cell),
                "cell {cell}: this target has no counter for it"
            );
        }));
    };
}
