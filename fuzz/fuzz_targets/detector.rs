#![no_main]
drivebench_fuzz::counters!(harness_sim::novobus::transitions::WITHOUT_TIME_OUT);
std::thread_local!(static DETECTOR: std::cell::RefCell<harness_sim::novobus::fuzz::Detector<Counters>> = std::cell::RefCell::default());
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Counters = DETECTOR.with_borrow_mut(|detector| detector.watched(data));
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    drivebench_fuzz::mutate(data, size, max_size, seed, 1)
});
