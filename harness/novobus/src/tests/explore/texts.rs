//! A case and its scenario are one.

use super::{repeat, scope, scope_of, seed};
use crate::explore::text::{Surroundings, text};
use crate::explore::{Case, CaseScope, Generator, MasterView, RingSetup, mutate, play};
use crate::language::read::RingScenario;
use crate::simulate::simulated;
use harness_bench::explore::Dice;
use harness_bench::explore::FuzzCase as _;
use harness_bench::link::Link;
use harness_bench::scenario::run::run;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;

/// Cases of many swarms, new ones and ones made of others.
pub(crate) fn cases(count: u64, drives: u8) -> Vec<Case> {
    cases_with(&scope(drives), 0, count)
}

/// The same with one of a bench's rings.
fn cases_with(scope: &CaseScope, ring: usize, count: u64) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for number in 0..count {
        let mut dice = Dice::of_part(seed(), number);
        let swarm = Case::swarm(seed(), number, scope);
        let maker = Generator::new(scope, scope.ring(ring), &swarm, &mut dice);
        let new = match cases.last().filter(|_| number % 2 == 1) {
            Some(old) => mutate(old, cases.first(), &maker, &mut dice),
            None => maker.case(&mut dice),
        };
        assert!(new.is_bounded(), "case {number}: {new:?}");
        cases.push(new);
    }
    cases
}

fn scenario(case: &Case, setup: &RingSetup, seen: &MasterView) -> String {
    let page = Surroundings {
        title: "a case",
        sources: &[],
        header: &setup.header,
        remarks: &[],
        seen,
        any: &[],
        timed: None,
    };
    text(case, &page)
}

/// Played by its text a case leaves the same bytes at the same times on every link, and its scenario passes.
#[test]
fn a_case_is_its_scenario() {
    let two = scope_of(2, Some(3));
    let second = cases_with(&two, 1, 100);
    let all = cases(300, 3).into_iter().chain(cases_with(&two, 0, 20));
    for (number, case) in all.chain(second).enumerate() {
        let setup = match number % 4 {
            0 => RingSetup::of_ports(case.sizes().len()),
            _ => RingSetup::default(),
        };
        let mut link = setup.model(&case.sizes()).expect("rings");
        let seen = play(&mut link, &case);
        let page = scenario(&case, &setup, &seen);
        let source = Source {
            name: "a case".to_owned(),
            text: page.clone().into(),
        };
        let entry =
            RingScenario::new(source, None).unwrap_or_else(|p| panic!("{page}\n{:#?}", p.all()));
        let plan = entry.plan;
        let mut other = simulated(&plan);
        let outcome = run(&plan, &mut other);
        assert_eq!(
            outcome.verdict,
            Verdict::Passed,
            "case {number}: {:?}\n{page}\n{}",
            outcome.finding,
            repeat("a_case_is_its_scenario")
        );
        for ring in 0..case.sizes().len() {
            assert!(
                link.trace(ring) == other.trace(ring),
                "case {number}\n{page}"
            );
        }
    }
}

/// One seed gives one text.
#[test]
fn the_same_seed_gives_the_same_cases() {
    assert_eq!(cases(50, 4), cases(50, 4));
    let json = serde_json::to_string(&cases(50, 4)).expect("a form");
    let again: Vec<Case> = serde_json::from_str(&json).expect("the same form");
    assert_eq!(again, cases(50, 4));
}

/// Lines of scenarios stay readable.
#[test]
fn lines_are_not_long() {
    for case in cases(200, 3) {
        let setup = RingSetup::default();
        let seen = setup.model_answers(&case).expect("a ring");
        for line in scenario(&case, &setup, &seen).lines() {
            assert!(line.chars().count() <= 120, "{line}");
            assert_eq!(line, line.trim_end());
        }
    }
}
