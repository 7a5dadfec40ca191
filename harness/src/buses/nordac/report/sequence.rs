//! A sequence diagram of telegrams: time goes down, a line for the master and one for each slave, an arrow a telegram (EN 2).
//!
//! Exchanges that repeat the one before them are folded: the first has arrows of its own, and says how many came after it.

use super::table::station;
use super::telegrams::{Said, said};
use super::words::Reader;
use crate::report::html::Html;
use harness_sim::record::Trace;
use std::collections::BTreeSet;

/// Arrows drawn at most.
const DRAWN: usize = 300;

const COLUMN: usize = 110;
const ROW: usize = 22;
const TOP: usize = 34;
/// Room for what the telegrams mean.
const WORDS: usize = 900;

/// A telegram, what it means, and the later ones that are folded into it.
struct Arrow {
    said: Said,
    words: String,
    to: Option<u8>,
    more: usize,
}

/// Writes the picture; false where there is nothing to draw.
pub(crate) fn sequence(html: &mut Html, id: &str, title: &str, trace: &Trace) -> bool {
    let arrows = folded(trace);
    if arrows.is_empty() {
        return false;
    }
    let senders = arrows.iter().filter_map(|own| own.said.from);
    let slaves: BTreeSet<u8> = senders.collect();
    let slaves: Vec<_> = slaves.into_iter().collect();
    let drawn = &arrows[..arrows.len().min(DRAWN)];
    let width = (slaves.len() + 2) * COLUMN + WORDS;
    let height = TOP + (drawn.len() + 1) * ROW;
    let description = format!(
        "{} arrows between the master and {}, one below the other. The table of telegrams says the same.",
        drawn.len(),
        crate::counted::counted(slaves.len() as u64, "slave"),
    );
    html.scroll(title, |html| {
        html.picture(
            &format!("{id}-s"),
            (width, height),
            (&title, &description),
            |html| {
                lifelines(html, &slaves, height);
                for (row, arrow) in drawn.iter().enumerate() {
                    draw(html, arrow, TOP + (row + 1) * ROW, &slaves);
                }
            },
        );
    });
    if drawn.len() < arrows.len() {
        let more = arrows.len() - drawn.len();
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{more} more are not drawn."),
        );
    }
    true
}

/// The arrows. A request and its reply are folded into those before them where both mean the same.
fn folded(trace: &Trace) -> Vec<Arrow> {
    let mut reader = Reader::default();
    let mut arrows: Vec<Arrow> = Vec::new();
    for said in said(trace) {
        let words = reader.read(&said);
        arrows.push(Arrow {
            to: words.to,
            words: format!("{}  {}", words.service, words.meaning),
            said,
            more: 0,
        });
        let same = |one: &Arrow, other: &Arrow| {
            one.said.from == other.said.from && one.words == other.words
        };
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

/// Where the line of a station stands; that of the master is in front of the slaves'.
fn place(slaves: &[u8], slave: Option<u8>) -> usize {
    let place = slave.and_then(|slave| slaves.iter().position(|own| *own == slave));
    COLUMN * place.map_or(1, |place| place + 2)
}

fn lifelines(html: &mut Html, slaves: &[u8], height: usize) {
    let all = std::iter::once(None).chain(slaves.iter().copied().map(Some));
    for slave in all {
        let x = place(slaves, slave);
        html.line(
            "text",
            &[("class", &"m"), ("x", &x), ("y", &(TOP - 12))],
            station(slave),
        );
        let line = format!("M{x} {}V{height}", TOP - 4);
        html.shape("path", &[("class", &"zero"), ("d", &line)]);
    }
}

fn draw(html: &mut Html, arrow: &Arrow, y: usize, slaves: &[u8]) {
    let last = COLUMN * (slaves.len() + 1);
    let start = place(slaves, arrow.said.from);
    let end = match (arrow.said.from, arrow.to) {
        (Some(_), _) => COLUMN,
        (None, Some(slave)) if slaves.contains(&slave) => place(slaves, Some(slave)),
        (None, _) => last,
    };
    let back = if end < start { 7 } else { -7 };
    let good = arrow.said.telegram().is_some();
    let head = if good {
        format!("M{end} {y}l{back} -4v8z")
    } else {
        String::new()
    };
    let class = if good { "arrow" } else { "x" };
    let line = format!("M{start} {y}H{end}{head}");
    html.shape("path", &[("class", &class), ("d", &line)]);
    let text = |html: &mut Html, class: &str, x: usize, text: &str| {
        html.line(
            "text",
            &[("class", &class), ("x", &x), ("y", &(y + 4))],
            text,
        );
    };
    text(html, "e", COLUMN - 14, &arrow.said.at.to_string());
    let mut words = arrow.words.clone();
    if arrow.more > 0 {
        words.push_str(&format!("  and {} more like it", arrow.more));
    }
    text(html, "s", last + 14, &words);
}
