//! Qualifications and fuzz runs on such a computer: no right drive fails, no deviation is named, and nothing is found.

use super::line::Stalls;
use super::{Run, rig, session};
use crate::cli::fuzz::port_scope;
use crate::explore::{Case, Finding, FuzzRun, FuzzSettings, Pool, Swarm};
use crate::explore::{OnRig, RingSetup};
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::qualify::{Qualification, QualificationFacts, QualifiedBench};
use crate::twin::Twin;
use harness_bench::explore::{Bounds, Progress, Watcher};
use harness_bench::rig::PlayedScenario;
use harness_bench::rig::playing::Qualified;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::verdict::Verdict;

/// A rig whose outcomes are kept.
struct WatchedRig<'r, 's> {
    run: &'r mut Run<'s>,
    failed: Vec<String>,
    /// Those of the other parts.
    others: Vec<Self>,
}

impl<'r, 's> WatchedRig<'r, 's> {
    const fn new(run: &'r mut Run<'s>) -> Self {
        Self {
            run,
            failed: Vec::new(),
            others: Vec::new(),
        }
    }
}

impl QualifiedBench for WatchedRig<'_, '_> {
    type Stop = String;

    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, String> {
        let plan = &entry.plan;
        let played = self.run.play(plan, None);
        let played = played.map_err(|error| format!("{}: {error}", entry.short_name()))?;
        if played.outcome.verdict == Verdict::Failed {
            let why = played.outcome.remarks.join("; ");
            self.failed.push(format!("{}: {why}", entry.short_name()));
        }
        Ok(played)
    }

    fn over(&mut self) -> bool {
        false
    }

    fn others(&mut self) -> &mut [Self] {
        &mut self.others
    }

    fn part(&self) -> String {
        "slice:2/2".to_owned()
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        self.run.twin_with(header)
    }

    fn tell(&mut self, _: &str) -> Result<(), String> {
        Ok(())
    }

    fn show(&mut self, _: &RingScenario, _: &PlayedScenario) -> Result<(), String> {
        Ok(())
    }
}

/// What a qualification of right drives says that it must not say.
fn blamed(drives: &str, (seed, one_in): (u64, u64)) -> Vec<String> {
    let rig = rig("");
    let stalls = Stalls::new(seed, one_in);
    let mut session = session(&rig, drives, stalls).expect("a right ring that opens");
    let mut run = Run::new(&mut session).expect("a run");
    run.repeat();
    let facts = QualificationFacts::of(&mut run);
    let mut watched = WatchedRig::new(&mut run);
    let mut said = match Qualification::new(facts).settle(&mut watched, String::new(), false) {
        Ok(found) => {
            let named = found.deviations.lines();
            let named = named.filter(|line| {
                line.starts_with("deviation:") || line.contains("the drives differ from the model")
            });
            let mut named: Vec<_> = named.map(str::to_owned).collect();
            if found.verdict == Verdict::Failed {
                named.push("exit code 1".to_owned());
            }
            named
        }
        Err(why) => vec![why],
    };
    said.extend(watched.failed);
    said.iter()
        .map(|line| format!("seed {seed}: {line}"))
        .collect()
}

/// Keeps what a run finds.
#[derive(Default)]
struct FindingLog(Vec<String>);

impl Watcher<Case> for FindingLog {
    fn round(&mut self, _: u64, _: &Swarm) {}

    fn found(&mut self, finding: &Finding, file: &str) {
        let Finding {
            confirmed,
            difference,
            ..
        } = finding;
        // A byte that was late, and was not late again, is told and blames no drive.
        if *confirmed || !difference.time {
            let confirmed = if *confirmed { "confirmed" } else { "flaky" };
            self.0
                .push(format!("{file}, {confirmed}: {}", difference.about));
        }
    }

    fn progress(&mut self, _: &Progress, _: &Pool) {}
}

/// What a fuzz run finds on right drives.
fn found(drives: &str, (seed, one_in): (u64, u64), cases: u64) -> Vec<String> {
    let rig = rig("");
    let stalls = Stalls::new(seed, one_in);
    let mut session = session(&rig, drives, stalls).expect("a right ring that opens");
    let mut run = Run::new(&mut session).expect("a run");
    let scope = port_scope(&mut run);
    let about = FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: "busy".to_owned(),
        drives: 3,
        second: None,
        ports: true,
        seed,
        confirm: 2,
        of: 3,
        setup: RingSetup::of_ports(1),
        spices: Vec::new(),
    };
    let mut target = OnRig::new(&mut run, scope.limits).expect("a target");
    let bounds = Bounds {
        cases,
        wire: None,
        findings: 1_000,
        every: 1,
    };
    let mut found = FindingLog::default();
    let mut fuzz = FuzzRun::new(about, scope);
    if let Err(error) = fuzz.run(&mut target, None, &bounds, &mut found) {
        found.0.push(error.to_string());
    }
    found
        .0
        .iter()
        .map(|finding| format!("seed {seed}: {finding}"))
        .collect()
}

const NOTHING: [String; 0] = [];

/// The settings of a right ring: the manual's, monitoring by the EEPROM (ND21 14.3.6), and other choices that it leaves open.
const RIGHT: [&str; 3] = [
    "",
    "drive 0..last eeprom 47 = 80",
    "drive 0..last eeprom 47 = 80\ndrive 0..last property read-long = as-printed\ndrive 0..last property short-address = kept-sum",
];

/// A trial by hand: `BUSY=ONE_IN,FIRST,LAST,DRIVES,CASES` are one stall in this number of actions, seeds from the first up to the last, an index into
/// [`RIGHT`], and the number of cases of a fuzz run; 0 stands for a qualification, 1 for the
/// built-in scenarios. `60,1,3,1,0` by default.
#[test]
#[ignore = "takes minutes; .ci/nightly runs it"]
fn by_hand() {
    let text = std::env::var("BUSY").unwrap_or_else(|_| "60,1,3,1,0".to_owned());
    let numbers: Vec<u64> = text
        .split(',')
        .map(|number| number.parse().expect("a number"))
        .collect();
    let [one_in, first, last, drives, cases] = numbers[..] else {
        panic!("five numbers")
    };
    let drives = RIGHT[usize::try_from(drives).expect("a number")];
    let all = (first..last).flat_map(|seed| match cases {
        0 => blamed(drives, (seed, one_in)),
        1 => super::accused(drives, (seed, one_in), ""),
        _ => found(drives, (seed, one_in), cases),
    });
    assert_eq!(all.collect::<Vec<_>>(), NOTHING);
}

/// What two parts of a qualification come to whose drives are set up like this, on a computer that is never late.
fn of_parts(drives: [&str; 2]) -> Qualified {
    let rig = rig("");
    let sessions = drives.map(|setup| session(&rig, setup, Stalls::new(1, 0)));
    let [mut one, mut other] = sessions.map(|session| session.expect("a ring that opens"));
    let mut runs = [&mut one, &mut other].map(|session| Run::new(session).expect("a run"));
    runs.iter_mut().for_each(Run::repeat);
    let [one, other] = &mut runs;
    let facts = QualificationFacts::of(one);
    let mut watched = WatchedRig::new(one);
    watched.others.push(WatchedRig::new(other));
    let qualified = Qualification::new(facts).settle(&mut watched, String::new(), false);
    qualified.expect("rings that are played to the end")
}

/// Parts whose drives are not the same: what one of them shows is never taken back by the other.
#[test]
fn parts_that_contradict_each_other_are_never_passed() {
    let other = "drive 0..last property read-long = as-printed";
    let found = of_parts(["", other]);
    let text = &found.deviations;
    assert_eq!(found.verdict, Verdict::Inconclusive, "{text}");
    assert!(text.starts_with("deviations: not known"), "{text}");
    let differ = "the probe of read-long: its values differ from part to part: ";
    assert!(text.contains(differ), "{text}");
    let profile = found.profile.expect("a profile");
    assert!(
        profile.contains("its values differ from part to part"),
        "{profile}"
    );
}

#[test]
fn a_wrong_part_is_never_passed() {
    of_a_wrong_part(["", "drive 1 deviates read-long-reversed"]);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_wrong_first_part_is_never_passed() {
    of_a_wrong_part(["drive 1 deviates read-long-reversed", ""]);
}

fn of_a_wrong_part(drives: [&str; 2]) {
    let found = of_parts(drives);
    let text = &found.deviations;
    assert_eq!(found.verdict, Verdict::Failed, "{text}");
    assert!(!text.contains("deviations: none"), "{text}");
}

#[test]
fn parts_of_like_drives_agree() {
    let found = of_parts(["", ""]);
    let text = &found.deviations;
    assert_eq!(found.verdict, Verdict::Passed, "{text}");
    assert!(text.starts_with("deviations: none;"), "{text}");
}

#[test]
fn a_qualification_on_a_busy_computer_blames_no_drive() {
    assert_eq!(blamed("", (1, 60)), NOTHING);
}

/// ND21 9.9, 14.3.6: the same of drives that miss their bytes meanwhile.
#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_silence_of_a_qualification_blames_no_drive() {
    let [_, _, others] = RIGHT;
    assert_eq!(blamed(others, (1, 60)), NOTHING);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_rare_silence_of_a_qualification_blames_no_drive() {
    let [_, monitors, _] = RIGHT;
    assert_eq!(blamed(monitors, (2, 300)), NOTHING);
}

#[test]
fn a_fuzz_run_on_a_busy_computer_finds_nothing() {
    assert_eq!(found("", (1, 60), 60), NOTHING);
    let [_, monitors, _] = RIGHT;
    assert_eq!(found(monitors, (3, 60), 60), NOTHING);
}
