#![no_main]
drivebench_fuzz::counters!(harness_sim::novobus::transitions::REACHABLE);
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Counters = harness_sim::novobus::fuzz::bus_end_watched(data);
});
