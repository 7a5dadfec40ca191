//! How fast the simulated ring is, in drive-bytes a second: one drive-byte is one byte through one
//! drive. The real line moves 38400 / 11 = 3491 bytes a second through every drive of its ring, so the
//! real ring of 250 does 872,727 drive-bytes a second.
//!
//! `repeater` is the baseline: the same ring and the same bytes through devices that only pass them on.

use divan::counter::ItemsCount;
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::{Deadline, Reaction};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::novobus::telegram::{Address, Telegram};
use harness_proto::time::Instant;
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

const SIZES: [u64; 4] = [1, 8, 100, 250];
const BYTES: usize = 4096;

fn main() {
    divan::main();
}

/// Telegrams for one drive after the other: reads, writes and process data.
fn traffic(size: RingSize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut drive = 0;
    while bytes.len() < BYTES {
        let address = Address::Byte(size.address_byte(drive).expect("a drive of the ring"));
        let commands = [
            Command::ReadByte { address: 0xFE13 }.encode(),
            Command::WriteWord {
                address: 0xFF08,
                data: 0x1234,
            }
            .encode(),
        ];
        let telegrams = [
            Telegram::new(address, None, &commands[0]),
            Telegram::new(Address::SameDrive, None, &commands[1]),
            Telegram::new(Address::SameDrive, Some(0x1234), &[]),
        ];
        for telegram in telegrams {
            bytes.extend(telegram.expect("at most 7 net bytes").encode());
        }
        drive = (drive + 1) % size.drives();
    }
    bytes
}

fn turn<D: Device>(ring: &mut Ring<D>, bytes: &[u8]) {
    let start = ring.now();
    ring.send(start, bytes);
    ring.run_until(start + ring.byte_time() * (bytes.len() as u64 + 1));
    while ring.receive().is_some() {}
}

fn measure<D: Device>(
    bencher: divan::Bencher<'_, '_>,
    drives: u64,
    first: &[u8],
    bytes: &[u8],
    device: impl FnMut(u8) -> D,
) {
    let size = RingSize::new(drives).expect("1 to 250");
    let mut ring = Ring::new(size, Rate::Baud38400, device);
    ring.stop_recording();
    turn(&mut ring, first);
    bencher
        .counter(ItemsCount::new(bytes.len() as u64 * drives))
        .bench_local(|| turn(&mut ring, bytes));
}

#[divan::bench(args = SIZES)]
fn fault_free(bencher: divan::Bencher<'_, '_>, drives: u64) {
    let bytes = traffic(RingSize::new(drives).expect("1 to 250"));
    measure(bencher, drives, &[], &bytes, |_| PlainDrive::default());
}

#[divan::bench(args = SIZES)]
fn error_mode(bencher: divan::Bencher<'_, '_>, drives: u64) {
    let bytes = traffic(RingSize::new(drives).expect("1 to 250"));
    // A bad sync byte puts the first drive into the error mode, and by its zeros all the others.
    measure(bencher, drives, &[0x00; 600], &bytes, |_| {
        PlainDrive::default()
    });
}

#[divan::bench(args = SIZES)]
fn repeater(bencher: divan::Bencher<'_, '_>, drives: u64) {
    let bytes = traffic(RingSize::new(drives).expect("1 to 250"));
    measure(bencher, drives, &[], &bytes, |_| Repeater);
}

#[derive(Clone)]
struct Repeater;

impl Device for Repeater {
    fn receive(&mut self, _now: Instant, received: Received) -> Reaction {
        Reaction {
            byte: Some(received.byte),
            marks: Marks::NONE,
        }
    }

    fn deadline(&self) -> Option<Deadline> {
        None
    }

    fn handle_deadline(&mut self, _now: Instant) -> Reaction {
        Reaction::default()
    }

    fn power_on(&mut self, _now: Instant) {}

    fn in_error(&self) -> bool {
        false
    }

    fn cause(&self) -> Option<BusError> {
        None
    }
}
