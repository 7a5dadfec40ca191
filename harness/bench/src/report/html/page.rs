//! The page around its sections, and its bounds.

use crate::html::{Html, hash_source};

/// The most bytes of a page, unless what is always shown is longer.
pub(crate) const MAX_PAGE: usize = 1_990_000;

/// How things look.
const STYLE: &str = concat!(
    include_str!("style.css"),
    include_str!("../chart/style.css")
);
/// What the page does when it is pointed at.
const SCRIPT: &str = include_str!("script.js");

/// A part of a section that is omitted if the page would become too long.
#[derive(Clone, Debug)]
pub struct FoldedPart {
    pub heading: String,
    /// The contents below it.
    pub html: Html,
    /// What shows the same, in a sentence, if it is omitted.
    pub instead: String,
}

/// A section of a page.
#[derive(Clone, Debug)]
pub struct Section {
    pub heading: String,
    /// Its name in the page's addresses: letters, digits and `-`.
    pub id: String,
    /// How serious it is: the most serious sections keep their parts first.
    pub gravity: u8,
    /// What is always shown.
    pub html: Html,
    /// What is shown below, if the page has room.
    pub parts: Vec<FoldedPart>,
}

/// A page with a title, a front part and its sections.
#[must_use]
pub fn page(title: &str, front: &Html, sections: &[Section]) -> String {
    let mut kept: Vec<Vec<bool>> = sections
        .iter()
        .map(|section| vec![false; section.parts.len()])
        .collect();
    // How long it is with everything left out decides what there is room for.
    let bare = written(title, front, sections, &kept).len();
    keep(sections, &mut kept, MAX_PAGE.saturating_sub(bare));
    written(title, front, sections, &kept)
}

fn written(title: &str, front: &Html, sections: &[Section], kept: &[Vec<bool>]) -> String {
    let mut html = Html::new();
    html.element("html", &[("lang", &"en")], |html| {
        head(html, title);
        html.element("body", &[], |html| {
            html.line(
                "a",
                &[("class", &"skip"), ("href", &"#main")],
                "Skip to the results",
            );
            html.element("header", &[], |html| html.line("h1", &[], title));
            if sections.len() > 1 {
                contents(html, sections);
            }
            html.element("main", &[("id", &"main")], |html| {
                html.part(front);
                for (section, kept) in sections.iter().zip(kept) {
                    whole(html, section, kept);
                }
            });
            html.element("footer", &[], |html| {
                html.line(
                    "p",
                    &[],
                    format_args!("drivebench {}", env!("CARGO_PKG_VERSION")),
                );
            });
            html.raw_text("script", SCRIPT);
        });
    });
    html.finish()
}

fn head(html: &mut Html, title: &str) {
    // Nothing is loaded, and no script runs but the page's own.
    let policy = format!(
        "default-src 'none'; style-src 'unsafe-inline'; script-src {}; base-uri 'none'; form-action 'none'",
        hash_source(SCRIPT)
    );
    html.element("head", &[], |html| {
        html.void("meta", &[("charset", &"utf-8")]);
        html.void(
            "meta",
            &[
                ("http-equiv", &"Content-Security-Policy"),
                ("content", &policy),
            ],
        );
        html.void(
            "meta",
            &[
                ("name", &"viewport"),
                ("content", &"width=device-width, initial-scale=1"),
            ],
        );
        html.void(
            "meta",
            &[("name", &"color-scheme"), ("content", &"light dark")],
        );
        html.line("title", &[], title);
        html.raw_text("style", STYLE);
    });
}

fn contents(html: &mut Html, sections: &[Section]) {
    html.element("nav", &[("aria-label", &"Contents")], |html| {
        html.element("details", &[], |html| {
            html.line("summary", &[], format_args!("{} sections", sections.len()));
            html.element("ol", &[], |html| {
                for section in sections {
                    html.element("li", &[], |html| {
                        let place = format!("#{}", section.id);
                        html.line("a", &[("href", &place)], &section.heading);
                    });
                }
            });
        });
    });
}

fn whole(html: &mut Html, section: &Section, kept: &[bool]) {
    let heading = format!("{}-h", section.id);
    html.element(
        "section",
        &[("id", &section.id), ("aria-labelledby", &heading)],
        |html| {
            html.line("h2", &[("id", &heading)], &section.heading);
            html.part(&section.html);
            for (part, kept) in section.parts.iter().zip(kept) {
                html.line("h3", &[], &part.heading);
                if *kept {
                    html.part(&part.html);
                } else {
                    html.line(
                        "p",
                        &[("class", &"note")],
                        format_args!("Left out, to keep the page small. {}", part.instead),
                    );
                }
            }
        },
    );
}

/// Chooses the parts to keep: those of the most serious sections first, and of these the shortest, so that as many as possible
/// fit.
fn keep(sections: &[Section], kept: &mut [Vec<bool>], mut free: usize) {
    let mut order: Vec<_> = (0..sections.len())
        .flat_map(|section| (0..sections[section].parts.len()).map(move |part| (section, part)))
        .collect();
    let length = |(section, part): (usize, usize)| sections[section].parts[part].html.len();
    order.sort_by_key(|place| (std::cmp::Reverse(sections[place.0].gravity), length(*place)));
    for place in order {
        if length(place) <= free {
            free -= length(place);
            kept[place.0][place.1] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run of any length gives a page within bounds, and the most serious section keeps its picture.
    #[test]
    fn a_page_has_bounds() {
        let section = |id: usize, gravity: u8| {
            let mut html = Html::new();
            html.line("p", &[], "x".repeat(100_000));
            let part = FoldedPart {
                heading: "Picture".into(),
                html,
                instead: "Look elsewhere.".into(),
            };
            let heading = format!("{gravity} <{id}>");
            Section {
                heading,
                id: format!("s{id}"),
                gravity,
                html: Html::new(),
                parts: vec![part],
            }
        };
        let mut sections: Vec<_> = (0..300).map(|id| section(id, 1)).collect();
        sections.push(section(300, 5));
        let page = page("many", &Html::new(), &sections);
        assert!(page.len() <= MAX_PAGE, "{}", page.len());
        assert!(page.len() > MAX_PAGE - 300_000, "{}", page.len());
        let last = page.split("id=\"s300\"").nth(1).expect("the last section");
        assert!(last.contains("xxxx"));
        assert!(page.contains("Left out"));
    }
}
