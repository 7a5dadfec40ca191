//! The walks of a ring: what they cover, what they find, and that they accuse no right drive.

use super::*;
use crate::language::run::over_bus::play_over_bus;
use crate::simulate::bench;
use crate::twin::{Conversation, Exactness, Twin};
use harness_bench::link::{Line as _, LinkEvent, Octets as _, Recording};
use harness_bench::scenario::run::AtMismatch;
use harness_bench::scenario::source::Source;
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::novobus::deviation::{DEVIATIONS, Deviation, deviation};

const DRIVES: u8 = 3;

/// What is seen of drives behind a port.
const THROUGH_A_PORT: Exactness = Exactness {
    tolerance: Span::from_millis(20),
    line_errors: true,
    knows_cells: false,
    looks: None,
};

const PLAIN: &str = "drive 0..last model plain";
const WHOLE: &str = "drive 0..last model nd21";

fn all() -> Walks {
    Walks::within(DRIVES, &Limits::unlimited())
}

fn told(limits: &Limits) -> String {
    let walks = Walks::within(DRIVES, limits);
    let played = walks.conversations().into_iter();
    let played = played.map(|scenario| (scenario.short_name().to_owned(), Verdict::Passed));
    walks.told(&played.collect::<Vec<_>>())
}

/// A conversation with these lines in its header.
fn with(entry: &RingScenario, lines: &str) -> RingScenario {
    let end = format!("default {DRIVES}\n");
    let text = entry
        .source
        .text
        .replacen(&end, &format!("{end}{lines}\n"), 1);
    let source = Source {
        name: entry.short_name().to_owned(),
        text: text.into(),
    };
    RingScenario::new(source, Some(DRIVES)).expect("no mistakes")
}

/// Where the first conversation differs from the model on drives of this kind with these lines in their header.
fn differing(walks: &Walks, model: &str, lines: &str) -> Option<String> {
    walks.conversations().iter().find_map(|entry| {
        let right = with(entry, model).plan;
        let mut link = bench(&with(entry, &format!("{model}\n{lines}")).plan);
        let byte_time = link.byte_time();
        let mut events: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut events);
        let _outcome = play_over_bus(&right, &mut recording, AtMismatch::GoOn);
        let conversations = Conversation::all(&events, byte_time, true);
        let mut twin = Twin::new(bench(&right), &right.rings);
        let (comparisons, _) = twin.follow_all(&conversations, THROUGH_A_PORT);
        let mut found = comparisons.into_iter();
        let found = found.find_map(|comparison| comparison.divergence)?;
        Some(format!("{}: {found}", entry.short_name()))
    })
}

fn finds(walks: &Walks, drive: u8, deviation: &Deviation) -> bool {
    let line = format!("drive {drive} deviates {}", deviation.name);
    differing(walks, PLAIN, &line).is_some()
}

/// ND21 9.1-9.8: nothing is left where everything is permitted, but for what the lines name.
#[test]
fn every_input_that_is_permitted_is_put_in_every_state() {
    insta::assert_snapshot!(told(&Limits::unlimited()), @"
    drive 0 walked: 485 of 600 pairs of a state and an input
      2 left out, as a cell that is used would be written: a zero
      1 left out, as conversations of their own reset drives: the right checking byte
      4 left out, as process data are not sent to other drives: the address in front of its own
      74 left out, it reaches the first drive behind the master alone: a wrong parity bit
      20 left out, the manual leaves `broken-sequence` open: 17 bytes that are no zeros, 7 zeros, 9 zeros, a zero, the check sequence behind 17 zeros
      10 left out, the manual leaves `empty-short-telegram` open: a next address without net bytes, a short address without net bytes
      1 left out, the manual leaves `read-long` open: a byte of a command
      3 left out, the manual leaves `short-address` open: the next drive, the same drive, the same drive, 7 net bytes
    drive 1 walked: 485 of 600 pairs of a state and an input
      2 left out, as a cell that is used would be written: a zero
      1 left out, as conversations of their own reset drives: the right checking byte
      4 left out, as process data are not sent to other drives: the address in front of its own
      74 left out, it reaches the first drive behind the master alone: a wrong parity bit
      20 left out, the manual leaves `broken-sequence` open: 17 bytes that are no zeros, 7 zeros, 9 zeros, a zero, the check sequence behind 17 zeros
      10 left out, the manual leaves `empty-short-telegram` open: a next address without net bytes, a short address without net bytes
      1 left out, the manual leaves `read-long` open: a byte of a command
      3 left out, the manual leaves `short-address` open: the next drive, the same drive, the same drive, 7 net bytes
    drive 2 walked: 609 of 691 pairs of a state and an input
      2 left out, as a cell that is used would be written: a zero
      1 left out, as conversations of their own reset drives: the right checking byte
      4 left out, as process data are not sent to other drives: the address in front of its own
      64 left out, the manual leaves `broken-sequence` open: 17 bytes that are no zeros, 7 zeros, 80 in the error mode, 9 zeros, a wrong parity bit, a zero, another byte in the error mode, the check sequence behind 17 zeros
      8 left out, the manual leaves `empty-short-telegram` open: a next address without net bytes, a short address without net bytes
      1 left out, the manual leaves `read-long` open: a byte of a command
      2 left out, the manual leaves `short-address` open: the same drive, the same drive, 7 net bytes
    ");
}

/// Each limit that is missing is named with what it would permit, and nothing that it denies is planned.
#[test]
fn what_the_rig_s_file_does_not_permit_is_named() {
    let none = told(&Limits::default());
    for missing in [
        "needs `allow_motion`: And, WriteByte, WriteWord, ",
        "needs `allow_motion`, `allow_reset`: ResetH8\n",
        "needs `allow_outputs`: WriteIO\n",
    ] {
        assert!(none.contains(missing), "{none}");
    }
    let still = Walks::within(DRIVES, &Limits::default()).conversations();
    for entry in still {
        assert!(
            !entry.source.text.contains("motion"),
            "{}",
            entry.source.text
        );
    }
}

/// What needs no motion stands in conversations without it, which are the same where motion is permitted too.
#[test]
fn the_first_conversations_need_no_motion() {
    let still = Limits {
        motion: false,
        ..Limits::unlimited()
    };
    let (still, all) = (Walks::within(DRIVES, &still), all());
    for (still, all) in still.walks.iter().zip(&all.walks) {
        assert_eq!(still.walk.parts[0].lines, all.walk.parts[0].lines);
        assert!(all.walk.parts.len() > 1);
    }
}

/// The same file plans the same conversations, and they take no more than 12 s.
#[test]
fn the_conversations_are_those_of_the_limits() {
    let texts = |walks: Walks| -> Vec<_> {
        let all = walks.conversations().into_iter();
        all.map(|entry| entry.source.text.to_string()).collect()
    };
    assert_eq!(texts(all()), texts(all()));
    let took = all().conversations().into_iter().map(|entry| {
        let mut link = bench(&with(&entry, PLAIN).plan);
        let _outcome = play_over_bus(&with(&entry, PLAIN).plan, &mut link, AtMismatch::GoOn);
        link.now().since_start().as_millis_f64()
    });
    let took: f64 = took.sum();
    assert!((10_000.0..12_000.0).contains(&took), "{took} ms");
}

#[test]
fn rings_of_any_size_have_conversations_without_mistakes() {
    for drives in [1, 2, 5] {
        let walks = Walks::within(drives, &Limits::unlimited());
        let parts: usize = walks.walks.iter().map(|walk| walk.walk.parts.len()).sum();
        assert_eq!(walks.conversations().len(), parts, "{drives}");
    }
    let large = Walks::within(SMALL + 1, &Limits::unlimited());
    assert!(large.conversations().is_empty());
    assert!(large.told(&[]).starts_with("walked: nothing"));
}

/// Wrong drives that the walk alone finds, in the first drive behind the master.
#[test]
fn wrong_drives_differ() {
    let walks = all();
    for name in [
        "accepts-bad-sync-bytes",
        "reads-anywhere",
        "counts-7-zeros",
        "command-kept-over-a-check-sequence",
        "parity-unchecked-in-passing",
    ] {
        let wrong = deviation(name).expect("a deviation");
        assert!(finds(&walks, DRIVES - 1, wrong), "{name}");
    }
}

/// How many wrong drives the walk alone finds, in the first drive behind the master and in the one behind that. What it does not find takes
/// a line error on another link, a time-out, a reset, or many values, which the conversations of corpora/qualify/novobus have.
#[test]
#[ignore = "takes two minutes; .ci/nightly runs it"]
fn wrong_drives_that_the_walk_finds() {
    let walks = all();
    let found = |drive| {
        let of_the_bus = DEVIATIONS
            .all()
            .filter(|deviation| !deviation.is_behind_the_bus());
        let found = of_the_bus.filter(|deviation| finds(&walks, drive, deviation));
        found.count()
    };
    assert_eq!(
        (found(2), found(1), DEVIATIONS.all().count()),
        (82, 76, 165)
    );
}

/// The values of a property: of a time its border.
fn settings() -> Vec<String> {
    let settings = PROPERTIES.iter().flat_map(|property| {
        let values = property.values.iter();
        let values = values.filter_map(|value| value.split("..").last());
        values.map(|value| format!("property {} = {value}", property.name))
    });
    settings.collect()
}

/// Right drives differ nowhere, whatever they do where the manual leaves it open.
#[test]
fn right_drives_with_all_values_at_once_are_not_accused() {
    let walks = all();
    assert_eq!(differing(&walks, PLAIN, ""), None);
    let lines: Vec<_> = settings();
    let lines = lines.iter().map(|line| format!("drive 0..last {line}"));
    let lines = lines.collect::<Vec<_>>().join("\n");
    assert_eq!(differing(&walks, PLAIN, &lines), None);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn right_drives_with_any_value_are_not_accused() {
    let walks = all();
    for setting in settings() {
        for drives in ["0..last", "0", "1", "2"] {
            let line = format!("drive {drives} {setting}");
            for model in [PLAIN, WHOLE] {
                assert_eq!(differing(&walks, model, &line), None, "{line}");
            }
        }
    }
}
