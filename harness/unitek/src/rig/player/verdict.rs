//! The verdict of an attempt in which a line was not met, or right drives would have sent something else.

use super::note::{meaning, phases};
use super::worlds::{AttemptFrames, BESIDE_THE_BUS, Proof, STOOD_STILL};
use super::{AtRest, ModelOptions, Player, RigScenario};
use crate::judge::World;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::run::outcome::Mismatch;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::unitek::Register;
use harness_proto::unitek::words::status;
use std::collections::BTreeSet;

/// Why a line that was not met accuses nothing.
const RIGHT_ALL_THE_SAME: &str = "right drives with these registers send the same, with frames as late as these and their clocks anywhere: the line is not met for that reason alone";

/// In how many attempts at a scenario, one after the other, an adapter may have lost a frame of the same register.
const LOST_BY_THE_ADAPTER: usize = 2;

/// Why a line that was not met accuses nothing, where right drives were compared.
const NOT_COMPARED: &str = "right drives send the same as far as it is compared, and the contents of this line follow from the plant or from inputs";

/// What no right drive does that the attempt is played on again.
const NOT_REPLAYED: &str = "no right drive sends this: the attempt was played on right drives with each value of what the manual leaves open, and \
                            their clocks at each place";

/// Why a line is not judged while right drives could have sent what came.
const UNDER_WAY: &str = "right drives could have sent this with another value of what the manual leaves open, or with frames that are still on their way";

impl Player {
    /// What was shown, where it is compared with the attempts before: a drive that does not send something does not send it each time.
    pub(super) fn lost_again(&mut self, scenario: &RigScenario, shown: Proof) -> Proof {
        let before = self.lost.remove(&scenario.name);
        let Proof::Lost(register, why) = shown else {
            return shown;
        };
        let same = before.filter(|lost| lost.0 == register);
        let times = same.map_or(1, |lost| lost.1 + 1);
        if times > LOST_BY_THE_ADAPTER {
            return Proof::Wrong(why);
        }
        self.lost.insert(scenario.name.clone(), (register, times));
        Proof::Lost(register, why)
    }

    /// The verdict of an attempt by what right drives could have sent. Its lines alone say what was not met.
    pub(super) fn judged(
        &self,
        scenario: &RigScenario,
        outcome: Outcome,
        unlike: &[(u8, u8)],
        foretold: &[usize],
        shown: Proof,
    ) -> Outcome {
        let differs = |register| unlike.iter().any(|differs| differs.1 == register);
        let judged = |line: &usize| {
            // That the model does not meet a line either was known before.
            let known = foretold.contains(line);
            let mut asked = scenario.asks_at(&[*line]).into_iter();
            asked.all(|register| (known || World::compares(register)) && !differs(register))
        };
        let judged_by_worlds = !outcome.unmet.is_empty() && outcome.unmet.iter().all(judged);
        match (outcome.verdict, shown) {
            (Verdict::Failed | Verdict::Passed, Proof::Wrong(why)) => {
                wronged(scenario, outcome, why)
            }
            (Verdict::Failed | Verdict::Passed, Proof::Lost(_, why)) => Outcome {
                verdict: Verdict::Inconclusive,
                shows_nothing: true,
                remarks: std::iter::once(why).chain(outcome.remarks).collect(),
                ..outcome
            },
            (Verdict::Failed, Proof::Complete) if judged_by_worlds => right_all_the_same(outcome),
            (Verdict::Failed, Proof::Complete) => inconclusive(outcome, NOT_COMPARED.to_owned()),
            (Verdict::Passed, Proof::Complete) => outcome.judged_by(&scenario.plan),
            (Verdict::Failed, Proof::Right) => inconclusive(outcome, UNDER_WAY.to_owned()),
            (Verdict::Failed, Proof::Unknown(why)) => inconclusive(outcome, not_to_its_end(why)),
            (Verdict::Passed, Proof::Unknown(why)) if scenario.by_frames || why == STOOD_STILL => {
                inconclusive(outcome, not_to_its_end(why))
            }
            _ => outcome.judged_by(&scenario.plan),
        }
    }

    /// What right drives show in virtual time where their frames alone do not tell it, as where faults are put on frames: the attempt is played
    /// on each of them, wherever its clock stands and whatever the manual leaves open. The lines alone compare times.
    pub(super) fn replayed(&self, scenario: &RigScenario, told: &AttemptFrames) -> Proof {
        let came = told.talk.came_since_it_began();
        let came: Vec<_> = came.map(|frame| meaning(frame, true)).collect();
        let could_send = |other: &ModelOptions| {
            let played = self.rehearse(scenario, &self.limits, *other).noted.exchange;
            let sent = played.came_since_it_began();
            sent.map(|frame| meaning(frame, true))
                .eq(came.iter().cloned())
        };
        let phases = phases(1).map(|phase| ModelOptions {
            phase,
            ..ModelOptions::default()
        });
        let drives = self.known().iter().enumerate();
        let values = drives.flat_map(|(place, known)| {
            known
                .candidates()
                .into_iter()
                .map(move |properties| ModelOptions {
                    drive: Some((place, properties)),
                    ..ModelOptions::default()
                })
        });
        match phases.chain(values).any(|other| could_send(&other)) {
            true => Proof::Right,
            false if told.unlike.is_empty() => Proof::Wrong(NOT_REPLAYED.to_owned()),
            false => Proof::Unknown(BESIDE_THE_BUS),
        }
    }
}

/// An attempt in which a drive did what no right one does, in a sentence.
fn wronged(scenario: &RigScenario, outcome: Outcome, wrong: String) -> Outcome {
    let last = scenario.plan.steps.last();
    let found = outcome.finding.unwrap_or_else(|| Mismatch {
        span: last.map_or(TextSpan::default(), |step| step.span),
        message: wrong.clone(),
        difference: None,
        in_error: String::new(),
    });
    Outcome {
        verdict: Verdict::Failed,
        finding: Some(found),
        remarks: std::iter::once(wrong).chain(outcome.remarks).collect(),
        ..outcome
    }
}

/// Whether right drives are compared in what the lines ask for that the model has not met.
pub(super) fn are_judged(scenario: &RigScenario, rehearsed: &Outcome) -> bool {
    let mut asked = scenario.asks_at(&rehearsed.unmet).into_iter();
    !rehearsed.unmet.is_empty() && asked.all(World::compares_partly)
}

fn inconclusive(outcome: Outcome, why: String) -> Outcome {
    Outcome {
        verdict: Verdict::Inconclusive,
        shows_nothing: true,
        remarks: std::iter::once(why).chain(outcome.remarks).collect(),
        ..outcome
    }
}

fn not_to_its_end(why: &str) -> String {
    format!("what came was not compared to its end: {why}")
}

/// An attempt in which the drives did what right ones do, and a line is not met since frames were late or the drive has other registers.
fn right_all_the_same(outcome: Outcome) -> Outcome {
    let found = outcome.finding.map(|finding| finding.message);
    let why = std::iter::once(RIGHT_ALL_THE_SAME.to_owned()).chain(found);
    Outcome {
        verdict: Verdict::Passed,
        finding: None,
        remarks: why.chain(outcome.remarks).collect(),
        ..outcome
    }
}

/// Registers that show whether a drive is ready, and those that show whether it runs, each with the bits for it that are 1 where it is, and
/// those that are 0 (ex 8, ex 11, App 7, dump).
const READY: [(u8, u32, u32); 3] = [(0xE2, 1, 0), (0xD8, 1 << 10, 0), (0xEF, 0, 0)];
const RUNS: [(u8, u32, u32); 4] = [
    (0xE3, 1, 0),
    (0x40, status::ENABLED, 0),
    (0xD8, 1 << 11, 0),
    (0xF2, 0, 1),
];

/// The scale of the speed, and whether it counts as standing: both follow from other registers alone.
const FROM_OTHERS: [u8; 2] = [0xCE, 0xF5];

/// The registers among those that read differently at rest which right drives read so: one that an input which no register shows keeps from
/// being ready or from running says so in all of them.
pub(super) fn explained(unlike: &[(u8, u8)], drives: &AtRest) -> Vec<(u8, u8)> {
    let agree = |node: u8, all: &[(u8, u32, u32)]| {
        let shown = all.iter().filter_map(|(register, one, zero)| {
            let read = drives
                .iter()
                .find(|cell| (cell.0, cell.1) == (node, *register));
            let read = read.filter(|_| one | zero != 0)?.2;
            Some(read & one != 0 || zero & !read != 0)
        });
        let shown: BTreeSet<_> = shown.collect();
        shown.len() < 2
    };
    let explained = |(node, register): &(u8, u8)| {
        let of = |all: &[(u8, u32, u32)]| all.iter().any(|cell| cell.0 == *register);
        let other = |all: &[_]| !of(all) || agree(*node, all);
        !FROM_OTHERS.contains(register) && other(&READY) && other(&RUNS)
    };
    unlike.iter().copied().filter(explained).collect()
}

/// The registers in which drives and their models read differently at rest, by number and register.
pub(super) fn unlike(drives: &AtRest, models: &AtRest) -> Vec<(u8, u8)> {
    let mask = |(node, register, bits): &(u8, u8, u32)| {
        (*node, *register, bits & Register::of(*register).mask())
    };
    let models: BTreeSet<_> = models.iter().map(mask).collect();
    let drives: BTreeSet<_> = drives.iter().map(mask).collect();
    let differing = drives.symmetric_difference(&models);
    let places: BTreeSet<_> = differing
        .map(|(node, register, _)| (*node, *register))
        .collect();
    places.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ex 8, ex 11, App 7: STATUS, O_GO, LOGICMAP_IO and the brake say the same of a drive that an unknown input keeps from running; one
    /// of them alone says it of none.
    #[test]
    fn an_input_that_no_register_shows_explains_all_of_them_or_none() {
        let locked = [
            (0x40, 0x0100),
            (0xD8, 0x0430),
            (0xE2, 1),
            (0xE3, 0),
            (0xF2, 1),
        ];
        let drives = |all: &[(u8, u32)]| -> AtRest {
            all.iter()
                .map(|(register, bits)| (1, *register, *bits))
                .collect()
        };
        let unlike = [0x40, 0xD8, 0xE3, 0xF2].map(|register| (1, register));
        assert_eq!(explained(&unlike, &drives(&locked)), unlike);
        let alone = [
            (0x40, 0x0101),
            (0xD8, 0x0430),
            (0xE2, 1),
            (0xE3, 1),
            (0xF2, 0),
        ];
        assert_eq!(explained(&[(1, 0xD8)], &drives(&alone)), []);
        // Other drives, and other registers.
        assert_eq!(
            explained(&[(2, 0xD8), (1, 0x8F)], &drives(&alone)),
            [(2, 0xD8), (1, 0x8F)]
        );
        assert_eq!(explained(&[(1, 0xCE)], &drives(&locked)), []);
    }
}
