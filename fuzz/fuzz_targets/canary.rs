#![no_main]
// Must crash: a fuzzer that does not notice this notices nothing.
libfuzzer_sys::fuzz_target!(|data: &[u8]| assert!(!data.starts_with(b"A")));
