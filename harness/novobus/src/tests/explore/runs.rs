//! Runs: what they find, that they repeat, and that a rig that is late now and then finds nothing.

use super::{
    Difference, ExploreError, FindingList, FuzzRun, Rehearsal, RunEnd, Target, Tried, about,
    bounds, explore, planted, repeat, scope, seed,
};
use crate::explore::{Case, OnSim, RingSetup};
use crate::twin::Symptom;

/// The ring and the reference model, which share no code, agree on everything that a run comes to.
#[test]
fn ring_and_reference_agree() {
    let (found, campaign, end) = explore(&RingSetup::default(), seed(), &bounds(3_000, 1));
    let told = found
        .first()
        .map(|finding| finding.difference.about.clone());
    assert_eq!(told, None, "{}", repeat("ring_and_reference_agree"));
    assert_eq!(end, RunEnd::Cases);
    assert!(campaign.pool().cases().len() > 100);
}

/// Deviations that need two telegrams, one after the other, are found from a fixed seed.
#[test]
fn two_telegrams_are_found() {
    for (name, most) in [
        ("writes-ignored", 1_000),
        ("next-drive-is-same-drive", 1_000),
        ("forgets-its-address", 1_000),
        ("and-is-or", 1_000),
        ("or-is-write", 3_000),
        ("check-sequence-without-zeros", 5_000),
    ] {
        let (found, campaign, end) = explore(&planted(1, name), 1, &bounds(most, 1));
        assert_eq!(end, RunEnd::Findings, "{name}: {:?}", campaign.progress());
        assert!(found[0].confirmed && found[0].seen_again == 2, "{name}");
        assert!(found[0].case.acts.len() > 1, "{name}: {:?}", found[0].case);
    }
}

/// One seed, one run: the same cases are kept and the same is found.
#[test]
fn a_run_repeats() {
    let setup = planted(0, "read-long-reversed");
    let one = |seed| {
        let (found, campaign, _) = explore(&setup, seed, &bounds(600, 3));
        (
            found,
            campaign.pool().cases().to_vec(),
            *campaign.progress(),
        )
    };
    assert_eq!(one(7), one(7));
    assert_ne!(one(7).1, one(8).1);
}

/// A ring that is late once and not again.
struct LateOnce {
    inner: OnSim,
    tried: u32,
    /// The attempts in which the ring deviates.
    wrong: fn(u32) -> bool,
}

impl Target<Case> for LateOnce {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        self.inner.rehearse(case)
    }

    fn attempt(&mut self, case: &Case, rehearsal: &Rehearsal) -> Result<Tried, ExploreError> {
        self.tried += 1;
        let mut tried = self.inner.attempt(case, rehearsal)?;
        tried.difference = (self.wrong)(self.tried).then(|| Difference {
            what: Symptom::Time,
            section: "9.2".to_owned(),
            rule: "sync byte".to_owned(),
            ring: 0,
            drive: None,
            meant: None,
            byte: Some(1),
            time: true,
            about: "late".to_owned(),
        });
        Ok(tried)
    }
}

/// What comes late once and not again is flaky, and so is what a busy computer delays three times more at the same byte; what is late at each
/// of four more attempts counts.
#[test]
fn a_finding_is_seen_again() {
    let wrong: [fn(u32) -> bool; 4] = [
        |n| n == 5,
        |n| n == 5 || n == 7,
        |n| (5..=8).contains(&n),
        |n| (5..=9).contains(&n),
    ];
    for (wrong, (findings, again)) in
        wrong
            .into_iter()
            .zip([((0, 1), 0), ((0, 2), 0), ((0, 1), 3), ((1, 0), 4)])
    {
        let mut target = LateOnce {
            inner: OnSim::new(RingSetup::default()),
            tried: 0,
            wrong,
        };
        let mut campaign = FuzzRun::new(about(&RingSetup::default(), 1), scope(3));
        let mut heard = FindingList::default();
        let end = campaign.run(&mut target, None, &bounds(20, 9), &mut heard);
        assert_eq!(end.expect("a ring"), RunEnd::Cases);
        assert_eq!(campaign.findings(), findings);
        assert_eq!(heard.findings[0].seen_again, again);
    }
}

/// The wire's time is never exceeded, to the nanosecond.
#[test]
fn the_wire_budget_holds() {
    let setup = RingSetup::default();
    let mut campaign = FuzzRun::new(about(&setup, 1), scope(3));
    let budget = harness_proto::time::Span::from_millis(500);
    let bounds = harness_bench::explore::Bounds {
        wire: Some(budget),
        ..bounds(u64::MAX, 1)
    };
    let mut target = OnSim::new(setup);
    let end = campaign.run(&mut target, None, &bounds, &mut FindingList::default());
    assert_eq!(end.expect("a ring"), RunEnd::Wire);
    let used = campaign.progress().wire_ns;
    assert!(
        used <= budget.as_nanos() && used > budget.as_nanos() / 2,
        "{used}"
    );
}
