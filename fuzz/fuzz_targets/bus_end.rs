#![no_main]
drivebench_fuzz::counters!(harness_sim::transitions::REACHABLE);
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Counters = harness_sim::fuzz::bus_end_watched(data);
});
