//! Every single fault on every link, byte and bit of small rings (ND21 9.7, 9.8).

use super::common::{exchange, healthy, mixed_stream, ring, spelled_out};
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::sync::SYNCO;
use harness_sim::fault::{Flips, LinkFault};

/// The manual's bound on the zeros in front of an address (ND21 9.7).
const MAX_ZEROS: usize = 25;

fn single_bits() -> Vec<Flips> {
    let mut all: Vec<_> = (0..8)
        .map(|bit| Flips {
            data: 1 << bit,
            ..Flips::default()
        })
        .collect();
    all.push(Flips {
        parity: true,
        ..Flips::default()
    });
    all.push(Flips {
        stop: true,
        ..Flips::default()
    });
    all
}

/// ND21 9.7: "the bytes H'61 = 97 means that the error has been noticed from slave 97"; 9.8: "After the
/// check sequence the bus is again ready for operation".
#[test]
fn every_single_bit_is_located_and_one_check_sequence_heals() {
    let mut most_zeros = 0;
    let mut runs = 0;
    for drives in 1..=4u8 {
        let size = ring(drives).size();
        let stream = mixed_stream(size);
        let idle = vec![SYNCO; 64];
        for (link, behind) in
            (0..=usize::from(drives)).zip((0..drives).rev().map(Some).chain([None]))
        {
            for byte in 1..=stream.len() as u64 {
                for flips in single_bits() {
                    let mut ring = ring(drives);
                    ring.arm_link(link, byte, LinkFault::Flip(flips));
                    let mut heard = exchange(&mut ring, &stream);
                    heard.extend(exchange(&mut ring, &idle));
                    let place = || format!("ring {drives}, link {link}, byte {byte}, {flips:?}");
                    runs += 1;
                    let Some(behind) = behind else {
                        // Only the master is behind the last link; it sees the bad byte itself.
                        assert!(healthy(&ring), "{}", place());
                        assert_eq!(heard.iter().filter(|b| b.error.is_some()).count(), 1);
                        continue;
                    };
                    let (address, zeros) =
                        spelled_out(&heard).unwrap_or_else(|| panic!("{}", place()));
                    assert_eq!(address, behind, "{}", place());
                    if behind != 0 {
                        assert!(zeros <= MAX_ZEROS, "{zeros} zeros: {}", place());
                        most_zeros = most_zeros.max(zeros);
                    }
                    let back = exchange(&mut ring, &CHECK_SEQUENCE);
                    assert!(healthy(&ring), "one check sequence: {}", place());
                    assert_eq!(back.len(), CHECK_SEQUENCE.len(), "{}", place());
                    assert_eq!(exchange(&mut ring, &[SYNCO]), [Received::good(SYNCO)]);
                }
            }
        }
    }
    // All links of all rings, 51 bytes, 10 bits; and the bound is nearly reached.
    assert_eq!(runs, (2 + 3 + 4 + 5) * 51 * 10);
    assert_eq!(most_zeros, 23);
}

/// A start bit that is lost puts the receiver out of step; the zeros of a check sequence bring it back (ND21 8.1, 9.8).
#[test]
fn every_lost_start_bit_is_noticed_and_check_sequences_heal() {
    let start = Flips {
        start: true,
        ..Flips::default()
    };
    for drives in 1..=4u8 {
        let stream = mixed_stream(ring(drives).size());
        for link in 0..=usize::from(drives) {
            for byte in 1..=stream.len() as u64 {
                let mut ring = ring(drives);
                let sound = exchange(&mut ring.clone(), &stream);
                ring.arm_link(link, byte, LinkFault::Flip(start));
                let heard = exchange(&mut ring, &stream);
                let place = || format!("ring {drives}, link {link}, byte {byte}");
                assert_ne!(heard, sound, "{}", place());
                exchange(&mut ring, &CHECK_SEQUENCE);
                exchange(&mut ring, &CHECK_SEQUENCE);
                assert!(healthy(&ring), "{}", place());
                let back = exchange(&mut ring, &[SYNCO, SYNCO]);
                assert_eq!(back, [Received::good(SYNCO); 2], "{}", place());
            }
        }
    }
}

/// A healthy ring changes nothing but address bytes and answers (ND21 9, 9.3).
#[test]
fn a_healthy_ring_changes_nothing_but_addresses_and_answers() {
    for drives in [1, 2, 7, 100, 250] {
        let mut ring = ring(drives);
        // k = N addresses no drive: the sum is 0 only behind the last drive.
        let stream = [
            &[SYNCO, 0x88, 0x00, 1, 2, 3, 4][..],
            &[0x8F, 0x00, 5, 6, 7, 8, 9, 10, 11],
            &[0x85, 0x00, 0xFF, 0x00],
            &[SYNCO],
        ]
        .concat();
        let heard = exchange(&mut ring, &stream);
        let mut expected = stream.clone();
        for place in [2, 8, 17] {
            expected[place] = drives;
        }
        let heard: Vec<_> = heard.iter().map(|b| b.byte).collect();
        assert_eq!(heard, expected, "ring {drives}");
        assert!(healthy(&ring));
    }
}
