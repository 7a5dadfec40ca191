//! Compares the cells of a ring with those of the same ring without a fault.

use super::class::WrongValue;
use crate::link::SimulatedLink;
use harness_bench::link::Link;
use harness_proto::nd21::ram::{BUS_ADDR, ERRORCODE};
use harness_proto::novobus::bus_end::BusEnd;
use harness_sim::novobus::cells::Cells;
use std::collections::{BTreeMap, BTreeSet};

/// What drives hold, and held, without a fault.
#[derive(Clone, Debug)]
pub(crate) struct Sound {
    end: SimulatedLink,
    /// Every value that a cell had on the way, where it had several.
    history: BTreeMap<(u8, u16), BTreeSet<u8>>,
}

/// The drives of a ring, past their bus.
pub(crate) trait DrivesBeyondBus {
    /// How many there are.
    fn count(&self) -> u8;

    /// The cells of a drive, if the ring has it.
    fn cells(&self, drive: u8) -> Option<&Cells>;

    fn bus_end(&self, drive: u8) -> Option<&BusEnd>;

    /// What a comparison of a drive's cells gives, which is always the same for the same state of it; `None` if the ring has not got the
    /// drive.
    fn compared(&self, drive: u8, compare: impl FnOnce(&Cells) -> bool) -> Option<bool> {
        self.cells(drive).map(compare)
    }
}

impl DrivesBeyondBus for SimulatedLink {
    fn count(&self) -> u8 {
        self.drives(0)
    }

    fn cells(&self, drive: u8) -> Option<&Cells> {
        Some(self.drive(0, drive)?.cells())
    }

    fn bus_end(&self, drive: u8) -> Option<&BusEnd> {
        Some(self.drive(0, drive)?.bus_end())
    }
}

/// The addresses at which two drives differ. The record of a bus error (14.10.1) and of the addressee of the last telegram (9.2) does
/// not count as damage.
fn differences<'c>(a: &'c Cells, b: &'c Cells) -> impl Iterator<Item = u16> + 'c {
    let noted = ERRORCODE..=ERRORCODE + 1;
    a.differences(b)
        .filter(move |address| !noted.contains(address) && *address != BUS_ADDR)
}

impl Sound {
    /// Starts with a ring before anything is sent.
    #[must_use]
    pub(crate) fn new(start: SimulatedLink) -> Self {
        Self {
            end: start,
            history: BTreeMap::new(),
        }
    }

    /// Notes what drives hold now.
    pub(crate) fn note(&mut self, now: &SimulatedLink) {
        for drive in 0..now.count() {
            let (Some(before), Some(cells)) = (self.end.cells(drive), now.cells(drive)) else {
                continue;
            };
            for address in differences(before, cells) {
                let values = self.history.entry((drive, address)).or_default();
                values.extend([before.peek(address), cells.peek(address)]);
            }
        }
        self.end = now.clone();
    }

    /// What drives hold that they should not. Where not every job is `confirmed`, a cell may hold whatever it held on the way.
    #[must_use]
    pub(crate) fn wrong(&self, now: &impl DrivesBeyondBus, confirmed: bool) -> Vec<WrongValue> {
        let mut wrong = Vec::new();
        for drive in 0..now.count() {
            let Some(sound) = self.end.cells(drive) else {
                continue;
            };
            let same = now.compared(drive, |cells| differences(sound, cells).next().is_none());
            if same == Some(true) {
                continue;
            }
            let Some(cells) = now.cells(drive) else {
                continue;
            };
            for address in differences(sound, cells) {
                let value = cells.peek(address);
                let held = self.history.get(&(drive, address));
                if confirmed || held.is_none_or(|values| !values.contains(&value)) {
                    wrong.push(WrongValue::Cell {
                        drive,
                        address,
                        value,
                        expected: sound.peek(address),
                    });
                }
            }
        }
        wrong
    }

    /// Whether every drive waits for the same as without a fault, so that it answers the same to all that follows.
    #[must_use]
    pub(crate) fn waits_as(&self, now: &impl DrivesBeyondBus) -> bool {
        (0..now.count()).all(|drive| {
            let addressed = |cells: &Cells| cells.peek(BUS_ADDR);
            let of_sound = self.end.bus_end(drive).zip(self.end.cells(drive));
            let real = now.bus_end(drive).zip(now.cells(drive));
            real.zip(of_sound)
                .is_some_and(|((end, cells), (sound, held))| {
                    end.waits_as(sound) && addressed(cells) == addressed(held)
                })
        })
    }

    /// Whether no drive is in the error mode.
    #[must_use]
    pub(crate) fn all_back(now: &impl DrivesBeyondBus) -> bool {
        (0..now.count()).all(|drive| now.bus_end(drive).is_some_and(|end| !end.in_error()))
    }

    /// Whether any drive watches for silence (9.9).
    #[must_use]
    pub(crate) fn any_monitors(ring: &impl DrivesBeyondBus) -> bool {
        use harness_proto::nd21::{bits::flags2::MONITORING, ram::FLAGS2};
        let monitors = |cells: &Cells| cells.peek(FLAGS2) & MONITORING != 0;
        (0..ring.count()).any(|drive| ring.cells(drive).is_some_and(monitors))
    }
}
