#![no_main]
drivebench_fuzz::noting!("nordac-fdl");
