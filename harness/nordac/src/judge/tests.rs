//! Right slaves are never accused, whatever the value of an open point; wrong ones are.

use super::judge;
use super::line::JudgedSlaves;
use crate::language::Nordac;
use harness_bench::capture::runs::{octet_time, octets, runs};
use harness_bench::scenario::files::sources;
use harness_bench::scenario::run::AtMismatch;
use harness_bench::scenario::settled::{BenchSize, settle};
use harness_bench::scenario::source::Source;
use harness_proto::nordac::properties::{Choices, PROPERTIES};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::deviation::DEVIATIONS;
use harness_sim::record::{LineByte, Trace};
use std::collections::BTreeSet;

const BUS: &str = "bus     nordac\n";

/// What a capture does not show: power, telegrams that were exchanged on the way, and slaves and masters that deviate.
const UNSEEN: [&str; 7] = [
    "restart",
    ": off",
    ": on",
    ": doubled",
    ": former",
    "deviates",
    ": lost",
];

pub(super) fn scenarios() -> Vec<Source> {
    let all = sources(&[]).expect("built-in scenarios");
    let seen = |source: &Source| UNSEEN.iter().all(|word| !source.text.contains(word));
    let all = all.into_iter();
    all.filter(|source| source.text.contains(BUS) && seen(source))
        .collect()
}

/// The telegrams of a scenario with these lines in its header.
pub(super) fn trace(source: &Source, lines: &str) -> Trace {
    // Lines about slaves stand after those that make them.
    let begin = source.text.find("\nslave ").map(|at| at + 1);
    let end = begin.map(|at| {
        let rest = &source.text[at..];
        let header = rest
            .split_inclusive('\n')
            .take_while(|line| line.starts_with("slave "));
        at + header.map(str::len).sum::<usize>()
    });
    let mut text = source.text.to_string();
    text.insert_str(end.expect("a slave"), lines);
    let source = Source::from_bytes(source.name.clone(), text.into_bytes()).expect("a text");
    let found = settle::<Nordac>(&source, BenchSize::Own);
    let (_, plan) = found.unwrap_or_else(|problems| panic!("{:#?}", problems.all()));
    let mut link = plan.simulate();
    plan.play(&mut *link, AtMismatch::GoOn);
    link.trace(0)
}

/// The same telegrams after a token that the master passes to itself, as a master alone on a line does: without it, the first octets of a
/// capture may be the end of a telegram.
fn behind_a_token(mut trace: Trace) -> Trace {
    let octets = octets(&trace);
    let octet = octet_time(octets.iter().map(|(from, octet)| (*from, octet)));
    let octet = octet.unwrap_or(Span::from_micros(22));
    let mut at = Instant::START;
    let token = [0xDC, 0x02, 0x02].map(|byte| {
        at += octet;
        LineByte::seen(at, Some(byte), Some(byte), None)
    });
    for channel in &mut trace.channels {
        let from = channel.from;
        let octets = channel.octets_mut().expect("a line of octets");
        octets.iter_mut().for_each(|seen| seen.at += octet * 20);
        if from.is_none() {
            octets.splice(..0, token);
        }
    }
    trace
}

/// What a trace shows from a time on.
pub(super) fn begun_at(trace: &Trace, at: Instant) -> Trace {
    let mut trace = trace.clone();
    for channel in &mut trace.channels {
        let octets = channel.octets_mut().expect("a line of octets");
        octets.retain(|octet| octet.at >= at);
    }
    trace
}

/// The slaves of a scenario.
fn slaves(source: &Source) -> BTreeSet<u8> {
    let lines = source.text.lines();
    let slaves = lines.filter_map(|line| line.strip_prefix("slave ")?.split(' ').next());
    slaves.filter_map(|address| address.parse().ok()).collect()
}

/// A line for each slave of a scenario, but for a property that it sets itself.
fn of_all(source: &Source, line: &str) -> String {
    let name = line.split(" = ").next().unwrap_or(line);
    if source.text.contains(name) {
        return String::new();
    }
    slaves(source)
        .iter()
        .map(|slave| format!("slave {slave} {line}\n"))
        .collect()
}

/// Judges captures of right slaves with every value of every open point: each of them in one scenario of `share`.
fn right_slaves(share: usize) -> usize {
    let mut lines = vec![String::new()];
    for property in PROPERTIES {
        let values: Vec<_> = match property.accepts {
            Choices::Words(words) => words[1..].iter().copied().map(str::to_owned).collect(),
            Choices::Count { .. } => vec!["1".to_owned(), "4".to_owned()],
        };
        lines.extend(
            values
                .iter()
                .map(|value| format!("property {} = {value}", property.name)),
        );
    }
    let mut compared = 0;
    for (place, source) in scenarios().into_iter().enumerate() {
        for (number, line) in lines.iter().enumerate() {
            if number > 0 && !(place + number).is_multiple_of(share) {
                continue;
            }
            let header = if line.is_empty() {
                String::new()
            } else {
                of_all(&source, line)
            };
            if header.is_empty() && !line.is_empty() {
                continue;
            }
            let trace = trace(&source, &header);
            let octets = octets(&trace);
            let at = octets[(7 * place + 13 * number) % octets.len()].1.at;
            let begun = begun_at(&trace, at);
            for trace in [trace.clone(), begun, behind_a_token(trace)] {
                let judged = judge(&trace, &[], Span::ZERO);
                assert!(
                    judged.breaches.is_empty(),
                    "{} {line}\n{:#?}",
                    source.name,
                    judged.breaches
                );
                compared += judged.compared;
            }
        }
    }
    compared
}

/// The same with a gap in front of a telegram, and with this number of telegrams lost in it.
fn with_gap(trace: &Trace, place: usize, lost: usize) -> Trace {
    let runs = runs(trace);
    let at = |place: usize| {
        runs.get(place)
            .map_or(Instant::NEVER, |run| run.octets[0].at)
    };
    let (begin, end) = (at(place), at(place + lost));
    let mut trace = trace.clone();
    for channel in &mut trace.channels {
        let octets = channel.octets_mut().expect("a line of octets");
        octets.retain(|octet| octet.at < begin || octet.at >= end);
        let later = octets.iter_mut().filter(|octet| octet.at >= end);
        later.for_each(|octet| octet.at += Span::from_millis(3_600_000));
    }
    trace
}

/// Judges captures of right slaves that have a gap in front of each telegram: in one scenario of `share`.
fn slaves_across_gaps(share: usize) {
    for source in scenarios().iter().step_by(share) {
        let trace = behind_a_token(trace(source, ""));
        for place in 2..runs(&trace).len() {
            for lost in [0, 1, 3] {
                let judged = judge(&with_gap(&trace, place, lost), &[], Span::ZERO);
                assert_eq!(
                    judged.breaches,
                    [],
                    "{} at {place}, {lost} lost",
                    source.name
                );
            }
        }
    }
}

/// A clock that was set forward, a log that was paused, frames that the logger lost.
#[test]
fn no_right_slave_is_accused_across_a_gap() {
    slaves_across_gaps(150);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn no_right_slave_is_accused_across_many_gaps() {
    slaves_across_gaps(4);
}

/// A wrong slave is found on either side of a gap.
#[test]
fn a_wrong_slave_is_accused_beside_a_gap() {
    let scenarios = scenarios();
    let found = |from_end: bool| {
        scenarios.iter().any(|source| {
            let trace = trace(source, &of_all(source, "deviates directions-exchanged"));
            let last = runs(&trace).len().saturating_sub(3);
            let place = if from_end { last } else { 3 };
            let judged = judge(&with_gap(&trace, place, 0), &[], Span::ZERO);
            let gap = |remark: &String| remark.starts_with("the log has a gap");
            last > 3 && !judged.breaches.is_empty() && judged.remarks.iter().any(gap)
        })
    };
    assert!(found(true) && found(false));
}

#[test]
fn no_right_slave_is_accused() {
    let compared = right_slaves(40);
    assert!(compared > 1_500, "{compared}");
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn no_right_slave_is_accused_in_any_scenario() {
    let compared = right_slaves(1);
    assert!(compared > 50_000, "{compared}");
}

/// Deviations that a capture alone does not show: they lie in what parameters, a plant or times decide, in a slave that is silent, or in what
/// octets lead to that the tap may have damaged itself.
const NOT_ACCUSED: usize = 65;

/// Those of them that no capture puts into doubt either: it passes.
const PASSED: usize = 53;

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn wrong_slaves_are_accused() {
    let scenarios = scenarios();
    let judged = |source: &Source, lines: &str| {
        // The shortest ones do not show that the slave is a NORDAC.
        let named: Vec<_> = slaves(source).into_iter().collect();
        judge(&behind_a_token(trace(source, lines)), &named, Span::ZERO)
    };
    let doubts = |judged: &JudgedSlaves| (judged.doubts.len(), judged.replies - judged.compared);
    let right: Vec<_> = scenarios
        .iter()
        .map(|scenario| doubts(&judged(scenario, "")))
        .collect();
    let (mut missed, mut passed) = (Vec::new(), Vec::new());
    for name in DEVIATIONS.all().map(|deviation| deviation.name) {
        let mut in_doubt = false;
        let accused = scenarios.iter().zip(&right).any(|(source, right)| {
            let judged = judged(source, &of_all(source, &format!("deviates {name}")));
            in_doubt |= doubts(&judged) != *right;
            !judged.breaches.is_empty()
        });
        if !accused {
            missed.push(name);
        }
        if !accused && !in_doubt {
            passed.push(name);
        }
    }
    assert_eq!(
        (missed.len(), passed.len()),
        (NOT_ACCUSED, PASSED),
        "{missed:?} {passed:?}"
    );
}

/// One wrong slave for each kind of rule.
#[test]
fn rules() {
    let scenarios = scenarios();
    for (name, section) in [
        ("executes-repetitions", "EN 1"),
        ("saps-exchanged", "EN 1"),
        ("answers-twice", "EN 1"),
        ("hides-prm-fault", "EN 2"),
        ("no-configuration", "EN 2"),
        ("never-enabled", "3.3"),
        ("directions-exchanged", "3.2.2"),
        ("answers-without-index", "3.4.2"),
        ("values-of-one-more", "3.4.3"),
        ("every-error-is-0", "3.4.1"),
    ] {
        let mut found = scenarios.iter().filter_map(|source| {
            let lines = of_all(source, &format!("deviates {name}"));
            judge(&trace(source, &lines), &[], Span::ZERO)
                .breaches
                .into_iter()
                .next()
        });
        let found = found.next().map(|breach| breach.section);
        assert_eq!(found, Some(section), "{name}");
    }
}
