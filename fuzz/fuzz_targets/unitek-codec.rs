#![no_main]
drivebench_fuzz::noting!(unitek, "unitek-codec");
