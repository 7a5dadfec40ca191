//! The simulated rings that a plan asks for.

use crate::language::plan::{Plan, PlannedSetupKind};
use crate::link::SimulatedLink;
use harness_bench::link::{Line, Link};
use harness_proto::nd21::bits::status;
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Span;
use harness_sim::nd21::{Nd21Drive, Nd21Properties, set_parity};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::deviation::Deviant;
use harness_sim::novobus::drive::{Drive, Model};
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

/// A link to simulated rings, their drives set up as the plan says.
#[must_use]
pub(crate) fn simulated(plan: &Plan) -> SimulatedLink {
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

/// The same with everything done that the header lets happen from outside the bus.
#[must_use]
pub(crate) fn bench(plan: &Plan) -> SimulatedLink {
    let mut link = simulated(plan);
    for (ring, drives, influence) in plan.influences() {
        influence.act(&mut link, ring, drives);
    }
    link
}

/// How long the drives of [`warm`] have been switched on: their self-tests are over (11.8).
const WARM: Span = Span::from_millis(200);

/// The same with drives that have been switched on for some time, at the beginning of a conversation.
pub(crate) fn warm(plan: &Plan) -> SimulatedLink {
    let mut link = bench(plan);
    let end = link.now() + WARM;
    link.run_until(end);
    link.begin();
    link
}

/// Drive `k`: the EEPROM first, since RAM is filled from it at power-up, then the cells.
fn drive(plan: &Plan, ring: usize, k: u8) -> Drive {
    let mut properties = Properties::default();
    let mut choices = Nd21Properties::default();
    let model = plan.model(ring, k);
    for setup in plan.setups_of(ring, k) {
        setup.apply_to(&mut properties);
        setup.apply_to_nd21(&mut choices);
    }
    let mut eeprom = model.eeprom();
    let parity = usize::from(ee::PARITY);
    let mut own_parity = false;
    for setup in plan.setups_of(ring, k) {
        if let PlannedSetupKind::Eeprom(address, bytes) = setup {
            for (cell, byte) in eeprom.iter_mut().skip(usize::from(*address)).zip(bytes) {
                *cell = *byte;
            }
            let first = usize::from(*address);
            own_parity |= (first..first + bytes.len()).contains(&parity);
        }
    }
    if model == Model::Nd21 && !own_parity {
        set_parity(&mut eeprom);
    }
    let deviations: Vec<_> = plan
        .setups_of(ring, k)
        .filter_map(|setup| match setup {
            PlannedSetupKind::Deviates(deviation) => Some(*deviation),
            _ => None,
        })
        .collect();
    let mut drive = match model {
        Model::Plain => Drive::Plain(PlainDrive::new(properties, eeprom)),
        Model::Nd21 => Drive::Nd21(Nd21Drive::new(properties, choices, eeprom)),
    };
    if !deviations.is_empty() {
        drive = Drive::Deviant(Box::new(Deviant::new(drive, deviations)));
    }
    for setup in plan.setups_of(ring, k) {
        if let PlannedSetupKind::Memory(address, bytes) = setup {
            for (address, byte) in (*address..=u16::MAX).zip(bytes) {
                let cells = drive.cells_mut();
                let byte = match (model, address) {
                    // A whole drive reports a reset by itself (11.8).
                    (Model::Nd21, ram::STATUS) => {
                        byte & !status::RESET | cells.peek(address) & status::RESET
                    }
                    _ => *byte,
                };
                // Planning has refused addresses where there is no memory.
                let _known = cells.poke(address, byte);
            }
        }
    }
    drive
}
