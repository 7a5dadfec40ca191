//! The space-time diagram of a ring: drives across, bytes down, a colour for what each sender was doing (ND21 9.7, 9.8).
//!
//! The picture works without scripts and is aligned by index, as the manual's tables are. The page also holds the meaning of every byte
//! as data. The script shows the meaning of a byte under the pointer or selected by keys, and can place the bytes at their times. Equal
//! neighbours are one rectangle, and all rectangles of a colour are one path.

use crate::report::html::Html;
use crate::report::pcapng::name;
use crate::report::svg::cells::{Area, Columns, areas};
use crate::report::svg::{MAX_AREAS, RowPlacing, class};
use crate::report::walk::SenderState;
use harness_proto::line::Rate;
use harness_sim::record::{Channel, LineByte, Trace};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

/// Where the columns begin.
const LEFT: usize = 64;
/// Where the rows begin.
const TOP: usize = 28;
/// How high a row is.
const ROW: usize = 14;
/// How wide all columns are together, if they are not narrower than [`NARROW`].
const WIDE: usize = 1_336;
const NARROW: usize = 5;
/// Bytes are written into columns as wide as this.
const LETTERS: usize = 22;
/// How many faults the description names.
const FAULTS: usize = 12;
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
    /// For each link pairs: how long after the byte before it a byte ends, and how many bytes follow without a gap.
    times: Vec<Vec<u64>>,
}

/// Writes the diagram of one ring. `id` names its parts; `differs` is the number of the first byte that the master received and that differs from
/// what was expected, counted from 1.
pub(crate) fn diagram(
    html: &mut Html,
    id: &str,
    title: &str,
    (ring, trace): (usize, &Trace),
    (rate, differs): (Rate, Option<usize>),
) {
    let columns = Columns::read(trace, None);
    let all = areas(&columns, RowPlacing::Index);
    let cut = columns.cut || all.len() > MAX_AREAS;
    let drawn = &all[..all.len().min(MAX_AREAS)];
    let column = (WIDE / trace.channels.len().max(1)).clamp(NARROW, 48);
    let rows = drawn.iter().map(|area| area.rows.end).max().unwrap_or(0);
    let differs = differs.and_then(|byte| received(trace, byte));
    let frame = Frame {
        column,
        rows,
        differs: differs.filter(|own| own[1] < rows),
    };
    let description = description(ring, trace, drawn, cut);
    html.element("div", &[("class", &"ring")], |html| {
        html.scroll(title, |html| {
            picture(html, id, title, &description, trace, drawn, &frame);
        });
        legend(html, drawn, frame.differs.is_some());
        damaged(html, ring, trace);
        if cut {
            html.line(
                "p",
                &[("class", &"note")],
                "The run goes on: only its beginning is drawn.",
            );
        }
        html.data(&data(ring, trace, drawn, &frame, rate));
    });
}

struct Frame {
    column: usize,
    rows: usize,
    /// The link and the row of the byte that differs.
    differs: Option<[usize; 2]>,
}

/// The link and the row of a byte that the master received, counted from 1; where it never came, of the last one that did.
fn received(trace: &Trace, byte: usize) -> Option<[usize; 2]> {
    let link = trace.channels.iter().position(|link| link.to.is_none())?;
    let octets = trace.channels[link].octets().iter().enumerate();
    let came = octets.filter(|(_, own)| own.received.is_some());
    let (row, _) = came.take(byte).last()?;
    Some([link, row])
}

/// Damaged bytes shown one by one at most.
const DAMAGED: usize = 20;

/// What arrived damaged, with what was sent.
fn damaged(html: &mut Html, ring: usize, trace: &Trace) {
    let bad = |own: &LineByte| own.sent != own.received || own.error.is_some();
    let of_link = |link: &'_ Channel| {
        let name = name(ring, link);
        let octets = link.octets().iter().zip(1..).filter(move |own| bad(own.0));
        let found = octets.map(move |(own, place)| (own.at, name.clone(), place, *own));
        found.collect::<Vec<_>>()
    };
    let mut all: Vec<_> = trace.channels.iter().flat_map(of_link).collect();
    if all.is_empty() {
        return;
    }
    all.sort_by_key(|own| own.0);
    html.element("table", &[], |html| {
        html.line(
            "caption",
            &[],
            "Damaged bytes: what was sent, and what arrived",
        );
        html.heads(&["Time", "Link", "Byte", "Sent", "Arrived"]);
        for (at, link, place, own) in all.iter().take(DAMAGED) {
            let hex =
                |byte: Option<u8>| byte.map_or("nothing".to_owned(), |own| format!("{own:02X}"));
            let error = own
                .error
                .map_or(String::new(), |error| format!(" ({error})"));
            html.element("tr", &[], |html| {
                html.line("td", &[("class", &"n")], at);
                html.line("td", &[("class", &"n")], link);
                html.line("td", &[("class", &"n")], place);
                html.line("td", &[("class", &"n")], hex(own.sent));
                html.line("td", &[("class", &"n bad")], hex(own.received) + &error);
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

impl Frame {
    fn place(&self, area: &Area) -> (usize, usize, usize, usize) {
        (
            LEFT + self.column * area.links.start,
            TOP + ROW * area.rows.start,
            self.column * area.links.len(),
            ROW * area.rows.len(),
        )
    }
}

fn picture(
    html: &mut Html,
    id: &str,
    title: &str,
    description: &str,
    trace: &Trace,
    areas: &[Area],
    frame: &Frame,
) {
    let width = (LEFT + frame.column * trace.channels.len() + 16).max(240);
    let height = TOP + ROW * frame.rows + 8;
    let title = format!("Space-time diagram: {title}");
    let id = format!("{id}-");
    html.picture(&id, (width, height), (&title, description), |html| {
        heads(html, trace, areas, frame);
        html.element("g", &[("class", &"by-index")], |html| {
            numbers(html, frame.rows);
            shapes(html, areas, frame);
            if frame.column >= LETTERS {
                letters(html, areas, frame);
            }
        });
    });
}

/// The senders above their columns; where there is not room for all, those at faults and at the byte that differs first.
fn heads(html: &mut Html, trace: &Trace, areas: &[Area], frame: &Frame) {
    let all = 0..trace.channels.len();
    let faults = areas.iter().filter(|area| area.fault);
    let matters = faults.map(|area| area.links.start);
    let matters = frame.differs.map(|own| own[0]).into_iter().chain(matters);
    // A fault on a link is of its sender or of the receiver, whose column is the next one.
    let matters = matters.flat_map(|place| [place, place + 1]);
    let ends = [0, all.end.saturating_sub(1)];
    // Neighbours that matter stand in two lines.
    let mut placed: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    let mut place_one = |place: usize, lines: &[usize]| {
        let x = LEFT + frame.column * place + frame.column / 2;
        let room = |own: usize| if own == 0 { 22 } else { 10 };
        let free = |y: &usize| {
            let apart = |(other, own): (&usize, &(usize, usize))| {
                own.1 != *y || own.0.abs_diff(x) >= room(*other) + room(place)
            };
            placed.iter().all(apart)
        };
        let line = lines.iter().find(|y| free(y)).copied();
        if let Some(y) = line.filter(|_| all.contains(&place) && !placed.contains_key(&place)) {
            placed.insert(place, (x, y));
        }
    };
    for place in matters.chain(ends) {
        place_one(place, &[TOP - 9, TOP - 19]);
    }
    for place in all.clone() {
        place_one(place, &[TOP - 9]);
    }
    for (place, (x, y)) in placed {
        let attributes: [(&str, &dyn std::fmt::Display); 3] =
            [("class", &"m"), ("x", &x), ("y", &y)];
        match trace.channels[place].from {
            Some(drive) => html.line("text", &attributes, drive),
            None => html.line("text", &attributes, "master"),
        }
    }
}

/// The rows at the left edge.
fn numbers(html: &mut Html, rows: usize) {
    let step = if rows > 1_000 { 10 } else { 5 };
    for row in (0..rows).step_by(step) {
        let y = TOP + ROW * row + 11;
        html.line(
            "text",
            &[("class", &"e"), ("x", &(LEFT - 8)), ("y", &y)],
            row + 1,
        );
    }
}

/// One path a colour, and one for the marks of faults.
fn shapes(html: &mut Html, areas: &[Area], frame: &Frame) {
    let mut paths: BTreeMap<char, String> = BTreeMap::new();
    for area in areas {
        let (x, y, width, height) = frame.place(area);
        let (width, height) = (width - 1, height - 1);
        let mut draw = |class: char| {
            let path = paths.entry(class).or_default();
            // Writing to a String cannot fail.
            let _infallible = write!(path, "M{x} {y}h{width}v{height}h-{width}z");
        };
        draw(class(area.state));
        if area.fault {
            // Behind all letters of the states.
            draw('x');
            let edge = LEFT - 6;
            let middle = y + ROW / 2;
            let path = paths.entry('y').or_default();
            let _infallible = write!(path, "M{edge} {}l5 4l-5 4z", middle - 4);
        }
    }
    for (class, path) in &paths {
        html.shape("path", &[("class", class), ("d", path)]);
    }
    if let Some([link, row]) = frame.differs {
        let (x, y) = (LEFT + frame.column * link, TOP + ROW * row);
        let around = format!(
            "M{} {}h{}v{ROW}h-{}z",
            x - 1,
            y - 1,
            frame.column,
            frame.column
        );
        html.shape("path", &[("class", &"w"), ("d", &around)]);
    }
}

/// A text a row, in which each letter has its place: much shorter than a text a byte.
fn letters(html: &mut Html, areas: &[Area], frame: &Frame) {
    let mut rows: BTreeMap<usize, (String, String)> = BTreeMap::new();
    for area in areas {
        let (x, y, width, _) = frame.place(area);
        let (places, letters) = rows.entry(y + 11).or_default();
        let middle = x + width / 2;
        // Writing to a String cannot fail.
        let _infallible = write!(places, "{} {} ", middle - 3, middle + 3);
        letters.push_str(&area.letters);
    }
    html.element("g", &[("class", &"m")], |html| {
        for (y, (places, letters)) in &rows {
            html.line("text", &[("y", y), ("x", &places.trim_end())], letters);
        }
    });
}

/// The colours in words, of the states that occur.
fn legend(html: &mut Html, areas: &[Area], differs: bool) {
    html.element(
        "ul",
        &[
            ("class", &"legend"),
            ("aria-label", &"Colours of the diagram"),
        ],
        |html| {
            for state in SenderState::ALL {
                if areas.iter().any(|area| area.state == state) {
                    html.element("li", &[], |html| {
                        html.line(
                            "i",
                            &[("class", &class(state)), ("aria-hidden", &"true")],
                            "",
                        );
                        html.text(state.name());
                    });
                }
            }
            let faults = areas.iter().any(|area| area.fault);
            let mark = |html: &mut Html, class: &str, text: &str| {
                html.element("li", &[], |html| {
                    html.line("i", &[("class", &class), ("aria-hidden", &"true")], "");
                    html.text(text);
                });
            };
            if faults {
                mark(
                    html,
                    "x",
                    "fault: damaged on the line, or the drive that detected it",
                );
                mark(html, "y", "a row with a fault");
            }
            if differs {
                mark(
                    html,
                    "w",
                    "the first byte that differs from what was expected",
                );
            }
        },
    );
}

/// What the picture shows, in words: of every fault the place.
fn description(ring: usize, trace: &Trace, areas: &[Area], cut: bool) -> String {
    let bytes = trace
        .channels
        .iter()
        .map(|l| l.octets().len())
        .max()
        .unwrap_or(0);
    let mut text = format!(
        "The links of a ring of {} drives across, headed by their senders; downwards {bytes} bytes, row n the n-th byte of each link.",
        trace.stations
    );
    let faults = areas.iter().filter(|area| area.fault);
    for area in faults.clone().take(FAULTS) {
        let words = if area.remark.is_empty() {
            &area.status
        } else {
            &area.remark
        };
        let link = name(ring, &trace.channels[area.links.start]);
        let _infallible = write!(
            text,
            " Fault: {link} byte {}: {words}.",
            area.rows.start + 1
        );
    }
    let more = faults.count().saturating_sub(FAULTS);
    if more > 0 {
        let _infallible = write!(text, " And {more} more.");
    }
    if cut {
        text.push_str(" Only the beginning is drawn.");
    }
    text
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

fn data(ring: usize, trace: &Trace, areas: &[Area], frame: &Frame, rate: Rate) -> Data {
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
        let ends = link.octets().iter().take(frame.rows);
        times(ends.map(|byte| byte.at.since_start().units()), byte)
    });
    Data {
        left: LEFT,
        top: TOP,
        column: frame.column,
        row: ROW,
        first: 0,
        rows: frame.rows,
        byte,
        links: trace.channels.iter().map(|link| name(ring, link)).collect(),
        differs: frame.differs,
        texts: texts.all,
        areas: flat,
        times: times.collect(),
    }
}

/// Times as runs of bytes without a gap: how long behind the byte before the first one ends, and how many they are.
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
