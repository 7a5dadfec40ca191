//! The rules of JUnit's XML, in our own words: those that Jenkins' plugin and GitLab hold a report against. Written from what the two
//! document, not from their files.

use roxmltree::{Document, Node};
use std::collections::BTreeSet;

/// Elements with their attributes, `*` in front of those that must be there, and with the elements that may stand in them.
const ELEMENTS: [(&str, &str, &str); 13] = [
    ("testsuites", "name time tests failures errors", "testsuite"),
    (
        "testsuite",
        "*name *tests *failures *errors time skipped timestamp hostname id package group file log url",
        "testsuite properties testcase system-out system-err",
    ),
    ("properties", "", "property"),
    ("property", "*name *value", ""),
    (
        "testcase",
        "*name classname time group",
        "skipped error failure rerunFailure rerunError flakyFailure flakyError system-out system-err",
    ),
    ("skipped", "*type message", ""),
    ("error", "*type message", ""),
    ("failure", "*type message", ""),
    (
        "flakyFailure",
        "*type message",
        "stackTrace system-out system-err",
    ),
    (
        "flakyError",
        "*type message",
        "stackTrace system-out system-err",
    ),
    ("stackTrace", "", ""),
    ("system-out", "", ""),
    ("system-err", "", ""),
];

/// The violations of a report; empty for a right one.
pub(crate) fn wrong(xml: &str) -> Vec<String> {
    // What is no XML, a character that XML cannot hold among it, is refused here.
    let document = match Document::parse(xml) {
        Ok(document) => document,
        Err(error) => return vec![error.to_string()],
    };
    let mut wrong = Vec::new();
    let root = document.root_element();
    if !matches!(root.tag_name().name(), "testsuites" | "testsuite") {
        wrong.push(format!("<{}> is no report", root.tag_name().name()));
    }
    for node in document.descendants().filter(Node::is_element) {
        element(node, &mut wrong);
    }
    let mut names = BTreeSet::new();
    for case in document
        .descendants()
        .filter(|n| n.has_tag_name("testcase"))
    {
        if !names.insert((case.attribute("classname"), case.attribute("name"))) {
            wrong.push(format!("{:?} stands twice", case.attribute("name")));
        }
    }
    for suite in document
        .descendants()
        .filter(|n| n.has_tag_name("testsuite"))
    {
        counts(suite, &mut wrong);
    }
    wrong
}

fn element(node: Node<'_, '_>, wrong: &mut Vec<String>) {
    let name = node.tag_name().name();
    let Some((_, attributes, inner)) = ELEMENTS.iter().find(|(known, ..)| *known == name) else {
        wrong.push(format!("<{name}> is no element of a report"));
        return;
    };
    let known: Vec<&str> = attributes.split_whitespace().collect();
    for attribute in node.attributes() {
        let fits = |known: &&str| known.trim_start_matches('*') == attribute.name();
        if !known.iter().any(fits) {
            wrong.push(format!("<{name}> has no attribute {}", attribute.name()));
        }
        if !typed(attribute.name(), attribute.value()) {
            wrong.push(format!(
                "{}=\"{}\" in <{name}>",
                attribute.name(),
                attribute.value()
            ));
        }
    }
    for needed in known.iter().filter_map(|known| known.strip_prefix('*')) {
        if node
            .attribute(needed)
            .is_none_or(|value| value.trim().is_empty())
        {
            wrong.push(format!("<{name}> needs {needed}"));
        }
    }
    for child in node.children().filter(Node::is_element) {
        let child = child.tag_name().name();
        if !inner.split_whitespace().any(|known| known == child) {
            wrong.push(format!("<{child}> cannot stand in <{name}>"));
        }
    }
    if node.has_tag_name("testsuites")
        || node.has_tag_name("testsuite")
        || node.has_tag_name("testcase")
    {
        let words = |node: &Node<'_, '_>| {
            node.is_text() && node.text().is_some_and(|text| !text.trim().is_empty())
        };
        if node.children().any(|child| words(&child)) {
            wrong.push(format!("text in <{name}>"));
        }
    }
}

/// Whether a value has the type of its attribute: counts are whole numbers, times have three decimals at most.
fn typed(name: &str, value: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match name {
        "tests" | "failures" | "errors" | "skipped" => digits(value),
        "time" => match value.split_once('.') {
            None => digits(value),
            Some((seconds, decimals)) => digits(seconds) && digits(decimals) && decimals.len() <= 3,
        },
        _ => true,
    }
}

/// The counts of a suite are those of its cases.
fn counts(suite: Node<'_, '_>, wrong: &mut Vec<String>) {
    let cases: Vec<_> = suite
        .children()
        .filter(|n| n.has_tag_name("testcase"))
        .collect();
    let with = |tag: &str| {
        let has = |case: &&Node<'_, '_>| case.children().any(|child| child.has_tag_name(tag));
        cases.iter().filter(has).count()
    };
    for (attribute, count) in [
        ("tests", cases.len()),
        ("failures", with("failure")),
        ("errors", with("error")),
        ("skipped", with("skipped")),
    ] {
        let stated = suite
            .attribute(attribute)
            .and_then(|value| value.parse::<usize>().ok());
        if stated.is_some_and(|stated| stated != count) {
            wrong.push(format!("{attribute} is {stated:?}, there are {count}"));
        }
    }
    let ends = ["skipped", "error", "failure"];
    for case in cases {
        let ended = case
            .children()
            .filter(|child| ends.contains(&child.tag_name().name()))
            .count();
        if ended > 1 {
            wrong.push(format!("{:?} ended {ended} times", case.attribute("name")));
        }
    }
}
