#![no_main]
drivebench_fuzz::cell_counters!(harness_sim::nordac::fuzz::CELLS, harness_sim::nordac::fuzz::slave_counted);
