//! How fast rings of fully modelled ND21 are against real time: the counter is ring-milliseconds a second,
//! so 1000 is real time and 20,000 twenty times as fast.
//!
//! `plain` is the baseline: the same ring and the same bytes (SYNCO without a gap) through drives that have
//! nothing behind their bus. `idle` drives are blocked, `moving` ones turn at their ramp or at constant
//! speed all the time, in the reversing test mode (ND21 14.3.1); `recording` ones also have their
//! oscilloscope running.

use divan::counter::ItemsCount;
use harness_proto::line::Rate;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::{bits, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Span;
use harness_sim::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

const SIZES: [u64; 3] = [1, 100, 250];
const MILLISECONDS: u64 = 100;

fn main() {
    divan::main();
}

fn measure<D: Device>(bencher: divan::Bencher<'_, '_>, drives: u64, device: impl FnMut(u8) -> D) {
    let size = RingSize::new(drives).expect("1 to 250");
    let mut ring = Ring::new(size, Rate::Baud38400, device);
    ring.stop_recording();
    let span = Span::from_millis(MILLISECONDS);
    let bytes = vec![SYNCO; (span.units() / ring.byte_time().units()) as usize];
    bencher
        .counter(ItemsCount::new(MILLISECONDS))
        .bench_local(|| {
            let now = ring.now();
            ring.send(now, &bytes);
            ring.run_until(now + span);
            while ring.receive().is_some() {}
            // What drives in a group do of their own is done when they are looked at.
            for k in 0..size.drives() {
                divan::black_box(ring.drive(k));
            }
        });
}

fn drive() -> Nd21Drive {
    Nd21Drive::new(
        Properties::default(),
        Nd21Properties::default(),
        factory::eeprom(),
    )
}

/// Each a little different, so that no two do the same at the same time.
fn moving(k: u8) -> Nd21Drive {
    let mut drive = drive();
    drive.stimulate(Stimulus::Input(Input::Gpin3, true));
    drive.stimulate(Stimulus::Input(Input::Gpin5, true));
    let program = drive.program_mut();
    program.write(ram::SW_VERSION, 0x43 | bits::sw_version::REVERSING);
    program.write(ram::REVERS_TAKT, 20 + k % 16);
    program.write(ram::NSOLL, 0x10 + k % 8);
    drive
}

#[divan::bench(args = SIZES)]
fn plain(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, |_| PlainDrive::default());
}

#[divan::bench(args = SIZES)]
fn idle(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, |_| drive());
}

#[divan::bench(args = SIZES)]
fn all_moving(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, moving);
}

#[divan::bench(args = SIZES)]
fn all_moving_and_recording(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, |k| {
        let mut drive = moving(k);
        drive.program_mut().write(ram::SCOPE_STATUS, 0);
        drive
    });
}
