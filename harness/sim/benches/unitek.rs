//! How fast a segment with a UNITEK drive is simulated, in frames a second. `hosts` is the baseline: the same load on the same segment
//! without a drive. A bus of 500 kbit/s that is full of replies of 4 bytes carries some 5,900 frames a second, so 1,000 times real time are
//! 5.9 million.

use divan::counter::ItemsCount;
use harness_proto::can::{BitRate, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Properties;
use harness_sim::segment::{Host, Segment, Station};
use harness_sim::unitek::{Drive, Inputs};

/// How much time of the bus is simulated.
const TIME: Span = Span::from_millis(1_000);

/// Registers with a cycle of 1 ms: eight are more than the bus carries (5.2).
const REGISTERS: [u8; 8] = [0xE2, 0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9];

fn main() {
    divan::main();
}

fn frame(text: &str) -> Frame {
    text.parse().expect("a frame")
}

/// A drive with eight cycles, and one with other identifiers that acknowledges its frames.
fn full_bus() -> Segment<Drive> {
    let drive = || Drive::new(Properties::default(), Inputs::default(), Instant::START);
    let other = drive().with_setup(&[(0x68, 0x202), (0x69, 0x182)]);
    let mut segment = Segment::new(BitRate::K500, vec![drive(), other]);
    for register in REGISTERS {
        let request = frame(&format!("201#3D{register:02X}01"));
        let taken = segment.station_mut(0).receive(Instant::START, &request);
        assert!(taken.is_ok(), "{request}");
    }
    segment
}

/// A host with as many frames as the bus carries in [`TIME`], and one that acknowledges them.
fn hosts() -> Segment<Host> {
    let mut segment = Segment::new(BitRate::K500, vec![Host::default(), Host::default()]);
    for _ in 0..7_000 {
        let sender = segment.station_mut(0);
        sender.send(Instant::START, frame("181#E2010000"));
    }
    segment
}

/// Simulates [`TIME`] of a segment, and counts its frames.
fn bench<S: Station>(bencher: divan::Bencher<'_, '_>, segment: fn() -> Segment<S>) {
    let mut counted = segment();
    counted.run_until(Instant::START + TIME);
    bencher
        .counter(ItemsCount::new(counted.record().len()))
        .with_inputs(|| {
            let mut segment = segment();
            segment.keep_no_record();
            segment
        })
        .bench_local_values(|mut segment| segment.run_until(Instant::START + TIME));
}

#[divan::bench]
fn eight_cycles(bencher: divan::Bencher<'_, '_>) {
    bench(bencher, full_bus);
}

#[divan::bench(name = "hosts")]
fn hosts_alone(bencher: divan::Bencher<'_, '_>) {
    bench(bencher, hosts);
}
