//! The structure of pages, and their bounds.

use super::parser::{outline, parse, sound};
use super::{FAILS, page, text};
use harness::scenario::run::Outcome;
use harness::scenario::verdict::Verdict;
use harness::shown::{Head, ScenarioView, ShownScenario, run, section};
use harness_proto::line::Rate;

/// The whole outline, for a human reader; other tests check the pictures.
fn snapshot(name: &str, scenarios: &[(&str, String)]) {
    let html = page(scenarios);
    let parsed = parse(&html);
    sound(&parsed);
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(concat!(env!("TREE"), "/snapshots/html"));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(name, outline(&parsed)));
}

#[test]
fn a_scenario_that_fails() {
    snapshot(
        "fails",
        &[
            ("fails", FAILS.to_owned()),
            ("9.2-synco", text("9.2-synco")),
        ],
    );
}

#[test]
fn a_ring_of_a_hundred() {
    snapshot(
        "hundred",
        &[("9.8-check-sequence", text("9.8-check-sequence"))],
    );
}

#[test]
fn recorded_cells() {
    snapshot(
        "recorded",
        &[("13.1.1-referencing", text("13.1.1-referencing"))],
    );
}

/// Two megabytes hold what a ring of 100 has to show, and nothing of it is left out.
#[test]
fn a_page_of_a_hundred_drives_is_small() {
    let names = ["9.7-parity-error", "9.8-check-sequence"];
    let html = page(&names.map(|name| (name, text(name))));
    assert!(html.len() < 400_000, "{}", html.len());
    assert!(!html.contains("Left out"));
    // A long run: 4000 bytes on each of 101 links and a fault every 40, more than a picture holds.
    let mut long = String::from("title long\nring 100\n");
    for fault in 0..60 {
        long.push_str(&format!(
            "! {}->{} byte {}: flip 0\n",
            99 - fault,
            98 - fault,
            30 + fault * 40
        ));
    }
    long.push_str("> 88 9C C0 13 FE D1\n> 80*4000\n");
    let html = page(&[("long", long)]);
    assert!(html.len() < 2_000_000, "{}", html.len());
    sound(&parse(&html));
}

/// The section of a built-in scenario with damaged bytes, as a rig shows it: without the text that damages them.
fn found_on_a_rig(number: usize, verdict: Verdict, remark: &str) -> ShownScenario {
    let (_, outcome, traces) = super::played("9.7-parity-error", &text("9.7-parity-error"));
    let outcome = Outcome {
        verdict,
        remarks: vec![remark.to_owned()],
        ..outcome
    };
    let view = ScenarioView {
        name: "parity",
        title: "a title",
        sources: &[],
        drives: "100",
        text: "",
        outcome: &outcome,
        traces: if verdict == Verdict::Skipped {
            &[]
        } else {
            &traces
        },
        report: super::BUS.report,
        rate: Rate::Baud38400,
        again: "drivebench trace it",
    };
    section(number, &view)
}

/// The verdict, the cable and the reason of a skip stand in front; damaged bytes have what was sent, and the drives at a fault are labelled.
#[test]
fn a_page_says_what_came_of_it() {
    let failed = page(&[
        ("fails", FAILS.to_owned()),
        ("9.2-synco", text("9.2-synco")),
    ]);
    assert!(
        failed.contains("1 of 2 scenarios failed: fails: "),
        "{failed}"
    );
    assert!(failed.contains("\"differs\":[3,2]"), "{failed}");
    assert!(failed.contains("the first byte that differs from what was expected"));
    let head = Head {
        found: Vec::new(),
        title: "drivebench: a test",
        facts: Vec::new(),
    };
    let rig = run(
        &head,
        vec![
            found_on_a_rig(1, Verdict::Inconclusive, "a remark"),
            found_on_a_rig(2, Verdict::Skipped, "the rig has no tap"),
        ],
    );
    sound(&parse(&rig));
    let sentence = "0 of 1 scenario passed, and none failed. 1 skipped. The cable between drives 98 and 97 damages bytes: 1 of 1 fault was located there.";
    assert!(rig.contains(sentence), "{rig}");
    assert!(rig.contains("the rig has no tap") && !rig.contains("id=\"s2\""));
    assert!(rig.contains("Damaged bytes: what was sent, and what arrived"));
    for drive in [98, 97] {
        let label = format!(">{drive}</text>");
        assert!(rig.contains(&label), "{drive}");
    }
}

/// Two runs give the same page.
#[test]
fn a_page_is_a_function_of_its_run() {
    let scenarios = [("fails", FAILS.to_owned())];
    assert_eq!(page(&scenarios), page(&scenarios));
}

/// What is drawn is what the links carried: every byte of every link is in one area of the data, with its time.
#[test]
fn the_data_holds_every_byte() {
    for name in [
        "9.7-parity-error",
        "9.8-two-check-sequences",
        "9.9-broken-ring-2-1",
    ] {
        let text = text(name);
        let (_, _, traces) = super::played(name, &text);
        let html = page(&[(name, text)]);
        let parsed = parse(&html);
        let all = parsed.all();
        let json = all
            .iter()
            .find(|element| element.attribute("type") == Some("application/json"))
            .expect("data")
            .text();
        let data: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        let areas = numbers(&data["areas"]);
        let byte = data["byte"].as_u64().expect("a time");
        for (place, link) in traces[0].channels.iter().enumerate() {
            let times = times(&numbers(&data["times"][place]), byte);
            assert_eq!(times.len(), link.octets().len(), "{name}, link {place}");
            for (row, (carried, at)) in link.octets().iter().zip(times).enumerate() {
                assert!(
                    carried.at.since_start().units().abs_diff(at) <= 6,
                    "{name}, link {place}, byte {row}"
                );
                let holds = |first: i64, count: i64, row: usize| {
                    (first..first + count).contains(&i64::try_from(row).expect("small"))
                };
                let found: Vec<_> = areas
                    .chunks(8)
                    .filter(|area| holds(area[0], area[1], place) && holds(area[2], area[3], row))
                    .collect();
                assert_eq!(found.len(), 1, "{name}, link {place}, byte {row}");
                let status = data["texts"][usize::try_from(found[0][5]).expect("a place")]
                    .as_str()
                    .expect("a text");
                let shown = carried
                    .received
                    .map_or("nothing".to_owned(), |b| format!("{b:02X}"));
                assert!(status.contains(&shown), "{status} holds {shown}");
                if carried.sent != carried.received {
                    assert!(found[0][4] < 0, "the fault is marked");
                }
            }
        }
    }
}

fn numbers(value: &serde_json::Value) -> Vec<i64> {
    let list = value.as_array().expect("a list").iter();
    list.map(|number| number.as_i64().expect("a number"))
        .collect()
}

/// When each byte of a link had passed: runs of bytes, each behind the one before.
fn times(runs: &[i64], byte: u64) -> Vec<u64> {
    let mut times = Vec::new();
    let mut at = 0;
    for run in runs.chunks(2) {
        at += run[0].unsigned_abs();
        for index in 0..run[1].unsigned_abs() {
            at += if index > 0 { byte } else { 0 };
            times.push(at);
        }
    }
    times
}
