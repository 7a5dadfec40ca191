//! The body of a fuzz target: any bytes, as a file.

use crate::buses::carrier;
use crate::capture::{Carries, JudgeOptions, ReadSettings, read, read_with};
use crate::report::pcapng;
use crate::report::vcd::Signals;
use crate::shown::{FileForm, RowPlacing, ShownRun};
use harness_proto::time::Span;
use std::io::ErrorKind;

/// The longest input that is looked at.
const LONGEST: usize = 65_536;

/// Any bytes are a capture or a reason why not; a capture can be written and is read back as it was, can be shown and made
/// into a scenario.
///
/// # Panics
/// Something that was written is not read back.
pub fn capture(data: &[u8]) {
    let data = &data[..data.len().min(LONGEST)];
    // What the kernel says of a CAN interface, and a frame of one.
    let _any = harness_socketcan::State::parse(data);
    if let Some(frame) = data.first_chunk() {
        harness_socketcan::decode(frame, &mut |_| {});
    }
    // The user may say what a channel or an interface is.
    for link in ["bus", "1->0=0"] {
        let settings = ReadSettings {
            links: link.parse().into_iter().collect(),
            ..ReadSettings::default()
        };
        let _any = read_with(data, &settings);
    }
    let taken = match read(data, None) {
        Ok(taken) => taken,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    // What is written is not longer than some tens of bytes for each byte read: nothing here grows without bound.
    assert!(taken.bytes() <= data.len(), "more bytes than the file has");
    let bus = carrier(Carries::of(&taken.traces));
    let report = bus.report;
    let mut written = Vec::new();
    let put = pcapng::write(&taken.traces, taken.rate, &mut written);
    assert!(put.is_ok(), "a Vec takes everything");
    match read(&written, Some(taken.rate)) {
        // Small times are relative to the start; large ones are times since 1970.
        Ok(again) if taken.end().since_start() < Span::from_millis(86_400_000) => {
            let names = ["read", "written"];
            let (same, text) = report.difference([&taken, &again], Span::ZERO, names);
            assert!(same, "{text}");
        }
        Ok(_) => {}
        Err(error) => assert_eq!(taken.traces.len(), 0, "{error}"),
    }
    let run = ShownRun {
        title: "any",
        traces: &taken.traces,
        records: &[],
        rate: taken.rate,
    };
    let forms = [
        FileForm::Csv,
        FileForm::Json,
        FileForm::Candump,
        FileForm::Vcd(Signals::All),
        FileForm::Svg(RowPlacing::Time, None),
    ];
    for form in forms {
        let is_picture = matches!(form, FileForm::Svg(..));
        let mut file = Vec::new();
        match report.write(&run, form, &mut file) {
            Ok(()) => {}
            Err(error) => assert_eq!(error.kind(), ErrorKind::Unsupported, "{error}"),
        }
        let length = file.len();
        assert!(
            !is_picture || length < 3_000_000,
            "a picture of {length} bytes"
        );
    }
    let options = JudgeOptions {
        title: "any",
        ..JudgeOptions::default()
    };
    if let Ok(text) = (bus.replayed)(&taken, &options) {
        assert!(!text.is_empty());
    }
}
