//! Verdicts for continuous integration: JUnit's XML as Jenkins reads it (junit-10.xsd).

use crate::scenario::verdict::Verdict;
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use std::time::Duration;

/// A scenario as a test case.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its unique name: `9.7-parity-error[rig=lab-1,drives=3]`.
    pub name: String,
    /// What came of it.
    pub verdict: Verdict,
    /// What was otherwise, for people.
    pub message: String,
    /// How long it took on the line.
    pub took: Duration,
}

/// The test cases as XML.
#[must_use]
pub fn junit(suite: &str, cases: &[Case]) -> String {
    let mut report = Report::new("drivebench");
    let mut own = TestSuite::new(suite);
    for case in cases {
        let status = match case.verdict {
            Verdict::Passed | Verdict::Marginal | Verdict::Flaky => TestCaseStatus::success(),
            Verdict::Skipped | Verdict::Inconclusive => TestCaseStatus::skipped(),
            Verdict::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
            Verdict::Aborted | Verdict::RigError => {
                TestCaseStatus::non_success(NonSuccessKind::Error)
            }
        };
        let mut status = status;
        if !matches!(case.verdict, Verdict::Passed) {
            status.set_message(printable(&case.message));
        }
        if !matches!(
            case.verdict,
            Verdict::Passed | Verdict::Marginal | Verdict::Flaky
        ) {
            status.set_type(case.verdict.name());
        }
        let mut test = TestCase::new(printable(&case.name), status);
        test.set_classname("drivebench");
        // Three decimals are the most that Jenkins takes.
        let millis = u64::try_from(case.took.as_millis()).unwrap_or(u64::MAX);
        test.set_time(Duration::from_millis(millis));
        own.add_test_case(test);
    }
    report.add_test_suite(own);
    report.to_string().unwrap_or_default()
}

/// What XML can hold.
fn printable(text: &str) -> String {
    text.chars()
        .filter(|c| matches!(c, '\t' | '\n') || !c.is_control())
        .collect()
}
