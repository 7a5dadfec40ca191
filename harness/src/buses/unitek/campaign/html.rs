//! The section of a campaign of frames in a page.

use super::report::{happened, serious};
use super::{FrameClass, PlayedFrames};
use crate::campaign::report::share;
use crate::report::html::{FoldedPart, Html, Section};
use harness_sim::segment::FrameFault;

/// Maximum number of the worst cases shown.
const WORST: usize = 100;

/// A class's letter, for readers who see no colours.
const fn letter(class: FrameClass) -> char {
    match class {
        FrameClass::Answered => '.',
        FrameClass::Retried => 'R',
        FrameClass::Noticed => 'N',
        FrameClass::Unnoticed => 'U',
    }
}

/// How serious a class is, as the page counts the classes of all campaigns.
const fn gravity(class: FrameClass) -> u8 {
    match class {
        FrameClass::Answered => 0,
        FrameClass::Retried => 2,
        FrameClass::Noticed => 4,
        FrameClass::Unnoticed => 6,
    }
}

/// A campaign as a section; `number` counts the sections of the page from 1.
#[must_use]
pub(crate) fn section(number: usize, played: &PlayedFrames<'_>) -> Section {
    let campaign = played.campaign;
    let name = campaign.name.trim_end_matches(".toml");
    let mut html = Html::new();
    html.line("p", &[], &campaign.file.title);
    html.line(
        "p",
        &[],
        format_args!(
            "{} cases: 1 drive, {} frames.",
            played.outcomes.len(),
            campaign.frames()
        ),
    );
    classes(&mut html, played);
    let instead = format!("It is in: drivebench campaign {name} --format json");
    let part = |heading: &str, html: Html| FoldedPart {
        heading: heading.to_owned(),
        html,
        instead: instead.clone(),
    };
    let found = FrameClass::ALL
        .into_iter()
        .rfind(|class| played.count(*class) > 0);
    let differs = !played.differs().is_empty();
    Section {
        heading: name.to_owned(),
        id: format!("s{number}"),
        gravity: found.map_or(0, gravity) + if differs { 10 } else { 0 },
        html,
        parts: vec![
            part("Where: faults across, frames down", map(played)),
            part("The worst", worst(played)),
        ],
    }
}

fn classes(html: &mut Html, played: &PlayedFrames<'_>) {
    let all = played.outcomes.len() as u64;
    html.element("table", &[], |html| {
        html.line("caption", &[], "Cases by class");
        html.heads(&["Letter", "Class", "Cases", "Share", "What it means"]);
        for class in FrameClass::ALL {
            let count = played.count(class);
            html.element("tr", &[], |html| {
                html.line("td", &[("class", &colour(class))], letter(class));
                html.line("th", &[("scope", &"row")], class.name());
                html.line("td", &[("class", &"n")], count);
                html.line("td", &[("class", &"n")], share(count, all));
                html.line("td", &[], class.about());
            });
        }
    });
    for (name, expected, found) in played.differs() {
        html.line(
            "p",
            &[("class", &"bad")],
            format_args!("{name} is {found}, the file pins {expected}"),
        );
    }
}

/// The class's colour is that of a class as serious in the ring's campaigns.
fn colour(class: FrameClass) -> String {
    format!("k{}", gravity(class))
}

/// A row a frame, a column a fault. Colours only repeat the letters.
fn map(played: &PlayedFrames<'_>) -> Html {
    let mut faults: Vec<FrameFault> = Vec::new();
    for outcome in &played.outcomes {
        if !faults.contains(&outcome.case.fault) {
            faults.push(outcome.case.fault);
        }
    }
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line("caption", &[], "The class of each case");
        let names: Vec<_> = faults.iter().map(ToString::to_string).collect();
        let mut heads = vec!["Frame", "As candump writes it"];
        heads.extend(names.iter().map(String::as_str));
        html.heads(&heads);
        for row in played
            .outcomes
            .chunk_by(|a, b| a.case.frame == b.case.frame)
        {
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"row")], row[0].case.frame);
                html.line("td", &[], &row[0].disturbed);
                for fault in &faults {
                    match row.iter().find(|own| own.case.fault == *fault) {
                        Some(own) => {
                            html.line("td", &[("class", &colour(own.class))], letter(own.class))
                        }
                        None => html.line("td", &[], ""),
                    }
                }
            });
        }
    });
    html
}

fn worst(played: &PlayedFrames<'_>) -> Html {
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line("caption", &[], "The worst cases");
        html.heads(&["Class", "Case", "Frame", "What happened"]);
        for own in serious(played).into_iter().take(WORST) {
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"row")], own.class.name());
                html.line("td", &[], own.case);
                html.line("td", &[], &own.disturbed);
                html.line("td", &[], happened(own));
            });
        }
    });
    html
}
