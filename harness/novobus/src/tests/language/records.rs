//! The language: `until`, `record`, and checks of values that a rig cannot show.

use super::drives::{nd21, plain};
use super::{entry, fails, passes, play, refused};
use crate::simulate::simulated;
use crate::tests::blind::Blind;
use harness_bench::report::plot::plot;
use harness_bench::scenario::run::{Outcome, run};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;

#[test]
fn until_waits_for_what_must_hold() {
    // It is seen at the next look, every 108 us, and the line behind counts from there.
    let (outcome, _) = play(&nd21(
        "! drive 1 @20ms: error 0151\nuntil drive 1 errorcode = 0151 within 1s\n+5ms drive 1 Status & 20 = 20",
    ));
    let took = outcome.took.as_nanos();
    assert!((25_000_000..25_108_000).contains(&took), "{outcome:?}");
    fails(
        &nd21("until drive 1 ps_status = 01 within 50ms"),
        "not within 50.000 ms: drive 1: ps_status is 00, expected 01 (finished)",
    );
    let (outcome, _) = play(&nd21("until drive 1 ps_status = 01 within 50ms"));
    assert_eq!(outcome.took, Span::from_millis(50));
    // Bytes go on meanwhile.
    passes(&nd21(
        "> 00\nuntil drives 0..1 in error within 2ms\nrecover\nuntil drives 0..1 normal within 2ms",
    ));
    passes(&nd21(
        "> 80*100\nuntil drive 0 normal within 1ms\n+1ms ! master->1: drop\n? received 99 bytes",
    ));
    refused(&nd21("until drive 0 nist = 0rpm"), "", "`within`", None);
    refused(
        &nd21("until drive 0 nist = 0rpm within 11s0"),
        "0",
        "complete",
        None,
    );
    refused(
        &nd21("until drive 0 nist = 0rpm within 700s"),
        "700s",
        "eleven minutes",
        None,
    );
    refused(
        &nd21("until located 3 within 1s"),
        "located",
        "`drive`",
        None,
    );
    refused(
        &nd21("utnil drive 0 normal within 1s"),
        "utnil",
        "a step",
        Some("`until`"),
    );
}

#[test]
fn wait_lets_time_pass() {
    let (outcome, _) = play(&nd21("wait 50ms"));
    assert_eq!(
        (outcome.verdict, outcome.took),
        (Verdict::Passed, Span::from_millis(50))
    );
    // It counts from when the last byte has left the master, and the next line from its end: with byte
    // times of 286.458 us that is 11.146 ms for the first byte of the second line, three byte times before
    // it is back.
    passes(&nd21(
        "> 80*4\nwait 5ms\n+5ms > A0\n< 80*4\n@12.0ms..12.1ms < A0",
    ));
    refused(&nd21("wait"), "", "a time such as 5ms", None);
}

#[test]
fn cells_are_recorded() {
    let (outcome, trace) = play(&plain(
        "record drive 0 nsoll every 10ms\nrecord drive 0 ps_status changes\nwait 25ms\n\
         write-word 0 nsoll = 1500rpm\nwrite-byte 0 ps_status = 21\nwait 20ms\nrecord drive 0 nsoll off\nwait 1s",
    ));
    assert_eq!(outcome.verdict, Verdict::Passed, "{:?}", outcome.finding);
    let [speed, changes] = &outcome.records[..] else {
        panic!("{:?}", outcome.records);
    };
    let ms: Vec<_> = speed
        .samples
        .iter()
        .map(|s| s.at.since_start().as_nanos() / 1_000_000)
        .collect();
    assert_eq!(ms, [0, 10, 20, 30, 40, 50]);
    let values: Vec<_> = speed
        .samples
        .iter()
        .filter_map(|s| speed.value(s))
        .collect();
    assert!(
        values[2] == 0.0 && (values[3] - 1_500.0).abs() < 0.2,
        "{values:?}"
    );
    assert_eq!(changes.samples.len(), 2);
    assert!(plot(speed).contains("rpm |"), "{}", plot(speed));
    assert!(
        plot(changes).contains("21  calculated, finished"),
        "{}",
        plot(changes)
    );
    let json: serde_json::Value = serde_json::from_str(&trace).expect("JSON");
    assert_eq!(json["schema"], 1);
    assert_eq!(json["records"][0]["cell"], "nsoll");
    assert_eq!(json["records"][0]["unit"], "rpm");
    assert_eq!(json["records"][0]["every_ns"], 10_000_000);
    assert_eq!(json["records"][0]["samples"][4]["raw"], "161E");
    assert_eq!(json["records"][1]["every_ns"], serde_json::Value::Null);
    let (_, trace) = play(&plain("> 80"));
    assert!(!trace.contains("records"), "{trace}");
    // A whole position, a range of drives, and a second record of the same cell.
    let (outcome, _) = play(&plain(
        "drive 0 memory umdrist = 10.25turns\nrecord drive 0..last position every 1ms\nwait 2ms\n\
         record drive 0 umdrist changes\nwait 2ms",
    ));
    let lengths: Vec<_> = outcome.records.iter().map(|r| r.samples.len()).collect();
    assert_eq!(lengths, [3, 5, 1]);
    let position = &outcome.records[0];
    assert_eq!(position.value(&position.samples[0]), Some(10.25));
    // What is recorded does not change what happens.
    let text = |record: &str| {
        plain(&format!(
            "{record}> 80*9\n< 80*9\n+5ms > 00\n? drives 0..1 in error"
        ))
    };
    let (with, trace_with) = play(&text("record drive 0 nist every 1ms\n"));
    let (without, trace_without) = play(&text(""));
    assert_eq!(
        (with.verdict, with.took),
        (Verdict::Passed, without.took),
        "{:?}",
        with.finding
    );
    let [mut with, without]: [serde_json::Value; 2] =
        [trace_with, trace_without].map(|text| serde_json::from_str(&text).expect("JSON"));
    assert!(
        with.as_object_mut()
            .expect("an object")
            .remove("records")
            .is_some()
    );
    assert_eq!(with, without);
}

#[test]
fn records_that_cannot_be_are_refused_and_bounded() {
    refused(&nd21("record drive 0 nist"), "", "when to look", None);
    refused(
        &nd21("record drive 0 nist every 100us"),
        "100us",
        "too short",
        None,
    );
    refused(
        &nd21("record drive 0 nist off"),
        "nist",
        "no record of `nist`",
        None,
    );
    refused(
        &nd21("record drive 0 scope_puffer changes"),
        "scope_puffer",
        "not a number",
        None,
    );
    refused(
        &nd21("record drive 2 nist changes"),
        "2",
        "no drive 2",
        None,
    );
    refused(
        &nd21("record drive 0 nits changes"),
        "nits",
        "a cell's name",
        Some("`nist`"),
    );
    refused(
        &format!(
            "title x\nring 250\n{}",
            "record drive 0..last nist changes\n".repeat(5)
        ),
        "nist",
        "more than 1000 records",
        None,
    );
    let (outcome, _) = play(
        "title x\nring 1\nrecord drive 0 nist every 108us\nrecord drive 0 nsoll every 108us\nwait 60s\n",
    );
    assert_eq!(outcome.verdict, Verdict::Aborted);
    let message = outcome.finding.expect("a finding").message;
    assert!(message.contains("more than 1000000 samples"), "{message}");
}

fn play_blind(lines: &str) -> Outcome {
    let entry = entry(&nd21(lines)).expect("no mistake");
    let plan = entry.plan;
    run(&plan, &mut Blind(simulated(&plan)))
}

/// ND21 10.1: cells can be read by telegrams, beside the conversation.
#[test]
fn cells_are_read_over_the_bus() {
    for check in [
        "? drive 0 memory FE13 = 00",
        "? drive 0..1 nist = 0rpm",
        "until drive 0 nist = 0rpm within 1s",
        "? drives 0..1 normal",
    ] {
        let outcome = play_blind(&format!("{check}\n? received 0 bytes"));
        let message = outcome.finding.map(|finding| finding.message);
        assert_eq!(outcome.verdict, Verdict::Passed, "{check}: {message:?}");
        let silent = play_blind(&format!("! master->1: cut\n{check}"));
        assert_eq!(silent.verdict, Verdict::Inconclusive, "{check}");
        let message = silent.finding.expect("a finding").message;
        assert!(message.contains("this link does not show"), "{message}");
    }
    let outcome = play_blind("? drive 1 memory FE13 = 01");
    assert_eq!(outcome.verdict, Verdict::Failed);
    // In the middle of a telegram nothing is asked.
    let outcome =
        play_blind("> 88 FF C0\n? drive 1 memory FE13 = 00\n> 13 FE D1\n< 88 01 C0 13 00 2D");
    assert_eq!(outcome.verdict, Verdict::Inconclusive);
    let message = outcome.finding.expect("a finding").message;
    assert!(message.contains("cell FE13"), "{message}");
}

#[test]
fn what_cannot_be_seen_is_inconclusive() {
    for check in [
        "? drive 0 in error",
        "? error 0502 at 0",
        "? drive 0 GPO1 low",
    ] {
        let outcome = play_blind(check);
        assert_eq!(outcome.verdict, Verdict::Inconclusive, "{check}");
        let message = outcome.finding.expect("a finding").message;
        assert!(message.contains("this link does not show"), "{message}");
        assert_eq!(outcome.took, Span::ZERO, "nothing is waited for");
        // A line behind it that is not met weighs more.
        let failed = play_blind(&format!("{check}\n? received 1 bytes"));
        assert_eq!(failed.verdict, Verdict::Failed, "{check}");
    }
    let recorded = play_blind("record drive 0 nist every 1ms\nwait 5ms");
    assert_eq!(recorded.verdict, Verdict::Passed);
    assert!(plot(&recorded.records[0]).contains("nothing was seen"));
}
