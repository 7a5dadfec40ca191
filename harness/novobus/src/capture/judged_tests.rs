//! Captures beside the model, beside each other, and as scenarios.

use super::tests::{DAMAGED, built_in, pcapng, run, text};
use crate::capture::diff::{ComparedRun, diff};
use crate::capture::judge::judge;
use crate::capture::scenario::scenario;
use harness_bench::capture::{Capture, JudgeOptions, read};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::LineError;
use harness_proto::time::Span;
use harness_sim::record::LineByte;

fn options<'o>(setup: Option<&'o Source>) -> JudgeOptions<'o> {
    JudgeOptions {
        title: "test",
        setup,
        tolerance: Some(Span::ZERO),
        stations: &[],
    }
}

fn imported(capture: &Capture) -> Capture {
    read(&pcapng(capture), None).expect("a capture")
}

/// Scenarios of the bus, faults on its links included: their captures alone, judged, say that all is by the manual, and as
/// scenarios they leave the same bytes at the same times.
#[test]
fn what_the_model_did_passes() {
    let names = [
        "9.7-parity-error",
        "9.8-check-sequence",
        "9.8-two-check-sequences",
        "9.8-three-check-sequences",
        "10.1-read-byte",
        "10.1-read-byte-wrong",
        "10.1-read-word",
        "10.1-read-long",
        "10.2-write-word",
        "10.3-and",
        "10.3-or-wrong",
        "10.4-write-io",
    ];
    for name in names {
        let capture = imported(&built_in(name));
        let judged =
            judge(&capture, &options(None)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let shown = judged.links.show("capture", "model").to_string();
        assert_eq!(judged.verdict, Verdict::Passed, "{name}: {shown}");
        assert_eq!(judged.links.differ, 0, "{name}: {shown}");
        let text = scenario(&capture, &options(None)).expect("a scenario");
        let again = run(&text);
        let (left, right) = (
            ComparedRun {
                name: "capture",
                capture: &capture,
            },
            ComparedRun {
                name: "again",
                capture: &again,
            },
        );
        let same = diff(left, right, Span::from_nanos(2));
        let shown = same.show("capture", "again").to_string();
        assert!(same.same(), "{name}: {shown}\n{text}");
    }
}

/// Every kind of damage is done again.
#[test]
fn damage_is_done_again() {
    let capture = imported(&run(DAMAGED));
    let text = scenario(&capture, &options(None)).expect("a scenario");
    for fault in [
        "byte 3: flip 2",
        "byte 5: flip p",
        "byte 7: flip s",
        "byte 12: overrun",
        "byte 14: drop",
        "byte 16: insert 55",
        "byte 18: replace 81",
        "byte 20: duplicate",
        "byte 9: break ",
    ] {
        assert!(
            text.contains(&format!("! 1->0 {fault}")),
            "{fault}:\n{text}"
        );
    }
    let judged = judge(&capture, &options(None)).expect("judged");
    let shown = judged.links.show("capture", "model").to_string();
    assert_eq!(judged.links.differ, 0, "{shown}\n{text}");
}

/// The drive that the ring spells out at the end is named (ND21 9.7).
#[test]
fn the_drive_that_saw_a_fault_is_named() {
    let capture = imported(&run("title f\nring 3\n! 2->1 byte 3: flip 0\n> 80*40\n"));
    assert_eq!(
        judge(&capture, &options(None)).expect("judged").located,
        Some((0, 1))
    );
}

/// A cut cable, and one that is whole again (ND21 9.9 begins so).
#[test]
fn a_cut_is_told() {
    let text = "title cut\nring 3\n! 2->1 byte 4: cut\n! 2->1 byte 16: join\n> 80*20\n";
    let capture = imported(&run(text));
    let again = scenario(&capture, &options(None)).expect("a scenario");
    assert!(
        again.contains("! 2->1 byte 4: cut") && again.contains("! 2->1 byte 16: join"),
        "{again}"
    );
    assert_eq!(
        judge(&capture, &options(None))
            .expect("judged")
            .links
            .differ,
        0
    );
}

/// A drive that does not keep to the manual is found, with the byte and the link behind it.
#[test]
fn a_wrong_drive_is_found() {
    let wrong = "title wrong\nring 3\ndrive 1 memory FE13 = 88\ndrive 1 deviates checksum-not-negated\n\
                 > 88 FE C0 13 FE D1\n";
    let capture = imported(&run(wrong));
    let judged = judge(&capture, &options(None)).expect("judged");
    assert_eq!(judged.verdict, Verdict::Failed);
    let first = judged.links.first.expect("a difference");
    assert!(first.link.starts_with("1->0"), "{first:?}");
}

/// A gap of the log, in which a clock was set or telegrams are missing, accuses no drives that monitor time-outs (ND21 9.9); a wrong one is found
/// on either side.
#[test]
fn a_gap_accuses_no_right_drive() {
    let on = "> 88 (1-N) A5 04 57 01\n> 88 (0-N) A5 04 57 01\n";
    let ask = "+8ms > 88 (1-N) C0 13 FE D1\n+8ms > 8A (1-N) 82 55 13 FE E8\n+8ms > 88 (1-N) C0 13 FE D1\n";
    // Each part has a telegram that shows the wrong drive.
    let off =
        "+8ms > 88 (1-N) A4 FB 57 F6\n> 88 (0-N) A4 FB 57 F6\n> 88 (1-N) C0 13 FE D1\nwait 5ms\n";
    let gap = |capture: &Capture, number: usize, is_lost: bool| {
        let links = capture.traces[0].channels.iter();
        let mut ends: Vec<_> = links
            .flat_map(|link| link.octets().iter().map(|byte| byte.at))
            .collect();
        ends.sort_unstable();
        let silent = ends
            .windows(2)
            .filter(|two| two[1].since(two[0]) > Span::from_millis(3));
        let begins: Vec<_> = silent.map(|two| two[1]).collect();
        let (begin, end) = (begins[number], begins[number + usize::from(is_lost)]);
        let mut all = capture.clone();
        for bytes in all.traces[0]
            .channels
            .iter_mut()
            .filter_map(|link| link.octets_mut())
        {
            bytes.retain(|byte| byte.at < begin || byte.at >= end);
            let later = bytes.iter_mut().filter(|byte| byte.at >= end);
            later.for_each(|byte| byte.at += Span::from_millis(3_600_000));
        }
        all
    };
    for (deviates, expected) in [
        ("", Verdict::Passed),
        ("drive 1 deviates checksum-not-negated\n", Verdict::Failed),
    ] {
        let text = format!("title gap\nring 2\ndrive 1 memory FE13 = 88\n{deviates}{on}{ask}{off}");
        let capture = imported(&run(&text));
        let mut found = Vec::new();
        for (number, is_lost) in [
            (0, false),
            (1, false),
            (2, false),
            (3, false),
            (0, true),
            (1, true),
            (2, true),
        ] {
            let judged = judge(&gap(&capture, number, is_lost), &options(None)).expect("judged");
            let note = |remark: &String| remark.starts_with("the log has a gap of 3600");
            assert!(judged.remarks.iter().any(note), "{:?}", judged.remarks);
            found.push(judged.verdict);
        }
        // A part in which a wrong drive shows itself once is no proof.
        match expected {
            Verdict::Passed => assert_eq!(found, [Verdict::Passed; 7]),
            _ => assert!(
                found.contains(&expected) && !found.contains(&Verdict::Passed),
                "{found:?}"
            ),
        }
    }
}

/// What only one end saw is judged too; without the master's incoming link nothing can be.
#[test]
fn a_capture_of_some_links() {
    let mut capture = imported(&built_in("10.1-read-byte"));
    let all = capture.traces[0].channels.clone();
    capture.traces[0]
        .channels
        .retain(|link| link.from.is_none() || link.to.is_none());
    let judged = judge(&capture, &options(None)).expect("judged");
    assert_eq!((judged.verdict, judged.links.links), (Verdict::Passed, 2));
    capture.traces[0]
        .channels
        .retain(|link| link.from.is_none());
    let judged = judge(&capture, &options(None)).expect("judged");
    assert_eq!(judged.verdict, Verdict::Inconclusive);
    capture.traces[0].channels = all[1..].to_vec();
    let error = judge(&capture, &options(None)).expect_err("no stimuli");
    assert!(error.to_string().contains("no link master->2"), "{error}");
}

/// Data that change by themselves are distinguished from data that a drive must keep.
#[test]
fn data_that_change_by_themselves() {
    let read = "> 88 FE C0 13 FE D1\n";
    let text = format!(
        "title changing\nring 3\ndrive 1 memory FE13 = 88\n{}",
        read.repeat(3)
    );
    let mut capture = imported(&run(&text));
    // The second answer holds another value, with its own checking byte.
    let last = capture.traces[0].channels.last_mut().expect("a link");
    for (index, byte) in [(10, 0x10), (11, 0x1D)] {
        let octets = last.octets_mut().expect("octets");
        let at = octets[index].at;
        octets[index] = LineByte::seen(at, Some(byte), Some(byte), None);
    }
    capture.traces[0]
        .channels
        .retain(|link| link.from.is_none() || link.to.is_none());
    let judged = judge(&capture, &options(None)).expect("judged");
    assert_eq!((judged.verdict, judged.unforeseen), (Verdict::Passed, 2));
    let text = scenario(&capture, &options(None)).expect("a scenario");
    assert!(text.contains("88 01 C0 13 xx xx"), "{text}");
}

/// Without a setup, what a drive may write itself and its process data accuse no drive, and nothing has passed (ND21 9.4, 14.2).
#[test]
fn what_is_left_to_the_drive_accuses_no_drive() {
    for name in [
        "8.2-exchange-1",
        "9.4-process-data",
        "9.5-several-commands",
        "13.3.1-phases",
        "14.4.1-status",
        "14.10.5-eeprom-read-byte",
        "14.11.10-register-errors",
    ] {
        let capture = imported(&built_in(name));
        let judged = judge(&capture, &options(None)).expect("judged");
        let shown = judged.links.show("capture", "model").to_string();
        assert_eq!(judged.verdict, Verdict::Inconclusive, "{name}: {shown}");
        let why = judged.remarks.last().expect("a reason");
        assert!(why.contains("--setup"), "{name}: {why}");
    }
}

/// A capture does not show whether drives monitor time-outs (ND21 9.9): where monitoring explains every byte, it is taken for their setting.
#[test]
fn monitoring_is_a_setting_of_right_drives() {
    for name in [
        "9.9-broken-ring-1-0",
        "9.9-broken-ring-master-3",
        "9.9-equal-clocks",
    ] {
        let judged = judge(&imported(&built_in(name)), &options(None)).expect("judged");
        assert_eq!(
            (judged.verdict, judged.links.differ),
            (Verdict::Passed, 0),
            "{name}"
        );
        let why = judged.remarks.last().expect("a remark");
        assert!(why.contains("monitor time-outs"), "{name}: {why}");
    }
}

/// It explains nothing else that a drive does in the error mode.
#[test]
fn monitoring_excuses_no_wrong_drive() {
    let broken = text("9.9-broken-ring-2-1");
    for deviation in [
        "counts-7-zeros",
        "never-increments",
        "increments-twice-in-error-mode",
    ] {
        let wrong = broken.replace(
            "strict\n",
            &format!("strict\ndrive 0 deviates {deviation}\n"),
        );
        assert_ne!(wrong, broken);
        let judged = judge(&imported(&run(&wrong)), &options(None)).expect("judged");
        assert_eq!(judged.verdict, Verdict::Failed, "{deviation}");
    }
}

/// A drive that loads what the master has written to its EEPROM (ND21 14.2.2, 14.3.6) is right.
#[test]
fn whole_drives_are_right_drives() {
    let judged = judge(&imported(&built_in("14.3.6-ee-selftest")), &options(None));
    let judged = judged.expect("judged");
    assert_eq!((judged.verdict, judged.links.differ), (Verdict::Passed, 0));
    let why = judged.remarks.last().expect("a remark");
    assert!(why.contains("whole ND21s"), "{why}");
}

/// ND21 10.5, 11.8: a drive may be silent after ResetH8. It may not answer wrong when it is back, nor be silent without one.
#[test]
fn a_drive_may_be_silent_while_it_tests_itself() {
    let silent = text("10.5-silent-self-test");
    let judged = |text: &str| judge(&imported(&run(text)), &options(None)).expect("judged");
    let right = judged(&silent);
    let why = right.remarks.join("; ");
    assert_eq!(right.verdict, Verdict::Inconclusive, "{why}");
    assert!(why.contains("tests itself"), "{why}");
    let wrong = silent.replace(
        "strict\n",
        "strict\ndrive 1 deviates checksum-not-negated\n",
    );
    assert_ne!(wrong, silent);
    assert_eq!(judged(&wrong).verdict, Verdict::Failed);
    // Where the capture begins with the silence, the reset may have been in front of it.
    for (front, verdict) in [
        ("> 82 00 00\n", Verdict::Failed),
        ("", Verdict::Inconclusive),
    ] {
        let swallows = format!(
            "title t\nring 3\ndrive 1 deviates swallows-synco\n{front}> 80*3\nwait 60ms\n> 82 00 00\n"
        );
        assert_eq!(judged(&swallows).verdict, verdict, "{front}");
    }
}

/// A value that the manual leaves open and that explains every byte is named, and settles nothing.
#[test]
fn an_open_value_that_explains_a_capture_is_named() {
    for (name, property) in [
        (
            "9.2-empty-short-telegram-error",
            "empty-short-telegram = error",
        ),
        ("9.2-short-address-kept-sum", "short-address = kept-sum"),
    ] {
        let judged = judge(&imported(&built_in(name)), &options(None)).expect("judged");
        let why = judged.remarks.last().expect("a remark").as_str();
        assert_eq!(judged.verdict, Verdict::Inconclusive, "{name}: {why}");
        assert!(
            why.contains(property) && why.contains("--setup"),
            "{name}: {why}"
        );
    }
}

/// What a reset loads is not known (ND21 10.5), and that the master's incoming link is missing is said only where it is.
#[test]
fn what_a_reset_loads_accuses_no_drive() {
    let judged = judge(
        &imported(&built_in("14.3.3-counter-after-reset")),
        &options(None),
    );
    let judged = judged.expect("judged");
    assert_eq!(judged.verdict, Verdict::Inconclusive);
    let why = judged.remarks.join("; ");
    assert!(
        why.contains("a reset has changed") && !why.contains("not captured"),
        "{why}"
    );
}

/// It excuses nothing else: a write to RAM that is not taken, a wrong checking byte of an answer with a cell of the drive's own.
#[test]
fn what_is_left_to_the_drive_excuses_nothing_else() {
    let process_data = "> 85 FE 12 34\n";
    let status = "> 8A FE 82 00 00 FF 81\n> 88 FE C0 00 FF BF\n";
    let ram = "> 8A FE 82 FF 20 FE 9F\n> 88 FE C0 20 FE DE\n";
    for (deviation, steps) in [
        ("writes-ignored", [process_data, ram].concat()),
        ("writes-ignored", [status, ram].concat()),
        ("checksum-not-negated", [process_data, status].concat()),
        ("checksum-wrong", [process_data, status].concat()),
    ] {
        let text = format!(
            "title wrong\nring 3\ndrive 1 memory DataOut = 28\ndrive 1 memory FF28 = 56 78\ndrive 1 deviates {deviation}\n{steps}"
        );
        let judged = judge(&imported(&run(&text)), &options(None)).expect("judged");
        assert_eq!(judged.verdict, Verdict::Failed, "{deviation}: {steps}");
    }
}

/// What comes back stands beside what was asked again after a whole check sequence (ND21 9.8), where a byte was lost or drives sent zeros
/// unasked in front of it.
#[test]
fn answers_behind_a_lost_byte_are_read_again() {
    for name in ["9.9-driver-silence", "14.11.14-time-out-only"] {
        let judged = judge(&imported(&built_in(name)), &options(None)).expect("judged");
        assert_eq!(judged.verdict, Verdict::Passed, "{name}");
    }
    let lost = "> 80*4\n! 2->1 byte 2: drop\n+5ms > 00*17 FF 44 72 4C 41\n";
    let read = "> 88 FE C0 20 FE DE\n";
    let write = "> 8A FE 82 FF 20 FE 9F\n";
    for (header, steps, verdict) in [
        ("", [lost, read].concat(), Verdict::Passed),
        ("", [lost, read, write, read].concat(), Verdict::Passed),
        (
            "drive 1 deviates writes-ignored\n",
            [lost, read, write, read].concat(),
            Verdict::Failed,
        ),
        (
            "drive 1 deviates checksum-wrong\n",
            [lost, read].concat(),
            Verdict::Failed,
        ),
    ] {
        let text = format!("title lost\nring 3\ndrive 1 memory FE20 = 5A\n{header}{steps}");
        let judged = judge(&imported(&run(&text)), &options(None)).expect("judged");
        assert_eq!(judged.verdict, verdict, "{text}");
    }
}

/// A drive whose supply was off in a silence of 300 ms has lost its RAM (ND21 14.2); a shorter one excuses nothing, nor what was read in front.
#[test]
fn a_supply_that_was_off_in_a_silence_accuses_no_drive() {
    let write = "> 8A FE 82 FF 20 FE 9F\n";
    let read = "> 88 FE C0 20 FE DE\n";
    for (silence, steps, verdict) in [
        ("400ms", [write, "", read], Verdict::Inconclusive),
        ("200ms", [write, "", read], Verdict::Failed),
        ("400ms", [write, read, ""], Verdict::Failed),
    ] {
        let [first, second, third] = steps;
        let text = format!(
            "title lost\nring 3\ndrive 1 deviates writes-ignored\n{first}{second}wait {silence}\n> 80\n{third}"
        );
        let judged = judge(&imported(&run(&text)), &options(None)).expect("judged");
        assert_eq!(judged.verdict, verdict, "{text}");
    }
}

/// A setup says what the drives are and what their cells hold.
#[test]
fn with_a_setup() {
    let name = "14.3.6-ee-selftest";
    let capture = imported(&built_in(name));
    let source = Source::from_bytes(name.to_owned(), text(name).into()).expect("a text");
    let judged = judge(&capture, &options(Some(&source))).expect("judged");
    let shown = judged.links.show("capture", "model").to_string();
    assert_eq!(
        (judged.verdict, judged.adopted),
        (Verdict::Passed, 0),
        "{shown}"
    );
}

#[test]
fn the_first_difference() {
    let left = run("title a\nring 2\n> 80*8\n");
    let mut right = left.clone();
    let last = right.traces[0].channels[2].octets_mut();
    let byte = &mut last.expect("octets")[5];
    *byte = LineByte::seen(byte.at, Some(0x80), Some(0x81), Some(LineError::Parity));
    let (a, b) = (
        ComparedRun {
            name: "a",
            capture: &left,
        },
        ComparedRun {
            name: "b",
            capture: &right,
        },
    );
    let summary = diff(a, b, Span::ZERO);
    let first = summary.first.clone().expect("a difference");
    assert_eq!(
        (first.link.as_str(), first.byte, summary.differ),
        ("0->master", 6, 1)
    );
    let shown = summary.show("a", "b").to_string();
    assert!(
        shown.contains(">      6  80                    81 parity (sent 80)"),
        "{shown}"
    );
    // Times alone.
    let mut late = left.clone();
    let first = late.traces[0].channels[0].octets_mut();
    let byte = &mut first.expect("octets")[7];
    byte.at += Span::from_millis(1);
    let b = ComparedRun {
        name: "b",
        capture: &late,
    };
    assert!(diff(a, b, Span::ZERO).first.expect("a time").only_time);
    assert!(diff(a, b, Span::from_millis(1)).same());
    // A link that one side alone has.
    late.traces[0].channels.pop();
    let b = ComparedRun {
        name: "b",
        capture: &late,
    };
    assert_eq!(diff(a, b, Span::from_millis(1)).alone, ["0->master (a)"]);
}

/// Titles of files are no lines of a scenario.
#[test]
fn hostile_names_stay_titles() {
    let capture = run("title a\nring 2\n> 80\n");
    let hostile = JudgeOptions {
        title: "x\n> 88\n# y\u{1b}[0m",
        ..options(None)
    };
    let text = scenario(&capture, &hostile).expect("a scenario");
    assert!(text.starts_with("title   x > 88   y [0m\nring"), "{text:?}");
    run(&text);
    // Nothing sent is nothing to play.
    let mut silent = capture.clone();
    silent.traces[0]
        .channels
        .iter_mut()
        .for_each(|link| link.octets_mut().expect("octets").clear());
    let error = scenario(&silent, &options(None)).expect_err("silence");
    assert!(error.to_string().contains("sent nothing"));
}
