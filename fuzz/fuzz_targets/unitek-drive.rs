#![no_main]
drivebench_fuzz::cell_counters!(harness_sim::unitek::fuzz::CELLS, harness_sim::unitek::fuzz::drive_counted);
