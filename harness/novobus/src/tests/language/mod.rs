//! The scenario language: accepted lines, rejected lines with their messages, and the effect of each line.

use crate::language::read::RingScenario;
use crate::report::json;
use crate::simulate::simulated;
use crate::tests::ROOT;
use harness_bench::link::Link;
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::run::{Outcome, run};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use std::path::Path;

mod driver;
mod drives;
mod masters;
mod records;
mod written;

fn entry(text: &str) -> Result<RingScenario, Vec<Problem>> {
    let source =
        Source::from_bytes("test.scn".to_owned(), text.as_bytes().to_vec()).expect("a text");
    RingScenario::new(source, None).map_err(|problems| problems.all().to_vec())
}

fn play(text: &str) -> (Outcome, String) {
    let entry = entry(text).unwrap_or_else(|problems| panic!("{problems:#?}\n{text}"));
    let plan = entry.plan;
    let mut link = simulated(&plan);
    let outcome = run(&plan, &mut link);
    let mut trace = Vec::new();
    json::write(&[link.trace(0)], &outcome.records, &mut trace).expect("JSON");
    (outcome, String::from_utf8(trace).expect("text"))
}

/// A scenario for a ring of 3 with these steps.
fn steps(steps: &str) -> String {
    format!("title test\nring 3\n{steps}\n")
}

#[track_caller]
fn passes(text: &str) {
    let (outcome, _) = play(text);
    assert_eq!(
        outcome.verdict,
        Verdict::Passed,
        "{:?}\n{text}",
        outcome.finding
    );
}

#[track_caller]
fn fails(text: &str, message: &str) {
    let (outcome, _) = play(text);
    let finding = outcome
        .finding
        .unwrap_or_else(|| panic!("it passed\n{text}"));
    assert!(
        finding.message.contains(message),
        "{}\n{text}",
        finding.message
    );
}

/// The mistake, its place as text, and the help.
#[track_caller]
fn refused(text: &str, place: &str, message: &str, help: Option<&str>) {
    let problems = entry(text)
        .err()
        .unwrap_or_else(|| panic!("it was accepted\n{text}"));
    let problem = &problems[0];
    let said = format!("{}; {}", problem.message, problem.expected);
    assert!(said.contains(message), "{problem:#?}\n{text}");
    assert_eq!(
        &text[problem.span.start..problem.span.end],
        place,
        "{problem:#?}"
    );
    match help {
        None => {}
        Some(help) => {
            let found = problem.help.clone().unwrap_or_default();
            assert!(found.contains(help), "{problem:#?}");
        }
    }
}

#[test]
fn drives_deviate() {
    let text = |what: &str| format!("title x\nring 2\n{what}\n> 88 FE\n< 88 00\n");
    passes(&text(""));
    fails(&text("drive 0 deviates increments-twice"), "received 01");
    // Two drives that pass the address on unchanged, and one that adds 2: what is wrong adds up.
    passes(&text(
        "drive 0 deviates does-not-increment\ndrive 1 deviates increments-twice",
    ));
    passes(&text(
        "drive 0 deviates does-not-increment\ndrive 0 deviates increments-twice\n",
    ));
    let needs = entry(&text("drive 0..1 deviates increments-twice")).expect("a scenario");
    let needs = needs.plan.needs;
    assert_eq!(needs, [harness_bench::link::Capability::Simulator]);
    refused(
        &text("drive 0 deviates increments-twise"),
        "increments-twise",
        "drivebench deviations",
        Some("`increments-twice`"),
    );
    refused(
        &text("drive 0 deviates"),
        "",
        "the name of a deviation",
        None,
    );
    // What is behind the bus is not in a plain drive.
    refused(
        &text("drive 0 model plain\ndrive 0 deviates ramps-ignored"),
        "drive 0 deviates ramps-ignored",
        "its model is `plain`",
        Some("drive 0 model nd21"),
    );
    passes(&text("drive 0 deviates ramps-ignored"));
    // What a drive shows of its cells is what a look finds.
    fails(
        &text("drive 0 deviates cooler-too-warm\n? drive 0 TempKK = 25C"),
        "TempKK",
    );
}

/// The lines of a loop are played for each number, upwards and downwards; its counter stands in every arithmetic.
#[test]
fn loops_are_played_for_each_number() {
    let text = "for k in last..0\n for i in 0..3\n  write-byte k FE10+i = (16*k+i)\n end\n read-byte k FE12 = (16*k+2)\nend\n\
                read-word 2 FE12 = 2223\nread-word 1 FE10 = 1011\n? sent 116 bytes";
    passes(&steps(text));
    // Down to one turn, and bit by bit.
    let text = "for a in 7..7\n> 88 (0-N) A4 (a&12|1^3) 00*0\n< 88 00 A4 06\nend";
    passes(&steps(text));
    fails(
        &steps("for k in 0..last\nread-byte k FE13 = (k)\nend"),
        "the master received",
    );
    let wrong = [
        ("for k in 0..last\n> 80", "the loop has no `end` line"),
        ("> 80\nend", "no loop begins above this `end`"),
        ("> (k)", "`k` is used outside a loop that counts with it"),
        (
            "for i in 0..9\n> 80\nend\nread-byte i FE13",
            "`i` is used outside",
        ),
        ("for i in 0..1000000\nend\n> 80", "more than 200000 steps"),
        (
            "for i in 0..9\nread-byte i FE13\nend",
            "there is no drive 3 in a ring of 3",
        ),
        (
            "for i in 0..1\nread-byte 0 FFFF+i\nend",
            "is not an address",
        ),
    ];
    for (text, message) in wrong {
        let problems = entry(&steps(text)).expect_err(text);
        assert_eq!(problems.len(), 1, "{text}: {problems:#?}");
        assert!(
            problems[0].message.contains(message),
            "{text}: {problems:#?}"
        );
    }
}

#[test]
fn near_misses_get_a_suggestion() {
    refused(
        "titel x\nring 3\n",
        "titel",
        "`titel` is not valid here",
        Some("did you mean `title`?"),
    );
    refused(
        &steps("raed-byte 1 FE13"),
        "raed-byte",
        "is not valid here",
        Some("`read-byte`"),
    );
    refused(
        &steps("! 2->1 byte 3: filp 0"),
        "filp",
        "a fault of a link",
        Some("`flip`"),
    );
    refused(&steps("? locatd 1"), "locatd", "a check", Some("`located`"));
    refused(
        &steps("! mater->2: drop"),
        "mater->2:",
        "`master`",
        Some("`master`"),
    );
    refused(
        "title x\nring 3\nbus novabus\n",
        "novabus",
        "a bus",
        Some("`novobus`"),
    );
    refused(
        "title x\nring 3\ndrive 0 property tim-out = 12ms\n",
        "tim-out",
        "a property",
        Some("`time-out`"),
    );
    refused(&steps("> 0x88"), "0x88", "hexadecimal", Some("without 0x"));
    refused(&steps("> 8O"), "8O", "hexadecimal", Some("`80`"));
    refused(&steps("> 888"), "888", "odd number", Some("`0888`?"));
    let speed = &steps("drive 1 memory nsoll = 100");
    refused(speed, "100", "odd number", Some("`0100` or `100rpm`?"));
    refused(
        &steps("! 2->0: drop"),
        "2->0",
        "no link 2->0",
        Some("`2->1`"),
    );
    refused(&steps("+5mss > 80"), "mss", "not a unit", Some("`ms`"));
}

#[test]
fn what_cannot_be_is_refused_with_its_range() {
    refused(
        &steps("read-byte 3 FE13"),
        "3",
        "no drive 3 in a ring of 3",
        None,
    );
    refused(
        &steps("read-byte 1 FD7F"),
        "FD7F",
        "ReadByte does not reach FD7F",
        None,
    );
    refused(
        &steps("read-word 1 FF7F"),
        "FF7F",
        "ReadWord does not reach FF7F",
        None,
    );
    refused(
        &steps("write-byte 1 FF80 = 00"),
        "FF80",
        "WriteByte does not reach FF80",
        None,
    );
    refused(&steps("write-io 1 = 04"), "04", "not an output code", None);
    refused(
        &steps("write-word 1 FF08 = 12"),
        "12",
        "1 byte where 2 bytes must stand",
        None,
    );
    refused(&steps("> xx"), "xx", "must be known", None);
    refused(&steps("> (300)"), "300", "300 is not a byte", None);
    refused(&steps("> (1/0)"), "1/0", "no value", None);
    refused(
        &steps("> 80*8000000"),
        "80*8000000",
        "more than 4000000 bytes",
        None,
    );
    refused(&steps("! 2->1 byte 0: drop"), "0", "no byte 0", None);
    refused(
        &steps("+5ms..7ms > 80"),
        "5ms..7ms",
        "waits for a byte",
        None,
    );
    refused(
        &steps("+7ms..5ms < 80"),
        "7ms..5ms",
        "ends before it begins",
        None,
    );
    refused(
        &steps("@2000000s > 80"),
        "2000000s",
        "longer than eleven minutes",
        None,
    );
    refused(&steps("> 80 drive"), "drive", "hexadecimal", None);
    refused(
        &steps("> 80\nring 4"),
        "ring",
        "after the first step",
        Some("above"),
    );
    refused(
        "title x\nring 3\ndrive 0 memory 1000 = 00\n> 80\n",
        "1000",
        "no memory at 1000",
        None,
    );
    refused(
        "title x\nring 3\ndrive 0 memory FFFF = 0000\n> 80\n",
        "FFFF",
        "no memory at 10000",
        None,
    );
    refused(
        "title x\nring 3\ndrive 0 property time-out = 21ms\n> 80\n",
        "21ms",
        "cannot be set",
        None,
    );
    refused(
        "title x\nring 5..3\n",
        "5..3",
        "ends before it begins",
        None,
    );
    refused(
        "title x\nring 3..5 default 6\n",
        "6",
        "outside the range",
        None,
    );
    refused(
        "title x\nring 3\nline 4800\n",
        "4800",
        "38400, 19200 or 9600",
        None,
    );
    refused(
        "title x\ntitle y\nring 3\n",
        "title",
        "is given twice",
        None,
    );
    refused("title x\n> 80\n", "", "how many drives", Some("ring 4"));
    refused(&steps("2> 80"), "80", "one ring", Some("ring 4, 3"));
}

#[test]
fn every_mistake_of_a_file_is_found() {
    let problems = entry("title x\nring 3\n> 8\n< zz\n! 9->8: drop\n").expect_err("mistakes");
    // What is wrong for every ring comes first; what is wrong for this ring only after that is mended.
    assert_eq!(problems.len(), 2, "{problems:#?}");
}

#[test]
fn deep_and_long_lines_are_refused_and_do_not_hang() {
    for text in ["(", "[", "0+", "1*", "-"] {
        assert!(entry(&steps(&format!("> {}", text.repeat(4_000)))).is_err());
        assert!(entry(&steps(&format!("? drive {}0 in error", text.repeat(4_000)))).is_err());
    }
    assert!(Source::from_bytes("x".to_owned(), vec![b'a'; 20_000]).is_err());
    passes(&steps("> []*999999999999 80 [80*99999]*0\n? sent 1 bytes"));
    assert!(entry(&steps("? drive 0 memory FF00 = 80*999999")).is_err());
    let bomb = steps("> [[[[[[[80*99]*99]*99]*99]*99]*99]*99]*99");
    assert!(entry(&bomb).is_err());
    assert!(entry(&"\n".repeat(100_000)).is_err());
}

#[test]
fn times_are_relative_absolute_and_windows() {
    // Three drives: the first byte is back after four byte times, 1145.8 us.
    passes(&steps("> 80\n@1145us..1146us < 80"));
    passes(&steps("> 80\n@1.146ms < 80"));
    fails(&steps("> 80\n@1.147ms < 80"), "came at 1.146 ms");
    fails(&steps("> 80\n@1.144ms < 80"), "at the latest");
    passes(&steps("> 80\n+3bytes < 80"));
    passes(&steps("> 80*5\n+5ms > 80\n< 80*5\n@7.5ms..7.6ms < 80"));
    passes(&steps("+2.5ms > 80\n< 80\n+1ms > 80\n< 80"));
    let late = play(&steps("> 80*100\n< 80*100\n@1ms > 80")).0;
    assert_eq!(late.verdict, Verdict::Aborted);
}

#[test]
fn received_bytes_are_taken_in_order() {
    passes(&steps("> 80*3 A0\n< 80*2\n< 80 A0"));
    passes(&steps("> 80*3\n< 80 xx 80"));
    passes(&steps("> 80*3\n< 80"));
    fails(
        &format!("strict\n{}", steps("> 80*3\n< 80")),
        "no line asks for",
    );
    fails(&steps("> 80\n< 80 80"), "nothing more was received");
}

#[test]
fn faults_on_links_do_what_they_say() {
    passes(&steps(
        "> 80*3\n! 1->0 byte 2: drop\n? received 2 bytes\n? drives 0..2 normal",
    ));
    passes(&steps(
        "> 80*3\n! 1->0 byte 2: duplicate\n? received 4 bytes\n< 80*4",
    ));
    passes(&steps(
        "> 80*3\n! 0->master byte 2: insert A0\n< 80 A0 80 80",
    ));
    passes(&steps("> 80*3\n! 0->master byte 2: replace E0\n< 80 E0 80"));
    passes(&steps("> 80*3\n! 1->0 byte 2: flip 0 1\n? error 0504 at 0"));
    passes(&steps(
        "> 80*3\n! 1->0 byte 2: flip p\n? error SCIparity at 0",
    ));
    passes(&steps("> 80*3\n! 1->0 byte 2: flip s\n? error 0503 at 0"));
    passes(&steps("> 80*3\n! 1->0 byte 2: overrun\n? error 0501 at 0"));
    passes(&steps(
        "> 80*9\n! 1->0 byte 2: break 1ms\n? error 0503 at 0\n? received 6 bytes",
    ));
    passes(&steps(
        "> 80*3\n! 2->1 byte 2: delay 3ms\n< 80\n+3ms..3.3ms < 80\n+1bytes < 80",
    ));
    passes(&steps(
        "! 2->1 byte 2: cut\n! 2->1 byte 4: join\n> 80*5\n? received 3 bytes",
    ));
    passes(&steps(
        "> 80*100\n! 2->1 @5ms: cut\n! 2->1 @10ms: join\n? drives 0..2 normal\n? received 82 bytes",
    ));
    passes(&steps(
        "> 80*100\n@5ms ! 2->1: cut\n@10ms ! 2->1: join\n? received 82 bytes",
    ));
    // Twice the same bit is no flip at all; and faults act in the order of their lines.
    passes(&steps(
        "> 80\n! 2->1 byte 1: flip 0\n! 2->1 byte 1: flip 0\n< 80",
    ));
    passes(&steps(
        "> 80\n! 0->master byte 1: flip 0\n! 0->master byte 1: replace A0\n< A0",
    ));
}

#[test]
fn faults_in_drives_do_what_they_say() {
    passes(&steps(
        "! drive 1: off\n> 80*3\n? received 0 bytes\n! drive 1: on\n> 80\n< 80",
    ));
    passes(&steps(
        "! drive 0 byte 3: stuck 55\n> 80*4\n< 80 80 55 55\n! drive 0 unstuck\n> 80\n< 80",
    ));
    passes(
        "title x\nring 1\ndrive 0 memory FE13 = 88\n! drive 0: off\n! drive 0: on\n? drive 0 memory FE13 = 00\n",
    );
    let (outcome, _) = play(&steps("> 80\n! 2->1 byte 7: drop\n! drive 0 byte 9: off"));
    assert_eq!(outcome.remarks.len(), 2, "{:?}", outcome.remarks);
}

#[test]
fn jobs_are_telegrams_with_whole_answers() {
    passes(&steps(
        "write-word 1 FF08 = 1234\nread-word 1 FF08 = 1234\nread-byte 1 FF08 = 12\nread-byte 1 FF09 = 34",
    ));
    passes(&steps(
        "write-byte 1 FD80 = 56\nread-byte 1 FD80 = 56\nread-byte 0 FD80 = 00",
    ));
    passes(&steps(
        "write-word 2 FF44 = 0001\nwrite-word 2 FF46 = 2345\nread-long 2 FF44 = 00012345",
    ));
    passes(&steps(
        "stop 1\nblock 1\nread-byte 1 Status = 81\ngo 1\nread-byte 1 Status = 00",
    ));
    passes(&steps(
        "or 1 FF10 = F0\nand 1 FF10 = 3C\n? drive 1 memory FF10 = 30",
    ));
    passes(&steps(
        "write-io 1 = 01\nwrite-io 1 = 03\n? drive 1 memory FFB7 = A0\nwrite-io 1 = 00\n? drive 1 memory FFB7 = 20",
    ));
    passes(&steps(
        "write-byte 1 DataIn = 08\nwrite-byte 1 DataOut = 08\nexchange 1 1234\nexchange 1 0000 = 1234",
    ));
    passes(&steps(
        "write-byte 1 FE13 = 88\nreset 1\nread-byte 1 FE13 = 00",
    ));
    passes(&steps(
        "> 00\n? drives 0..2 in error\nrecover\ndelete-error 2\nread-byte 2 errorcode = AF",
    ));
    fails(
        &steps("read-byte 1 FE13 = 88"),
        "received 00 where 88 is expected",
    );
    passes(
        "title x\nring 2\ndrive 1 property read-long = as-printed\ndrive 1 memory FF44 = 01020304\nread-long 1 FF44 = 010203 04\n",
    );
}

#[test]
fn checks_can_fail() {
    fails(&steps("> 80\n? located 1"), "spells out no address");
    fails(
        &steps("! master->2 byte 1: flip 0\n> 80\n? located 1"),
        "spells out drive 2, expected drive 1",
    );
    fails(
        &steps("! master->2 byte 1: flip 0\n> 80\n? within 3 zeros"),
        "zeros, expected at most 3",
    );
    fails(
        &steps("? drive 1 in error"),
        "drive 1 is not in the error mode",
    );
    fails(
        &steps("> 00\n? drives 0..2 normal"),
        "drives 0, 1, 2 are in the error mode",
    );
    fails(&steps("? error 0502 at 1"), "is not in the error mode");
    fails(
        &steps("> 00\n? error 0502 at 2"),
        "has error 0504 NBsync, expected 0502 SCIparity",
    );
    fails(
        &steps("? drive 1 memory FE13 = 88"),
        "cell FE13 of drive 1 holds 00",
    );
    fails(&steps("? corrected 1"), "0 check sequences came back");
    fails(&steps("> 80\n? sent 2 bytes"), "1 byte sent");
    fails(&steps("> 80\n? sent 1 bytes in 0.3us"), "the 1 byte took");
    fails(&steps("> 80\n? received 2 bytes"), "received 1 byte");
    fails(&steps("! 0->master: cut\nrecover"), "did not come back");
}

#[test]
fn located_leaves_no_trace() {
    let text = |check: &str| steps(&format!("! 2->1 byte 2: flip 0\n> 80*5\n{check}"));
    let (with, trace_with) = play(&text("? located 1\n? within 25 zeros"));
    let (_, trace_without) = play(&text(""));
    assert_eq!(with.verdict, Verdict::Passed);
    assert_eq!(trace_with, trace_without);
}

/// What a stranger found.
#[test]
fn regressions() {
    // What shows nothing is refused.
    refused("title x\nring 3\n", "", "no step", Some("SYNCO"));
    refused(
        "title x\nring 3\ndrive 0..1 model nd21\ndrive 0..2 property eeprom-read-time = 2ms\n> 80\n",
        "eeprom-read-time",
        "drive 2 has no",
        Some("drive 2 model nd21"),
    );
    // `xx` cannot be written.
    refused(
        &steps("write-byte 0 FE13 = xx"),
        "xx",
        "must be known",
        None,
    );
    refused(&steps("write-io 0 = xx"), "xx", "must be known", None);
    // SYNCO after the seven zeros of a telegram is not drive 128.
    fails(
        "title x\nring 200\n> 8E 05 00*7\n> 80*10\n? located 128\n",
        "no address",
    );
    // A check takes as long as it lets everything come round.
    passes("title x\nring 100\n> 80*100\n? received 100 bytes\n+1ms > 80\n< 80\n");
    // A byte outside its window is distinguished from one that never came.
    fails(
        "title x\nring 10\n> 80\n+1ms..2ms < 80\n",
        "80 came at 3.151 ms, expected at",
    );
    // A long line on a slow line comes round as well.
    passes("title x\nring 1\nline 9600\n> 80*70000\n? received 70000 bytes\n");
    // A probe ends although a byte is late.
    fails(
        "title x\nring 5\ndrive 0..last memory Flags2 = 04\n! 0->master byte 3: delay 10s\n> 80*9\n@1ms ? located 3\n",
        "",
    );
}

/// The example with which the language was defined.
#[test]
fn the_example_of_the_readme_passes() {
    let readme = std::fs::read_to_string(Path::new(ROOT).join("README.md")).expect("the README");
    let start = readme.find("title   Parity error").expect("the example");
    let text = readme[start..].split("```").next().expect("its end");
    passes(text);
}

/// Arithmetic over the ring's size: one file, rings of any size.
#[test]
fn one_file_serves_rings_of_any_size() {
    let text = "title x\nring 1..250 default 7\ndrive 0..N-1 memory FE13 = 88\n\
                > 88 (last-N) C0 13 FE D1\n< 88 (N-1) C0 13 88 A5\n> 88 (N/2-N) C0 13 FE D1\n< 88 (N/2) C0 13 88 A5\n\
                > 80*N\n< 80*(N)\n! master->last byte 1: flip 0 1\n";
    for size in [1, 2, 7, 250] {
        let source = Source::from_bytes("x.scn".to_owned(), text.into()).expect("text");
        let entry =
            RingScenario::new(source, Some(size)).unwrap_or_else(|e| panic!("{:#?}", e.all()));
        assert_eq!(entry.plan.rings[0].drives(), size);
    }
}

/// Any text is a scenario or has mistakes whose places lie in the text; it never panics.
#[test]
fn any_text_is_read_or_refused() {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(38_400);
    let config = Config {
        cases: 4_000,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    let piece = prop_oneof![
        Just("title x\n".to_owned()),
        Just("ring 4\n".to_owned()),
        "(ring|drive|line|needs|deadline|source|bus) [0-9a-zN.,= -]{0,20}\n",
        "[>] ([0-9A-F]{2} |xx |80\\*[0-9]{1,3} |\\(N-[0-9]\\) |\\[80 ){1,6}\n",
        "[<] ([0-9A-F]{2} |xx ){1,6}\n",
        "! [0-4a-z]{1,6}->[0-4a-z]{1,6} (byte [0-9]{1,3})?:? (flip|drop|insert|break|delay|cut|join|replace) ?[0-9a-fps]{0,3}(ms)?\n",
        "\\? (located|drive|error|within|sent|corrected) [0-9a-zA-F .=]{0,24}\n",
        "[+@][0-9.]{1,6}(us|ms|s|bytes|x)?(\\.\\.[0-9]{1,4}ms)? [><!?] ?[0-9A-F]{2}\n",
        "(read-byte|write-word|go|recover|exchange|and) [0-9a-zA-F =]{0,16}\n",
        "drive [0-2](\\.\\.last)? (model nd21|type 56[012][05]|input GPIN[0-9] (high|low)|(load|rail|cooler) -?[0-9]{1,3}[ACV])\n",
        "([?] |until )?drive [0-3] (nist|imax|Flags2|nRampe[+]|position) [&=<>]{1,2} ?[0-9A-F.]{1,5} ?(rpm|A|turns|C)?( [+]-1%)?( within [0-9]ms)?\n",
        "(drive 0 (memory|eeprom)|write-word 0|read-word 0) (nMax|EE_pole|nsoll|imax|i0) = [0-9.]{1,4}(rpm|A|Aeff)?\n",
        "record drive [0-3] (nist|position|ps_status|stack) (every [0-9]ms|changes|off)\n",
        "(wait [0-9]{1,2}ms|! drive 0: error 01[0-5][0-4])\n",
        "\\PC{0,20}\n",
    ];
    let texts = prop::collection::vec(piece, 0..8);
    let result = TestRunner::new(config).run(&texts, |lines| {
        let text = lines.concat();
        match entry(&text) {
            Err(problems) => {
                for problem in problems {
                    prop_assert!(problem.span.end <= text.len());
                    prop_assert!(text.get(problem.span.start..problem.span.end).is_some());
                }
            }
            Ok(entry) => {
                run(&entry.plan, &mut simulated(&entry.plan));
            }
        }
        Ok(())
    });
    if let Err(error) = result {
        panic!(
            "{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-novobus any_text"
        );
    }
}
