#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| harness_sim::novobus::fuzz::links(data));
