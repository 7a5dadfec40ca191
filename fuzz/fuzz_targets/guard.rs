#![no_main]
drivebench_fuzz::noting!("guard");
