//! The page of campaigns: how many cases there are of each class.

use super::{OutcomeClass, PlayedCampaign};
use crate::html::Html;
use crate::report::html;

/// The page of campaigns that were played.
#[must_use]
pub fn page(all: &[Box<dyn PlayedCampaign>]) -> String {
    let mut front = Html::new();
    let numbered: Vec<_> = (1..).zip(all).collect();
    // Campaigns of one bus have the same classes.
    let mut buses: Vec<Vec<(usize, &dyn PlayedCampaign)>> = Vec::new();
    for (number, campaign) in &numbered {
        let same = buses
            .iter_mut()
            .find(|bus| bus[0].1.classes() == campaign.classes());
        match same {
            Some(bus) => bus.push((*number, &***campaign)),
            None => buses.push(vec![(*number, &***campaign)]),
        }
    }
    front.element("section", &[("aria-labelledby", &"summary")], |html| {
        html.line("h2", &[("id", &"summary")], "Summary");
        buses.iter().for_each(|bus| summary(html, bus));
        html.line(
            "p",
            &[],
            "Each case is the conversation with one fault or two. A map shows the most serious class of the cases at a place.",
        );
        for bus in &buses {
            letters(html, bus[0].1.classes());
        }
    });
    let sections = numbered.iter();
    let sections = sections.map(|(number, campaign)| campaign.section(*number));
    let sections: Vec<_> = sections.collect();
    html::page("drivebench: campaigns of faults", &front, &sections)
}

fn summary(html: &mut Html, bus: &[(usize, &dyn PlayedCampaign)]) {
    let [(_, first), ..] = bus else { return };
    html.element("table", &[], |html| {
        html.line("caption", &[], "Campaigns");
        let mut names = vec!["Campaign"];
        let size = first.size();
        names.extend(size.iter().map(|(name, _)| name.as_str()));
        names.extend(["Cases", "Pinned figures"]);
        names.extend(first.classes().iter().map(|class| class.name));
        html.heads(&names);
        for (number, campaign) in bus {
            html.element("tr", &[], |html| {
                html.element("th", &[("scope", &"row")], |html| {
                    let place = format!("#s{number}");
                    html.line("a", &[("href", &place)], campaign.name());
                });
                for (_, size) in campaign.size() {
                    html.line("td", &[("class", &"n")], size);
                }
                html.line("td", &[("class", &"n")], campaign.cases());
                match campaign.differs().len() {
                    0 => html.line("td", &[("class", &"good")], "as found"),
                    many => html.line("td", &[("class", &"bad")], format_args!("{many} differ")),
                }
                for place in 0..campaign.classes().len() {
                    html.line("td", &[("class", &"n")], campaign.count(place));
                }
            });
        }
    });
}

/// What the letters mean.
fn letters(html: &mut Html, classes: &[OutcomeClass]) {
    html.element("table", &[], |html| {
        html.line("caption", &[], "Classes, in order of gravity");
        html.heads(&["Letter", "Class", "What it means"]);
        for class in classes {
            html.element("tr", &[], |html| {
                html.line("td", &[("class", &class.colour())], class.letter);
                html.line("th", &[("scope", &"row")], class.name);
                html.line("td", &[], class.about);
            });
        }
    });
}
