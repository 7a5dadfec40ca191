//! Verdicts for continuous integration: JUnit's XML as Jenkins and GitLab read it.
//!
//! A flaky scenario counts as passed and has a `flakyFailure` for its failed attempts. Files that a scenario left are named in
//! its output, as `[[ATTACHMENT|path]]`.

use crate::scenario::verdict::Verdict;
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestRerun, TestSuite};
use std::collections::BTreeSet;
use std::time::Duration;

/// A scenario as a test case.
#[derive(Clone, Debug)]
pub struct JunitCase {
    /// Its unique name: `9.7-parity-error[rig=lab-1,drives=3]`.
    pub name: String,
    /// The group that reports show it in, as `package.class`: `nd21.chapter-9`.
    pub class: String,
    pub verdict: Verdict,
    /// What differed, as a text for people.
    pub message: String,
    /// The finding with its place, the bytes and the table: the text of a failure. May be empty.
    pub details: String,
    /// How long it took on the line.
    pub took: Duration,
    /// The files that it has written.
    pub attachments: Vec<String>,
}

/// The test cases as XML.
#[must_use]
pub fn junit(suite: &str, cases: &[JunitCase]) -> String {
    let mut report = Report::new("drivebench");
    let mut suite = TestSuite::new(named(suite, "run"));
    let mut took = Duration::ZERO;
    let mut names = BTreeSet::new();
    for case in cases {
        let time = in_millis(case.took);
        let mut test = TestCase::new(unique(&case.name, &mut names), status(case));
        test.set_classname(named(&case.class, "scenarios"))
            .set_time(time);
        let output = output(case);
        if !output.is_empty() {
            test.set_system_out(output);
        }
        took += time;
        suite.add_test_case(test);
    }
    suite.set_time(took);
    report.set_time(took).add_test_suite(suite);
    let xml = report.to_string().unwrap_or_default();
    without_skipped(xml)
}

/// Jenkins knows no count of skipped cases for the whole report; each suite has its own.
fn without_skipped(mut xml: String) -> String {
    let end = xml
        .find("<testsuites")
        .and_then(|at| Some(at + xml[at..].find('>')?));
    let head = end.map_or("", |end| &xml[..end]);
    if let Some(at) = head.find(" skipped=\"") {
        let value = at + " skipped=\"".len();
        if let Some(length) = head[value..].find('"') {
            xml.replace_range(at..=value + length, "");
        }
    }
    xml
}

/// A name that no case has had yet: GitLab drops cases with the same name.
fn unique(name: &str, names: &mut BTreeSet<String>) -> String {
    let wanted = named(name, "scenario");
    let later = (2..).map(|number: usize| format!("{wanted}_{number}"));
    let mut free = std::iter::once(wanted.clone()).chain(later);
    let name = free.find(|name| !names.contains(name)).unwrap_or(wanted);
    names.insert(name.clone());
    name
}

/// Three decimals are the most that Jenkins takes.
fn in_millis(took: Duration) -> Duration {
    Duration::from_millis(u64::try_from(took.as_millis()).unwrap_or(u64::MAX))
}

fn status(case: &JunitCase) -> TestCaseStatus {
    let message = printable(&case.message);
    let details = printable(&case.details);
    let mut status = match case.verdict {
        Verdict::Passed | Verdict::Marginal => return TestCaseStatus::success(),
        Verdict::Flaky => {
            let mut before = TestRerun::new(NonSuccessKind::Failure);
            before.set_type(case.verdict.name()).set_message(message);
            if !details.is_empty() {
                before.set_description(details);
            }
            let mut status = TestCaseStatus::success();
            status.add_rerun(before);
            return status;
        }
        Verdict::Skipped | Verdict::Inconclusive => TestCaseStatus::skipped(),
        Verdict::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Verdict::Aborted | Verdict::RigError => TestCaseStatus::non_success(NonSuccessKind::Error),
    };
    status.set_type(case.verdict.name()).set_message(message);
    if !details.is_empty() {
        status.set_description(details);
    }
    status
}

/// What there is to say about what passed only just, and the files.
fn output(case: &JunitCase) -> String {
    let said = match case.verdict {
        Verdict::Marginal => format!("marginal: {}\n", printable(&case.message)),
        _ => String::new(),
    };
    // A path that would end the mark too early cannot be named by it.
    let paths = case.attachments.iter().map(|path| printable(path));
    let paths = paths.filter(|path| !path.trim().is_empty() && !path.contains([']', '\n']));
    said + &paths
        .map(|path| format!("[[ATTACHMENT|{path}]]\n"))
        .collect::<String>()
}

/// The printable part of a name, or the other text if nothing of it is printable.
fn named(name: &str, otherwise: &str) -> String {
    match printable(name) {
        empty if empty.trim().is_empty() => otherwise.to_owned(),
        printable => printable,
    }
}

/// What XML 1.0 can hold, without control characters that are no white space.
fn printable(text: &str) -> String {
    text.chars()
        .filter(|c| {
            matches!(c, '\t' | '\n') || !c.is_control() && !matches!(c, '\u{FFFE}' | '\u{FFFF}')
        })
        .collect()
}
