//! The twin: a ring beside its model, and what explains a ring that is otherwise.

use harness::library::{Entry, sources};
use harness::link::{Event, Link, Recording, Replay};
use harness::qualify::{Hypothesis, explaining, hypotheses, probes};
use harness::scenario::plan::Plan;
use harness::scenario::run::{AtFinding, Outcome, lacks, play_over_bus};
use harness::scenario::simulate::bench;
use harness::scenario::source::Source;
use harness::scenario::verdict::Verdict;
use harness::twin::{Conversation, Exactness, Twin, What};
use harness_proto::time::Span;

const EXACT: Exactness = Exactness {
    tolerance: Span::ZERO,
    line_errors: true,
    knows_cells: true,
};

fn entry(text: &str) -> Entry {
    let source = Source {
        name: "test".to_owned(),
        text: text.to_owned().into(),
    };
    Entry::new(source, None).unwrap_or_else(|problems| panic!("{:#?}", problems.all()))
}

/// Plays a plan on a ring and gives what the master's end saw of it.
fn conversations(plan: &Plan, link: &mut dyn Link) -> Vec<Conversation> {
    let byte_time = link.byte_time();
    let mut events: Vec<Event> = Vec::new();
    let mut recording = Recording::new(link, &mut events);
    let _outcome = play_over_bus(plan, &mut recording, AtFinding::GoOn);
    Conversation::all(&events, byte_time, true)
}

/// ND21 9 and 10: every built-in scenario that needs nothing but the bus, on a ring that is its own model.
#[test]
fn a_ring_is_its_own_twin() {
    let mut compared = 0;
    for source in sources(&[]).expect("the built-in scenarios") {
        let name = source.name.clone();
        let entry = Entry::new(source, None).expect("no mistakes");
        let plan = entry.plan.expect("novobus");
        if plan.rings[0].drives() > 10 {
            continue;
        }
        let mut link = bench(&plan);
        let mut events: Vec<Event> = Vec::new();
        if lacks(&plan, &Recording::new(&mut link, &mut events)).is_some() {
            continue;
        }
        let mut twin = Twin::new(bench(&plan), &plan.rings);
        for conversation in conversations(&plan, &mut link) {
            let comparison = twin.follow(&conversation, EXACT);
            let found = comparison.divergence.or(comparison.untimely);
            assert_eq!(found, None, "{name}: {}", found.as_ref().expect("one"));
            compared += comparison.compared;
        }
    }
    assert!(compared > 5_000, "{compared}");
}

/// A record is judged as the run was: the same verdict, the same sentence, and nothing is left over.
#[test]
fn a_record_is_played_again() {
    let mut played = 0;
    for source in sources(&[]).expect("the built-in scenarios") {
        let name = source.name.clone();
        let plan = Entry::new(source, None).expect("no mistakes").plan;
        let plan = plan.expect("novobus");
        if plan.rings[0].drives() > 10 {
            continue;
        }
        let mut link = bench(&plan);
        let mut events: Vec<Event> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut events);
        let capabilities = recording.capabilities().to_vec();
        let outcome = play_over_bus(&plan, &mut recording, AtFinding::Stop);
        let drives = plan.rings.iter().map(|ring| ring.drives()).collect();
        let mut replay = Replay::new(events, plan.rate, Span::ZERO, drives, capabilities);
        let again = play_over_bus(&plan, &mut replay, AtFinding::Stop);
        assert_eq!(
            again.verdict, outcome.verdict,
            "{name}: {:?}",
            again.finding
        );
        let message = |outcome: &Outcome| outcome.finding.as_ref().map(|f| f.message.clone());
        assert_eq!(message(&again), message(&outcome), "{name}");
        assert_eq!(replay.left(), None, "{name}");
        played += usize::from(outcome.verdict != Verdict::Skipped);
    }
    assert!(played >= 30, "{played}");
}

/// Every word that an open property can have is told from the others by its probe.
#[test]
fn probes_tell_properties() {
    for probe in probes(3).expect("no mistakes") {
        let Some(entry) = probe.entry else { continue };
        let plan = entry.plan.expect("novobus");
        let alike = |h: &Hypothesis| h.lines.len() == 1;
        for hypothesis in hypotheses(probe.property, 3).into_iter().filter(alike) {
            let (_, mut link) = model(&hypothesis.lines);
            let seen = conversations(&plan, &mut link);
            let twin = |lines: &[String]| -> Result<Twin, ()> {
                let (plan, link) = model(lines);
                Ok(Twin::new(link, &plan.rings))
            };
            let all = hypotheses(probe.property, 3);
            let found = explaining(&all, &seen, EXACT, &twin).expect("rings");
            // A drive behind one that has gone into the error mode is not asked: it may be of either kind.
            let names: Vec<_> = found
                .iter()
                .filter(|(h, _)| alike(h))
                .map(|(h, _)| h.name.as_str())
                .collect();
            assert_eq!(names, [hypothesis.name.as_str()], "{}", probe.property);
        }
    }
}

fn model(lines: &[String]) -> (Plan, harness::link::SimulatedLink) {
    let entry = entry(&format!(
        "title x\nring 3\ndrive 0..last model nd21\n{}\n> 80\n",
        lines.join("\n")
    ));
    let plan = entry.plan.expect("novobus");
    let link = bench(&plan);
    (plan, link)
}

/// The first byte that is otherwise, with its drive and the rule: ND21 10.1.
#[test]
fn a_divergence_says_where() {
    let lines = ["drive 1 property read-long = as-printed".to_owned()];
    let (_, mut link) = model(&lines);
    let plan = entry("title x\nring 3\nread-long 1 FE12\n")
        .plan
        .expect("novobus");
    let seen = conversations(&plan, &mut link);
    let (plan, link) = model(&[]);
    let mut twin = Twin::new(link, &plan.rings);
    let found = seen
        .iter()
        .find_map(|conversation| twin.follow(conversation, EXACT).divergence)
        .expect("another form of the answer");
    assert_eq!((found.byte, found.drive), (8, Some(1)));
    assert_eq!(found.what, What::Value);
    assert!(found.to_string().contains("ND21 10.1"), "{found}");
    let none = Hypothesis {
        name: "as the manual says".to_owned(),
        lines: Vec::new(),
    };
    let twin = |_: &[String]| -> Result<Twin, ()> {
        let (plan, link) = model(&[]);
        Ok(Twin::new(link, &plan.rings))
    };
    assert_eq!(explaining(&[none], &seen, EXACT, &twin), Ok(Vec::new()));
}

/// ND21 9.2, 9.5: data that a drive measures are its own, also behind a PAUSE and in a command that is cut over telegrams.
#[test]
fn measured_data_are_nobodys_wherever_they_stand() {
    let lines = ["drive 1 cooler 60C".to_owned()];
    // In the second one a byte behind them is lost.
    let text = "title x\nring 3\n> 81 80\n> 84 FE C0 26\n> 81 80\n> A4 FF E5\n> 81 80*40\n";
    for more in ["", "! 2->1 byte 20: drop\n"] {
        measured_differ(&lines, &format!("{text}{more}"));
    }
    // A parameter that no drive accepts (10.1), and a PAUSE that is answered in the error mode.
    let error = "title x\nring 3\n> 88 FE C0 26 FF E5\n> 88 FF C0 DE 2F CD 81\n";
    measured_differ(&lines, error);
}

fn measured_differ(lines: &[String], text: &str) {
    let (_, mut link) = model(lines);
    let plan = entry(text).plan.expect("novobus");
    let seen = conversations(&plan, &mut link);
    let (plan, link) = model(&[]);
    let real = Exactness {
        knows_cells: false,
        tolerance: Span::from_millis(3),
        ..EXACT
    };
    let mut twin = Twin::new(link, &plan.rings);
    let comparisons: Vec<_> = seen.iter().map(|one| twin.follow(one, real)).collect();
    let measured: u64 = comparisons.iter().map(|one| one.measured).sum();
    let divergence = comparisons.iter().find_map(|one| one.divergence.as_ref());
    assert_eq!(divergence, None, "{}", divergence.expect("one"));
    assert_eq!(measured, 1);
}
