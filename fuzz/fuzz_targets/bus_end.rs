#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| { let drivebench_fuzz::Counters = harness_sim::fuzz::bus_end_watched(data); });
