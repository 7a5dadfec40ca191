//! Files that were written are read as they were.

use crate::report::csv;
use crate::report::vcd::{self, Signals};
use harness_bench::capture::{Capture, read};
use harness_bench::report::pcapng::name;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte, Trace};
use std::fmt::Write as _;

/// A line for each link: its name, and what was received.
fn shown(capture: &Capture) -> String {
    let mut text = String::new();
    for (ring, trace) in capture.traces.iter().enumerate() {
        for channel in &trace.channels {
            let _infallible = write!(text, "{}:", name(ring, channel));
            for own in channel.octets() {
                let mark = match own.error {
                    None => "",
                    Some(LineError::Parity) => "p",
                    Some(LineError::Framing) => "f",
                    Some(LineError::Break) => "b",
                    Some(LineError::Overrun) => "o",
                };
                let byte = own.received.unwrap_or_default();
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
            let cut = |own: &LineByte| {
                (
                    own.at.since_start().as_nanos(),
                    own.sent,
                    own.received,
                    own.error,
                )
            };
            let both =
                [found, expected].map(|own| own.octets().iter().map(cut).collect::<Vec<_>>());
            assert_eq!(both[0], both[1]);
        }
    }
    assert_eq!(found.traces.len(), 2);
}
