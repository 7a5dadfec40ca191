//! The first cases on a ring behind a port: every family of faults that a drive can have on the bus, with all its places and values, in an
//! order in which each family has its share of every stretch of the line's time. What is written is read back.

mod bus;
mod memory;

use super::case::{Act, ActKind, Case, Talk, To};
use super::generate::{CaseScope, RingScope};
use super::order::{CommandSent, RawCommand, Spoil};
use crate::explore::Spice;
use harness_bench::explore::Dice;
use harness_proto::nd21::{own, ram};

/// Maximum number of bytes of a case of the tour.
const MOST: usize = 300;

/// Maximum number of drives of a ring that it visits: the first ones, the last ones and some between.
const MOST_DRIVES: usize = 8;

/// Parameters in the page that the bit commands and process data reach (ND21 10.3, 14.10.3): the drive only reads them.
const PAGE_CELLS: [u16; 4] = [ram::NKP, ram::NKI, ram::LKP, ram::LKD];

/// A family: the cases for one drive, in order.
type Family = fn(&Tour<'_>, u8, &mut Dice) -> Vec<Vec<Act>>;

/// The families, each with what a rig must allow for it.
const FAMILIES: [(Family, &[Spice]); 15] = [
    (memory::march, &[Spice::WriteByte, Spice::WriteWord]),
    (memory::rom, &[]),
    (memory::values, &[Spice::WriteByte]),
    (memory::masks, &[Spice::And, Spice::Or]),
    (memory::process_data, &[Spice::ProcessData]),
    (memory::edges, &[Spice::Forbidden]),
    (bus::refused, &[Spice::Spoil]),
    (bus::codes, &[Spice::Spoil]),
    (bus::outputs, &[Spice::WriteIo]),
    (bus::sums_of_zero, &[Spice::Spoil]),
    (bus::sync_bytes, &[Spice::Noise, Spice::Zeros]),
    (bus::broken_sequences, &[Spice::Zeros]),
    (bus::cuts, &[Spice::Cut]),
    (bus::damaged, &[Spice::Flip]),
    (bus::resets, &[Spice::Spoil]),
];

/// What the families are made for.
struct Tour<'s> {
    ring: &'s RingScope,
    /// The drives that it goes to.
    drives: Vec<u8>,
    /// Whether drives may be reset.
    resets: bool,
}

/// The cases for a ring, in the order in which they are tried.
#[must_use]
pub(crate) fn tour(scope: &CaseScope, ring: &RingScope, seed: u64) -> Vec<Case> {
    let tour = Tour {
        ring,
        drives: visited(ring.drives),
        resets: scope.limits.reset && scope.limits.motion,
    };
    let mut all: Vec<(u32, Case)> = Vec::new();
    for (number, (family, needs)) in (0_u64..).zip(&FAMILIES) {
        if !needs.iter().all(|spice| scope.spices.contains(spice)) {
            continue;
        }
        let mut dice = Dice::of_part(seed ^ 0x5EED, number);
        let each = tour
            .drives
            .iter()
            .map(|drive| family(&tour, *drive, &mut dice));
        for (turn, cases) in (0..).zip(each.collect::<Vec<_>>()) {
            let count = u32::try_from(cases.len().max(1)).unwrap_or(u32::MAX);
            let share = |at: usize| {
                let at = u32::try_from(at).unwrap_or(u32::MAX);
                at.saturating_mul(10_000) / count
            };
            // What a march finds is seen again with what was written a little before.
            let place = |at: usize| if number == 0 { 1_000 * turn } else { share(at) };
            let cases = cases.into_iter().enumerate();
            all.extend(cases.map(|(at, acts)| (place(at), ring.case(acts))));
        }
    }
    all.sort_by_key(|(place, _)| *place);
    all.into_iter().map(|(_, case)| case).collect()
}

/// Drives of a ring, at both ends of it and between.
fn visited(drives: u8) -> Vec<u8> {
    let count = usize::from(drives).min(MOST_DRIVES);
    let last = usize::from(drives).saturating_sub(1);
    let at = |index: usize| index * last / count.saturating_sub(1).max(1);
    let all = (0..count).map(|index| u8::try_from(at(index)).unwrap_or(0));
    all.collect()
}

impl Tour<'_> {
    /// Acts that are tried together as far as they fit into a case.
    fn packed(&self, groups: Vec<Vec<Act>>) -> Vec<Vec<Act>> {
        let length =
            |acts: &[Act]| -> usize { acts.iter().map(|act| act.length(self.ring.drives)).sum() };
        let mut cases: Vec<Vec<Act>> = Vec::new();
        for group in groups {
            match cases.last_mut() {
                Some(last) if length(last) + length(&group) <= MOST => last.extend(group),
                _ => cases.push(group),
            }
        }
        cases
    }

    /// SYNCO until a ring in the error mode has spelled out an address (ND21 9.7).
    fn spell(&self) -> Act {
        let count = 27 + usize::from(self.ring.drives);
        Act::sound(ActKind::Synco(u8::try_from(count).unwrap_or(u8::MAX)))
    }

    /// This drive's share of what is tried with one drive each.
    fn share<T>(&self, drive: u8, all: Vec<T>) -> Vec<T> {
        let place = self
            .drives
            .iter()
            .position(|visited| *visited == drive)
            .unwrap_or(0);
        let shared = all.into_iter().skip(place);
        shared.step_by(self.drives.len().max(1)).collect()
    }
}

fn talk(drive: u8, commands: &[RawCommand]) -> Act {
    Act::sound(ActKind::Talk(Talk {
        orders: commands
            .iter()
            .map(|command| CommandSent::sound(*command))
            .collect(),
        ..Talk::one(To::Drive(drive), RawCommand::Reset)
    }))
}

fn exchange(drive: u8, data: u16, commands: &[RawCommand]) -> Act {
    let mut act = talk(drive, commands);
    if let ActKind::Talk(talk) = &mut act.what {
        talk.process_data = Some(data);
    }
    act
}

fn spoiled(drive: u8, command: RawCommand, at: u8, byte: u8) -> Act {
    let order = CommandSent {
        command,
        spoil: Some(Spoil { at, byte }),
    };
    Act::sound(ActKind::Talk(Talk {
        orders: vec![order],
        ..Talk::one(To::Drive(drive), command)
    }))
}

fn spare(dice: &mut Dice) -> u16 {
    own::SPARE.start() + 2 * dice.below(own::SPARE.len() / 2) as u16
}

fn page_cell(dice: &mut Dice) -> u16 {
    PAGE_CELLS[dice.below(PAGE_CELLS.len())]
}

fn recover() -> Act {
    Act::sound(ActKind::Recover)
}

/// Numbers in any order.
fn shuffled<T>(mut all: Vec<T>, dice: &mut Dice) -> Vec<T> {
    for at in (1..all.len()).rev() {
        all.swap(at, dice.below(at + 1));
    }
    all
}
