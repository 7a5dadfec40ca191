#![no_main]
drivebench_fuzz::noting!(novobus, "master");
