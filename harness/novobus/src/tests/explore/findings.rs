//! Findings made small, and kept.

use super::{Difference, bounds, explore, planted};
use crate::explore::shrink::Subject;
use crate::explore::{Case, Finding, OnSim, RingSetup, against_reference, play};
use crate::language::read::RingScenario;
use crate::simulate::simulated;
use harness_bench::explore::promote::{Naming, checkout, promote};
use harness_bench::explore::smaller::Shrinkable as _;
use harness_bench::explore::smaller::{ShrinkOutcome, shrink};
use harness_bench::explore::{Differing as _, ExploreError, FuzzCase as _, Target};
use harness_bench::link::Link as _;
use harness_bench::scenario::run::run;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use std::path::Path;

/// Asks a simulated ring.
fn ask(subject: &Subject) -> Result<Option<Difference>, ExploreError> {
    let mut target = OnSim::new(subject.setup.clone());
    let rehearsal = target.rehearse(&subject.case)?;
    Ok(target.attempt(&subject.case, &rehearsal)?.difference)
}

fn subject(finding: &Finding) -> Subject {
    Subject {
        case: finding.case.clone(),
        setup: finding.setup.clone(),
    }
}

/// The first finding of a drive, and what it is made into.
fn small(name: &str) -> (Finding, ShrinkOutcome<Case>) {
    let (found, ..) = explore(&planted(1, name), 1, &bounds(10_000, 1));
    let finding = found
        .into_iter()
        .next()
        .unwrap_or_else(|| panic!("{name} is not found"));
    let mut measures = vec![finding.case.measure()];
    let mut asking = |subject: &Subject| {
        let answer = ask(subject)?;
        let last = measures[measures.len() - 1];
        assert!(
            subject.case.measure() < last,
            "a candidate is smaller than the best one"
        );
        if answer
            .as_ref()
            .is_some_and(|other| other.is_like(&finding.difference))
        {
            measures.push(subject.case.measure());
        }
        Ok(answer)
    };
    let start = finding.difference.clone();
    let shrunk = shrink(subject(&finding), start, 300, &mut asking).expect("a ring");
    assert_eq!(shrunk.subject.case.measure(), measures[measures.len() - 1]);
    (finding, shrunk)
}

fn page(finding: &Finding, shrunk: ShrinkOutcome<Case>) -> String {
    let new = Finding {
        shrunk_in: Some(shrunk.runs),
        difference: shrunk.difference,
        setup: shrunk.subject.setup,
        case: shrunk.subject.case,
        ..finding.clone()
    };
    Case::scenario(&new, "small", None, false).expect("a ring")
}

/// A drive that does not write: what is left is a telegram that writes and one that reads (ND21 10.1, 10.2).
#[test]
fn a_finding_is_made_readable() {
    let (finding, shrunk) = small("writes-ignored");
    assert!(shrunk.complete);
    assert!(shrunk.runs <= 40, "{} runs", shrunk.runs);
    let bytes = shrunk.subject.case.bytes().len();
    assert!(
        bytes <= 15 && bytes < finding.case.bytes().len(),
        "{bytes} bytes"
    );
    insta::assert_snapshot!(page(&finding, shrunk), @"
    title   small
    source  nd21 10.2 write-byte
    ring    1
    strict

    # byte 12: another value: received 00 at 3.724 ms, the manual says 01 at 3.724 ms (ND21 10.2, contents
    # of a cell)
    # found on drive 0 deviates writes-ignored
    > 8A FF 82 01 80 FD 01           # drive 0: WriteByte 01 to FD80
    > 88 FF C0 80 FD 3D              # drive 0: ReadByte FD80
    < 8A 00 82 01 80 FD 01
    < 88 00 C0 80 01 BF
    ");
}

/// ND21 10.2: a write that is never read back shows in the cell, which is compared with that of the reference model.
#[test]
fn a_cell_that_is_not_read_is_compared() {
    let ShrinkOutcome { subject, .. } = small("writes-ignored").1;
    let mut case = subject.case;
    case.acts.truncate(1);
    let judged = |setup: &RingSetup| {
        let mut link = setup.under_test(&case.sizes()).expect("a ring");
        let _seen = play(&mut link, &case);
        against_reference(&case, &link, &link.trace(case.ring()))
    };
    assert_eq!(judged(&RingSetup::default()), None);
    let found = judged(&subject.setup).expect("another cell");
    assert_eq!(
        (found.drive, found.rule.as_str()),
        (Some(0), "contents of a cell")
    );
    assert!(found.about.contains(" FD80 "), "{}", found.about);
}

/// The same twice gives the same.
#[test]
fn shrinking_repeats() {
    let one = || {
        let (finding, shrunk) = small("next-drive-is-same-drive");
        (shrunk.runs, page(&finding, shrunk))
    };
    assert_eq!(one(), one());
}

/// What the runs of a few deviations come to: protocol-aware shrinking costs few.
#[test]
fn shrinking_needs_few_runs() {
    let names = [
        "checksum-wrong",
        "writes-ignored",
        "next-drive-is-same-drive",
        "ignores-parity-errors",
        "counts-7-zeros",
        "time-out-after-25ms",
        "read-long-reversed",
    ];
    let mut told = String::new();
    for name in names {
        let (finding, shrunk) = small(name);
        let (before, after) = (
            finding.case.bytes().len(),
            shrunk.subject.case.bytes().len(),
        );
        told += &format!(
            "{name}: {before} bytes became {after} in {} runs\n",
            shrunk.runs
        );
        assert!(shrunk.complete && after <= before, "{told}");
    }
    insta::assert_snapshot!(told, @"
    checksum-wrong: 60 bytes became 6 in 4 runs
    writes-ignored: 117 bytes became 13 in 15 runs
    next-drive-is-same-drive: 84 bytes became 11 in 18 runs
    ignores-parity-errors: 23 bytes became 7 in 22 runs
    counts-7-zeros: 84 bytes became 29 in 27 runs
    time-out-after-25ms: 84 bytes became 12 in 32 runs
    read-long-reversed: 59 bytes became 14 in 14 runs
    ");
}

/// Whatever a ring answers, shrinking ends, and never takes what is not smaller.
#[test]
fn shrinking_always_ends() {
    let (found, ..) = explore(&planted(1, "checksum-wrong"), 3, &bounds(2_000, 1));
    let finding = &found[0];
    let always = finding.difference.clone();
    for answer in 0..4 {
        let mut count = 0_u32;
        let mut asking = |_: &Subject| {
            count += 1;
            let yes = match answer {
                0 => false,
                1 => true,
                2 => count.is_multiple_of(2),
                _ => count.is_multiple_of(3),
            };
            Ok(yes.then(|| always.clone()))
        };
        let shrunk = shrink(subject(finding), always.clone(), 500, &mut asking).expect("an answer");
        assert!(shrunk.runs <= 500 && shrunk.runs == count, "{answer}");
        assert!(shrunk.subject.case.measure() <= finding.case.measure());
        let mut few = |_: &Subject| Ok(None);
        let shrunk = shrink(subject(finding), always.clone(), 2, &mut few).expect("an answer");
        assert!(shrunk.runs <= 2 && !shrunk.complete);
        assert_eq!(shrunk.subject, subject(finding));
    }
}

/// A checkout with nothing in it.
fn empty_checkout(folder: &Path) {
    for inner in [
        "corpora/scenarios/novobus",
        "corpora/fuzz/ring",
        "snapshots/scenarios/novobus",
    ] {
        std::fs::create_dir_all(folder.join(inner)).expect("room");
    }
}

/// What comes of a scenario, why, and a page of it.
fn played(name: &str, text: &str) -> Result<(Verdict, String, String), ExploreError> {
    let source = Source {
        name: name.to_owned(),
        text: text.to_owned().into(),
    };
    let plan = RingScenario::new(source, None)?.plan;
    let outcome = run(&plan, &mut simulated(&plan));
    let why = outcome.finding.map(|finding| finding.message);
    Ok((
        outcome.verdict,
        why.unwrap_or_default(),
        outcome.verdict.to_string(),
    ))
}

/// A finding becomes a scenario that the model passes and the deviating drive fails, an input and a table.
#[test]
fn a_finding_is_kept() {
    let (finding, shrunk) = small("writes-ignored");
    let finding = Finding {
        difference: shrunk.difference,
        setup: shrunk.subject.setup,
        case: shrunk.subject.case,
        ..finding
    };
    let top = tempfile::tempdir().expect("a folder");
    empty_checkout(top.path());
    let naming = Naming {
        name: "10.2-not-written".to_owned(),
        title: Some("What is written is there".to_owned()),
        source: Some("nd21 10.2 write-byte".to_owned()),
    };
    let inner = top.path().join("corpora/fuzz");
    let found = checkout(&inner).expect("a checkout");
    let promoted = promote(&finding, &naming, (&found, played)).expect("room");
    assert_eq!(promoted.fails_on_deviating, Some(true));
    let source = Source::read(&promoted.files[0]).expect("a text");
    let entry = RingScenario::new(source, None).expect("no mistakes");
    assert_eq!(entry.scenario.sources[0].text, "nd21 10.2 write-byte");
    let plan = entry.plan;
    assert_eq!(run(&plan, &mut simulated(&plan)).verdict, Verdict::Passed);
    let input = std::fs::read_to_string(&promoted.files[1]).expect("an input");
    let wire: Vec<_> = finding
        .case
        .bytes()
        .iter()
        .map(|byte| format!("{byte:02X}"))
        .collect();
    assert!(input.contains(&wire.join(" ")), "{input}");
    let table = std::fs::read_to_string(&promoted.files[2]).expect("a table");
    assert_eq!(table.trim_end().lines().last(), Some("passed"), "{table}");
    // Nothing is written twice, under no other name, and no table that there is not.
    let again = promote(&finding, &naming, (&found, played)).expect_err("it is there");
    assert!(again.to_string().contains("is there already"), "{again}");
    for (name, source, word) in [
        ("../x", None, "is not a name"),
        ("new", Some("nd21 99".to_owned()), "the catalogue has no"),
    ] {
        let naming = Naming {
            name: name.to_owned(),
            title: None,
            source,
        };
        let error = promote(&finding, &naming, (&found, played)).expect_err("refused");
        assert!(error.to_string().contains(word), "{error}");
    }
    let nowhere = tempfile::tempdir().expect("a folder");
    let error = checkout(nowhere.path()).expect_err("no checkout");
    assert!(error.to_string().contains("in no checkout"), "{error}");
}
