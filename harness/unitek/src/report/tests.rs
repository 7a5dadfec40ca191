//! Frames that were written are read as they were.

use super::FrameReport;
use harness_bench::capture::{Capture, read};
use harness_bench::shown::{FileForm, SegmentReport as _, ShownRun};
use harness_proto::can::{BitRate, CanError, Frame};
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, FrameEnd, LineFrame, Trace};

/// Every kind of frame and of end, at times in nanoseconds.
fn every_kind() -> Capture {
    let kinds = [
        (None, "201#3D4000", FrameEnd::Good),
        (Some(1), "181#40810100", FrameEnd::Good),
        (Some(2), "182#", FrameEnd::Lost),
        (None, "1FFFFFFF#R8", FrameEnd::Good),
        (None, "201#R", FrameEnd::Good),
        (
            None,
            "201#0011223344556677",
            FrameEnd::Error(CanError::ErrorFrame),
        ),
        (
            Some(1),
            "00000181#AA",
            FrameEnd::Error(CanError::NoAcknowledge),
        ),
    ];
    let frames = kinds
        .into_iter()
        .zip(1..)
        .map(|((from, text, ended), number)| {
            let frame: Frame = text.parse().expect("a frame");
            let at = Instant::START + Span::from_nanos(number * 1_000_001);
            LineFrame {
                from,
                start: at - BitRate::K500.time_of(frame.wire_bits()),
                at,
                frame,
                ended,
            }
        });
    Capture {
        rate: Rate::default(),
        traces: vec![Trace {
            channels: vec![Channel::of_frames(frames.collect())],
            ..Trace::empty(2)
        }],
        listened: None,
        timed: true,
    }
}

fn written(capture: &Capture, form: FileForm) -> Vec<u8> {
    let mut bytes = Vec::new();
    let run = ShownRun {
        title: "",
        traces: &capture.traces,
        records: &[],
        rate: capture.rate,
    };
    let written = FrameReport.write(&run, form, &mut bytes);
    written.expect("a Vec");
    bytes
}

#[test]
fn json_survives() {
    let capture = every_kind();
    let bytes = written(&capture, FileForm::Json);
    assert_eq!(read(&bytes, None), Ok(capture));
}

#[test]
fn a_candump_log_survives_but_for_what_it_cannot_hold() {
    let capture = every_kind();
    let again = read(&written(&capture, FileForm::Candump), None).expect("a capture");
    let frames = |capture: &Capture| capture.traces[0].channels[0].frames().to_vec();
    let good = frames(&capture)
        .into_iter()
        .filter(|frame| frame.ended == FrameEnd::Good);
    let good: Vec<_> = good.map(|frame| frame.frame).collect();
    let read: Vec<_> = frames(&again).iter().map(|frame| frame.frame).collect();
    assert_eq!(read, good);
}
