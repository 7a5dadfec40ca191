//! The page of a run of fuzzing: what was found, what was reached, how it went on.

use super::setup::planted_line;
use crate::explore::FuzzSettings;
use harness_bench::counted::counted;
use harness_bench::explore::Progress;
use harness_bench::html::Html;
use harness_bench::report::chart::{Along, Chart, Curve, Points};
use harness_bench::report::html::{Section, page};
use harness_bench::shown::{ShownScenario, colour};
use harness_sim::novobus::transitions::{Event, Reached, State, Transition, why_unreachable};

/// Progress shown in a table at most; of a longer run every n-th line is.
const ROWS: usize = 40;

/// What a run of fuzzing has come to.
#[derive(Clone, Debug)]
pub(crate) struct Explored<'e> {
    /// What the run is.
    pub about: &'e FuzzSettings,
    /// The progress of the run over time; the last entry is the current state.
    pub history: &'e [Progress],
    /// After how many cases how many features had been seen.
    pub features: &'e [(u64, u64)],
    /// The protocol transitions that the kept cases reach on the model.
    pub reached: &'e Reached,
    /// What was found, each with its picture.
    pub findings: Vec<ShownScenario>,
    /// The command that continues the run.
    pub again: &'e str,
}

/// The page of a run.
#[must_use]
pub(crate) fn explored(run: Explored<'_>) -> String {
    let mut front = Html::new();
    front.element("section", &[("aria-labelledby", &"summary")], |html| {
        html.line("h2", &[("id", &"summary")], "Summary");
        facts(html, &run);
        findings(html, &run.findings);
    });
    front.element("section", &[("aria-labelledby", &"course")], |html| {
        html.line("h2", &[("id", &"course")], "How it went on");
        course(html, &run);
    });
    front.element("section", &[("aria-labelledby", &"reached")], |html| {
        html.line("h2", &[("id", &"reached")], "Transitions reached");
        transitions(html, run.reached);
    });
    let sections: Vec<Section> = run
        .findings
        .into_iter()
        .map(|shown| shown.section)
        .collect();
    page("drivebench: fuzzing", &front, &sections)
}

fn facts(html: &mut Html, run: &Explored<'_>) {
    let about = run.about;
    let last = run.history.last().copied().unwrap_or_default();
    html.element("ul", &[("class", &"counts")], |html| {
        let class = if run.findings.is_empty() {
            "good"
        } else {
            "bad"
        };
        html.line(
            "li",
            &[("class", &class)],
            counted(run.findings.len(), "finding"),
        );
        html.line("li", &[], counted(last.cases, "case"));
    });
    html.element("dl", &[], |html| {
        let mut fact = |name: &str, value: &dyn std::fmt::Display| {
            html.line("dt", &[], name);
            html.line("dd", &[], value);
        };
        fact("Rig", &about.rig);
        fact("Drives", &about.drives);
        if let Some(second) = about.second {
            fact("Drives of ring 2", &second);
        }
        fact("Seed", &about.seed);
        for planted in &about.setup.deviates {
            fact("Planted", &planted_line(planted));
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
        fact("Go on", &run.again);
    });
}

fn findings(html: &mut Html, all: &[ShownScenario]) {
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
fn course(html: &mut Html, run: &Explored<'_>) {
    let last = run.history.last().copied().unwrap_or_default();
    let executions = run
        .history
        .iter()
        .map(|progress| (seconds(progress.wire_ns) * 1e3, Some(progress.cases as f64)));
    let features = run
        .features
        .iter()
        .map(|(cases, all)| (*cases as f64, Some(*all as f64)));
    let title = "Cases against the time on the line";
    let end = seconds(last.wire_ns) * 1e3;
    let cases = curve("cases", false, executions.collect());
    figure(html, title, ("executions", Along::Time, end), cases);
    if !run.features.is_empty() {
        let title = "Features of the bus seen against cases";
        let end = last.cases as f64;
        let seen = curve("features", true, features.collect());
        figure(html, title, ("features", Along::Count("cases"), end), seen);
    }
    progress(html, run.history);
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

/// The matrix of a drive's end of the bus (ND21 9.1-9.9): a row a state, a column an event.
fn transitions(html: &mut Html, reached: &Reached) {
    let all = Transition::reachable().count();
    html.line(
        "p",
        &[],
        format_args!(
            "The kept cases reach {} of {all} reachable transitions of a drive's end of the bus on the model (ND21 9.1-9.9). \
             R is reached, - is not; where nothing stands, nothing can reach it. Silence is not played again: time-outs (9.9) are not counted.",
            reached.count()
        ),
    );
    html.scroll("Transitions", |html| {
        html.element("table", &[("class", &"heat")], |html| {
            html.line(
                "caption",
                &[],
                "Transitions: states down, events across by their numbers",
            );
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"col")], "State");
                for event in Event::ALL {
                    html.line(
                        "th",
                        &[("scope", &"col"), ("title", &event.name())],
                        event.index() + 1,
                    );
                }
            });
            for state in State::ALL.iter().copied() {
                html.element("tr", &[], |html| {
                    html.line("th", &[("scope", &"row")], state.name());
                    for event in Event::ALL.iter().copied() {
                        let cell = Transition { state, event };
                        if why_unreachable(cell).is_some() {
                            html.line("td", &[], "");
                        } else if reached.contains(cell) {
                            html.line("td", &[("class", &"k1")], "R");
                        } else {
                            html.line("td", &[("class", &"k0")], "-");
                        }
                    }
                });
            }
        });
    });
    events(html);
}

fn events(html: &mut Html) {
    html.element("details", &[], |html| {
        html.line("summary", &[], "The events by their numbers");
        html.element("ol", &[], |html| {
            for event in Event::ALL {
                html.line(
                    "li",
                    &[],
                    format_args!("{} (ND21 {})", event.name(), event.section()),
                );
            }
        });
    });
}
