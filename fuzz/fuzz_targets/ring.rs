#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| { let drivebench_fuzz::Counters = drivebench_fuzz::ring(data); });
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| { drivebench_fuzz::mutate(data, size, max_size, seed, 2) });
