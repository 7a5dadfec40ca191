//! A sequence diagram of telegrams: time goes down, a line for the master and one for each slave, an arrow a telegram (EN 2).
//!
//! Exchanges that repeat the one before them are folded: the first has arrows of its own, and says how many came after it.

use super::words::Reader;
use harness_bench::capture::runs::{HeardTelegram, said};
use harness_bench::html::Html;
use harness_bench::report::html::sequence::{Arrow, SequenceWords};
use harness_bench::report::html::{self};
use harness_sim::record::Trace;
use std::collections::BTreeSet;

/// Room for what the telegrams mean.
const WORDS: usize = 900;

/// A telegram, what it means, and the later ones that are folded into it.
struct Fold {
    said: HeardTelegram,
    words: String,
    to: Option<u8>,
    more: usize,
}

/// Writes the picture; false where there is nothing to draw.
pub(crate) fn sequence(html: &mut Html, id: &str, title: &str, trace: &Trace) -> bool {
    let folded = folded(trace);
    let senders = folded.iter().filter_map(|row| row.said.from);
    let slaves: BTreeSet<u8> = senders.collect();
    let slaves: Vec<_> = slaves.into_iter().collect();
    let arrows = folded.iter().map(drawn);
    let words = SequenceWords {
        drive: "slave",
        carried: "telegrams",
        room: WORDS,
    };
    html::sequence::sequence(html, id, title, &slaves, arrows, words)
}

/// The arrows. A request and its reply are folded into those before them where both mean the same.
fn folded(trace: &Trace) -> Vec<Fold> {
    let mut reader = Reader::default();
    let mut arrows: Vec<Fold> = Vec::new();
    for said in said(trace) {
        let words = reader.read(&said);
        arrows.push(Fold {
            to: words.to,
            words: format!("{}  {}", words.service, words.meaning),
            said,
            more: 0,
        });
        let same =
            |one: &Fold, other: &Fold| one.said.from == other.said.from && one.words == other.words;
        if let [.., first, second, third, fourth] = &mut arrows[..]
            && same(first, third)
            && same(second, fourth)
        {
            first.more += third.more + 1;
            second.more += fourth.more + 1;
            arrows.truncate(arrows.len() - 2);
        }
    }
    arrows
}

fn drawn(folded: &Fold) -> Arrow {
    let mut words = folded.words.clone();
    if folded.more > 0 {
        words.push_str(&format!("  and {} more like it", folded.more));
    }
    Arrow {
        at: folded.said.at,
        from: folded.said.from,
        to: folded.to,
        good: folded.said.telegram().is_some(),
        words,
    }
}
