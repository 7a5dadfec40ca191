//! A trace as a capture for Wireshark: a packet a telegram, see `report/pcapng_telegrams.rs`.

use super::telegrams::{octet_time, octets, runs};
use crate::report::pcapng_telegrams;
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::io::Write;

/// Writes the capture.
///
/// # Errors
/// Those of `out`.
pub fn write(traces: &[Trace], out: impl Write) -> std::io::Result<()> {
    let runs: Vec<_> = traces.iter().flat_map(runs).collect();
    let telegrams: Vec<_> = runs
        .iter()
        .map(|run| (run.from, run.octets.as_slice()))
        .collect();
    let rate = traces.iter().find_map(rate);
    let bits = rate.map(|rate| u64::from(rate.bits_per_second()));
    pcapng_telegrams::write(&telegrams, bits, out)
}

/// The rate at which an octet takes as long as the shortest of a trace, give or take a hundredth.
#[must_use]
pub fn rate(trace: &Trace) -> Option<BusRate> {
    let octets = octets(trace);
    let shortest = octet_time(octets.iter().map(|(from, own)| (*from, own)))?.units();
    let fits = |rate: &BusRate| {
        let own: Span = rate.octet_time();
        shortest.abs_diff(own.units()) * 100 <= own.units()
    };
    BusRate::ALL.into_iter().find(fits)
}
