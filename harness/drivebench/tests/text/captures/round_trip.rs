//! A written capture is read back unchanged: bytes, times, line status, on every link.

use super::{DAMAGED, built_in, pcapng, root, run, written};
use harness::buses::novobus::BUS;
use harness::capture::{Capture, read};
use harness::shown::FileForm;
use harness_proto::line::{LineError, Rate};
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Times are written in nanoseconds, cut off below.
fn assert_same(left: &Capture, right: &Capture) {
    assert_eq!(left.rate, right.rate);
    assert_eq!(left.traces.len(), right.traces.len());
    for (left, right) in left.traces.iter().zip(&right.traces) {
        assert_eq!(left.stations, right.stations);
        assert_eq!(left.channels.len(), right.channels.len());
        for (left, right) in left.channels.iter().zip(&right.channels) {
            assert_eq!((left.from, left.to), (right.from, right.to));
            let what = |byte: &LineByte| {
                let at = byte.at.since_start().as_nanos();
                (at, byte.sent, byte.received, byte.error)
            };
            let bytes = |link: &Channel| link.octets().iter().map(what).collect::<Vec<_>>();
            assert_eq!(bytes(left), bytes(right));
        }
    }
}

#[test]
fn runs_are_read_back() {
    let two = "title two\nring 3, 2\n> 88 FE C0 13 FE D1\n2> 80*5\n! 2:1->0 byte 3: flip 1\n";
    let slow = "title slow\nring 2\nline 9600\n> 80*5\n";
    let runs = [
        run(DAMAGED),
        run(two),
        run(slow),
        built_in("9.7-parity-error"),
        built_in("9.8-check-sequence"),
    ];
    for capture in runs {
        assert_same(&capture, &read(&pcapng(&capture), None).expect("a capture"));
        let again = read(&written(&capture, FileForm::Json, ""), None).expect("a capture");
        assert_same(&capture, &again);
        // What drives remarked is in the JSON, so that tables and pictures stay as they are.
        let marks = |capture: &Capture| {
            let all = capture.traces[0].remarks.iter();
            let detected = all.filter(|mark| mark.marks().contains(Marks::DETECTED));
            detected
                .map(|mark| (mark.station, mark.piece, mark.cause()))
                .collect::<Vec<_>>()
        };
        assert_eq!(marks(&again), marks(&capture));
    }
}

/// Rings with any bytes at any times.
fn captures() -> impl Strategy<Value = Capture> {
    let byte = (
        any::<Option<u8>>(),
        any::<Option<u8>>(),
        0..5_usize,
        0..3_000_000_u64,
    );
    let links = proptest::collection::vec(proptest::collection::vec(byte, 0..20), 2..7);
    let rings = proptest::collection::vec(links, 1..3);
    (rings, 0..3_usize).prop_map(|(rings, rate)| Capture {
        rate: Rate::ALL[rate],
        traces: rings.into_iter().map(trace).collect(),
        listened: None,
        timed: true,
    })
}

type Any = (Option<u8>, Option<u8>, usize, u64);

fn trace(links: Vec<Vec<Any>>) -> Trace {
    const ERRORS: [Option<LineError>; 5] = [
        None,
        Some(LineError::Parity),
        Some(LineError::Framing),
        Some(LineError::Break),
        Some(LineError::Overrun),
    ];
    let drives = u8::try_from(links.len() - 1).expect("few");
    let end = |place: usize| drives.checked_sub(u8::try_from(place).expect("few"));
    let links = links.into_iter().enumerate().map(|(place, bytes)| {
        let mut at = Instant::START;
        let bytes = bytes.into_iter().map(|(sent, received, error, gap)| {
            at += Span::from_units(gap);
            let error = received.and(ERRORS[error]);
            LineByte::seen(at, sent, received, error)
        });
        let from = end(place).filter(|drive| *drive < drives);
        Channel::of_octets(from, end(place + 1), bytes.collect())
    });
    Trace {
        channels: links.collect(),
        ..Trace::empty(drives)
    }
}

#[test]
fn anything_is_read_back() {
    let config = Config {
        cases: 300,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(250),
        ..Config::default()
    };
    let mut runner = TestRunner::new(config);
    let result = runner.run(&captures(), |capture| {
        let rate = Some(capture.rate);
        let again = read(&pcapng(&capture), rate).expect("a capture");
        assert_same(&capture, &again);
        assert_same(
            &capture,
            &read(&written(&capture, FileForm::Json, ""), rate).expect("a capture"),
        );
        let sides = [&capture, &again];
        let (same, text) = BUS
            .report
            .difference(sides, Span::from_nanos(1), ["a", "b"]);
        assert!(same, "{text}");
        Ok(())
    });
    result.unwrap_or_else(|error| {
        panic!("{error}; repeat with: cargo test --test text anything_is_read_back")
    });
}

/// A capture of another program: the high byte first, microseconds since 1970, unknown blocks and options, several bytes a packet.
#[test]
fn captures_of_others_are_read() {
    let path = root().join("corpora/captures/big-endian.pcapng");
    let capture = read(&std::fs::read(path).expect("a file"), None).expect("a capture");
    assert_eq!(capture.rate, Rate::Baud19200);
    let trace = &capture.traces[0];
    assert_eq!((trace.stations, trace.channels.len()), (1, 2));
    let received: Vec<_> = trace.channels[0]
        .octets()
        .iter()
        .map(|byte| byte.received)
        .collect();
    assert_eq!(received, [0x80, 0x81, 0x80].map(Some));
    let last = trace.channels[1].octets();
    assert_eq!(
        (last[0].received, last[0].error),
        (Some(0), Some(LineError::Break))
    );
    // The first byte takes its time from the start on.
    assert_eq!(
        trace.channels[0].octets()[0].at.since_start().as_nanos(),
        572_916
    );
}
