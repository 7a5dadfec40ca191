//! How the bus is shown: its table. Pictures and files for tools have defaults.

use super::valve::Said;
use crate::traffic::SegmentReport;
use harness_sim::record::{LineFrame, Trace};
use std::ops::Range;

/// The table of valves.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValveReport;

impl SegmentReport for ValveReport {
    fn carries(&self) -> &'static str {
        "frames of valves"
    }

    fn rows(&self, trace: &Trace, wanted: Option<Range<usize>>, at_most: Option<usize>) -> String {
        let frames = trace.channels.iter().flat_map(|channel| channel.frames());
        let wanted = wanted.unwrap_or(0..usize::MAX);
        let shown = frames.skip(wanted.start).take(wanted.len());
        let rows = shown.take(at_most.unwrap_or(usize::MAX)).map(row);
        let head = "time  meaning\n".to_owned();
        std::iter::once(head).chain(rows).collect()
    }
}

fn row(frame: &LineFrame) -> String {
    let meaning = match Said::decode(&frame.frame) {
        Some(Said::Ask(valve)) => format!("where is valve {valve}?"),
        Some(Said::Move(valve, place)) => format!("valve {valve}: go to {place} %"),
        Some(Said::At(valve, place)) => format!("valve {valve} is at {place} %"),
        None => format!("foreign: {}", frame.frame),
    };
    format!("{}  {meaning}\n", frame.at)
}
