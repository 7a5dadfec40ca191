#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| harness::buses::novobus::capture::fuzz::import(data));
