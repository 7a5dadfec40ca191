//! The simulated rings that a plan asks for.

use super::plan::{Plan, PlannedSetupKind};
use crate::link::SimulatedLink;
use harness_proto::novobus::properties::Properties;
use harness_sim::bench::Bench;
use harness_sim::plain::PlainDrive;
use harness_sim::ring::Ring;

/// A link to simulated rings of plain drives, set up as the plan says.
#[must_use]
pub fn simulated(plan: &Plan) -> SimulatedLink {
    let mut rings = plan
        .rings
        .iter()
        .enumerate()
        .map(|(index, &size)| Ring::new(size, plan.rate, |k| drive(plan, index, k)));
    let bench = match (rings.next(), rings.next()) {
        (Some(first), Some(second)) => Bench::two(first, second),
        (Some(first), None) => Bench::one(first),
        (None, _) => Bench::default(),
    };
    SimulatedLink::new(bench)
}

/// Drive `k`: the EEPROM first, since RAM is filled from it at power-up, then the cells.
fn drive(plan: &Plan, ring: usize, k: u8) -> PlainDrive {
    let mut eeprom = [0; 256];
    let mut properties = Properties::default();
    for setup in plan.setups_of(ring, k) {
        setup.apply_to(&mut properties);
        if let PlannedSetupKind::Eeprom(address, bytes) = setup {
            for (cell, byte) in eeprom.iter_mut().skip(usize::from(*address)).zip(bytes) {
                *cell = *byte;
            }
        }
    }
    let mut drive = PlainDrive::new(properties, eeprom);
    for setup in plan.setups_of(ring, k) {
        if let PlannedSetupKind::Memory(address, bytes) = setup {
            for (address, byte) in (*address..=u16::MAX).zip(bytes) {
                // Planning has refused addresses where there is no memory.
                let _known = drive.memory_mut().poke(address, *byte);
            }
        }
    }
    drive
}
