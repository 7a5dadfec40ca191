//! How fast a line with a NORDAC drive is simulated, in exchanges a second: a start-up and 1,000 exchanges of PPO1 at 1.5 Mbit/s with a motor on
//! its ramp and a parameter that is read in each. `hosts` is the baseline: the same octets between two stations without a protocol.
//!
//! An exchange takes 506 bit times on the wire, 337 us: 200 times real time are 593,000 exchanges a second.

use divan::counter::ItemsCount;
use harness_proto::nordac::pkw::Index;
use harness_proto::profibus::fdl::{FcFunction, FrameControl, Pdu, Sequence};
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::{Drive, InverterSetup, Member};
use harness_sim::octet_segment::{LineHost, Octet, OctetSegment, Wish};

const EXCHANGES: usize = 1_000;
/// From request to request: 33 idle bits, 21 octets, the reply delay of 11 bits, 21 octets, and a few bits of the master.
const PERIOD: Span = Span::from_units(510 * 2_000);

type Line = OctetSegment<Member<Drive>>;

fn main() {
    divan::main();
}

/// A request to slave 8 in the order of a start: telegram 0 is Set_Prm, 1 is Chk_Cfg, the others exchange.
fn request(number: usize) -> Vec<Octet> {
    let mut sequence = Sequence::None;
    let turns = if number == 0 { 1 } else { 2 + (number + 1) % 2 };
    for _ in 0..turns {
        sequence = sequence.next();
    }
    let (sap, data): (Option<u8>, &[u8]) = match number {
        0 => (Some(61), &[0x80, 0, 0, 0x0B, 0x75, 0x31, 0]),
        1 => (Some(62), &[0xF3, 0xF1]),
        2 => (None, &[0x17, 0x15, 0, 0, 0, 0, 0, 0, 0x04, 0x7E, 0, 0]),
        _ => (None, &[0x17, 0x15, 0, 0, 0, 0, 0, 0, 0x04, 0x7F, 0x40, 0]),
    };
    let control = FrameControl::request(FcFunction::SrdHigh, sequence);
    let pdu = Pdu::with_saps(8, 2, control, sap, sap.map(|_| 62), data);
    let telegram = Telegram::Pdu(pdu.expect("a telegram"));
    telegram.encode().iter().copied().map(Octet::from).collect()
}

/// A host that sends the requests, one in a period.
fn master() -> LineHost {
    let mut host = LineHost::default();
    for number in 0..EXCHANGES + 2 {
        let wish = Wish {
            ready: Instant::START + PERIOD * number as u64,
            idle_bits: 33,
        };
        host.send(wish, request(number));
    }
    host
}

fn with_drive() -> Line {
    let first = |number, value| (number, Index::default(), value);
    let setup = InverterSetup {
        parameters: vec![first(1624, 8), first(1621, 2)],
        ..InverterSetup::default()
    };
    let drive = Drive::new(&setup, BusRate::K1500, Instant::START);
    let stations = vec![Member::Host(master()), Member::Drive(drive)];
    OctetSegment::new(BusRate::K1500.format(), stations)
}

/// Two hosts that speak in turn.
fn hosts() -> Line {
    let mut second = LineHost::default();
    for number in 0..EXCHANGES + 2 {
        let wish = Wish {
            ready: Instant::START + PERIOD * number as u64 + Span::from_units(275 * 2_000),
            idle_bits: 11,
        };
        second.send(wish, request(number));
    }
    let stations = vec![Member::Host(master()), Member::Host(second)];
    OctetSegment::new(BusRate::K1500.format(), stations)
}

fn bench(bencher: divan::Bencher<'_, '_>, line: fn() -> Line) {
    let end = Instant::START + PERIOD * (EXCHANGES as u64 + 3);
    let mut checked = line();
    checked.run_until(end);
    // Every request has its reply.
    let replies = checked.record(1).len();
    assert!(replies > EXCHANGES * 20, "{replies} octets of replies");
    bencher
        .counter(ItemsCount::new(EXCHANGES))
        .with_inputs(|| {
            let mut line = line();
            line.keep_no_record();
            line
        })
        .bench_local_values(|mut line| line.run_until(end));
}

#[divan::bench]
fn exchanges(bencher: divan::Bencher<'_, '_>) {
    bench(bencher, with_drive);
}

#[divan::bench(name = "hosts")]
fn hosts_alone(bencher: divan::Bencher<'_, '_>) {
    bench(bencher, hosts);
}
