//! The states of a drive and what can happen to it, as the target `unitek-drive` counts them.
//!
//! A state is made of MODE (lock, sending by event), the hardware enable, ready, and the number of cycles.

use crate::fuzz::{Feature, events};
use crate::unitek::Drive;
use harness_proto::unitek::frame::CYCLES;
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK};

/// How many cycles run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CycleCount {
    /// None.
    None,
    /// 1 to 7.
    Some,
    /// 8: the table is full.
    Full,
}

/// The state of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellState {
    /// MODE bit 2.
    pub(super) locked: bool,
    /// MODE bit 4: STATUS is sent when it changes.
    pub(super) by_event: bool,
    /// Both enable inputs are closed.
    pub(super) closed: bool,
    /// E2.
    pub(super) ready: bool,
    pub(super) cycles: CycleCount,
}

/// How many states there are.
const STATES: usize = 16 * 3;

impl CellState {
    /// The state of a drive.
    #[must_use]
    pub(super) fn of(drive: &Drive) -> Self {
        let mode = drive.held()[0x51];
        let cycles = match drive.running_cycles().count() {
            0 => CycleCount::None,
            CYCLES => CycleCount::Full,
            _ => CycleCount::Some,
        };
        Self {
            locked: mode & u32::from(MODE_LOCK) != 0,
            by_event: mode & u32::from(MODE_EVENT) != 0,
            closed: drive.inputs().run && drive.inputs().rfe,
            ready: drive.is_ready(),
            cycles,
        }
    }

    /// The state with this number, below 48.
    const fn numbered(number: usize) -> Self {
        let cycles = match number / 16 {
            0 => CycleCount::None,
            1 => CycleCount::Some,
            _ => CycleCount::Full,
        };
        Self {
            locked: number & 1 != 0,
            by_event: number & 2 != 0,
            closed: number & 4 != 0,
            ready: number & 8 != 0,
            cycles,
        }
    }

    const fn index(self) -> usize {
        let bits = self.locked as usize
            | (self.by_event as usize) << 1
            | (self.closed as usize) << 2
            | (self.ready as usize) << 3;
        bits + 16 * self.cycles as usize
    }

    /// In words.
    #[must_use]
    pub(super) fn name(self) -> String {
        let lock = if self.locked { "locked" } else { "released" };
        let events = if self.by_event { "on" } else { "off" };
        let enable = if self.closed { "closed" } else { "open" };
        let ready = if self.ready { "ready" } else { "not ready" };
        let cycles = match self.cycles {
            CycleCount::None => "no cycle",
            CycleCount::Some => "1 to 7 cycles",
            CycleCount::Full => "8 cycles",
        };
        format!("{lock}, events {events}, enable {enable}, {ready}, {cycles}")
    }
}

events! {
    Foreign "4.3" "a frame with another identifier";
    Remote "4.4" "a remote frame";
    TooShort "5.1" "a frame with too few bytes";
    Read "5.2" "a request for one reply";
    ReadOfCycle "5.2" "a request for one reply from a register with a cycle";
    Start "5.2" "a request for a cycle";
    Restart "5.2" "a request for another interval";
    Ninth "App 8" "a request for a ninth cycle";
    Stop "5.2" "a cycle is stopped";
    StopOfNone "5.2" "a stop where no cycle runs";
    Release "ex 2" "MODE: released, events off";
    Lock "ex 2" "MODE: locked, events off";
    ReleaseWithStatus "ex 10" "MODE: released, events on";
    LockWithStatus "ex 10" "MODE: locked, events on";
    Mask "ex 10" "a write of STATUS_MASK";
    Speed "ex 3" "a speed command";
    Torque "ex 5" "a torque command";
    Position "ex 4" "a destination";
    Preset "App 6" "a position preset";
    Homing "ex 12" "homing begins";
    NoFunction "ex 12" "a function that does nothing";
    ClearErrors "dump" "errors are cleared";
    Store "ex 7" "parameters are stored";
    Load "dump" "parameters are loaded";
    Identifier "ex 1" "a write of an identifier";
    TimeOut "dump" "a write of the bus time-out";
    Width "App 3" "a write of DEFINE_DAC";
    Ramp "ex 6" "a write of a ramp or a limit";
    ReadOnly "dump" "a write of a register that cannot be written";
    Parameter "dump" "a write of another register";
    ShortWrite "App 1" "16 bits to a register of 32 bits";
    LongWrite "App 1" "32 bits to a register of 16 bits";
    Input "ex 11" "an input changes";
    Fault "dump" "fault bits change";
    Forced "dump" "a sensor changes";
    Quiet "5.2" "time passes, and nothing is sent";
    Cyclic "5.2" "a cyclic frame is sent";
    StatusSent "ex 10" "an event frame is sent";
    TimedOut "dump" "the bus time-out is found";
    HomingEnds "ex 12" "homing ends";
}

/// A cell: what happened, and in which state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DriveCell {
    pub(super) state: CellState,
    pub(super) event: Event,
}

/// How many cells there are, those that nothing can reach included.
pub const CELLS: usize = STATES * Event::ALL.len();

impl DriveCell {
    /// Its number, below [`CELLS`].
    #[must_use]
    pub(super) const fn index(self) -> usize {
        self.state.index() * Event::ALL.len() + self.event as usize
    }

    /// Whether a drive can reach it.
    #[must_use]
    pub(super) fn is_reachable(self) -> bool {
        let CellState {
            locked,
            by_event,
            closed,
            ready,
            cycles,
        } = self.state;
        match self.event {
            // A ninth request is one of a full table, and any other needs a free place.
            Event::Start => cycles != CycleCount::Full,
            Event::Ninth => cycles == CycleCount::Full,
            Event::ReadOfCycle | Event::Restart | Event::Stop | Event::Cyclic => {
                cycles != CycleCount::None
            }
            Event::StatusSent => by_event,
            // Only an enabled drive homes, and it stops when it is no longer enabled.
            Event::Homing | Event::HomingEnds => closed && ready && !locked,
            _ => true,
        }
    }

    /// All that can be reached.
    pub(super) fn reachable() -> impl Iterator<Item = Self> {
        let cells = (0..STATES).flat_map(|state| {
            let state = CellState::numbered(state);
            Event::ALL.iter().map(move |&event| Self { state, event })
        });
        cells.filter(|cell| cell.is_reachable())
    }

    #[must_use]
    pub(super) fn feature(self) -> Feature {
        let (section, words) = self.event.words();
        Feature::new(section, self.state.name(), words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_cell_has_a_number_of_its_own() {
        let numbers: BTreeSet<_> = DriveCell::reachable().map(DriveCell::index).collect();
        assert_eq!(numbers.len(), DriveCell::reachable().count());
        assert!(numbers.iter().all(|number| *number < CELLS));
        for number in 0..STATES {
            assert_eq!(CellState::numbered(number).index(), number);
        }
    }
}
