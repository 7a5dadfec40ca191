//! How many cases of a campaign are of each class, and which share of all they are.

use super::PlayedCampaign;
use crate::html::Html;
use std::fmt::Write as _;

/// How many cases there are of each class, and what differs from the file.
#[must_use]
pub fn counts(played: &dyn PlayedCampaign) -> String {
    let mut text = format!("  {:18} {:>8} {:>9}\n", "class", "cases", "share");
    for (place, class) in played.classes().iter().enumerate() {
        let (name, count) = (class.name, played.count(place));
        let share = share(count, played.cases());
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "  {name:18} {count:>8} {share:>9}  {}", class.about);
    }
    for (name, expected, found) in played.differs() {
        let differs = format!("{name} is {found}, the file pins {expected}");
        let _infallible = writeln!(text, "  differs: {differs}");
    }
    text
}

/// The same in a page; with the letters of the classes, where these are in a map.
pub fn table(html: &mut Html, played: &dyn PlayedCampaign, letters: bool) {
    html.element("table", &[], |html| {
        html.line("caption", &[], "Cases by class");
        let heads = ["Letter", "Class", "Cases", "Share", "What it means"];
        html.heads(&heads[usize::from(!letters)..]);
        for (place, class) in played.classes().iter().enumerate() {
            let count = played.count(place);
            html.element("tr", &[], |html| {
                if letters {
                    html.line("td", &[("class", &class.colour())], class.letter);
                }
                html.line("th", &[("scope", &"row")], class.name);
                html.line("td", &[("class", &"n")], count);
                html.line("td", &[("class", &"n")], share(count, played.cases()));
                html.line("td", &[], class.about);
            });
        }
    });
    for (name, expected, found) in played.differs() {
        let differs = format_args!("{name} is {found}, the file pins {expected}");
        html.line("p", &[("class", &"bad")], differs);
    }
}

/// How serious a campaign is among the sections of a page: as its most serious class, and above all others where a pinned figure is
/// not met.
#[must_use]
pub fn gravity(played: &dyn PlayedCampaign) -> u8 {
    let classes = played.classes().iter().enumerate();
    let found = classes.filter(|(place, _)| played.count(*place) > 0);
    let gravest = found.map(|(_, class)| class.gravity).max();
    let differs = !played.differs().is_empty();
    gravest.unwrap_or(0) + if differs { 10 } else { 0 }
}

/// A share of all cases, to a hundredth of a percent; a share above zero is not shown as zero.
#[must_use]
pub fn share(part: u64, all: u64) -> String {
    if all == 0 {
        return "-".to_owned();
    }
    let hundredths = (u128::from(part) * 20_000 / u128::from(all)).div_ceil(2);
    if hundredths == 0 && part > 0 {
        return "< 0.01 %".to_owned();
    }
    format!("{}.{:02} %", hundredths / 100, hundredths % 100)
}
