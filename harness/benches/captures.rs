//! How fast captures of a million bytes are written and read, in bytes of the line a second, beside a baseline that only walks
//! the same bytes and copies them; and the picture of the 100-axis run (ND21 9.7).

use divan::counter::ItemsCount;
use harness::buses::novobus::report::csv;
use harness::buses::novobus::report::svg::{RowPlacing, SvgOptions, svg};
use harness::buses::novobus::report::vcd;
use harness::buses::novobus::report::vcd::Signals;
use harness::capture::read;
use harness::report::pcapng;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::Instant;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use std::io::Write;

/// Bytes on all links together.
const BYTES: usize = 1_000_000;

fn main() {
    divan::main();
}

/// A ring of three with a million bytes of telegrams on its four links; one byte in a thousand is damaged.
fn million() -> Vec<Trace> {
    let telegram = [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1, 0x80, 0x80];
    let byte_time = Rate::Baud38400.byte_time();
    let links = (0..4_u8).map(|place| {
        let mut at = Instant::START + byte_time * u64::from(place);
        let bytes = (0..BYTES / 4).map(|index| {
            at += byte_time;
            let byte = telegram[index % telegram.len()];
            let error = (index % 1_000 == 999).then_some(LineError::Parity);
            LineByte::seen(
                at,
                Some(byte),
                Some(byte ^ u8::from(error.is_some())),
                error,
            )
        });
        let from = 3_u8.checked_sub(place).filter(|drive| *drive < 3);
        Channel::of_octets(from, 2_u8.checked_sub(place), bytes.collect())
    });
    vec![Trace {
        channels: links.collect(),
        ..Trace::empty(3)
    }]
}

/// The baseline: the same bytes, copied as they are.
#[divan::bench(sample_count = 10)]
fn copied(bencher: divan::Bencher<'_, '_>) {
    let traces = million();
    bencher.counter(ItemsCount::new(BYTES)).bench_local(|| {
        let mut out = Vec::new();
        for byte in traces[0].channels.iter().flat_map(Channel::octets) {
            let nanos = byte.at.since_start().as_nanos().to_le_bytes();
            let put = out.write_all(&nanos).and_then(|()| {
                let bytes = [byte.sent.unwrap_or(0), byte.received.unwrap_or(0)];
                out.write_all(&bytes)
            });
            put.expect("a Vec takes everything");
        }
        out
    });
}

#[divan::bench(sample_count = 10)]
fn pcapng_written(bencher: divan::Bencher<'_, '_>) {
    let traces = million();
    bencher.counter(ItemsCount::new(BYTES)).bench_local(|| {
        let mut out = Vec::new();
        pcapng::write(&traces, Rate::Baud38400, &mut out).expect("a Vec takes everything");
        out
    });
}

#[divan::bench(sample_count = 10)]
fn pcapng_read(bencher: divan::Bencher<'_, '_>) {
    let mut file = Vec::new();
    pcapng::write(&million(), Rate::Baud38400, &mut file).expect("a Vec takes everything");
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| read(&file, None).expect("a capture"));
}

#[divan::bench(args = [true, false], sample_count = 10)]
fn vcd_written(bencher: divan::Bencher<'_, '_>, vectors: bool) {
    let traces = million();
    let signals = if vectors {
        Signals::All
    } else {
        Signals::Lines
    };
    bencher.counter(ItemsCount::new(BYTES)).bench_local(|| {
        let mut out = Vec::new();
        vcd::write(&traces, Rate::Baud38400, signals, &mut out).expect("a Vec takes everything");
        out
    });
}

/// The levels of the lines, decoded.
#[divan::bench(sample_count = 5)]
fn vcd_read(bencher: divan::Bencher<'_, '_>) {
    let mut file = Vec::new();
    vcd::write(&million(), Rate::Baud38400, Signals::Lines, &mut file).expect("a Vec");
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| read(&file, None).expect("a capture"));
}

#[divan::bench(sample_count = 5)]
fn csv_read(bencher: divan::Bencher<'_, '_>) {
    let mut file = Vec::new();
    csv::write(&million(), &mut file).expect("a Vec");
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| read(&file, None).expect("a capture"));
}

#[divan::bench(sample_count = 10)]
fn csv_written(bencher: divan::Bencher<'_, '_>) {
    let traces = million();
    bencher.counter(ItemsCount::new(BYTES)).bench_local(|| {
        let mut out = Vec::new();
        csv::write(&traces, &mut out).expect("a Vec takes everything");
        out
    });
}

/// The picture of the 100-axis parity error and its check sequence, 7777 bytes on 101 links.
#[divan::bench(args = ["index", "time"])]
fn picture(bencher: divan::Bencher<'_, '_>, scale: &str) {
    let traces = hundred();
    let options = SvgOptions {
        title: "100 axes",
        id: "ring",
        scale: if scale == "time" {
            RowPlacing::Time
        } else {
            RowPlacing::Index
        },
        rate: Rate::Baud38400,
        rows: None,
    };
    bencher.bench_local(|| svg(&traces, &options));
}

fn hundred() -> Vec<Trace> {
    use harness::library::Entry;
    use harness::link::Link;
    use harness::scenario::source::Source;
    let text = include_str!("../../corpora/scenarios/novobus/9.8-check-sequence.scn");
    let source = Source::from_bytes("9.8".to_owned(), text.into()).expect("a text");
    let entry = Entry::new(source, None).expect("a scenario");
    let plan = entry.plan.expect("novobus");
    let mut link = harness::buses::novobus::simulate::simulated(&plan);
    harness::scenario::run::run(&plan, &mut link);
    vec![link.trace(0)]
}
