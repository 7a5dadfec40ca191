//! Files that were written are read as they were.

use crate::language::read::RingScenario;
use crate::report::csv;
use crate::report::vcd;
use crate::simulate::simulated;
use harness_bench::capture::{Capture, read};
use harness_bench::link::Link as _;
use harness_bench::report::pcapng::{self, name};
use harness_bench::report::vcd::Signals;
use harness_bench::scenario::run::{AtMismatch, play};
use harness_bench::scenario::source::Source;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte, Trace};
use std::fmt::Write as _;

/// A scenario's run.
pub(super) fn run(text: &str) -> Capture {
    let source = Source::from_bytes("test.scn".to_owned(), text.into()).expect("a text");
    let plan = RingScenario::new(source, None).expect("a scenario").plan;
    let mut link = simulated(&plan);
    play(&plan, &mut link, AtMismatch::GoOn);
    Capture {
        rate: plan.rate,
        traces: (0..plan.rings.len()).map(|ring| link.trace(ring)).collect(),
        listened: None,
        timed: true,
    }
}

/// A built-in scenario's text.
pub(super) fn text(name: &str) -> String {
    let root = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../corpora/scenarios/novobus"
    );
    std::fs::read_to_string(format!("{root}/{name}.scn")).expect("a scenario")
}

/// A built-in scenario's run.
pub(super) fn built_in(name: &str) -> Capture {
    run(&text(name))
}

pub(super) fn pcapng(capture: &Capture) -> Vec<u8> {
    let mut bytes = Vec::new();
    pcapng::write(&capture.traces, capture.rate, &mut bytes).expect("a Vec");
    bytes
}

/// Every kind of damage on the link between two drives, every byte a telegram of its own.
pub(super) const DAMAGED: &str = "title damage\nring 2\n\
    ! 1->0 byte 3: flip 2\n! 1->0 byte 5: flip p\n! 1->0 byte 7: flip s\n! 1->0 byte 9: break 300us\n\
    ! 1->0 byte 12: overrun\n! 1->0 byte 14: drop\n! 1->0 byte 16: insert 55\n! 1->0 byte 18: replace 81\n\
    ! 1->0 byte 20: duplicate\n> 80*30\n";

/// A line for each link: its name, and what was received.
fn shown(capture: &Capture) -> String {
    let mut text = String::new();
    for (ring, trace) in capture.traces.iter().enumerate() {
        for channel in &trace.channels {
            let _infallible = write!(text, "{}:", name(ring, channel));
            for byte in channel.octets() {
                let mark = match byte.error {
                    None => "",
                    Some(LineError::Parity) => "p",
                    Some(LineError::Framing) => "f",
                    Some(LineError::Break) => "b",
                    Some(LineError::Overrun) => "o",
                };
                let byte = byte.received.unwrap_or_default();
                let _infallible = write!(text, " {byte:02X}{mark}");
            }
            text.push('\n');
        }
    }
    text
}

/// Our own VCD and csv, read again: what the receiver saw survives.
#[test]
fn our_own_files_survive() {
    let byte = |place: u64, received, error| {
        let at = Instant::START + Rate::Baud38400.byte_time() * (place + 1);
        LineByte::seen(at, Some(0x88), received, error)
    };
    let line = vec![
        byte(0, Some(0x88), None),
        byte(1, Some(0x89), Some(LineError::Parity)),
        byte(2, Some(0x88), Some(LineError::Framing)),
        byte(4, Some(0x00), Some(LineError::Break)),
        byte(7, None, None),
        byte(9, Some(0x88), None),
    ];
    let mut trace = Trace::empty(2);
    trace.channels = vec![
        Channel::of_octets(None, Some(1), line.clone()),
        Channel::of_octets(Some(1), Some(0), line),
        Channel::of_octets(Some(0), None, Vec::new()),
    ];
    let traces = [trace.clone(), trace];
    for signals in [Signals::All, Signals::Lines] {
        let mut file = Vec::new();
        vcd::write(&traces, Rate::Baud38400, signals, &mut file).expect("a Vec");
        let found = read(&file, None).expect("a capture");
        let ring = "master->1: 88 89p 88f 00b 88\n1->0: 88 89p 88f 00b 88\n0->master:\n";
        let other = "2:master->1: 88 89p 88f 00b 88\n2:1->0: 88 89p 88f 00b 88\n2:0->master:\n";
        assert_eq!(shown(&found), format!("{ring}{other}"));
        // Times are drawn in steps of 100 ns.
        let at = found.traces[0].channels[0].octets()[0].at;
        let expected = Instant::START + Rate::Baud38400.byte_time();
        assert!(at.since(expected).max(expected.since(at)) <= Span::from_nanos(100));
    }
    let capture = Capture {
        rate: Rate::Baud38400,
        traces: traces.to_vec(),
        listened: None,
        timed: true,
    };
    let mut file = Vec::new();
    csv::write(&traces, &mut file).expect("a Vec");
    // A link without a byte leaves no row.
    let mut expected = capture;
    for trace in &mut expected.traces {
        trace.channels.pop();
    }
    let found = read(&file, Some(Rate::Baud38400)).expect("a capture");
    for (found, expected) in found.traces.iter().zip(&expected.traces) {
        for (found, expected) in found.channels.iter().zip(&expected.channels) {
            let cut = |byte: &LineByte| {
                (
                    byte.at.since_start().as_nanos(),
                    byte.sent,
                    byte.received,
                    byte.error,
                )
            };
            let both =
                [found, expected].map(|link| link.octets().iter().map(cut).collect::<Vec<_>>());
            assert_eq!(both[0], both[1]);
        }
    }
    assert_eq!(found.traces.len(), 2);
}
