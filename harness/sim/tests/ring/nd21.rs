//! The ND21 behind its bus: no bytes make it panic, change what is read only, or leave its memory map.

use crate::against_reference::telegram;
use crate::common::{Random, repeat, seed};
use harness_proto::line::Rate;
use harness_proto::nd21::cells::{Access, RAM};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Span;
use harness_sim::fault::DriveFault;
use harness_sim::nd21::{Nd21Drive, Nd21Properties};
use harness_sim::ring::Ring;

const CASES: u64 = 300;

#[test]
fn read_only_cells_keep_their_values() {
    let mut written = 0;
    for case in 0..CASES {
        let mut random = Random(seed().wrapping_mul(CASES).wrapping_add(case));
        let drives = 1 + random.below(4) as u8;
        let size = RingSize::new(u64::from(drives)).expect("a ring");
        let mut ring = Ring::new(size, Rate::Baud38400, |_| {
            Nd21Drive::new(
                Properties::default(),
                Nd21Properties::default(),
                [0x5A; 256],
            )
        });
        for _ in 0..40 {
            let now = ring.now();
            match random.below(10) {
                0 => ring.send(now, &CHECK_SEQUENCE),
                1 => ring.suffer_drive(random.below(u64::from(drives)) as u8, DriveFault::Off),
                2 => (0..drives).for_each(|k| ring.suffer_drive(k, DriveFault::On)),
                3 => {
                    // The cells of the EEPROM controller, which random addresses rarely meet.
                    let code = [0x81, 0x82, 0x84, 0x10][random.below(4) as usize];
                    let command = [0x82, code, 0x8A, 0xFD];
                    let sum = command
                        .iter()
                        .fold(0u8, |sum, byte| sum.wrapping_add(*byte));
                    ring.send(now, &[0x8A, drives.wrapping_neg()]);
                    ring.send(now, &command);
                    ring.send(now, &[sum]);
                }
                _ => ring.send(now, &telegram(&mut random, drives)),
            }
            ring.run_until(now + Span::from_millis(1 + random.below(30)));
        }
        for k in 0..drives {
            let cells = ring
                .drive(k)
                .expect("a drive of the ring")
                .program()
                .cells();
            for cell in RAM.iter().filter(|cell| cell.access == Access::Read) {
                for address in cell.addresses() {
                    // Loaded from the EEPROM or 00 since power-up, and never written by the bus.
                    let loaded = harness_proto::nd21::eeprom::eeprom_of(address)
                        .map_or(0, |e| cells.eeprom()[usize::from(e)]);
                    let found = cells.peek(address);
                    assert!(
                        found == loaded || found == 0x5A,
                        "case {case}, drive {k}, {}: {found:02X}; {}",
                        cell.printed,
                        repeat("read_only_cells")
                    );
                }
            }
            written += usize::from(cells.eeprom().iter().any(|byte| *byte != 0x5A));
        }
    }
    assert!(
        written > 20,
        "{written}: the EEPROM controller was hardly used"
    );
}
