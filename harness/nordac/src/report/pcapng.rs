//! A trace as a capture for Wireshark: a packet a telegram, see `report/pcapng_telegrams.rs`.

use harness_bench::capture::runs::{rate, runs};
use harness_bench::report::pcapng_telegrams;
use harness_sim::record::Trace;
use std::io::Write;

/// Writes the capture.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn write(traces: &[Trace], out: impl Write) -> std::io::Result<()> {
    let runs: Vec<_> = traces.iter().flat_map(runs).collect();
    let telegrams: Vec<_> = runs
        .iter()
        .map(|run| (run.from, run.octets.as_slice()))
        .collect();
    let rate = traces.iter().find_map(rate);
    let bits = rate.map(|rate| u64::from(rate.bits_per_second()));
    pcapng_telegrams::write(&telegrams, bits, out)
}
