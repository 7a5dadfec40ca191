//! The section of a campaign: where in the ring which class happens, as a map of letters and colours.

use crate::campaign::PlayedCampaign;
use crate::campaign::class::CaseClass;
use crate::campaign::fault::{FaultEffect, LineBit};
use crate::campaign::report::{WORST, happened};
use harness_bench::campaign::share::{gravity, table};
use harness_bench::html::Html;
use harness_bench::report::html::{FoldedPart, Section};
use std::collections::BTreeMap;

/// Maximum number of cells of a map; a larger map shows several bytes in one row.
const CELLS: usize = 12_000;

/// Maximum number of rows of the table by link: the manual's largest ring has 251 links.
const LINKS: usize = 251;

/// How many cases there are of each class.
type Counts = BTreeMap<CaseClass, u64>;

fn name(finished: &PlayedCampaign) -> &str {
    finished.name.trim_end_matches(".toml")
}

/// A campaign as a section; `number` counts the sections of the page from 1.
pub(super) fn section(number: usize, finished: &PlayedCampaign) -> Section {
    let mut html = Html::new();
    html.line("p", &[], &finished.title);
    html.line(
        "p",
        &[],
        format_args!(
            "{} cases of {}: {} drives, {} bytes.",
            finished.outcomes.len(),
            finished.scenario,
            finished.drives,
            finished.bytes
        ),
    );
    table(&mut html, finished, false);
    let instead = format!(
        "It is in: drivebench campaign {} --format json",
        name(finished)
    );
    let part = |heading: &str, html: Html| FoldedPart {
        heading: heading.to_owned(),
        html,
        instead: instead.clone(),
    };
    let mut parts = vec![part("Where: links across, bytes down", by_byte(finished))];
    parts.extend(by_bit(finished).map(|html| part("Which bit: links across, bits down", html)));
    parts.push(part("By link", by_link(finished)));
    parts.extend(worst(finished).map(|html| part("The worst", html)));
    Section {
        heading: name(finished).to_owned(),
        id: format!("s{number}"),
        gravity: gravity(finished),
        html,
        parts,
    }
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
                    let full = finished.link(link);
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
    let places = finished.by_place();
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
    for ((link, _), counts) in finished.by_place() {
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
                    html.line("th", &[("scope", &"row")], finished.link(*link));
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

fn worst(finished: &PlayedCampaign) -> Option<Html> {
    let mut worst: Vec<_> = finished
        .outcomes
        .iter()
        .filter(|outcome| outcome.class >= CaseClass::Recovered)
        .collect();
    worst.sort_by_key(|outcome| std::cmp::Reverse(outcome.class));
    if worst.is_empty() {
        return None;
    }
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line(
            "caption",
            &[],
            "The gravest cases, each with what plays it again",
        );
        html.heads(&["Class", "Case", "What happened", "Reproduce with"]);
        for outcome in worst.into_iter().take(WORST) {
            let case = outcome.case.name(finished.drives);
            html.element("tr", &[], |html| {
                html.line("td", &[], outcome.class.name());
                html.line("th", &[("scope", &"row")], &case);
                html.line("td", &[], happened(&outcome.evidence, finished.drives));
                let again = format!("drivebench campaign {} --case '{case}'", name(finished));
                html.line("td", &[("class", &"n")], again);
            });
        }
    });
    Some(html)
}
