//! What may leave the program: decides byte by byte, below scenarios, driver and fuzzer.
//!
//! This is no safety function in the sense of a machine's safety: an emergency stop must be wired.
