//! The page of a fuzz run, made from its folder and nothing else: what was found, how it went on, and what was reached. The same folder gives
//! the same page.

use super::{ExploreError, Finding, FuzzCase, KeptRun, LogLine, Progress, read_as};
use crate::counted::counted;
use crate::explore::Differing as _;
use crate::html::Html;
use crate::report::chart::{Along, Chart, Curve, Points};
use crate::report::html::{Section, page as whole};
use crate::scenario::problem::TextSpan;
use crate::scenario::run::{AtMismatch, Mismatch};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::shown::{ScenarioView, ShownScenario, colour, section};
use std::fmt::Display;
use std::path::Path;

/// Findings shown at most.
const MOST: usize = 40;

/// Progress shown in a table at most; of a longer run every n-th line is.
const ROWS: usize = 40;

/// The page of the run in a folder.
///
/// # Errors
/// It holds no run of this bus, or its record or a finding is damaged.
pub fn page<C: FuzzCase>(folder: &Path) -> Result<String, ExploreError> {
    let (kept, _) = read_as::<C>(folder)?;
    let (mut findings, mut features) = (Vec::new(), vec![(0, 0)]);
    for line in &kept.lines {
        match line {
            LogLine::Finding { file, .. } if findings.len() < MOST && is_name(file) => {
                let (finding, _) = Finding::<C>::read_as(&folder.join(format!("{file}.json")))?;
                findings.push(shown(findings.len() + 1, &finding, file)?);
            }
            LogLine::Kept { number, new, .. } => {
                let before = features.last().map_or(0, |(_, all)| *all);
                features.push((number + 1, before + *new as u64));
            }
            _ => {}
        }
    }
    let reached = C::reached(&kept)?;
    let mut front = Html::new();
    let mut part = |id: &str, heading: &str, inside: &dyn Fn(&mut Html)| {
        front.element("section", &[("aria-labelledby", &id)], |html| {
            html.line("h2", &[("id", &id)], heading);
            inside(html);
        });
    };
    part("summary", "Summary", &|html| {
        facts(html, &kept, findings.len());
        table(html, &findings);
    });
    part("course", "How it went on", &|html| {
        course(html, &kept, &features);
    });
    if let Some((heading, text)) = &reached {
        part("reached", heading, &|html| html.part(text));
    }
    let sections = findings.into_iter().map(|shown| shown.section);
    let sections: Vec<Section> = sections.collect();
    Ok(whole("drivebench: fuzzing", &front, &sections))
}

/// Whether a name leads to a file of the folder and nowhere else.
fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
}

/// A finding as a section: shows the drives under test, or their model if they are behind ports.
fn shown<C: FuzzCase>(
    number: usize,
    finding: &Finding<C>,
    file: &str,
) -> Result<ShownScenario, ExploreError> {
    let text = C::scenario(finding, &C::kind(finding), None, true)?;
    let source = Source {
        name: "the drives under test".to_owned(),
        text: text.as_str().into(),
    };
    let (head, plan) = C::settled(&source).map_err(Box::new)?;
    let mut link = plan.simulate();
    let mut outcome = plan.play(&mut *link, AtMismatch::GoOn);
    let traces: Vec<_> = (0..plan.ports()).map(|port| link.trace(port)).collect();
    outcome.verdict = match finding.confirmed {
        true => Verdict::Failed,
        false => Verdict::Flaky,
    };
    let again = format!("seen again {} of {} times", finding.seen_again, finding.of);
    outcome.remarks.insert(0, again);
    if finding.ports {
        let model = "the picture shows the model, not the rig";
        outcome.remarks.push(model.to_owned());
    }
    let about = finding.difference.about();
    match &mut outcome.finding {
        Some(found) => found.message = format!("{about}; the scenario says: {}", found.message),
        None => {
            outcome.finding = Some(Mismatch {
                span: TextSpan { start: 0, end: 0 },
                message: about.to_owned(),
                difference: None,
                in_error: String::new(),
            });
        }
    }
    let again = match finding.ports {
        true => {
            let rig = &finding.rig;
            format!("drivebench run --rig {rig} {file}.scn, in the folder of the run")
        }
        false => format!("drivebench shrink {file}.json, in the folder of the run"),
    };
    let sources: Vec<_> = head.sources.into_iter().map(|source| source.text).collect();
    let rings = plan.rings();
    let played = ScenarioView {
        name: file,
        title: &finding.difference.signature(),
        sources: &sources,
        drives: &plan.size(),
        text: &text,
        outcome: &outcome,
        traces: &traces,
        report: C::REPORT,
        rate: rings.map(|rings| rings.rate).unwrap_or_default(),
        again: &again,
    };
    Ok(section(number, &played))
}

fn facts<C: FuzzCase>(html: &mut Html, run: &KeptRun<C>, findings: usize) {
    let about = &run.about;
    let last = run.history.last().copied().unwrap_or_default();
    html.element("ul", &[("class", &"counts")], |html| {
        let class = if findings == 0 { "good" } else { "bad" };
        html.line("li", &[("class", &class)], counted(findings, "finding"));
        html.line("li", &[], counted(last.cases, "case"));
    });
    html.element("dl", &[], |html| {
        let mut fact = |name: &str, value: &dyn Display| {
            html.line("dt", &[], name);
            html.line("dd", &[], value);
        };
        fact("Rig", &about.rig);
        fact("Drives", &about.drives);
        if let Some(second) = about.second {
            fact("Drives of ring 2", &second);
        }
        fact("Seed", &about.seed);
        for planted in C::planted(&about.setup) {
            fact("Planted", &planted);
        }
        fact(
            "Confirmed",
            &format_args!("seen again {} of {} times", about.confirm, about.of),
        );
        fact("Cases may have", &about.spices.join(", "));
        fact(
            "Not sent",
            &format_args!("{}: not allowed or not possible here", last.not_sent),
        );
        fact("Repeats of findings", &last.repeats);
        fact(
            "On the line",
            &format_args!("{:.3} s", seconds(last.wire_ns)),
        );
        fact(
            "Go on",
            &"drivebench fuzz run --resume FOLDER, the folder of this run",
        );
    });
}

fn table(html: &mut Html, all: &[ShownScenario]) {
    if all.is_empty() {
        return;
    }
    html.element("table", &[], |html| {
        html.line("caption", &[], "Findings");
        html.heads(&["Verdict", "Finding", "What differed"]);
        for ShownScenario { row, section } in all {
            html.element("tr", &[], |html| {
                html.line("td", &[("class", &colour(row.verdict))], row.verdict);
                html.element("th", &[("scope", &"row")], |html| {
                    html.line("a", &[("href", &format!("#{}", section.id))], &row.name);
                });
                html.line("td", &[], &row.title);
            });
        }
    });
}

fn curve(name: &str, held: bool, points: Points) -> Curve {
    Curve {
        name: name.to_owned(),
        held,
        points,
        ..Curve::default()
    }
}

fn figure(html: &mut Html, title: &str, (id, along, end): (&str, Along, f64), curve: Curve) {
    html.element("figure", &[], |html| {
        html.line("figcaption", &[], title);
        Chart {
            id,
            title,
            along,
            ends: Some((0.0, end)),
            curves: &[curve],
            ..Chart::default()
        }
        .draw(html);
    });
}

#[expect(clippy::cast_precision_loss, reason = "points of a curve")]
fn course<C: FuzzCase>(html: &mut Html, run: &KeptRun<C>, features: &[(u64, u64)]) {
    let last = run.history.last().copied().unwrap_or_default();
    let executions = run
        .history
        .iter()
        .map(|progress| (seconds(progress.wire_ns) * 1e3, Some(progress.cases as f64)));
    let points = features
        .iter()
        .map(|(cases, all)| (*cases as f64, Some(*all as f64)));
    let title = "Cases against the time on the line";
    let end = seconds(last.wire_ns) * 1e3;
    let cases = curve("cases", false, executions.collect());
    figure(html, title, ("executions", Along::Time, end), cases);
    if features.len() > 1 {
        let title = "Features of the bus seen against cases";
        let end = last.cases as f64;
        let seen = curve("features", true, points.collect());
        figure(html, title, ("features", Along::Count("cases"), end), seen);
    }
    progress(html, &run.history);
}

fn progress(html: &mut Html, history: &[Progress]) {
    html.element("details", &[], |html| {
        html.line("summary", &[], "As a table");
        html.element("table", &[], |html| {
            html.line("caption", &[], "Progress");
            html.heads(&["Cases", "Not sent", "Repeats", "On the line"]);
            for progress in history.iter().step_by(history.len().div_ceil(ROWS).max(1)) {
                html.element("tr", &[], |html| {
                    html.line("td", &[("class", &"n")], progress.cases);
                    html.line("td", &[("class", &"n")], progress.not_sent);
                    html.line("td", &[("class", &"n")], progress.repeats);
                    html.line(
                        "td",
                        &[("class", &"n")],
                        format_args!("{:.3} s", seconds(progress.wire_ns)),
                    );
                });
            }
        });
    });
}

#[expect(clippy::cast_precision_loss, reason = "seconds for people")]
fn seconds(nanos: u64) -> f64 {
    nanos as f64 / 1e9
}
