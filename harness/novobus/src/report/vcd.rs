//! A trace as a value change dump: a wire for each link, 8O1. The time scale is 100 ns: a bit at 38400 bit/s is 260.4 of them.
//!
//! | `state` | |
//! |---|---|
//! | 0 | SYNCO or PAUSE |
//! | 1 | forwarding a telegram |
//! | 2 | addressed: the drive's answer |
//! | 3 | zero of the error mode |
//! | 4 | received + 1 |
//! | 5 | check sequence |
//! | 6 | lost, or no telegram |

use crate::report::walk::{LinkReader, SenderState};
use harness_bench::report::pcapng::name;
use harness_bench::report::vcd::{self, Drawing, DrawnLine, Signals};
use harness_proto::line::Rate;
use harness_sim::record::Trace;
use std::io::Write;

/// Writes one or two rings of a run.
///
/// # Errors
/// What the writer says.
pub(crate) fn write(
    traces: &[Trace],
    rate: Rate,
    signals: Signals,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let drawing = Drawing {
        bit: rate.bit_time().units(),
        tick: 300,
        scale: "100 ns",
        odd: true,
        signals,
    };
    let mut wires = Vec::new();
    for (ring, trace) in traces.iter().enumerate() {
        for (link, mut reader) in trace.channels.iter().zip(LinkReader::all(trace)) {
            // `98->97` as a word that every program takes for a name.
            let name = name(ring, link)
                .replace("->", "_to_")
                .replace("2:", "ring2_");
            wires.push(DrawnLine {
                name,
                place: ring * 256 + link.from.map_or(250, usize::from),
                channel: link,
                states: Some(Box::new(move |byte| number(reader.see(byte).state))),
            });
        }
    }
    vcd::write(wires, drawing, out)
}

fn number(state: SenderState) -> u8 {
    let place = SenderState::ALL.iter().position(|known| *known == state);
    place
        .and_then(|place| u8::try_from(place).ok())
        .unwrap_or(7)
}
