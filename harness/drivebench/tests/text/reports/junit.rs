//! JUnit's XML of every end that a run can have, against the rules.

use super::{Bench, program, said};
use crate::junit_rules::wrong;
use harness::evidence::{JunitCase, junit};
use harness::scenario::verdict::Verdict;
use proptest::prelude::*;
use std::path::Path;
use std::time::Duration;

#[track_caller]
fn right(xml: &str) {
    assert_eq!(wrong(xml), Vec::<String>::new(), "{xml}");
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn case(name: &str, verdict: Verdict, message: &str) -> JunitCase {
    JunitCase {
        name: name.to_owned(),
        class: "nd21.chapter-9".to_owned(),
        verdict,
        details: message.to_owned(),
        message: message.to_owned(),
        took: Duration::from_nanos(1_234_567_890),
        attachments: Vec::new(),
    }
}

#[test]
fn every_verdict_has_its_element() {
    let page = |verdict| {
        let xml = junit(
            "rig lab",
            &[case("one[rig=lab,drives=3]", verdict, "a <reason> & ]]>")],
        );
        right(&xml);
        xml
    };
    for (verdict, element) in [
        (
            Verdict::Skipped,
            "<skipped type=\"skipped\" message=\"a &lt;reason&gt; &amp; ]]&gt;\"",
        ),
        (Verdict::Inconclusive, "<skipped type=\"inconclusive\""),
        (Verdict::Flaky, "<flakyFailure type=\"flaky\""),
        (Verdict::Marginal, "<system-out>marginal: a &lt;reason&gt;"),
        (Verdict::Failed, "<failure type=\"failed\""),
        (Verdict::Aborted, "<error type=\"aborted\""),
        (Verdict::RigError, "<error type=\"rig-error\""),
    ] {
        let xml = page(verdict);
        let ordered = xml.replace("message=\"a &lt;reason&gt; &amp; ]]&gt;\" type=", "type=");
        let element = element.replace(" message=\"a &lt;reason&gt; &amp; ]]&gt;\"", "");
        assert!(ordered.contains(&element), "{element}: {xml}");
    }
    let passed = page(Verdict::Passed);
    assert!(
        passed.contains("time=\"1.234\"") && !passed.contains("reason"),
        "{passed}"
    );
}

#[test]
fn names_are_unique_whatever_is_left_of_them() {
    let cases: Vec<_> = ["a", "a", "a_2", "", "\u{1}", "a\u{FFFE}"]
        .iter()
        .map(|name| case(name, Verdict::Passed, ""))
        .collect();
    let xml = junit("\u{0}\u{FFFF}rig", &cases);
    right(&xml);
    for name in [
        "\"a\"",
        "\"a_2\"",
        "\"a_3\"",
        "\"a_2_2\"",
        "\"scenario\"",
        "\"scenario_2\"",
    ] {
        assert!(xml.contains(&format!("name={name}")), "{name}: {xml}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    /// No name and no message makes a report that is none.
    #[test]
    fn any_words(name in any::<String>(), message in any::<String>(), path in any::<String>(), verdict in 0..Verdict::ALL.len()) {
        let mut case = case(&name, Verdict::ALL[verdict], &message);
        case.attachments.push(path);
        let xml = junit(&message, &[case.clone(), case]);
        prop_assert_eq!(wrong(&xml), Vec::<String>::new(), "{}", xml);
    }
}

/// The rules themselves: each of these is against one.
#[test]
fn what_is_against_a_rule_is_noticed() {
    let good = "<testsuites><testsuite name=\"s\" tests=\"1\" failures=\"1\" errors=\"0\" time=\"1.5\"><testcase name=\"c\"><failure type=\"t\"/></testcase></testsuite></testsuites>";
    right(good);
    for (what, with) in [
        (" name=\"c\"", ""),
        (" name=\"s\"", ""),
        ("time=\"1.5\"", "time=\"1.2345\""),
        ("time=\"1.5\"", "time=\"1s\""),
        ("tests=\"1\"", "tests=\"2\""),
        ("tests=\"1\"", "tests=\"one\""),
        ("failures=\"1\"", "failures=\"0\""),
        (" errors=\"0\"", ""),
        ("<testsuites", "<testsuites skipped=\"0\""),
        (" type=\"t\"", ""),
        ("<failure", "<properties/><failure"),
        ("<failure", "<error type=\"t\"/><failure"),
        ("<failure", "words<failure"),
        ("<failure", "<weather/><failure"),
        ("name=\"c\"", "name=\"c\" colour=\"red\""),
        ("name=\"c\"", "name=\"c&#1;\""),
        ("<testcase", "<testcase name=\"c\"/><testcase"),
    ] {
        let bad = good.replacen(what, with, 1);
        assert!(bad != good && !wrong(&bad).is_empty(), "{bad}");
    }
    assert!(
        !wrong(&good[..60]).is_empty() && !wrong("").is_empty() && !wrong("<report/>").is_empty()
    );
}

#[test]
fn a_run_and_its_attachments() {
    let bench = Bench::new("");
    // A scenario that is wrong fails, although the model does the same (a simulated drive has no state of its own).
    let (output, evidence) = bench.play_all("run");
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let xml = read(&evidence.join("junit.xml"));
    right(&xml);
    for words in [
        "tests=\"4\"",
        "failures=\"1\"",
        "type=\"skipped\"",
        "rig=two",
    ] {
        assert!(xml.contains(words), "{words}: {xml}");
    }
    // A failure says where, what was expected and what was received, and shows the manual's table.
    let page = roxmltree::Document::parse(&xml).expect("XML");
    let failure = page.descendants().find(|node| node.has_tag_name("failure"));
    let failure = failure.expect("a failure");
    let message = "the master received 80 where 42 is expected";
    let told = failure.attribute("message").unwrap_or_default();
    assert!(told.starts_with(message), "{told}");
    let text = failure.text().unwrap_or_default();
    for words in [
        "scenarios/fails.scn:5:1: the master received 80 where 42 is expected\n    < 80 80 42\n",
        "\nexpected  80 80 42\nreceived  80 80 80\n",
        "  byte  Master   1     0\n",
        "see nd21 9.1",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let classes: std::collections::BTreeSet<_> = page
        .descendants()
        .filter_map(|node| node.attribute("classname"))
        .collect();
    assert_eq!(
        classes.into_iter().collect::<Vec<_>>(),
        ["nd21.chapter-10", "nd21.chapter-9"]
    );
    let mut named = 0;
    for rest in xml.split("[[ATTACHMENT|").skip(1) {
        let (path, _) = rest.split_once("]]").expect("an end");
        assert!(Path::new(path).is_file(), "{path}");
        named += 1;
    }
    // The text of each scenario, and of each that was played what its links carried.
    assert_eq!(named, 7, "{xml}");
}

#[test]
fn a_run_without_evidence() {
    let bench = Bench::new("");
    let file = bench.path("verdicts.xml");
    let scenarios = bench.path("scn");
    let play = |more: &[&str]| {
        let mut command = program(&["run"]);
        command.arg(&scenarios).args(more).arg("--junit").arg(&file);
        command.output().expect("the program")
    };
    let two = bench.path("two.toml");
    for (more, verdicts) in [
        (&[][..], "failures=\"1\""),
        (&["--rig", "sim:2"], "failures=\"1\""),
        (&["--rig", two.to_str().expect("a name")], "failures=\"1\""),
    ] {
        let output = play(more);
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        let xml = read(&file);
        right(&xml);
        assert!(
            xml.contains("tests=\"4\"")
                && xml.contains(verdicts)
                && xml.contains("fails.scn:5:1: "),
            "{more:?}: {xml}"
        );
    }
    // Whole or not at all, and told.
    let nowhere = bench.path("none/verdicts.xml");
    let mut command = program(&["run", "9.2-synco", "--junit"]);
    let output = command.arg(&nowhere).output().expect("the program");
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        said(&output).contains("failed to write"),
        "{}",
        said(&output)
    );
    assert!(
        std::fs::read_dir(bench.path(""))
            .expect("a folder")
            .all(|entry| {
                !entry
                    .expect("an entry")
                    .file_name()
                    .to_string_lossy()
                    .ends_with(".part")
            })
    );
}

#[test]
fn a_qualification_retries() {
    let bench = Bench::new("[retry]\nattempts = 3\n");
    let (output, evidence) = bench.play(&["qualify", "9.2-synco"], "qualify");
    assert!(
        matches!(output.status.code(), Some(0 | 5)),
        "{}",
        said(&output)
    );
    right(&read(&evidence.join("junit.xml")));
    let (_, evidence) = bench.play_all("retries");
    let xml = read(&evidence.join("junit.xml"));
    right(&xml);
    assert!(xml.contains("3 attempts: failed, failed, failed"), "{xml}");
}
