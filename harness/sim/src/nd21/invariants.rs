//! Invariants that hold after every cycle, for any bus write and any outside input. A drive that breaks one is
//! in an impossible state: a mistake in this model. Builds with debug assertions check every cycle, and so does a
//! `InvariantWatch` that has begun.

use super::positioning::Positioning;
use super::world::Mode;
use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::{flags, ps_status, status};
use harness_proto::nd21::ram;

/// What is looked at.
pub(super) struct CheckedState<'a> {
    pub(super) cells: &'a Cells,
    pub(super) mode: Mode,
    pub(super) positioning: &'a Positioning,
    pub(super) speed: f64,
    pub(super) position: f64,
}

/// A sentence and whether it holds.
type Invariant = (&'static str, fn(&CheckedState<'_>) -> bool);

const INVARIANTS: &[Invariant] = &[
    ("the rotor has a speed and a place", |s| {
        s.speed.is_finite() && s.position.is_finite()
    }),
    ("the torque stays within its limit (14.5.2)", |s| {
        let most = u16::from(s.cells.byte(ram::MMAX)) * 256;
        s.cells.signed(ram::MSOLL).unsigned_abs() <= most
    }),
    (
        "the torque limit is at most the peak current (14.5.1.2)",
        |s| s.cells.byte(ram::MMAX) <= s.cells.byte(ram::IMAX).min(0x7F),
    ),
    (
        "a blocked regulator has no torque and no nominal speed (11.8)",
        |s| {
            released(s.mode)
                || s.cells.word(ram::MSOLL) == 0
                    && s.cells.word(ram::NSOLLRAMPE) == 0
                    && s.cells.word(ram::IASOLL) == 0
                    && s.cells.word(ram::IAIST) == 0
        },
    ),
    (
        "the nominal position of a blocked regulator is the actual one",
        |s| released(s.mode) || s.cells.long(ram::UMDRSOLL) == s.cells.long(ram::UMDRIST),
    ),
    (
        "Flags bit 7 says whether the regulator is blocked (13.2.1.1)",
        |s| (s.cells.byte(ram::FLAGS) & flags::BLOCK == 0) == released(s.mode),
    ),
    (
        "Status bit 5 and the error mode go together (14.10.1)",
        |s| {
            let error = s.cells.byte(ram::STATUS) & status::ERROR != 0;
            s.mode == Mode::Reset || error == (s.mode == Mode::Error)
        },
    ),
    ("Status bit 6 and the reset mode go together (11.8)", |s| {
        (s.cells.byte(ram::STATUS) & status::RESET != 0) == (s.mode == Mode::Reset)
    }),
    (
        "a positioning runs only in Go, in exactly one phase (13.3.2.3)",
        |s| {
            let phases = ps_status::CONSTANT | ps_status::BRAKING | ps_status::TARGET_BRAKING;
            let phase = s.cells.byte(ram::PS_STATUS) & (phases | ps_status::FINISHED);
            !s.positioning.running() || phase.is_power_of_two() && phase & phases != 0
        },
    ),
    ("no motor turns faster than the model allows", |s| {
        s.speed.abs() <= 65_000.0
    }),
];

fn released(mode: Mode) -> bool {
    matches!(mode, Mode::Stop | Mode::Go)
}

/// What is known of the invariants of a drive.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InvariantWatch {
    watching: bool,
    broken: Option<&'static str>,
}

impl InvariantWatch {
    /// Starts to watch: the first broken invariant is kept from now on.
    pub(crate) fn begin(&mut self) {
        self.watching = true;
    }

    /// The first invariant that was broken since the watch began.
    pub(crate) fn broken(self) -> Option<&'static str> {
        self.broken
    }

    /// Checks the invariants after a cycle.
    pub(super) fn look(&mut self, state: &CheckedState<'_>) {
        if self.watching {
            self.broken = self.broken.or_else(|| broken(state));
        } else {
            debug_assert_eq!(broken(state), None);
        }
    }
}

/// The first invariant that does not hold.
fn broken(state: &CheckedState<'_>) -> Option<&'static str> {
    let (sentence, _) = INVARIANTS.iter().find(|(_, holds)| !holds(state))?;
    Some(sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A watch keeps the first broken invariant in every build and does not panic.
    #[test]
    fn a_broken_invariant_is_kept() {
        let cells = Cells::with_eeprom([0; 256]);
        let positioning = Positioning::default();
        let state = |speed, position| CheckedState {
            cells: &cells,
            mode: Mode::Stop,
            positioning: &positioning,
            speed,
            position,
        };
        let mut watch = InvariantWatch::default();
        watch.begin();
        watch.look(&state(0.0, 0.0));
        assert_eq!(watch.broken(), None);
        watch.look(&state(70_000.0, 0.0));
        watch.look(&state(0.0, f64::NAN));
        let first = "no motor turns faster than the model allows";
        assert_eq!(watch.broken(), Some(first));
    }
}
