//! The space-time diagram of a ring: drives across, bytes down, a colour for what each sender was doing (ND21 9.7, 9.8).
//!
//! The picture works without scripts and is aligned by index, as the manual's tables are. The page also holds the meaning of every byte
//! as data. The script shows the meaning of a byte under the pointer or selected by keys, and can place the bytes at their times.

use super::cells::Area;
use super::picture::{LEFT, MAX_AREAS, ROW, RingPicture, TOP};
use super::walk::SenderState;
use harness_bench::html::Html;
use harness_bench::report::pcapng::name;
use harness_bench::shown::{RowPlacing, TraceView};
use harness_proto::line::Rate;
use harness_sim::record::{Channel, LineByte, Trace};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;

/// How far a byte may be from where the byte before it puts it, in thirds of a nanosecond: what times in nanoseconds lose.
const EXACT: u64 = 6;

/// The data for the script. Lists are flat, because a line of numbers is short and fast to read.
#[derive(Serialize)]
struct Data {
    left: usize,
    top: usize,
    column: usize,
    row: usize,
    /// The number of the first row, counted from 0.
    first: usize,
    rows: usize,
    /// How long a byte takes, in thirds of a nanosecond, as all times.
    byte: u64,
    links: Vec<String>,
    /// The first byte that differs from what a scenario expects: its link and its row.
    differs: Option<[usize; 2]>,
    /// Words that areas point into.
    texts: Vec<String>,
    /// Eight numbers an area: the first link and how many; the first row and how many; the state, and behind it as
    /// texts what the line carried, what it means by which rule, and what the drive remarked; a fault is -1 - state.
    areas: Vec<i64>,
    /// For each link, pairs: the time from the end of one byte to the end of the next, and how many bytes follow without a gap.
    times: Vec<Vec<u64>>,
}

/// Writes the diagram of one ring.
pub(crate) fn diagram(html: &mut Html, view: &TraceView<'_>, title: &str) {
    let (ring, trace, rate) = (view.ring, view.trace, view.rate);
    let mut picture = RingPicture::new(ring, trace, RowPlacing::Index, rate, None, MAX_AREAS);
    if let Some([link, row]) = view.differs.and_then(|byte| received(trace, byte)) {
        picture.mark(link, row);
    }
    html.element("div", &[("class", &"ring")], |html| {
        html.scroll(title, |html| {
            let title = format!("Space-time diagram: {title}");
            let (id, words) = (format!("{}-", view.id), picture.description());
            html.picture(&id, picture.size(), &title, &words, |html| {
                picture.draw(html);
            });
        });
        legend(html, &picture);
        damaged(html, ring, trace);
        if picture.cut {
            html.line(
                "p",
                &[("class", &"note")],
                "The run goes on: only its beginning is drawn.",
            );
        }
        html.data(&data(ring, trace, &picture, rate));
    });
}

/// The link and the row of a byte that the master received, counted from 1; where it never came, of the last one that did.
fn received(trace: &Trace, byte: usize) -> Option<[usize; 2]> {
    let link = trace.channels.iter().position(|link| link.to.is_none())?;
    let octets = trace.channels[link].octets().iter().enumerate();
    let came = octets.filter(|(_, byte)| byte.received.is_some());
    let (row, _) = came.take(byte).last()?;
    Some([link, row])
}

/// Damaged bytes shown one by one at most.
const DAMAGED: usize = 20;

/// What arrived damaged, with what was sent.
fn damaged(html: &mut Html, ring: usize, trace: &Trace) {
    let bad = |byte: &LineByte| byte.sent != byte.received || byte.error.is_some();
    let of_link = |link: &'_ Channel| {
        let name = name(ring, link);
        let bytes = link.octets().iter().zip(1..).filter(move |at| bad(at.0));
        let found = bytes.map(move |(byte, place)| (byte.at, name.clone(), place, *byte));
        found.collect::<Vec<_>>()
    };
    let mut all: Vec<_> = trace.channels.iter().flat_map(of_link).collect();
    if all.is_empty() {
        return;
    }
    all.sort_by_key(|row| row.0);
    html.element("table", &[], |html| {
        html.line(
            "caption",
            &[],
            "Damaged bytes: what was sent, and what arrived",
        );
        html.heads(&["Time", "Link", "Byte", "Sent", "Arrived"]);
        for (at, link, place, byte) in all.iter().take(DAMAGED) {
            let hex =
                |byte: Option<u8>| byte.map_or("nothing".to_owned(), |byte| format!("{byte:02X}"));
            let error = byte
                .error
                .map_or(String::new(), |error| format!(" ({error})"));
            html.element("tr", &[], |html| {
                html.line("td", &[("class", &"n")], at);
                html.line("td", &[("class", &"n")], link);
                html.line("td", &[("class", &"n")], place);
                html.line("td", &[("class", &"n")], hex(byte.sent));
                html.line("td", &[("class", &"n bad")], hex(byte.received) + &error);
            });
        }
    });
    if all.len() > DAMAGED {
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{} more are not shown.", all.len() - DAMAGED),
        );
    }
}

/// The colours in words, of the states that occur.
fn legend(html: &mut Html, picture: &RingPicture<'_>) {
    html.element(
        "ul",
        &[
            ("class", &"legend"),
            ("aria-label", &"Colours of the diagram"),
        ],
        |html| {
            for (class, meaning) in picture.legend() {
                html.element("li", &[], |html| {
                    html.line("i", &[("class", &class), ("aria-hidden", &"true")], "");
                    html.text(meaning);
                });
            }
        },
    );
}

/// Words that occur again and again, each once.
#[derive(Default)]
struct Texts {
    all: Vec<String>,
    known: BTreeMap<String, i64>,
}

impl Texts {
    fn number(&mut self, text: String) -> i64 {
        if let Some(number) = self.known.get(&text) {
            return *number;
        }
        let number = i64::try_from(self.all.len()).unwrap_or(i64::MAX);
        self.all.push(text.clone());
        self.known.insert(text, number);
        number
    }
}

fn data(ring: usize, trace: &Trace, picture: &RingPicture<'_>, rate: Rate) -> Data {
    let areas: &[Area] = &picture.areas;
    let mut texts = Texts::default();
    let number = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    let range = |range: &Range<usize>| [number(range.start), number(range.len())];
    let mut flat = Vec::with_capacity(areas.len() * 8);
    for area in areas {
        let states = SenderState::ALL.iter();
        let state = states.take_while(|state| **state != area.state).count();
        let state = if area.fault {
            -1 - number(state)
        } else {
            number(state)
        };
        flat.extend(range(&area.links));
        flat.extend(range(&area.rows));
        flat.push(state);
        flat.push(texts.number(area.status.clone()));
        flat.push(texts.number(format!("{} (ND21 {})", area.words, area.section)));
        flat.push(texts.number(area.remark.clone()));
    }
    let byte = rate.byte_time().units();
    let times = trace.channels.iter().map(|link| {
        let ends = link.octets().iter().take(picture.rows.end);
        times(ends.map(|byte| byte.at.since_start().units()), byte)
    });
    Data {
        left: LEFT,
        top: TOP,
        column: picture.column,
        row: ROW,
        first: 0,
        rows: picture.rows.end,
        byte,
        links: trace.channels.iter().map(|link| name(ring, link)).collect(),
        differs: picture.differs,
        texts: texts.all,
        areas: flat,
        times: times.collect(),
    }
}

/// Times as runs of bytes without a gap: how long after the byte before the first one ends, and how many they are.
fn times(ends: impl Iterator<Item = u64>, byte: u64) -> Vec<u64> {
    let mut runs: Vec<u64> = Vec::new();
    let (mut shown, mut due) = (0, None);
    for at in ends {
        match (due, runs.last_mut()) {
            (Some(due), Some(count)) if at.abs_diff(due) <= EXACT => {
                *count += 1;
                shown = due;
            }
            _ => {
                runs.extend([at.saturating_sub(shown), 1]);
                shown = at.max(shown);
            }
        }
        due = Some(shown + byte);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::times;

    #[test]
    fn bytes_without_a_gap_are_one_run() {
        let runs = |ends: &[u64]| times(ends.iter().copied(), 100);
        assert!(runs(&[]).is_empty());
        assert_eq!(runs(&[250, 350, 450, 900, 1003]), [250, 3, 450, 2]);
        // Out of order: it cannot be shown, and breaks nothing.
        assert_eq!(runs(&[250, 100, 350]), [250, 1, 0, 2]);
    }
}
