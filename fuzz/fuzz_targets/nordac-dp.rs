#![no_main]
drivebench_fuzz::noting!(nordac, "nordac-dp");
