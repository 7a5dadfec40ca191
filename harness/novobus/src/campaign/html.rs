//! The maps of a campaign: where in the ring which class happens, by letters and colours.

use crate::campaign::PlayedCampaign;
use crate::campaign::class::CaseClass;
use crate::campaign::fault::{FaultEffect, LineBit};
use harness_bench::html::Html;
use harness_bench::link::link_name;
use std::collections::BTreeMap;

/// Maximum number of cells of a map; a larger map shows several bytes in one row.
const CELLS: usize = 12_000;

/// Maximum number of rows of the table by link: the manual's largest ring has 251 links.
const LINKS: usize = 251;

/// How many cases there are of each class.
type Counts = BTreeMap<CaseClass, u64>;

/// The maps of a page, each with its heading.
pub(super) fn maps(finished: &PlayedCampaign) -> Vec<(String, Html)> {
    let by_byte = ("Where: links across, bytes down", by_byte(finished));
    let by_bit = by_bit(finished).map(|html| ("Which bit: links across, bits down", html));
    let all = std::iter::once(by_byte).chain(by_bit);
    let all = all.chain([("By link", by_link(finished))]);
    all.map(|(heading, html)| (heading.to_owned(), html))
        .collect()
}

/// A map: a table with the most serious class in each cell. Colours only repeat the letters.
fn map(
    html: &mut Html,
    caption: &str,
    finished: &PlayedCampaign,
    rows: &[(String, BTreeMap<usize, Counts>)],
) {
    let links = usize::from(finished.drives) + 1;
    html.scroll(caption, |html| {
        html.element("table", &[("class", &"heat")], |html| {
            html.line("caption", &[], caption);
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"col")], "");
                for link in 0..links {
                    let full = link_name(0, finished.drives, link);
                    let sender = full.split("->").next().unwrap_or_default();
                    let short = if link == 0 { "m" } else { sender };
                    html.line("th", &[("scope", &"col"), ("title", &full)], short);
                }
            });
            for (name, cells) in rows {
                html.element("tr", &[], |html| {
                    html.line("th", &[("scope", &"row")], name);
                    for link in 0..links {
                        cell(html, cells.get(&link));
                    }
                });
            }
        });
    });
}

fn cell(html: &mut Html, counts: Option<&Counts>) {
    let gravest = counts.and_then(|counts| counts.iter().rfind(|(_, count)| **count > 0));
    let (Some((class, _)), Some(counts)) = (gravest, counts) else {
        html.line("td", &[], "");
        return;
    };
    let words: Vec<_> = counts
        .iter()
        .filter(|(_, count)| **count > 0)
        .map(|(class, count)| format!("{count} {class}"))
        .collect();
    let class = class.outcome();
    html.line(
        "td",
        &[("class", &class.colour()), ("title", &words.join(", "))],
        class.letter,
    );
}

fn add(to: &mut Counts, from: &Counts) {
    for (class, count) in from {
        *to.entry(*class).or_default() += count;
    }
}

fn by_byte(finished: &PlayedCampaign) -> Html {
    let places = by_place(finished);
    let last = places.keys().map(|(_, byte)| *byte).max().unwrap_or(0);
    let links = u64::from(finished.drives) + 1;
    let together = (last * links).div_ceil(CELLS as u64).max(1);
    let mut rows: BTreeMap<u64, BTreeMap<usize, Counts>> = BTreeMap::new();
    for ((link, byte), counts) in &places {
        let row = rows.entry(byte.saturating_sub(1) / together).or_default();
        add(row.entry(*link).or_default(), counts);
    }
    let rows: Vec<_> = rows
        .into_iter()
        .map(|(row, cells)| {
            let first = row * together + 1;
            let name = match together {
                1 => first.to_string(),
                _ => format!("{first}-{}", (first + together - 1).min(last)),
            };
            (name, cells)
        })
        .collect();
    let mut html = Html::new();
    map(
        &mut html,
        "The gravest class at each byte of each link, headed by its sender",
        finished,
        &rows,
    );
    html
}

/// The same by bits, where the campaign damages single ones.
fn by_bit(finished: &PlayedCampaign) -> Option<Html> {
    let mut bits: BTreeMap<LineBit, BTreeMap<usize, Counts>> = BTreeMap::new();
    for outcome in &finished.outcomes {
        for fault in outcome.case.faults() {
            if let FaultEffect::Bit(bit) = fault.what {
                let cells = bits.entry(bit).or_default();
                *cells
                    .entry(fault.link)
                    .or_default()
                    .entry(outcome.class)
                    .or_default() += 1;
            }
        }
    }
    if bits.is_empty() {
        return None;
    }
    let rows: Vec<_> = bits
        .into_iter()
        .map(|(bit, cells)| match bit {
            LineBit::Data(number) => (format!("data bit {number}"), cells),
            LineBit::Start => ("start bit".to_owned(), cells),
            LineBit::Parity => ("parity bit".to_owned(), cells),
            LineBit::Stop => ("stop bit".to_owned(), cells),
        })
        .collect();
    let mut html = Html::new();
    map(
        &mut html,
        "The gravest class at each bit of each link, headed by its sender",
        finished,
        &rows,
    );
    Some(html)
}

fn by_link(finished: &PlayedCampaign) -> Html {
    let mut links: BTreeMap<usize, Counts> = BTreeMap::new();
    for ((link, _), counts) in by_place(finished) {
        add(links.entry(link).or_default(), &counts);
    }
    let mut html = Html::new();
    html.element("details", &[], |html| {
        html.line("summary", &[], "As a table");
        html.element("table", &[], |html| {
            html.line(
                "caption",
                &[],
                "Cases by link and class; a case with two faults counts at both",
            );
            let mut names = vec!["Link"];
            names.extend(CaseClass::ALL.map(CaseClass::name));
            html.heads(&names);
            for (link, counts) in links.iter().take(LINKS) {
                html.element("tr", &[], |html| {
                    html.line(
                        "th",
                        &[("scope", &"row")],
                        link_name(0, finished.drives, *link),
                    );
                    for class in CaseClass::ALL {
                        html.line(
                            "td",
                            &[("class", &"n")],
                            counts.get(&class).copied().unwrap_or(0),
                        );
                    }
                });
            }
        });
    });
    html
}

/// How many cases of each class there are at each link and byte, where a case with two faults counts at both:
/// the figures of a map with a row for a link and a column for a byte.
#[must_use]
pub(crate) fn by_place(
    finished: &PlayedCampaign,
) -> BTreeMap<(usize, u64), BTreeMap<CaseClass, u64>> {
    let mut map: BTreeMap<_, BTreeMap<_, _>> = BTreeMap::new();
    for outcome in &finished.outcomes {
        let mut places: Vec<_> = outcome.case.faults().map(|f| (f.link, f.byte)).collect();
        places.dedup();
        for place in places {
            *map.entry(place)
                .or_default()
                .entry(outcome.class)
                .or_default() += 1;
        }
    }
    map
}
