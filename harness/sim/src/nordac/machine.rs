//! The state machine (3.3; section 6 of the reading): which transition a control word or the standstill of the motor causes.
//!
//! The model starts in start-disable, so that "not ready to start" does not occur.

use harness_proto::nordac::words::{State, stw};

/// The number of a transition in section 6 of the reading; the figure of 3.3 is lost, and its numbers with it.
pub type TransitionNumber = u8;

/// The transition that ends a state because the motor stands: rules 5, 10 and 12.
#[must_use]
pub const fn at_standstill(state: State, control: u16) -> Option<(TransitionNumber, State)> {
    match state {
        State::OperationEnabled if control & stw::ON == 0 => Some((5, State::ReadyToStart)),
        State::QuickStop => Some((10, State::StartDisable)),
        State::FaultReaction => Some((12, State::Fault)),
        _ => None,
    }
}

/// The next transition that a valid control word causes; `None` where nothing changes any more.
///
/// `standing` says whether the frequency is 0. `off1_first` says whether OFF1 has priority over "disable operation"
/// (`off1-beats-disable`).
#[must_use]
pub const fn next(
    state: State,
    control: u16,
    standing: bool,
    off1_first: bool,
) -> Option<(TransitionNumber, State)> {
    let (on, voltage) = (control & stw::ON != 0, control & stw::NO_OFF2 != 0);
    let (no_quick_stop, enabled) = (control & stw::NO_OFF3 != 0, control & stw::ENABLE != 0);
    let valid = control & stw::VALID != 0;
    match state {
        State::ReadyToStart
        | State::ReadyForOperation
        | State::OperationEnabled
        | State::QuickStop
            if !voltage =>
        {
            Some((8, State::StartDisable))
        }
        State::FaultReaction if !voltage => Some((12, State::Fault)),
        State::OperationEnabled if !no_quick_stop && !standing => Some((9, State::QuickStop)),
        State::ReadyToStart | State::ReadyForOperation | State::OperationEnabled
            if !no_quick_stop =>
        {
            Some((11, State::StartDisable))
        }
        State::ReadyForOperation if !on => Some((6, State::ReadyToStart)),
        State::OperationEnabled if !enabled && (on || !off1_first) => {
            Some((7, State::ReadyToStart))
        }
        State::OperationEnabled if !on && standing => Some((5, State::ReadyToStart)),
        State::ReadyForOperation if enabled => Some((4, State::OperationEnabled)),
        State::ReadyToStart if on => Some((3, State::ReadyForOperation)),
        State::StartDisable if !on && voltage && no_quick_stop && valid => {
            Some((2, State::ReadyToStart))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transitions that a word causes, with their numbers.
    fn path(mut state: State, control: u16, standing: bool) -> (Vec<TransitionNumber>, State) {
        let mut rules = Vec::new();
        while let Some((rule, new)) = next(state, control, standing, true) {
            rules.push(rule);
            state = new;
            assert!(rules.len() < 8, "{control:04X} does not settle");
        }
        (rules, state)
    }

    #[test]
    fn every_transition_of_a_control_word() {
        use State::{FaultReaction, QuickStop, ReadyForOperation, StartDisable};
        use State::{OperationEnabled as Enabled, ReadyToStart as Ready};
        let cases: [(State, u16, bool, &[TransitionNumber], State); 23] = [
            (StartDisable, 0x047E, true, &[2], Ready),
            (StartDisable, 0x047F, true, &[], StartDisable),
            (StartDisable, 0x007E, true, &[], StartDisable),
            (StartDisable, 0x047C, true, &[], StartDisable),
            (Ready, 0x047F, true, &[3, 4], Enabled),
            (Ready, 0x0477, true, &[3], ReadyForOperation),
            (ReadyForOperation, 0x047F, true, &[4], Enabled),
            (Enabled, 0x047E, false, &[], Enabled),
            (Enabled, 0x047E, true, &[5], Ready),
            (ReadyForOperation, 0x0476, true, &[6], Ready),
            (Enabled, 0x0477, false, &[7, 3], ReadyForOperation),
            (Enabled, 0x0476, false, &[], Enabled),
            (Ready, 0x047D, true, &[8], StartDisable),
            (ReadyForOperation, 0x047D, true, &[8], StartDisable),
            (Enabled, 0x047D, false, &[8], StartDisable),
            (QuickStop, 0x047D, false, &[8], StartDisable),
            (Enabled, 0x047B, false, &[9], QuickStop),
            (QuickStop, 0x047F, false, &[], QuickStop),
            (Ready, 0x047B, true, &[11], StartDisable),
            (ReadyForOperation, 0x047B, true, &[11], StartDisable),
            (Enabled, 0x047B, true, &[11], StartDisable),
            (FaultReaction, 0x047D, false, &[12], State::Fault),
            (FaultReaction, 0x0470, true, &[12], State::Fault),
        ];
        for (from, control, standing, rules, to) in cases {
            let expected = (rules.to_vec(), to);
            assert_eq!(
                path(from, control, standing),
                expected,
                "{from:?} {control:04X} {standing}"
            );
        }
        // The words of 3.2.1 that the reading names: two telegrams lead from start-disable to operation.
        assert_eq!(path(Ready, 0x040F, true).1, Enabled);
    }

    #[test]
    fn every_word_settles_and_a_fault_stays() {
        for state in State::ALL {
            for control in 0..=0xFFFF {
                for standing in [false, true] {
                    let (_, end) = path(state, control, standing);
                    assert!(state != State::Fault || end == State::Fault);
                    assert!(
                        control & stw::NO_OFF2 != 0 || !end.output_on(),
                        "{state:?} {control:04X}"
                    );
                }
            }
        }
    }

    #[test]
    fn disabled_at_once_or_after_the_ramp() {
        assert_eq!(next(State::OperationEnabled, 0x0476, false, true), None);
        assert_eq!(
            next(State::OperationEnabled, 0x0476, false, false),
            Some((7, State::ReadyToStart))
        );
    }

    #[test]
    fn standstill_ends_three_states() {
        assert_eq!(
            at_standstill(State::OperationEnabled, 0x047E),
            Some((5, State::ReadyToStart))
        );
        assert_eq!(at_standstill(State::OperationEnabled, 0x046F), None);
        assert_eq!(
            at_standstill(State::QuickStop, 0x047F),
            Some((10, State::StartDisable))
        );
        assert_eq!(
            at_standstill(State::FaultReaction, 0x047F),
            Some((12, State::Fault))
        );
        assert_eq!(at_standstill(State::ReadyToStart, 0x047E), None);
    }
}
