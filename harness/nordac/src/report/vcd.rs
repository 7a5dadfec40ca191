//! Traces as a value change dump: for each station a wire with what this station sends, 8E1. The time scale is 10 ns: a bit at 1.5 Mbit/s is
//! 66.7 of them.

use harness_bench::capture::runs::bits_per_second;
use harness_bench::report::vcd::{self, Drawing, DrawnLine, Signals};
use harness_sim::record::Trace;
use std::io::{Error, Write};

pub(crate) fn write(traces: &[Trace], signals: Signals, out: &mut dyn Write) -> Result<(), Error> {
    let drawing = Drawing {
        bit: 3_000_000_000 / u64::from(bits_per_second(traces).max(1)),
        tick: 30,
        scale: "10 ns",
        odd: false,
        signals,
    };
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let wires = channels.enumerate().map(|(place, channel)| DrawnLine {
        name: channel
            .from
            .map_or("master".to_owned(), |slave| format!("drive_{slave}")),
        place,
        channel,
        states: None,
    });
    vcd::write(wires, drawing, out)
}
