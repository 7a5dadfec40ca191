//! Telegrams as lines of text while they arrive: the rows of the table.

use super::table::row;
use super::words::Reader;
use harness_bench::capture::Piece;
use harness_bench::capture::live::{LiveLine, LiveText};
use harness_bench::capture::runs::TelegramRun;

/// Text of the telegrams of one line.
#[derive(Debug, Default)]
pub(crate) struct TelegramText {
    reader: Reader,
}

impl LiveText for TelegramText {
    fn piece(&mut self, piece: &Piece) -> Vec<LiveLine> {
        let Piece::Telegram(from, octets) = piece else {
            return Vec::new();
        };
        let run = TelegramRun {
            from: *from,
            octets: octets.clone(),
        };
        let said = run.said().into_iter();
        let lines = said.map(|telegram| {
            let words = self.reader.read(&telegram);
            (telegram.at.since_start().as_nanos(), row(&telegram, &words))
        });
        lines.collect()
    }
}
