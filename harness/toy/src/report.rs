//! How the bus is shown: its table. Pictures and files for tools have defaults.

use crate::valve::Telegram;
use harness_bench::capture::Piece;
use harness_bench::capture::live::{LiveLine, LiveText};
use harness_bench::shown::{SegmentReport, TablePart};
use harness_sim::record::{LineFrame, Trace};

/// The table of valves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ValveReport;

impl SegmentReport for ValveReport {
    fn carries(&self) -> &'static str {
        "frames of valves"
    }

    fn rows(&self, trace: &Trace, part: &TablePart) -> String {
        let frames = trace.channels.iter().flat_map(|channel| channel.frames());
        let wanted = part.rows.clone().unwrap_or(0..usize::MAX);
        let shown = frames.skip(wanted.start).take(wanted.len());
        let rows = shown.take(part.at_most.unwrap_or(usize::MAX)).map(row);
        let head = "time  meaning\n".to_owned();
        std::iter::once(head).chain(rows).collect()
    }
}

/// Frames as lines of text, while they arrive.
#[derive(Debug)]
pub(crate) struct ValveText;

impl LiveText for ValveText {
    fn piece(&mut self, piece: &Piece) -> Vec<LiveLine> {
        match piece {
            Piece::Frame(frame) => vec![(frame.at.since_start().as_nanos(), meaning(frame))],
            _ => Vec::new(),
        }
    }
}

fn row(frame: &LineFrame) -> String {
    format!("{}  {}\n", frame.at, meaning(frame))
}

fn meaning(frame: &LineFrame) -> String {
    match Telegram::decode(&frame.frame) {
        Some(Telegram::Ask(valve)) => format!("where is valve {valve}?"),
        Some(Telegram::Move(valve, place)) => format!("valve {valve}: go to {place} %"),
        Some(Telegram::At(valve, place)) => format!("valve {valve} is at {place} %"),
        None => format!("foreign: {}", frame.frame),
    }
}
