#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| drivebench_fuzz::count(&harness_sim::fuzz::bus_end_watched(data)));
