//! How fast captures of a million bytes are written and read, in bytes of the line a second, beside a baseline that only walks
//! the same bytes and copies them; and the picture of the 100-axis run (ND21 9.7).

use divan::counter::ItemsCount;
use harness::buses::novobus::BUS;
use harness::capture::read;
use harness::report::pcapng;
use harness::report::vcd::Signals;
use harness::shown::{FileForm, RowPlacing, ShownRun};
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

fn written(traces: &[Trace], form: FileForm) -> Vec<u8> {
    let run = ShownRun {
        title: "100 axes",
        traces,
        records: &[],
        rate: Rate::Baud38400,
    };
    let mut out = Vec::new();
    let done = BUS.report.write(&run, form, &mut out);
    done.expect("a Vec takes everything");
    out
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
    let form = FileForm::Vcd(signals);
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| written(&traces, form.clone()));
}

/// The levels of the lines, decoded.
#[divan::bench(sample_count = 5)]
fn vcd_read(bencher: divan::Bencher<'_, '_>) {
    let file = written(&million(), FileForm::Vcd(Signals::Lines));
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| read(&file, None).expect("a capture"));
}

#[divan::bench(sample_count = 5)]
fn csv_read(bencher: divan::Bencher<'_, '_>) {
    let file = written(&million(), FileForm::Csv);
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| read(&file, None).expect("a capture"));
}

#[divan::bench(sample_count = 10)]
fn csv_written(bencher: divan::Bencher<'_, '_>) {
    let traces = million();
    bencher
        .counter(ItemsCount::new(BYTES))
        .bench_local(|| written(&traces, FileForm::Csv));
}

/// The picture of the 100-axis parity error and its check sequence, 7777 bytes on 101 links.
#[divan::bench(args = ["index", "time"])]
fn picture(bencher: divan::Bencher<'_, '_>, scale: &str) {
    let traces = hundred();
    let placing = match scale {
        "time" => RowPlacing::Time,
        _ => RowPlacing::Index,
    };
    let form = FileForm::Svg(placing, None);
    bencher.bench_local(|| written(&traces, form.clone()));
}

fn hundred() -> Vec<Trace> {
    use harness::library::Entry;
    use harness::scenario::run::AtMismatch;
    use harness::scenario::source::Source;
    let text = include_str!("../../../corpora/scenarios/novobus/9.8-check-sequence.scn");
    let source = Source::from_bytes("9.8".to_owned(), text.into()).expect("a text");
    let entry = Entry::new(source, None).expect("a scenario");
    let plan = &entry.settled;
    let mut link = plan.simulate();
    plan.play(&mut *link, AtMismatch::Stop);
    vec![link.trace(0)]
}
