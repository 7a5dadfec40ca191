//! Cases that share what they have in common against the same cases, each played on a ring of its own from the start: what the
//! master hears, and every drive, on random rings, telegrams and faults (ND21 9.1-9.9).

use super::against_reference::{fault, telegram};
use super::common::{Random, repeat, seed};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;
use harness_sim::novobus::shared::{Passage, SharedRing, SharedState};

/// Rings whose cases are played, and cases on each.
const RINGS: u64 = 40;
const CASES: u64 = 40;

fn ring(random: &mut Random) -> Ring<Drive> {
    let most = if random.below(8) == 0 { 60 } else { 8 };
    let drives = 1 + random.below(most);
    let monitored = random.below(4) == 0;
    let size = RingSize::new(drives).expect("1 to 250");
    let mut ring = Ring::new(size, Rate::Baud38400, |_| {
        let mut eeprom = [0; 256];
        eeprom[0x47] = if monitored { 0x80 } else { 0 };
        Drive::Plain(PlainDrive::new(Properties::default(), eeprom))
    });
    ring.stop_recording();
    ring
}

/// Bytes of a conversation: telegrams, silence of SYNCO, and check sequences.
fn bytes(random: &mut Random, drives: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..1 + random.below(5) {
        bytes.extend(match random.below(6) {
            0 => CHECK_SEQUENCE.to_vec(),
            1 => vec![0x80; 60],
            _ => telegram(random, drives),
        });
    }
    bytes
}

fn any_fault(random: &mut Random) -> LinkFault {
    match random.below(6) {
        0 => LinkFault::Delay(Span::from_micros(random.below(15_000))),
        1 => LinkFault::Break(Span::from_micros(700)),
        2 => LinkFault::Cut,
        3 => LinkFault::Join,
        4 => LinkFault::Flip(Flips {
            start: true,
            ..Flips::default()
        }),
        _ => fault(random).0,
    }
}

fn exchange(ring: &mut Ring<Drive>, bytes: &[u8]) -> Vec<Received> {
    let now = ring.now();
    ring.send(now, bytes);
    ring.run_until(ring.sent_by());
    let heard = std::iter::from_fn(|| ring.receive());
    heard.filter_map(|byte| byte.arrival()).collect()
}

fn same(shared: &SharedRing, state: &SharedState, ring: &Ring<Drive>) {
    for k in 0..ring.size().drives() {
        let ours = shared.drive(state, k).expect("a drive");
        let Drive::Plain(theirs) = ring.drive(k).expect("a drive") else {
            panic!("a plain drive")
        };
        assert_eq!(ours.bus_end(), theirs.bus_end(), "drive {k}");
        assert!(ours.memory() == theirs.memory(), "cells of drive {k}");
    }
}

/// Plays a case both ways. `Passage`s with one fault are kept by the caller, as campaigns do.
fn case(random: &mut Random, shared: &mut SharedRing, start: &Ring<Drive>, before: &SharedState) {
    let drives = start.size().drives();
    let opening = bytes(random, drives);
    let mut faults: Vec<_> = (0..random.below(4))
        .map(|_| {
            let link = random.below(u64::from(drives) + 1) as usize;
            (link, 1 + random.below(40), any_fault(random))
        })
        .collect();
    faults.sort_by_key(|(link, ..)| *link);
    let mut ring = start.clone();
    ring.advance_each();
    for (link, byte, fault) in &faults {
        ring.arm_link(*link, *byte, *fault);
    }
    let heard = exchange(&mut ring, &opening);
    let mut passage: Passage = shared.send(before, &opening);
    for all in faults.chunk_by(|a, b| a.0 == b.0) {
        let link = all[0].0;
        let disturbed = all.iter().map(|(_, byte, fault)| (*byte, *fault));
        let became = shared.disturb(before, &passage, link, disturbed);
        passage = shared.follow(before, &passage, link, became.expect("a link"));
    }
    assert_eq!(shared.bytes(passage.heard()), heard);
    same(shared, passage.after(), &ring);
    for _ in 0..random.below(3) {
        let more = bytes(random, drives);
        passage = shared.send(passage.after(), &more);
        assert_eq!(
            shared.bytes(passage.heard()),
            exchange(&mut ring, &more),
            "{more:02X?}"
        );
        same(shared, passage.after(), &ring);
    }
}

#[test]
fn shared_cases_are_what_each_is_from_the_start() {
    for number in 0..RINGS {
        let mut random = Random(seed().wrapping_mul(RINGS).wrapping_add(number));
        let start = ring(&mut random);
        let (mut shared, before) = SharedRing::new(&start).expect("a ring at rest");
        let played = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            for _ in 0..CASES {
                let mark = shared.mark();
                case(&mut random, &mut shared, &start, &before);
                // What is forgotten is worked out again.
                if random.below(3) == 0 {
                    shared.forget_after(mark);
                }
            }
        }));
        assert!(played.is_ok(), "ring {number}; {}", repeat("shared"));
    }
}

/// A ring of which something would be lost is refused.
#[test]
fn a_ring_that_is_not_at_rest_is_refused() {
    let mut random = Random(7);
    let mut recording = Ring::new(RingSize::new(3).expect("3"), Rate::Baud38400, |_| {
        Drive::Plain(PlainDrive::default())
    });
    assert!(SharedRing::new(&recording).is_none(), "it records");
    recording.stop_recording();
    assert!(SharedRing::new(&recording).is_some());
    recording.send(recording.now(), &bytes(&mut random, 3));
    assert!(
        SharedRing::new(&recording).is_none(),
        "it has something to send"
    );
}
