//! Verdicts of attempts on rings in virtual time that are seen as through a port.

#[path = "judge_right_tests.rs"]
mod right;

use super::{AttemptFacts, judge, known};
use crate::language::plan::Plan;
use crate::language::read::RingScenario;
use crate::link::SimulatedLink;
use crate::rig::parse;
use crate::rig::run::Way;
use crate::rig::run::play_one;
use crate::rig::run::twin;
use crate::simulate::bench;
use crate::twin::{Comparison, Conversation, Exactness, UnaskedByte};
use harness_bench::link::{Link, LinkEvent, Octets, Recording};
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict::{self, Failed, Inconclusive, Passed};
use harness_proto::time::{Instant, Span};

/// The verdict of a scenario on a ring of three with these header lines, on a rig whose file ends with this text.
pub(super) fn judged(ring: &str, rig: &str, scenario: &str) -> Outcome {
    judged_with(ring, rig, scenario, &|_, _| {})
}

/// Looks at what was played, and edits the comparisons of it with the twin.
type Change<'a> = &'a dyn Fn(&[Conversation], &mut [Comparison]);

/// The same, but `change` edits the comparisons with the twin first.
pub(super) fn judged_with(ring: &str, rig: &str, scenario: &str, change: Change<'_>) -> Outcome {
    let plan = plan(format!("title x\nring 3\n{scenario}"));
    let way = Way {
        rings: plan.rings.clone(),
        attempts: None,
        anew: false,
    };
    judged_on(&mut link(ring), rig, (&plan, &way), change)
}

fn source(text: String) -> Source {
    Source {
        name: "test".to_owned(),
        text: text.into(),
    }
}

pub(super) fn plan(text: String) -> Plan {
    let entry = RingScenario::new(source(text), None).expect("no mistakes");
    entry.plan
}

/// A ring of three with these header lines.
pub(super) fn link(ring: &str) -> SimulatedLink {
    link_of(3, ring)
}

/// The same of another size.
fn link_of(drives: u8, ring: &str) -> SimulatedLink {
    bench(&plan(format!(
        "title x\nring {drives}\ndrive 0..last model nd21\n{ring}\n> 80\n"
    )))
}

/// The verdict of a scenario that is played in this way.
pub(super) fn judged_on(
    link: &mut dyn Link,
    rig: &str,
    (plan, way): (&Plan, &Way),
    change: Change<'_>,
) -> Outcome {
    judged_early(link, rig, (plan, way), change, (Span::ZERO, 0))
}

/// The same where each byte is stamped that much earlier, as behind a socket, which is not bound to the times of a line, and with this number of line errors
/// whose bytes are not known.
pub(super) fn judged_early(
    link: &mut dyn Link,
    rig: &str,
    (plan, way): (&Plan, &Way),
    change: Change<'_>,
    (early, unplaced): (Span, u64),
) -> Outcome {
    let drives = way.rings[0].drives();
    let rig = format!(
        "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = {drives}\ntransport = \"tcp\"\nport = \"127.0.0.1:1\"\nmarks = \"in-band\"\n{rig}"
    );
    let rig = parse(&source(rig)).expect("a rig");
    let byte_time = link.byte_time();
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(link, &mut events);
    let mut outcome = play_one(&mut recording, plan, way).expect("it is not examined");
    let exactness = Exactness {
        tolerance: Span::from_millis(3),
        line_errors: true,
        knows_cells: false,
        looks: None,
    };
    let all = Conversation::all(&events, byte_time, true);
    let (mut conversations, _) = way.compared(all, exactness);
    let received = conversations.iter_mut().flat_map(|talk| &mut talk.received);
    for (_, at, _) in received {
        *at = *at - early;
    }
    let mut twin = twin(&rig, &known(&rig)).expect("a twin");
    let (mut comparisons, _) = twin.follow_all(&conversations, exactness);
    change(&conversations, &mut comparisons);
    let facts = AttemptFacts {
        rig: &rig,
        plan,
        way,
        exactness,
        conversations: &conversations,
        comparisons: &comparisons,
        unplaced,
        alive: &|| {},
    };
    judge(&mut outcome, &facts);
    outcome
}

#[track_caller]
fn check(ring: &str, rig: &str, scenario: &str, expected: Verdict) {
    let outcome = judged(ring, rig, scenario);
    assert_eq!(outcome.verdict, expected, "{scenario}: {outcome:#?}");
}

pub(super) const READ: &str = "> 88 FE C0 13 FE D1\n";
const SET: &str = "drive 1 memory FE13 = 88\n";

/// ND21 10.1: the content of a cell that was not set is the drive's choice.
#[test]
fn a_state_that_the_scenario_does_not_set_settles_nothing() {
    let holds = "drive 1 memory FE13 = 12";
    for ring in ["", holds] {
        check(ring, "", "read-byte 1 FE13 = 77\n", Inconclusive);
        check(ring, "", "? drive 1 memory FE13 = 77\n", Inconclusive);
        let read = format!("{READ}< 88 01 C0 13 77 xx\n");
        check(ring, "", &read, Inconclusive);
        let read = format!("{READ}< 88 01 C0 13 xx 77\n");
        check(ring, "", &read, Inconclusive);
        // ND21 14.2: written, and the drive writes it itself.
        check(
            ring,
            "",
            "write-byte 1 FF26 = 11\nread-byte 1 FF26 = 77\n",
            Inconclusive,
        );
    }
}

/// What the scenario sets or writes, and what no state can explain, is a failure, although the model does the same.
#[test]
fn a_scenario_that_asks_for_something_else_fails() {
    let read = |answer: &str| format!("{READ}< {answer}\n");
    for scenario in [
        SET.to_owned() + &read("88 01 C0 13 77"),
        SET.to_owned() + &read("88 01 C0 13 xx 77"),
        format!("{SET}? drive 1 memory FE13 = 77\n"),
        "write-byte 1 FE13 = 77\nread-byte 1 FE13 = 78\n".to_owned(),
        read("88 02"),
        read("88 01 C0 13 xx xx 80"),
        format!("{READ}? received 7 bytes\n"),
    ] {
        // The cell holds it already, and is not written.
        for ring in ["", "drive 1 memory FE13 = 88"] {
            check(ring, "", &scenario, Failed);
        }
    }
}

/// A known deviation is put up with where it explains what differs, in the drives that have it.
#[test]
fn a_known_deviation_excuses_nothing_else() {
    let known = |name: &str, drive: u8, rule: &str| {
        format!(
            "[[deviation]]\nname = \"{name}\"\ndrives = [{drive}]\nrule = \"nd21 {rule}\"\nreason = \"x\"\n"
        )
    };
    let ignores = "drive 1 deviates writes-ignored";
    let writes = "write-byte 1 FE13 = 77\nread-byte 1 FE13 = 77\n";
    let deviation = known("writes-ignored", 1, "10.2");
    check(ignores, &deviation, writes, Passed);
    check(ignores, "", writes, Failed);
    check(ignores, &deviation, &format!("{READ}< 88 02\n"), Failed);
    check("", &deviation, &format!("{READ}< 88 02\n"), Failed);
    // One that the simulator does not have, of another drive, and of another section.
    let (wrong, reads) = ("drive 1 deviates checksum-wrong", "read-byte 1 FE13\n");
    check(wrong, &known("odd-sums", 1, "9.6"), reads, Passed);
    check(wrong, &known("odd-sums", 2, "9.6"), reads, Failed);
    check(ignores, &known("odd-reads", 1, "10.1"), writes, Failed);
    // Where a drive could not be made ready, no step was played.
    let unready = format!("{SET}{reads}");
    check(wrong, "", &unready, Failed);
    check(wrong, &known("odd-sums", 1, "9.6"), &unready, Inconclusive);
}

/// ND21 9.9: the number of unasked zeros, and which drive sends the first one, is a race of the drives' clocks.
#[test]
fn a_race_of_clocks_accuses_no_drive() {
    let silent = "drive 0..last memory Flags2 = 04\n> 80*3\n< 80*3\nwait 80ms\n";
    let late = ["10.2ms", "10.0ms", "10.3ms"];
    for waits in [["10.0ms"; 3], ["10.3ms", "10.1ms", "10.0ms"]] {
        let drives = late.iter().zip(waits).enumerate();
        let lines = drives.map(|(drive, (time_out, wait))| {
            format!("drive {drive} property time-out = {time_out}\ndrive {drive} property time-out-wait = {wait}\n")
        });
        let ring: String = lines.collect();
        let outcome = judged(&ring, "", silent);
        assert_eq!(outcome.verdict, Passed, "{outcome:#?}");
        let located = judged(&ring, "", &format!("{silent}? located last\n"));
        let right = matches!(located.verdict, Passed | Inconclusive);
        assert!(right, "{located:#?}");
    }
    // What no clock explains is a failure still.
    check(
        "drive 1 deviates no-time-out",
        "",
        &format!("{silent}? located last\n"),
        Passed,
    );
    let none = "drive 0..last deviates no-zeros-unasked";
    check(none, "", silent, Failed);
    let twice = "drive 0..last deviates increments-twice-in-error-mode";
    check(twice, "", silent, Failed);
}

/// ND21 10.3, 14.10.6: the settings of an oscilloscope that stands are the master's.
#[test]
fn a_written_setting_of_the_oscilloscope_is_known() {
    let scenario = "write-byte 1 FF3F = 5A\nand 1 FF3F = 0F\nread-byte 1 FF3F = 0A\n";
    check("", "", scenario, Passed);
    check("drive 1 deviates and-is-or", "", scenario, Failed);
    let wrong = "write-byte 1 FF3F = 5A\nread-byte 1 FF3F = 5B\n";
    check("", "", wrong, Failed);
}

/// ND21 9.4, 14.10.3: process data that come in write the cells that the master has chosen.
#[test]
fn cells_that_process_data_have_written_are_known() {
    let scenario = "write-byte 1 DataIn = 6C\nexchange 1 0102\nread-byte 1 FF6C = 01\n";
    let swapped = "drive 1 deviates process-data-in-swapped";
    check("", "", scenario, Passed);
    check(swapped, "", scenario, Failed);
    let noted = judged(swapped, "", scenario);
    let learned = |remark: &String| remark.contains("did not know");
    assert!(!noted.remarks.iter().any(learned), "{noted:#?}");
}

/// ND21 9.9: a race of clocks excuses bytes of its own ring and conversation only.
#[test]
fn a_race_excuses_nothing_elsewhere() {
    let scenario = format!("{SET}{READ}< 88 01 C0 13 77 xx\n");
    let ended = |ring: usize, until: Option<Instant>| UnaskedByte {
        ring,
        at: Instant::START,
        until,
        answers: 0,
    };
    let race = |ring: usize| ended(ring, None);
    let verdict = |change: Change<'_>| judged_with("", "", &scenario, change).verdict;
    assert_eq!(verdict(&|_, _| {}), Failed);
    assert_eq!(verdict(&|_, all| all[0].unasked.push(race(0))), Failed);
    let of_all = |ring: usize| {
        move |_: &[Conversation], all: &mut [Comparison]| {
            let end = |result: &mut Comparison| result.unasked.push(race(ring));
            all.iter_mut().for_each(end);
        }
    };
    assert_eq!(verdict(&of_all(1)), Failed);
    assert_eq!(verdict(&of_all(0)), Inconclusive);
    // The bytes after a check sequence that ended it are compared again.
    let over = |_: &[Conversation], all: &mut [Comparison]| {
        let end = |result: &mut Comparison| result.unasked.push(ended(0, Some(Instant::START)));
        all.iter_mut().for_each(end);
    };
    assert_eq!(verdict(&over), Failed);
}

/// ND21 9.1: any byte may be the one that a line error has damaged.
#[test]
fn line_errors_without_their_bytes_settle_nothing() {
    let plan = plan(format!("title x\nring 3\n{SET}read-byte 1 FE13 = 88\n"));
    let way = Way {
        rings: plan.rings.clone(),
        attempts: None,
        anew: false,
    };
    let wrong = "drive 1 deviates checksum-wrong\n";
    for (drives, errors, expected) in [
        ("", 0, Passed),
        (wrong, 0, Failed),
        ("", 1, Inconclusive),
        (wrong, 1, Inconclusive),
    ] {
        let mut link = link(&format!("{SET}{drives}"));
        let seen = (Span::ZERO, errors);
        let outcome = judged_early(&mut link, "", (&plan, &way), &|_, _| {}, seen);
        assert_eq!(outcome.verdict, expected, "{drives}{errors}: {outcome:#?}");
    }
}

/// ND21 9.8: a byte that is lost at the very end of a conversation is noticed although no line asks for it.
#[test]
fn a_byte_missing_at_the_end_does_not_pass() {
    let scenario = "> 08 00*40 FF 44 72 4C 41\n";
    check("", "", scenario, Passed);
    let swallows = "drive 1 deviates swallows-the-end-of-a-check-sequence";
    check(swallows, "", scenario, Verdict::Marginal);
}

/// ND21 9.2, 9.8, 10.1: what the manual leaves open is no drive's fault, in every drive, in one, and where several choices show together.
#[test]
fn a_choice_of_the_drives_is_not_blamed() {
    let forwards = |drives: &str| format!("drive {drives} property broken-sequence = forwarded\n");
    let broken = "> 08 00*40 FF 44 72 00 80*8\nrecover\n";
    let long = "read-long 1 FE12\n";
    let set = "drive 1 memory FE12 = 12 34 56 78\n";
    let printed = "drive 0..last property read-long = as-printed\n";
    check(&forwards("0..last"), "", broken, Inconclusive);
    check(&forwards("1"), "", broken, Inconclusive);
    let both = forwards("0..last") + printed;
    let asks_both = format!("{set}{broken}> 8C FE C7 12 FE 31 32 3A\n");
    let outcome = judged(&both, "", &asks_both);
    assert_eq!(outcome.verdict, Inconclusive, "{outcome:#?}");
    let named = outcome.remarks.iter().any(|remark| {
        remark.contains("broken-sequence = forwarded") && remark.contains("read-long = as-printed")
    });
    assert!(named, "{outcome:#?}");
    check(printed, "", &format!("{set}{long}"), Inconclusive);
    // No choice explains these.
    let wrong = "drive 1 deviates checksum-wrong\n";
    check(wrong, "", &format!("{set}{long}"), Failed);
    check(
        &(forwards("0..last") + wrong),
        "",
        &format!("{broken}read-byte 1 FE13\n"),
        Failed,
    );
}

/// ND21 11.8: drives may be silent while they test themselves. The resets before a scenario show it, and the scenario is judged all the same.
#[test]
fn a_choice_that_shows_before_the_scenario_leaves_it_judged() {
    let silent_for = |drives: &str, ms: u64| {
        format!(
            "drive {drives} property self-test-bus = silent\ndrive 0..last property self-test-time = {ms}ms\n"
        )
    };
    let silent = |drives: &str| silent_for(drives, 81);
    let judged = |ring: &str, scenario: &str, expected: Verdict| {
        let plan = plan(format!("title x\nring 3\n{scenario}"));
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: true,
        };
        let outcome = judged_on(&mut link(ring), "", (&plan, &way), &|_, _| {});
        assert_eq!(outcome.verdict, expected, "{scenario}: {outcome:#?}");
        outcome.remarks.join("\n")
    };
    let writes = "write-byte 1 FE13 = 11\nread-byte 1 FE13 = 11\n";
    for drives in ["0..last", "0", "1"] {
        let remarks = judged(&silent(drives), writes, Passed);
        assert!(remarks.contains("self-test-bus = silent"), "{remarks}");
    }
    // Where the drives are not heard for long, the times are part of the choice.
    for ms in [500, 2_000] {
        let remarks = judged(&silent_for("0..last", ms), writes, Passed);
        let with = "self-test-bus = silent with self-test-time = ";
        assert!(remarks.contains(with), "{remarks}");
    }
    for ms in [81, 500] {
        let wrong = silent_for("0..last", ms) + "drive 1 deviates writes-ignored\n";
        judged(&wrong, writes, Failed);
    }
    // A scenario that asks for the model's own choice settles nothing.
    let resets = "> 86 FE DD 21 FE 80*3\n< 86 01 DD 21 02 80*3\n";
    judged("", resets, Passed);
    judged(&silent("0..last"), resets, Inconclusive);
}

/// ND21 13.3, 14.4: what the master has written to a cell of the drive's program is known as long as the manual does not let the drive
/// change it.
#[test]
fn written_cells_of_the_drive_excuse_nothing() {
    let reads = |address: &str, written: &str, expected: &str| {
        format!("write-byte 1 {address} = {written}\nread-byte 1 {address} = {expected}\n")
    };
    let ignored = "drive 1 deviates writes-ignored";
    for (address, written, other) in [
        ("FF44", "12", "13"),
        ("FF43", "00", "40"),
        ("FD89", "34", "35"),
    ] {
        check("", "", &reads(address, written, written), Passed);
        check("", "", &reads(address, written, other), Failed);
    }
    check(ignored, "", &reads("FF44", "12", "12"), Failed);
    check("", "", &reads("FF57", "00", "04"), Failed);
    // Bits 7 and 0 of Status are the master's, the others the drive's.
    check("", "", &reads("FF00", "01", "80"), Failed);
    let drives = "write-byte 1 FF00 = 01\n> 88 FE C0 00 FF BF\n< 88 01 C0 00 7F xx\n";
    check("", "", drives, Inconclusive);
    // 13.3.2.2: once a calculation has been started, the cells are the controller's.
    let started = format!("write-byte 1 FF43 = 40\n{}", reads("FF48", "12", "13"));
    check("", "", &started, Inconclusive);
}

/// ND21 10.1: in the place of a '?' that is wrong no data come back, also if they are those of the cell.
#[test]
fn data_behind_a_wrong_fixed_byte_fail() {
    let scenario = "write-word 1 FE12 = 1234\n> 8A (1-N) C1 12 FE 3E 00*2\n< 8A 01 C1 12 34 00*3\n";
    check("", "", scenario, Passed);
    let outcome = judged("drive 1 deviates fixed-bytes-not-checked", "", scenario);
    assert_eq!(outcome.verdict, Failed);
    let remarks = outcome.remarks.join("\n");
    assert!(remarks.contains("the model: byte "), "{remarks}");
}

/// ND21 10.3: And and Or leave bits of a cell that are the drive's choice.
#[test]
fn masks_on_cells_that_were_not_set_accuse_no_drive() {
    let holds = "drive 1 memory FF74 = 5A";
    let scenario = "or 1 FF74 = 0F\nread-byte 1 FF74\n";
    check(holds, "", scenario, Passed);
    let wrong = "drive 1 memory FF74 = 5A\ndrive 1 deviates or-is-exclusive-or";
    check(wrong, "", scenario, Failed);
}

/// ND21 14.10.3: `DataIn` is known after every command that writes it.
#[test]
fn every_command_that_sets_data_in_is_followed() {
    let swapped = "drive 1 deviates process-data-in-swapped";
    for sets in [
        "write-word 1 FF32 = 6C00\n",
        "and 1 FF32 = 00\nor 1 FF32 = 6C\n",
        "write-byte 1 FF32 = 6E\nand 1 FF32 = FC\n",
    ] {
        let scenario = format!("{sets}exchange 1 0102\nread-byte 1 FF6C = 01\n");
        check("", "", &scenario, Passed);
        check(swapped, "", &scenario, Failed);
    }
}

/// ND21 9.7, 10.1: 00 stands in the place of data where a command is refused, whatever the cell held when it was read before. A cell of
/// ROM that was read with another value holds that value, also where the model's own is 00.
#[test]
fn a_refused_read_says_nothing_of_a_cell() {
    let judged = |ring: &str, scenario: &str| {
        let plan = plan(format!("title x\nring 3\n{scenario}"));
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: false,
        };
        judged_on(&mut link(ring), "", (&plan, &way), &|_, _| {}).verdict
    };
    let contents = "drive 0..last memory FF7D = 40 50 60\ndrive 0..last memory 2F00 = 5A";
    let refused = "read-byte 1 FF7D\n> 8C FE C7 7D FF 31 32 A6 80*40\nrecover\nread-byte 1 FF7D\n";
    assert_eq!(judged(contents, refused), Passed);
    let again = "read-byte 1 2F33\n".repeat(20);
    assert_eq!(judged(contents, &again), Passed);
    let wrong = format!("{contents}\ndrive 1 deviates rom-cell-wrong-at-times");
    assert_eq!(judged(&wrong, &again), Failed);
}

/// ND21 11.8: drives that are silent while they test themselves lose bytes. A value read after that is still known to be the drive's.
#[test]
fn silent_self_tests_accuse_no_drive() {
    let mut ring = link(
        "drive 0..last property self-test-bus = silent\ndrive 0..last property self-test-time = 81ms\n\
         drive 0..last eeprom 34 = 5A 3C",
    );
    let plan = plan("title x\nring 3\nread-byte 1 FF74\nread-byte 2 FF75\n".to_owned());
    let way = Way {
        rings: plan.rings.clone(),
        attempts: None,
        anew: true,
    };
    let outcome = judged_on(&mut ring, "", (&plan, &way), &|_, _| {});
    let remarks = outcome.remarks.join("\n");
    assert_eq!(outcome.verdict, Passed, "{remarks}");
    assert!(remarks.contains("self-test-bus = silent"), "{remarks}");
}

/// The verdict of a scenario on a simulated rig of three with these lines in its `[sim] setup`, after these lines played before.
fn judged_simulated(setup: &[&str], before: &str, scenario: &str) -> Outcome {
    let text = format!(
        "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n[sim]\nsetup = {setup:?}\n"
    );
    let rig = parse(&source(text)).expect("a rig");
    let ring = plan(format!("title x\nring 3\n{}\n> 80\n", setup.join("\n")));
    let mut link = bench(&ring);
    let way = Way {
        rings: ring.rings.clone(),
        attempts: None,
        anew: false,
    };
    let exactness = Exactness {
        tolerance: Span::ZERO,
        line_errors: true,
        knows_cells: true,
        looks: None,
    };
    let mut twin = twin(&rig, &known(&rig)).expect("a twin");
    link.run_until(Instant::START);
    let mut last = None;
    for steps in [before, scenario] {
        let plan = plan(format!("title x\nring 3\n{steps}"));
        let mut events: Vec<LinkEvent> = Vec::new();
        let byte_time = link.byte_time();
        let mut recording = Recording::new(&mut link, &mut events);
        let mut outcome = play_one(&mut recording, &plan, &way).expect("it is not examined");
        let all = Conversation::all(&events, byte_time, true);
        let (conversations, _) = way.compared(all, exactness);
        let (comparisons, _) = twin.follow_all(&conversations, exactness);
        let facts = AttemptFacts {
            rig: &rig,
            plan: &plan,
            way: &way,
            exactness,
            conversations: &conversations,
            comparisons: &comparisons,
            unplaced: 0,
            alive: &|| {},
        };
        judge(&mut outcome, &facts);
        last = Some(outcome);
    }
    last.expect("two were played")
}

/// On a simulated rig the state of the drives is known: it excuses nothing. A choice that the manual leaves open excuses what it explains.
#[test]
fn nothing_of_a_simulated_drive_is_excused() {
    let check = |setup: &[&str], before: &str, scenario: &str, expected: Verdict| {
        let outcome = judged_simulated(setup, before, scenario);
        assert_eq!(outcome.verdict, expected, "{scenario}: {outcome:#?}");
        outcome.remarks.join("\n")
    };
    let reads = "read-byte 1 FE13 = 00\n";
    let writes = "write-byte 1 FE13 = 55\n";
    check(&[], "> 80\n", reads, Passed);
    let remarks = check(&[], writes, reads, Failed);
    assert!(remarks.contains("what was played before"), "{remarks}");
    // Cells of the drive's own.
    check(
        &["drive 1 model nd21"],
        "> 80\n",
        "read-byte 1 TempKK = 01\n",
        Failed,
    );
    // 10.1: the answer of ReadLong is open.
    let set = "drive 1 memory FE12 = 12 34 56 78\n";
    let long = format!("{set}> 8C FE C7 12 FE 31 32 3A\n< 8C 01 C7 12 12 34 56 78\n");
    let printed = "drive 0..last property read-long = as-printed";
    let remarks = check(&[printed], "> 80\n", &long, Inconclusive);
    assert!(remarks.contains("the model's defaults"), "{remarks}");
    // The choice explains nothing else, and a wrong drive with it is wrong.
    check(
        &[printed],
        "> 80\n",
        &format!("{set}read-byte 1 FE13 = 35\n"),
        Failed,
    );
    check(&[printed], writes, reads, Failed);
    let wrong = "drive 1 deviates checksum-wrong";
    check(&[printed, wrong], "> 80\n", &long, Failed);
    check(
        &[printed, wrong],
        "> 80\n",
        &format!("{set}read-byte 1 FE13 = 34\n"),
        Failed,
    );
}
