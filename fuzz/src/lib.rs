//! What the targets share: libFuzzer's extra counters, fed with the protocol transitions of a case or with what else it reaches, and the
//! mutator that repairs commands.

use harness_sim::fuzz::{Feature, NOTING, Notebook, repair};
use harness_sim::transitions::{REACHABLE, Reached};
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

/// Tells libFuzzer which transitions a case went through.
pub fn count(reached: &Reached) {
    for number in reached.reachable_numbers() {
        TRANSITIONS[number].store(1, Ordering::Relaxed);
    }
}

/// How many counters there are for features; two features with one counter are no harm.
pub const FEATURES: usize = 8_192;

/// A target that tells libFuzzer what its cases reach, by the names of `harness_sim::fuzz::features`. The counters stand in the target's own
/// crate, so that others have none.
#[macro_export]
macro_rules! noting {
    ($name:literal) => {
        // Unsafe, since a section of a wrong form would harm the program; this one is an array of bytes, as libFuzzer documents it.
        #[used]
        #[unsafe(link_section = "__libfuzzer_extra_counters")]
        static COUNTERS: [std::sync::atomic::AtomicU8; $crate::FEATURES] = [const { std::sync::atomic::AtomicU8::new(0) }; $crate::FEATURES];
        libfuzzer_sys::fuzz_target!(|data: &[u8]| $crate::note($name, data, &COUNTERS));
    };
}

/// Plays an input of a target, and counts what it reaches.
///
/// # Panics
/// The input breaks a rule, or there is no such target.
pub fn note(name: &str, data: &[u8], counters: &[AtomicU8; FEATURES]) {
    let Some(target) = NOTING.iter().find(|target| target.name == name) else {
        panic!("no target {name}");
    };
    let mut count = |feature: Feature| {
        let counter = hash([feature.section, &feature.place, &feature.what]) % FEATURES;
        counters[counter].store(1, Ordering::Relaxed);
    };
    (target.body)(data, &mut Notebook::to(&mut count));
}

/// FNV-1a: short, and the same in every run.
fn hash(parts: [&str; 3]) -> usize {
    let bytes = parts.iter().flat_map(|part| part.bytes().chain([0]));
    bytes.fold(0x811C_9DC5_usize, |hash, byte| {
        (hash ^ usize::from(byte)).wrapping_mul(0x0100_0193) & 0xFFFF_FFFF
    })
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
