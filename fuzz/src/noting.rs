//! Targets that tell libFuzzer what their cases reach, by the names of `harness_sim::fuzz::Feature`.

use harness_sim::fuzz::{Feature, Notebook, Noting};
use std::sync::atomic::{AtomicU8, Ordering};

/// How many counters there are for features; two features with one counter are no harm.
pub const FEATURES: usize = 8_192;

/// The target of this name of a bus. The counters stand in the target's own crate, so that others have none.
#[macro_export]
macro_rules! noting {
    ($bus:ident, $name:literal) => {
        // Unsafe, since a section of a wrong form would harm the program; this one is an array of bytes, as libFuzzer documents it.
        #[used]
        #[unsafe(link_section = "__libfuzzer_extra_counters")]
        static COUNTERS: [std::sync::atomic::AtomicU8; $crate::FEATURES] =
            [const { std::sync::atomic::AtomicU8::new(0) }; $crate::FEATURES];
        libfuzzer_sys::fuzz_target!(|data: &[u8]| $crate::note(
            &harness_sim::$bus::fuzz::NOTING,
            $name,
            data,
            &COUNTERS
        ));
    };
}

/// Plays an input of one of these targets, and counts what it reaches.
///
/// # Panics
/// The input breaks a rule, or there is no such target.
pub fn note(targets: &[Noting], name: &str, data: &[u8], counters: &[AtomicU8; FEATURES]) {
    let Some(target) = targets.iter().find(|target| target.name == name) else {
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
