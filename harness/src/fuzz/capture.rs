//! The body of a fuzz target: any bytes, as a file.

use crate::buses::novobus::capture::diff::{ComparedRun, diff};
use crate::buses::novobus::capture::scenario::{JudgeOptions, scenario};
use crate::buses::novobus::report::{csv, json, svg, vcd};
use crate::capture::{ReadSettings, read, read_with};
use crate::report::pcapng;
use harness_proto::time::Span;

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
    let mut written = Vec::new();
    let put = pcapng::write(&taken.traces, taken.rate, &mut written);
    assert!(put.is_ok(), "a Vec takes everything");
    match read(&written, Some(taken.rate)) {
        // Small times are relative to the start; large ones are times since 1970.
        Ok(again) if taken.end().since_start() < Span::from_millis(86_400_000) => {
            let (left, right) = (
                ComparedRun {
                    name: "read",
                    capture: &taken,
                },
                ComparedRun {
                    name: "written",
                    capture: &again,
                },
            );
            let same = diff(left, right, Span::ZERO);
            assert!(same.same(), "{}", same.show("read", "written"));
        }
        Ok(_) => {}
        Err(error) => assert_eq!(taken.traces.len(), 0, "{error}"),
    }
    let mut sink = std::io::sink();
    let shown = csv::write(&taken.traces, &mut sink)
        .and_then(|()| json::write(&taken.traces, &[], &mut sink))
        .and_then(|()| vcd::write(&taken.traces, taken.rate, vcd::Signals::All, &mut sink));
    assert!(shown.is_ok(), "a sink takes everything");
    let picture = svg::svg(
        &taken.traces,
        &svg::SvgOptions {
            title: "any",
            id: "any",
            scale: svg::RowPlacing::Time,
            rate: taken.rate,
            rows: None,
        },
    );
    assert!(
        picture.len() < 3_000_000,
        "a picture of {} bytes",
        picture.len()
    );
    let options = JudgeOptions {
        title: "any",
        setup: None,
        tolerance: Span::ZERO,
    };
    if let Ok(text) = scenario(&taken, &options) {
        assert!(!text.is_empty());
    }
}
