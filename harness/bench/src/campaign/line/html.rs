//! The section of a campaign on a shared line in a page.

use super::PlayedLine;
use crate::campaign::share::{gravity, table};
use crate::html::Html;
use crate::report::html::{FoldedPart, Section};

/// Maximum number of the worst cases shown.
const WORST: usize = 100;

/// A campaign as a section; `number` counts the sections of the page from 1.
#[must_use]
pub(crate) fn section(number: usize, played: &PlayedLine) -> Section {
    let name = &played.name;
    let mut html = Html::new();
    html.line("p", &[], &played.title);
    html.line(
        "p",
        &[],
        format_args!(
            "{} cases: 1 drive, {} {}.",
            played.outcomes.len(),
            played.count,
            played.table.units
        ),
    );
    table(&mut html, played, true);
    let instead = format!("It is in: drivebench campaign {name} --format json");
    let part = |heading: &str, html: Html| FoldedPart {
        heading: heading.to_owned(),
        html,
        instead: instead.clone(),
    };
    Section {
        heading: name.to_owned(),
        id: format!("s{number}"),
        gravity: gravity(played),
        html,
        parts: vec![
            part(
                &format!("Where: faults across, {} down", played.table.units),
                map(played),
            ),
            part("The worst", worst(played)),
        ],
    }
}

/// A row for each thing that was disturbed, a column a fault. Colours only repeat the letters.
fn map(played: &PlayedLine) -> Html {
    let mut faults: Vec<&str> = Vec::new();
    for outcome in &played.outcomes {
        if !faults.contains(&outcome.case.fault.as_str()) {
            faults.push(&outcome.case.fault);
        }
    }
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line("caption", &[], "The class of each case");
        let mut heads = vec!["Number", played.table.heading];
        heads.extend(&faults);
        html.heads(&heads);
        for row in played
            .outcomes
            .chunk_by(|a, b| a.case.place == b.case.place)
        {
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"row")], row[0].case.place);
                html.line("td", &[], &row[0].case.disturbed);
                for fault in &faults {
                    match row.iter().find(|outcome| outcome.case.fault == *fault) {
                        Some(outcome) => {
                            let class = played.of(outcome);
                            html.line("td", &[("class", &class.colour())], class.letter)
                        }
                        None => html.line("td", &[], ""),
                    }
                }
            });
        }
    });
    html
}

fn worst(played: &PlayedLine) -> Html {
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line("caption", &[], "The worst cases");
        html.heads(&["Class", "Case", "Disturbed", "What happened"]);
        for outcome in played.serious().into_iter().take(WORST) {
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"row")], played.of(outcome).name);
                html.line("td", &[], outcome.case.name());
                html.line("td", &[], &outcome.case.disturbed);
                html.line("td", &[], &outcome.happened);
            });
        }
    });
    html
}
