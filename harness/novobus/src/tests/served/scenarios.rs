//! Scenarios over sockets and pseudo terminals against rings that are served: the same files, the
//! same verdicts as on the simulator.

use super::ServedRings;
use crate::language::read::RingScenario;
use crate::language::run::over_bus::{play_over_bus, start_anew};
use crate::simulate::simulated;
use crate::stream::StreamLink;
use crate::tests::built_in_sources;
use harness_bench::link::{Line, Octets, PortLink as _};
use harness_bench::port::PortAddress;
use harness_bench::scenario::run::{AtMismatch, Outcome, lacks, run};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::novobus::drive::Model;
use std::collections::BTreeMap;
use std::io::Write;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;

fn link(served: &ServedRings, sizes: &[u8], marks: bool) -> StreamLink {
    let wires = sizes.iter().enumerate();
    let wires = wires.map(|(ring, size)| (served.wire(ring, marks), *size));
    StreamLink::new(wires.collect(), Vec::new(), Rate::default(), Arc::default())
}

fn play_on(link: &mut StreamLink, entry: &RingScenario) -> Outcome {
    let plan = &entry.plan;
    if lacks(plan, link).is_none() {
        start_anew(link, &plan.rings).unwrap_or_else(|why| panic!("{}: {why}", entry.source.name));
    }
    play_over_bus(plan, link, AtMismatch::Stop)
}

/// How often a scenario is played whose bytes are right and some late, as a rig plays it.
const MOST_UNTIMELY: usize = 3;

/// Plays a scenario, and again where it did not pass: the computer may have stood still, here or in the thread that serves the ring.
fn play_again_on(link: &mut StreamLink, entry: &RingScenario) -> Outcome {
    let mut outcome = play_on(link, entry);
    for _ in 1..MOST_UNTIMELY {
        if matches!(outcome.verdict, Verdict::Passed | Verdict::Skipped) {
            break;
        }
        outcome = play_on(link, entry);
    }
    outcome
}

/// Every built-in scenario, by its model and the sizes of its rings.
fn by_rings() -> BTreeMap<(&'static str, Vec<u8>), Vec<RingScenario>> {
    let mut all: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for source in built_in_sources() {
        let entry = RingScenario::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
        let plan = &entry.plan;
        if plan.rate == Rate::default() && plan.rings[0].drives() < 100 {
            let sizes = plan.rings.iter().map(|ring| ring.drives()).collect();
            let model = if plan.model(0, 0) == Model::Plain {
                "plain"
            } else {
                "nd21"
            };
            all.entry((model, sizes)).or_default().push(entry);
        }
    }
    all
}

/// What a ring does not show beside the bus, or only in an answer that takes longer than the line is exact.
const INCONCLUSIVE: [&str; 5] = [
    "14.10.5-prog-param",
    "14.10.6.2-time-basis",
    "14.10.6.5-scope-status",
    "9.2-empty-short-telegram",
    "9.3-address-byte",
];

/// How long a conversation is that is played with every change. The others wait for the drives' motion and EEPROM.
const SHORT: Span = Span::from_millis(50);

/// Any conversation.
const LONG: Span = Span::from_millis(600_000);

/// Whether a scenario takes no longer than this.
fn is_within(entry: &RingScenario, longest: Span) -> bool {
    let plan = &entry.plan;
    longest == LONG || run(plan, &mut simulated(plan)).took <= longest
}

/// Plays all that fits rings of up to `largest` drives and takes no longer than `longest`, and says how many passed.
fn all_that_fit(transport: &str, marks: bool, largest: u8, longest: Span) -> usize {
    let mut passed = 0;
    let mut wrong = Vec::new();
    for ((model, sizes), entries) in by_rings() {
        if sizes.iter().any(|size| *size > largest) {
            continue;
        }
        let setup: String = ["", "2:"]
            .iter()
            .zip(&sizes)
            .map(|(ring, _)| match model {
                "plain" => format!("drive {ring}0..last model plain\n"),
                _ => format!("drive {ring}0..last input GPIN3 GPIN5 high\n"),
            })
            .collect();
        let served = ServedRings::start(&setup, &sizes, transport, marks, Vec::new());
        let mut link = link(&served, &sizes, marks);
        for entry in entries
            .into_iter()
            .filter(|entry| is_within(entry, longest))
        {
            let outcome = play_again_on(&mut link, &entry);
            match outcome.verdict {
                Verdict::Passed => passed += 1,
                Verdict::Skipped => {}
                // It begins with the outputs as they are after power-up, which a reset leaves as they are.
                Verdict::Failed if entry.short_name() == "10.2-read-back" => {}
                // The header sets a cell that the drive writes by itself.
                Verdict::Inconclusive if outcome.unready.is_some() => {}
                Verdict::Inconclusive if INCONCLUSIVE.contains(&entry.short_name()) => {}
                verdict => wrong.push(format!(
                    "{}: {verdict} {:?}",
                    entry.source.name, outcome.finding
                )),
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    passed
}

#[test]
fn over_a_socket_with_marks() {
    let passed = all_that_fit("tcp", true, 10, SHORT);
    assert!(passed >= 24, "{passed}");
}

#[test]
fn over_a_socket() {
    let passed = all_that_fit("tcp", false, 2, SHORT);
    assert!(passed >= 6, "{passed}");
}

#[test]
fn over_a_pty_with_marks() {
    let passed = all_that_fit("pty", true, 2, SHORT);
    assert!(passed >= 6, "{passed}");
}

#[test]
fn over_a_pty() {
    let passed = all_that_fit("pty", false, 6, SHORT);
    assert!(passed >= 18, "{passed}");
}

#[test]
#[ignore = "takes two minutes; .ci/nightly runs it"]
fn long_ones_over_a_socket_with_marks_and_a_pty_without() {
    let passed = all_that_fit("tcp", true, 10, LONG);
    assert!(passed >= 24, "{passed}");
    let passed = all_that_fit("pty", false, 6, LONG);
    assert!(passed >= 18, "{passed}");
}

/// Edge-triggered: unread bytes do not end a `wait` twice, so a caller that fetches nothing sleeps. After a byte was fetched, `wait` returns
/// at once if another one is there.
#[test]
fn bytes_that_lie_there_are_no_news() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let wires = vec![(super::wire(&PortAddress::Tcp(address), false), 1)];
    let (mut far, _) = listener.accept().expect("a client");
    let mut link = StreamLink::new(wires, Vec::new(), Rate::default(), Arc::default());
    far.write_all(&[0x80; 8]).expect("room");
    let until = link.now() + Span::from_millis(300);
    while link.now() < until && link.wait(until) {}
    let looks = link.beats().load(Ordering::Relaxed);
    assert!(looks < 50, "{looks} looks at the port in 300 ms");
    for left in (0..8).rev() {
        assert!(link.receive_octet(0).is_some(), "{left} bytes behind it");
        if left > 0 {
            let before = link.beats().load(Ordering::Relaxed);
            link.wait(link.now() + Span::from_millis(10_000));
            assert_eq!(link.beats().load(Ordering::Relaxed), before + 1);
        }
    }
}
