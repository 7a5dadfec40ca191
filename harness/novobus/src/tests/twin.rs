//! The twin: a ring beside its model, and what explains a ring that differs from it.

use crate::language::plan::Plan;
use crate::language::read::RingScenario;
use crate::language::run::over_bus::{play_over_bus, start_anew};
use crate::language::syntax::Header;
use crate::qualify::{
    Hypothesis, Probe, ProbeAnswer, ProbeTarget, RingSeen, answer, explaining, hypotheses, name,
    probes,
};
use crate::simulate::bench;
use crate::tests::built_in_sources;
use crate::twin::{Conversation, Exactness, Symptom, Twin};
use harness_bench::link::{Line as _, Link, LinkEvent, Octets, Recording, Replay};
use harness_bench::scenario::run::{AtMismatch, Outcome, lacks};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::{Instant, Span};

const EXACT: Exactness = Exactness {
    tolerance: Span::ZERO,
    line_errors: true,
    knows_cells: true,
    looks: None,
};

fn entry(text: &str) -> RingScenario {
    let source = Source {
        name: "test".to_owned(),
        text: text.to_owned().into(),
    };
    RingScenario::new(source, None).unwrap_or_else(|problems| panic!("{:#?}", problems.all()))
}

/// Plays a plan on a ring and gives what the master's end saw of it.
fn conversations(plan: &Plan, link: &mut dyn Link) -> Vec<Conversation> {
    let byte_time = link.byte_time();
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(link, &mut events);
    let _outcome = play_over_bus(plan, &mut recording, AtMismatch::GoOn);
    Conversation::all(&events, byte_time, true)
}

/// The built-in scenarios for rings of ten drives at most.
fn short_rings() -> impl Iterator<Item = (String, Plan)> {
    let read = |source: Source| {
        let name = source.name.clone();
        (
            name,
            RingScenario::new(source, None).expect("no mistakes").plan,
        )
    };
    let all = built_in_sources().map(read);
    all.filter(|(_, plan)| plan.rings[0].drives() <= 10)
}

/// ND21 9 and 10: every built-in scenario that needs nothing but the bus, on a ring that is its own model.
#[test]
fn a_ring_is_its_own_twin() {
    let mut compared = 0;
    for (name, plan) in short_rings() {
        let mut link = bench(&plan);
        let mut events: Vec<LinkEvent> = Vec::new();
        if lacks(&plan, &Recording::new(&mut link, &mut events)).is_some() {
            continue;
        }
        let mut twin = Twin::new(bench(&plan), &plan.rings);
        for conversation in conversations(&plan, &mut link) {
            let comparison = twin.follow(&conversation, EXACT);
            let found = comparison.divergence.or(comparison.untimely);
            assert_eq!(found, None, "{name}: {}", found.as_ref().expect("one"));
            compared += comparison.compared;
        }
    }
    assert!(compared > 5_000, "{compared}");
}

/// ND21 11.8: drives that leave the ring open during their self-test can be reset like others, in rings of any size. Each is waited for once.
#[test]
fn drives_that_are_silent_in_their_self_test_are_reset() {
    for (drives, silent, time, most) in [
        (3, "0..last", 81, 900),
        (3, "0..last", 150, 900),
        (3, "1", 150, 2_000),
        (3, "0..last", 2_000, 8_000),
        (60, "0..last", 150, 20_000),
        (250, "0..last", 81, 130_000),
    ] {
        let header = format!(
            "title t\nring {drives}\ndrive 0..last model nd21\ndrive {silent} property self-test-bus = silent\n\
             drive 0..last property self-test-time = {time}ms\n> 80\n"
        );
        let plan = entry(&header).plan;
        let mut link = bench(&plan);
        link.run_until(harness_proto::time::Instant::START + Span::from_millis(500));
        let begin = link.now();
        start_anew(&mut link, &plan.rings).expect("they come back");
        let took = link.now().since(begin);
        assert!(
            took < Span::from_millis(most),
            "{drives} {silent} {time}: {took}"
        );
    }
}

/// A replayed record gives the verdict and the message of the run, and no event is left over.
#[test]
fn a_record_is_played_again() {
    let mut played = 0;
    for (name, plan) in short_rings() {
        let mut link = bench(&plan);
        let mut events: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut events);
        let capabilities = recording.capabilities().to_vec();
        let outcome = play_over_bus(&plan, &mut recording, AtMismatch::Stop);
        let drives = plan.rings.iter().map(|ring| ring.drives()).collect();
        let mut replay = Replay::new(events, plan.rate, Span::ZERO, drives, capabilities);
        let again = play_over_bus(&plan, &mut replay, AtMismatch::Stop);
        assert_eq!(
            again.verdict, outcome.verdict,
            "{name}: {:?}",
            again.finding
        );
        let message = |outcome: &Outcome| outcome.finding.as_ref().map(|f| f.message.clone());
        assert_eq!(message(&again), message(&outcome), "{name}");
        assert_eq!(replay.left(), None, "{name}");
        played += usize::from(outcome.verdict != Verdict::Skipped);
    }
    assert!(played >= 30, "{played}");
}

/// The probe of an open property distinguishes each of its values from the others.
#[test]
fn probes_tell_properties() {
    for probe in probes(3).expect("no mistakes") {
        if probe.asked != ProbeTarget::Ring {
            continue;
        }
        let alike = |h: &Hypothesis| h.header.setups.len() == 1;
        for hypothesis in hypotheses(probe.property, 3).into_iter().filter(alike) {
            let value = hypothesis.name.clone();
            let header = hypothesis.header.clone();
            let answer = answered(3, &probe, EXACT, &header);
            let span = None;
            let settled = ProbeAnswer::Settled {
                value,
                header,
                span,
            };
            assert_eq!(answer, settled, "{}", probe.property);
        }
    }
}

/// ND21 9.9: one probe finds the time-out, the wait after it and the fate of a byte during that wait, and keeps them apart.
#[test]
fn a_time_out_is_told_from_the_wait_behind_it() {
    let all = |property: &str, ms: u64| format!("drive 0..last property {property} = {ms}ms");
    for (time_out, wait) in [(13, 7), (11, 8), (18, 12)] {
        for silent in [false, true] {
            let mut lines = vec![all("time-out", time_out), all("time-out-wait", wait)];
            let answered_not = "drive 0..last property time-out-answer = silent".to_owned();
            lines.extend(silent.then_some(answered_not));
            let probes = probes(3).expect("no mistakes");
            let mut probes = probes.iter();
            let probe = probes.find(|probe| probe.property == "time-out");
            let found = answered(3, probe.expect("a probe"), EXACT, &header(&lines));
            // Silences of 12.5, 15.5 and 18.5 ms were tried: it is known between which, and exactly when the zeros came.
            let same = |ms: u64| [13, 16, 19].map(|gap| ms < gap);
            let found_is = |time_out: u64, wait: u64| {
                let mut lines = lines.clone();
                lines[0] = all("time-out", time_out);
                lines[1] = all("time-out-wait", wait);
                let value = format!("{time_out}ms");
                let header = header(&lines);
                found
                    == ProbeAnswer::Settled {
                        value,
                        header,
                        span: None,
                    }
            };
            let alike = (10..=20).filter(|ms| same(*ms) == same(time_out));
            let sum = time_out + wait;
            let mut alike = alike.filter(|ms| (5..=15).contains(&(sum - ms)) && sum - ms != 10);
            assert!(
                alike.any(|ms| found_is(ms, sum - ms)),
                "{lines:?}: {found:?}"
            );
        }
    }
}

/// ND21 9.9: a round of 40 drives takes longer than their time-out, and what is asked of them takes a round.
#[test]
fn a_long_ring_is_asked_for_its_time_outs() {
    let time_outs = [
        ("time-out", "13ms"),
        ("time-out-wait", "7ms"),
        ("time-out-answer", "silent"),
    ];
    let probes = probes(40).expect("no mistakes");
    for (property, value) in time_outs {
        let probe = probes.iter().find(|probe| probe.property == property);
        let own_header = header(&[format!("drive 0..last property {property} = {value}")]);
        let answer = answered(40, probe.expect("a probe"), EXACT, &own_header);
        let is_it = matches!(&answer, ProbeAnswer::Settled { header, .. } if *header == own_header);
        assert!(is_it, "{property} = {value}: {answer:?}");
    }
}

/// These lines of a header.
fn header(lines: &[String]) -> Header {
    lines.join("\n").parse().expect("a header")
}

/// The answer to a probe of a ring of `drives` drives with this header.
fn answered(drives: u8, probe: &Probe, exactness: Exactness, header: &Header) -> ProbeAnswer {
    let entries = probe.entries.iter();
    let seen = entries.map(|entry| {
        let (_, mut link) = model_of(drives, &header.lines());
        conversations(&entry.plan, &mut link)
    });
    let twin = |header: &Header| -> Result<Twin, ()> {
        let (plan, link) = model_of(drives, &header.lines());
        Ok(Twin::new(link, &plan.rings))
    };
    answer(probe, drives, &seen.collect::<Vec<_>>(), exactness, &twin).expect("rings")
}

/// ND21 11.8, 13.3.2, 14.10.5, 14.11.14: cells of each drive show the open properties of the drive itself.
#[test]
fn what_a_drive_leaves_open_is_settled() {
    // What is found is a span of times around the true one, as wide as the questions are apart.
    let times = [
        ("eeprom-read-time", 1, 0, 8),
        ("eeprom-read-time", 300, 280, 320),
        ("eeprom-write-time", 1, 0, 2),
        ("eeprom-write-time", 20, 19, 21),
        ("self-test-time", 50, 40, 60),
        ("self-test-time", 4_000, 3_980, 4_020),
        ("ps-calculation-time", 10, 0, 20),
        ("ps-calculation-time", 400, 370, 430),
        ("i2t-time", 500, 450, 550),
        ("i2t-time", 2_000, 1_990, 2_010),
        ("i2t-time", 15_000, 14_990, 15_010),
    ];
    for (property, is, from, to) in times {
        let ProbeAnswer::Settled { value, header, .. } = asked(property, &format!("{is}ms"), READY)
        else {
            panic!("{property} = {is} is not settled");
        };
        let (low, high) = value.split_once(" to ").expect("a span");
        let ms = |text: &str| text.trim_end_matches("ms").parse::<f64>().expect("a time");
        let (low, high) = (ms(low), ms(high));
        let is = f64::from(is);
        // A cycle of 432 us (4.1) more or less is not to be seen.
        assert!(
            low - 0.5 <= is && is <= high + 0.5,
            "{property}: {is}: {value}"
        );
        assert!(
            low >= f64::from(from) && high <= f64::from(to),
            "{property}: {value}"
        );
        assert!(header.lines()[0].starts_with(&format!("drive 1 property {property} = ")));
    }
    let words = [
        ("ps-position", "mode-bit"),
        ("ps-position", "whole-word"),
        ("bus-errors", "block"),
        ("bus-errors", "time-out-only"),
        ("s-ramp-wire", "none"),
        ("s-ramp-wire", "puffer"),
    ];
    for (property, word) in words {
        let answer = asked(property, word, READY);
        let is_it = matches!(&answer, ProbeAnswer::Settled { value, .. } if value == word);
        assert!(is_it, "{property} = {word}: {answer:?}");
    }
}

/// ND21 14.4.2: a motor without current gives no answer, a motor with another current than the set one gives no time, and a motor that
/// keeps its peak current beyond the longest wait is distinguished from both.
#[test]
fn a_motor_that_has_not_its_peak_current_settles_nothing() {
    let answer = asked("i2t-time", "2000ms", "drive 0..last input GPIN3 low");
    assert_eq!(answer, ProbeAnswer::NoDifference);
    let ignores = format!("{READY}\ndrive 1 deviates current-limit-ignored");
    assert_eq!(
        asked("i2t-time", "2000ms", &ignores),
        ProbeAnswer::Unexplained
    );
    let never = format!("{READY}\ndrive 1 deviates i2t-never-limits");
    let answer = asked("i2t-time", "2000ms", &never);
    assert!(matches!(answer, ProbeAnswer::NotDone(_)), "{answer:?}");
}

/// ND21 5.3.3: released and started.
const READY: &str = "drive 0..last input GPIN3 GPIN5 high";

/// What drive 1 of three answers to the probe for a property, where it is so and these lines stand in the header.
fn asked(property: &str, value: &str, lines: &str) -> ProbeAnswer {
    let probes = probes(3).expect("no mistakes").into_iter();
    let mut of_property = probes.filter(|probe| probe.property == property);
    let probe = of_property
        .find(|probe| matches!(probe.asked, ProbeTarget::Drive(1, _)))
        .expect("a probe");
    let so = format!("drive 0..last property {property} = {value}");
    // As on a rig, where the cells that a drive writes itself are not known.
    let real = Exactness {
        knows_cells: false,
        ..EXACT
    };
    answered(3, &probe, real, &header(&[lines.to_owned(), so]))
}

/// What a rig's drives held before is set back, however long all the telegrams take.
#[test]
fn many_cells_are_set_back() {
    let plan =
        entry("title x\nring 60\ndrive 0..last memory FDB0 = 01*20\nread-byte 0 FDB0 = 01\n");
    let plan = plan.plan;
    let (_, mut link) = model_of(60, &[]);
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(&mut link, &mut events);
    let outcome = play_over_bus(&plan, &mut recording, AtMismatch::Stop);
    assert_eq!(outcome.verdict, Verdict::Passed, "{outcome:?}");
    assert_eq!(outcome.remarks, Vec::<String>::new());
}

fn model(lines: &[String]) -> (Plan, crate::link::SimulatedLink) {
    model_of(3, lines)
}

fn model_of(drives: u8, lines: &[String]) -> (Plan, crate::link::SimulatedLink) {
    let entry = entry(&format!(
        "title x\nring {drives}\ndrive 0..last model nd21\n{}\n> 80\n",
        lines.join("\n")
    ));
    let plan = entry.plan;
    let link = bench(&plan);
    (plan, link)
}

/// A divergence names the first byte that differs, its drive and the rule: ND21 10.1.
#[test]
fn a_divergence_says_where() {
    let holds = "drive 1 memory FE12 = 01 02 03 04".to_owned();
    let plan = entry("title x\nring 3\nread-long 1 FE12\n").plan;
    let differs = |holds: &[String]| {
        let other = "drive 1 property read-long = as-printed".to_owned();
        let (_, mut link) = model(&[holds, &[other]].concat());
        let seen = conversations(&plan, &mut link);
        let (plan, link) = model(holds);
        let mut twin = Twin::new(link, &plan.rings);
        let found = seen
            .iter()
            .find_map(|conversation| twin.follow(conversation, EXACT).divergence);
        (found.expect("another form of the answer"), seen)
    };
    // Two bytes of the answer differ. A single one may have been damaged by any drive.
    let (found, _) = differs(&[holds]);
    assert_eq!((found.byte, found.drive), (7, Some(1)));
    let (found, seen) = differs(&[]);
    assert_eq!((found.byte, found.drive), (8, None));
    assert_eq!(found.what, Symptom::Value);
    assert!(found.to_string().contains("ND21 10.1"), "{found}");
    let none = Hypothesis {
        name: "as the manual says".to_owned(),
        header: Header::default(),
    };
    let twin = |_: &Header| -> Result<Twin, ()> {
        let (plan, link) = model(&[]);
        Ok(Twin::new(link, &plan.rings))
    };
    assert_eq!(explaining(&[none], &seen, EXACT, &twin), Ok(Vec::new()));
}

/// ND21 9.2, 9.5: data that a drive measures are its own, also after a PAUSE and in a command that is cut over telegrams.
#[test]
fn measured_data_are_nobodys_wherever_they_stand() {
    let lines = ["drive 1 cooler 60C".to_owned()];
    // In the second one a byte behind them is lost.
    let text = "title x\nring 3\n> 81 80\n> 84 FE C0 26\n> 81 80\n> A4 FF E5\n> 81 80*40\n";
    for more in ["", "! 2->1 byte 20: drop\n"] {
        measured_differ(&lines, &format!("{text}{more}"));
    }
    // A parameter that no drive accepts (10.1), and a PAUSE that is answered in the error mode.
    let error = "title x\nring 3\n> 88 FE C0 26 FF E5\n> 88 FF C0 DE 2F CD 81\n";
    measured_differ(&lines, error);
}

fn measured_differ(lines: &[String], text: &str) {
    let (_, mut link) = model(lines);
    let plan = entry(text).plan;
    let seen = conversations(&plan, &mut link);
    let (plan, link) = model(&[]);
    let real = Exactness {
        knows_cells: false,
        tolerance: Span::from_millis(3),
        ..EXACT
    };
    let mut twin = Twin::new(link, &plan.rings);
    let comparisons: Vec<_> = seen.iter().map(|one| twin.follow(one, real)).collect();
    let measured: u64 = comparisons.iter().map(|one| one.measured).sum();
    let divergence = comparisons.iter().find_map(|one| one.divergence.as_ref());
    assert_eq!(divergence, None, "{}", divergence.expect("one"));
    assert_eq!(measured, 1);
}

/// Bytes that are right and late by what no deviation explains name none. Another byte does (ND21 9.6).
#[test]
fn what_the_right_drive_explains_names_no_deviation() {
    let names = |lines: &[String], late: Span| {
        let plan = entry("title x\nring 3\nread-byte 1 FE13\n").plan;
        let (_, mut link) = model(lines);
        let mut seen = conversations(&plan, &mut link);
        for conversation in &mut seen {
            for (_, at, _) in conversation.received.iter_mut().skip(2) {
                *at += late;
            }
        }
        let real = Exactness {
            tolerance: Span::from_millis(20),
            ..EXACT
        };
        let twin = |header: &Header| -> Result<Twin, ()> {
            let (plan, link) = model(&header.lines());
            Ok(Twin::new(link, &plan.rings))
        };
        let seen = RingSeen {
            drives: 3,
            suspects: &[],
            differing: &[seen],
            alike: &[],
            exactness: real,
        };
        let found = name(&seen, &twin);
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(names(&[], Span::from_millis(60)), [""; 0]);
    assert_eq!(names(&[], Span::ZERO), [""; 0]);
    let wrong = ["drive 1 deviates checksum-wrong".to_owned()];
    let named = names(&wrong, Span::ZERO);
    assert!(
        named
            .iter()
            .any(|name| name.contains("drive 1: checksum-wrong")),
        "{named:?}"
    );
}

/// Bytes that were held up and are still coming when the bench stops to listen are late, and none of them is lost; where nothing has come any
/// more for longer than the tolerance, one is.
#[test]
fn bytes_that_are_still_coming_are_not_lost() {
    let plan = entry("title x\nring 3\nread-byte 0 FE13\nwait 100ms\nread-byte 1 FE13\n").plan;
    let (_, mut link) = model(&[]);
    let seen = conversations(&plan, &mut link);
    let compared = |held_up: Span, silent: Span| {
        let mut seen = seen.clone();
        for conversation in &mut seen {
            for (_, at, _) in conversation.received.iter_mut().skip(3) {
                *at += held_up;
            }
            let most = conversation.received.len();
            conversation.received.truncate(most.saturating_sub(2));
            if let Some((_, last, _)) = conversation.received.last() {
                conversation.end = *last + silent;
            }
        }
        let real = Exactness {
            tolerance: Span::from_millis(20),
            ..EXACT
        };
        let (plan, link) = model(&[]);
        let mut twin = Twin::new(link, &plan.rings);
        let all: Vec<_> = seen.iter().map(|one| twin.follow(one, real)).collect();
        let missing = |one: &crate::twin::Comparison| Some(one.divergence.as_ref()?.what);
        let late = all.iter().any(|one| one.untimely.is_some());
        (all.iter().find_map(missing), late)
    };
    let soon = Span::from_millis(1);
    assert_eq!(compared(Span::from_millis(200), soon), (None, true));
    let long = Span::from_millis(60);
    let lost = compared(Span::ZERO, long);
    assert_eq!(lost, (Some(Symptom::Missing), false));
    let lost = compared(Span::from_millis(200), long);
    assert_eq!(lost.0, Some(Symptom::Missing));
}

/// A byte that was read late is late only where the bench had looked for it in time.
#[test]
fn a_byte_is_late_where_the_bench_had_looked_for_it() {
    let plan = entry("title x\nring 3\nread-byte 1 FE13\n").plan;
    let (_, mut link) = model(&[]);
    let seen = conversations(&plan, &mut link);
    let is_late = |moved: fn(Instant) -> Instant, unwatched: &[(u64, u64)]| {
        let mut seen = seen.clone();
        for conversation in &mut seen {
            for (_, at, _) in &mut conversation.received {
                *at = moved(*at);
            }
            let at = |ms| Instant::START + Span::from_millis(ms);
            let unwatched = unwatched.iter();
            conversation.unwatched = unwatched.map(|&(from, to)| (at(from), at(to))).collect();
            conversation.end = at(200);
        }
        let real = Exactness {
            tolerance: Span::from_millis(20),
            ..EXACT
        };
        let (plan, link) = model(&[]);
        let mut twin = Twin::new(link, &plan.rings);
        let mut all = seen.iter().map(|one| twin.follow(one, real));
        all.any(|one| one.untimely.is_some())
    };
    let late = |at| at + Span::from_millis(60);
    assert!(is_late(late, &[]));
    assert!(!is_late(late, &[(0, 80)]));
    assert!(is_late(late, &[(40, 80)]));
    assert!(is_late(late, &[(0, 30)]));
}
