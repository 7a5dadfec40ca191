#![no_main]
// Does nothing: what the fuzzer itself costs, to compare the others with.
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    std::hint::black_box(data);
});
