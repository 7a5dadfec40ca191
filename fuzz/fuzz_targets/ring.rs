#![no_main]
drivebench_fuzz::counters!(harness_sim::novobus::transitions::REACHABLE);
std::thread_local!(static DRIVES: std::cell::RefCell<harness_sim::novobus::fuzz::ThreeDrives<Counters>> = std::cell::RefCell::default());
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Counters = DRIVES.with_borrow_mut(|drives| drives.watched(data));
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    drivebench_fuzz::mutate(data, size, max_size, seed, 2)
});
