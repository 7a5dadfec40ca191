//! The states of a drive and what can happen to it, as the target `nordac-slave` counts them: DP state, drive state, event.

use crate::fuzz::{Feature, events};
use crate::nordac::Drive;
use harness_proto::nordac::words::State as DriveState;
use harness_proto::profibus::dp::DpState;

/// The state of a drive and its module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct State {
    /// Of the module.
    pub(super) dp: DpState,
    /// Of the inverter.
    pub(super) drive: DriveState,
}

const DP: [DpState; 3] = [DpState::WaitPrm, DpState::WaitCfg, DpState::DataExch];

/// How many states there are; "not ready to start" does not occur.
const STATES: usize = DP.len() * (DriveState::ALL.len() - 1);

impl State {
    pub(super) fn of(drive: &Drive) -> Self {
        Self {
            dp: drive.slave().state(),
            drive: drive.inverter().state(),
        }
    }

    fn numbered(number: usize) -> Self {
        Self {
            dp: DP[number % DP.len()],
            drive: DriveState::ALL[number / DP.len() + 1],
        }
    }

    fn index(self) -> usize {
        let dp = DP.iter().position(|dp| *dp == self.dp);
        let drive = DriveState::ALL
            .iter()
            .position(|drive| *drive == self.drive);
        dp.unwrap_or(0) + DP.len() * drive.unwrap_or(1).saturating_sub(1)
    }

    fn name(self) -> String {
        let dp = match self.dp {
            DpState::WaitPrm => "Wait_Prm",
            DpState::WaitCfg => "Wait_Cfg",
            DpState::DataExch => "Data_Exch",
        };
        format!("{dp}, {}", self.drive)
    }
}

events! {
    Silence "EN 1" "a telegram without an answer";
    Status "EN 1" "FDL status";
    Refused "EN 1" "a refused service";
    Repeated "EN 1" "a repetition";
    Parameters "EN 2" "Set_Prm is accepted";
    PrmFault "EN 2" "Set_Prm is wrong";
    Unlock "EN 2" "Set_Prm unlocks or sets the delay alone";
    Configuration "EN 2" "Chk_Cfg is accepted";
    CfgFault "EN 2" "Chk_Cfg is wrong";
    Diagnosis "EN 2" "Slave_Diag";
    Read "EN 2" "RD_Inp, RD_Outp or Get_Cfg";
    Control "EN 2" "Global_Control";
    WrongLength "EN 2" "a Data_Exchange of the wrong length";
    Invalid "3.2.1" "words that are not valid";
    Off1 "3.2.1" "words with OFF1";
    Off2 "3.2.1" "words with OFF2";
    Off3 "3.2.1" "words with OFF3";
    Disable "3.2.1" "words that disable operation";
    Enable "3.2.1" "words that enable operation";
    Acknowledge "3.2.1" "words that acknowledge";
    Requested "3.4.1" "a task that reads";
    Changed "3.4.1" "a task that changes";
    TaskError "3.4.1" "a task that cannot be executed";
    Lost "2.6" "module and inverter lose each other";
    Found "2.6" "module and inverter find each other";
    Cause "5.7" "the cause of a fault comes";
    Gone "5.7" "the cause of a fault goes";
    Fault "5.7" "a fault occurs by itself";
    Standstill "3.3" "the motor comes to rest, and the state ends";
    Watchdog "EN 2" "the watchdog expires";
    Quiet "3.3" "time passes, and nothing happens";
}

/// A cell: what happened, and in which state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DpCell {
    pub(super) state: State,
    pub(super) event: Event,
}

/// How many cells there are, those that nothing can reach included.
pub const CELLS: usize = STATES * Event::ALL.len();

impl DpCell {
    /// Its number, below [`CELLS`].
    pub(super) fn index(self) -> usize {
        self.state.index() * Event::ALL.len() + self.event as usize
    }

    /// Whether a drive can reach it.
    pub(super) fn is_reachable(self) -> bool {
        let State { dp, drive } = self.state;
        let exchanges = dp == DpState::DataExch;
        match self.event {
            Event::WrongLength | Event::Requested | Event::Changed | Event::TaskError => exchanges,
            Event::Invalid | Event::Off1 | Event::Off2 | Event::Off3 => exchanges,
            Event::Disable | Event::Enable | Event::Acknowledge => exchanges,
            Event::Configuration | Event::CfgFault | Event::Watchdog | Event::Control => {
                dp != DpState::WaitPrm
            }
            Event::Standstill => drive.output_on(),
            // In the state "fault" a further one is not recorded.
            Event::Fault => drive != DriveState::Fault,
            _ => true,
        }
    }

    /// All that can be reached.
    pub(super) fn reachable() -> impl Iterator<Item = Self> {
        let cells = (0..STATES).flat_map(|state| {
            let state = State::numbered(state);
            Event::ALL.iter().map(move |&event| Self { state, event })
        });
        cells.filter(|cell| cell.is_reachable())
    }

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
        let numbers: BTreeSet<_> = DpCell::reachable().map(DpCell::index).collect();
        assert_eq!(numbers.len(), DpCell::reachable().count());
        assert!(numbers.iter().all(|number| *number < CELLS));
        for number in 0..STATES {
            assert_eq!(State::numbered(number).index(), number);
        }
    }
}
