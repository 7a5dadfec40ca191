//! A trace as a table: a row a telegram.

use super::words::{Reader, Words};
use crate::value::hex;
use harness_bench::capture::runs::{HeardTelegram, said};
use harness_sim::record::Trace;
use std::fmt::Write as _;
use std::ops::Range;

/// The table. Of a table longer than `at_most` the middle is left out.
#[must_use]
pub(crate) fn table(trace: &Trace, wanted: Option<Range<usize>>, at_most: Option<usize>) -> String {
    let mut reader = Reader::default();
    let rows = said(trace)
        .into_iter()
        .map(|telegram| line(&telegram, &reader.read(&telegram)));
    let rows: Vec<_> = rows.collect();
    let wanted = wanted.unwrap_or(0..rows.len());
    let rows = &rows[wanted.start.min(rows.len())..wanted.end.min(rows.len())];
    let shown = at_most.unwrap_or(usize::MAX).min(rows.len());
    let (head, tail) = (shown.div_ceil(2), shown / 2);
    let mut text = format!(
        "{:>14}  {:<9} {:<9} {:<14} meaning [bytes]\n",
        "time", "from", "to", "service"
    );
    rows[..head].iter().for_each(|row| text.push_str(row));
    if shown < rows.len() {
        let _infallible = writeln!(text, "{:>14}  {} more", "...", rows.len() - shown);
    }
    rows[rows.len() - tail..]
        .iter()
        .for_each(|row| text.push_str(row));
    text
}

/// The name of a station in a row.
pub(super) fn station(slave: Option<u8>) -> String {
    slave.map_or("master".to_owned(), |address| format!("slave {address}"))
}

fn line(said: &HeardTelegram, words: &Words) -> String {
    format!("{:>14}  {}\n", said.at.to_string(), row(said, words))
}

/// A row without its time.
pub(super) fn row(said: &HeardTelegram, words: &Words) -> String {
    let to = match (said.from, words.to) {
        (None, Some(127)) => "all".to_owned(),
        (None, Some(to)) => format!("slave {to}"),
        (Some(_), Some(to)) => to.to_string(),
        (_, None) => String::new(),
    };

    format!(
        "{:<9} {to:<9} {:<14} {}  [{}]",
        station(said.from),
        words.service,
        words.meaning,
        hex(&said.octets),
    )
}
