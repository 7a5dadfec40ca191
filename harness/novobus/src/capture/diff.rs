//! Two runs side by side: the first byte that differs, and how much does.

use crate::report::csv::status;
use crate::report::meaning::Meaning;
use crate::report::walk::LinkReader;
use harness_bench::capture::Capture;
use harness_bench::counted::counted;
use harness_bench::report::pcapng::name;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use std::fmt;

/// Bytes in front of and behind the first difference that are shown.
const AROUND: usize = 4;

/// One side of a comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComparedRun<'r> {
    /// What it is called.
    pub name: &'r str,
    /// What was captured.
    pub capture: &'r Capture,
}

/// The first difference on one link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LinkDifference {
    /// The link, as in a scenario.
    pub link: String,
    /// Which byte of it, counted from 1.
    pub byte: usize,
    /// When, on the side that was earlier.
    pub at: Instant,
    /// What one has there, and the other.
    pub sides: [Option<LineByte>; 2],
    /// What the byte is on each side, in words, with the section.
    pub words: [String; 2],
    /// Only their times are apart.
    pub only_time: bool,
    /// The bytes around it: the number of each, and the byte of either side.
    pub around: Vec<(usize, Option<LineByte>, Option<LineByte>)>,
}

/// The result of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Summary {
    /// The first difference in time.
    pub first: Option<LinkDifference>,
    /// How many links both have.
    pub links: usize,
    /// Links that one side alone has.
    pub alone: Vec<String>,
    /// How many bytes were compared.
    pub compared: usize,
    /// How many of them differ, apart from their times.
    pub differ: usize,
    /// Links with a difference.
    pub differing_links: usize,
    /// The largest difference of times between equal bytes.
    pub latest: Span,
}

impl Summary {
    /// Whether nothing differs.
    #[must_use]
    pub(crate) fn same(&self) -> bool {
        self.first.is_none() && self.alone.is_empty()
    }
}

/// Compares two runs: bytes, line status, and times as far as `tolerance`.
#[must_use]
pub(crate) fn diff(left: ComparedRun<'_>, right: ComparedRun<'_>, tolerance: Span) -> Summary {
    compare(left, right, tolerance, &|_, _, _| false, None)
}

/// The same; `ignored` says of ring, link and byte what is not compared, and bytes behind `until` that one side alone has are none too
/// many.
pub(crate) fn compare(
    left: ComparedRun<'_>,
    right: ComparedRun<'_>,
    tolerance: Span,
    ignored: &dyn Fn(usize, &Channel, usize) -> bool,
    until: Option<Instant>,
) -> Summary {
    let mut summary = Summary::default();
    let none = Trace::default();
    let rings = left.capture.traces.len().max(right.capture.traces.len());
    for ring in 0..rings {
        let a = left.capture.traces.get(ring).unwrap_or(&none);
        let b = right.capture.traces.get(ring).unwrap_or(&none);
        let find = |trace: &Trace, link: &Channel| {
            let same = |other: &Channel| (other.from, other.to) == (link.from, link.to);
            trace.channels.iter().position(same)
        };
        for (at, link) in a.channels.iter().enumerate() {
            let Some(other) = find(b, link) else {
                summary
                    .alone
                    .push(format!("{} ({})", name(ring, link), left.name));
                continue;
            };
            let pair = Pair {
                ring,
                a: (a, at),
                b: (b, other),
                tolerance,
                until,
            };
            pair.compare(&mut summary, ignored);
        }
        for link in b.channels.iter().filter(|link| find(a, link).is_none()) {
            summary
                .alone
                .push(format!("{} ({})", name(ring, link), right.name));
        }
    }
    summary
}

/// A link on both sides.
struct Pair<'t> {
    ring: usize,
    a: (&'t Trace, usize),
    b: (&'t Trace, usize),
    tolerance: Span,
    until: Option<Instant>,
}

impl Pair<'_> {
    fn compare(&self, summary: &mut Summary, ignored: &dyn Fn(usize, &Channel, usize) -> bool) {
        summary.links += 1;
        let (a, b) = (&self.a.0.channels[self.a.1], &self.b.0.channels[self.b.1]);
        let mut first: Option<(usize, bool)> = None;
        let mut differ = 0;
        for index in 0..a.octets().len().max(b.octets().len()) {
            let (left, right) = (a.octets().get(index), b.octets().get(index));
            let late = |byte: &LineByte| self.until.is_some_and(|until| byte.at > until);
            if let (Some(alone), None) | (None, Some(alone)) = (left, right)
                && late(alone)
            {
                break;
            }
            summary.compared += 1;
            if ignored(self.ring, a, index) {
                continue;
            }
            let what = |byte: &LineByte| (byte.sent, byte.received, byte.error);
            if left.map(what) != right.map(what) {
                differ += 1;
                if first.is_none_or(|(_, only_time)| only_time) {
                    first = Some((index, false));
                }
            } else if let (Some(left), Some(right)) = (left, right) {
                let apart = left.at.since(right.at).max(right.at.since(left.at));
                summary.latest = summary.latest.max(apart);
                if apart > self.tolerance && first.is_none() {
                    first = Some((index, true));
                }
            }
        }
        summary.differ += differ;
        let Some((index, only_time)) = first else {
            return;
        };
        summary.differing_links += 1;
        let at = |byte: Option<&LineByte>| byte.map_or(Instant::NEVER, |byte| byte.at);
        let at = at(a.octets().get(index)).min(at(b.octets().get(index)));
        // A byte that differs weighs more than one that is late.
        let earlier = summary
            .first
            .as_ref()
            .is_none_or(|known| (only_time, at) < (known.only_time, known.at));
        if earlier {
            summary.first = Some(self.difference(index, at, only_time));
        }
    }

    fn difference(&self, index: usize, at: Instant, only_time: bool) -> LinkDifference {
        let (a, b) = (&self.a.0.channels[self.a.1], &self.b.0.channels[self.b.1]);
        let end = a
            .octets()
            .len()
            .max(b.octets().len())
            .min(index + AROUND + 1);
        let around = (index.saturating_sub(AROUND)..end).map(|n| {
            (
                n + 1,
                a.octets().get(n).copied(),
                b.octets().get(n).copied(),
            )
        });
        LinkDifference {
            link: name(self.ring, a),
            byte: index + 1,
            at,
            sides: [
                a.octets().get(index).copied(),
                b.octets().get(index).copied(),
            ],
            words: [words(self.a, index), words(self.b, index)],
            only_time,
            around: around.collect(),
        }
    }
}

/// What a byte is, in words, with the section of its rule.
fn words((trace, place): (&Trace, usize), index: usize) -> String {
    let link = &trace.channels[place];
    let mut readers = LinkReader::all(trace);
    let mut last: Option<(Meaning, Option<u8>)> = None;
    for byte in link.octets().iter().take(index + 1) {
        last = Some((readers[place].see(byte).meaning, byte.received));
    }
    match last.filter(|_| index < link.octets().len()) {
        Some((meaning, byte)) => format!("{}; {}", meaning.words(byte), meaning.citation()),
        None => "nothing".to_owned(),
    }
}

/// A byte as it is shown beside another.
fn shown(byte: Option<&LineByte>) -> String {
    let Some(byte) = byte else {
        return "-".to_owned();
    };
    let hex = |byte: Option<u8>| byte.map_or("--".to_owned(), |byte| format!("{byte:02X}"));
    let mut text = hex(byte.received);
    if byte.error.is_some() {
        text = format!("{text} {}", status(byte));
    }
    if byte.sent != byte.received {
        text = format!("{text} (sent {})", hex(byte.sent));
    }
    text
}

impl Summary {
    /// The comparison for people, the sides by their names.
    #[must_use]
    pub(crate) fn show<'s>(&'s self, left: &'s str, right: &'s str) -> impl fmt::Display + 's {
        Show {
            summary: self,
            names: [left, right],
        }
    }
}

struct Show<'s> {
    summary: &'s Summary,
    names: [&'s str; 2],
}

impl fmt::Display for Show<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = self.summary;
        if let Some(first) = &summary.first {
            let what = if first.only_time {
                "time"
            } else {
                "difference"
            };
            writeln!(
                f,
                "first {what}: link {}, byte {}, at {}",
                first.link, first.byte, first.at
            )?;
            for (name, (words, side)) in self.names.iter().zip(first.words.iter().zip(&first.sides))
            {
                let at = side.map_or_else(String::new, |byte| format!(" at {}", byte.at));
                writeln!(f, "  {name}: {}{at} ({words})", shown(side.as_ref()))?;
            }
            writeln!(
                f,
                "\n{:>8}  {:20}  {}",
                "byte", self.names[0], self.names[1]
            )?;
            for (number, left, right) in &first.around {
                let pointer = if *number == first.byte { '>' } else { ' ' };
                let (left, right) = (shown(left.as_ref()), shown(right.as_ref()));
                writeln!(f, "{pointer}{number:>7}  {left:20}  {right}")?;
            }
            writeln!(f)?;
        }
        for alone in &summary.alone {
            writeln!(f, "on one side only: link {alone}")?;
        }
        let (differ, compared, links) = (summary.differ, summary.compared, summary.links);
        let other = summary.differing_links;
        writeln!(
            f,
            "{differ} of {} differ, on {other} of {}; times of equal bytes differ by up to {} ns",
            counted(compared, "byte"),
            counted(links, "link"),
            summary.latest.as_nanos()
        )
    }
}
