//! The language of this bus: reading, writing, mistakes and verdicts.

use super::Unitek;
use harness_bench::bus_name::BusName;
use harness_bench::fuzz::written;
use harness_bench::scenario::files::sources;
use harness_bench::scenario::parse::{bus, parse};
use harness_bench::scenario::settled::{BenchSize, settle};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_bench::scenario::verdict::Verdict;
use harness_bench::scenario::write::write;

const HEADER: &str = "title   Frames\nsource  unitek 5.4 ex 8\nbus     unitek\n";

fn source(text: &str) -> Source {
    Source::new("unitek.scn", text)
}

/// The verdict of these lines after the common header, and what was wrong.
fn played(lines: &str) -> (Verdict, String) {
    let found = settle::<Unitek>(&source(&format!("{HEADER}{lines}")), BenchSize::Own);
    let (_, plan) = found.unwrap_or_else(|problems| panic!("{lines}\n{:#?}", problems.all()));
    let mut link = plan.simulate();
    let outcome = plan.play(&mut *link, harness_bench::scenario::run::AtMismatch::Stop);
    let message = outcome.finding.map(|finding| finding.message);
    let message = message.unwrap_or_default();
    (outcome.verdict, message)
}

fn passes(lines: &str) {
    assert_eq!(played(lines), (Verdict::Passed, String::new()), "{lines}");
}

fn fails(lines: &str, with: &str) {
    let (verdict, message) = played(lines);
    assert_eq!(verdict, Verdict::Failed, "{lines}");
    assert!(message.contains(with), "{lines}\n{message}");
}

/// The first mistake: what stands there, the message, the help.
fn mistake(lines: &str) -> (String, String, String) {
    let source = source(&format!("{HEADER}{lines}"));
    let found = settle::<Unitek>(&source, BenchSize::Own).expect_err(lines);
    let first = found.all()[0].clone();
    let place = source.text[first.span.start..first.span.end].to_owned();
    let said = format!("{}; {}", first.message, first.expected);
    (place, said, first.help.unwrap_or_default())
}

/// Every line of the language is written as it was read.
#[test]
fn lines_are_written_as_they_are_read() {
    let lines = "rate    250
drive 1
drive 3 rx 210 tx 190
drive 1 register 52 = 3000
drive 1 register SPEED_RPMMAX = 3600rpm
drive 1 profile fw472
drive 1 property map-reply = native
drive 1 property stuff = A5
drive 1 property homing-time = 20ms
drive 1 mode position
drive 1 input run low
drive 1 force tol = 1
drive 1 force speed off
drive 3 deviates no-lock
master deviates never-locks

> 201 52 0C 00
> 201
> 201 rtr 3
> x00000201 3D 40 00
! frame 3: lost
! frame 4: doubled
! frame 5: delay 3ms
! frame 6: corrupt
! frame 7: no-acknowledge
@5ms ! drive 1: off
! drive 1: on
! drive 3: bus-off
! frame 4: bus-off
drive 1 input limit1 high
drive 1 force errors = 00000008
drive 1 register D4 = 11223344
drive 1 restart
+1ms..2ms < 181 40 85 31 00 00 xx
? quiet
? drive 1 register 6E = 11E1CA10
? drive 1 register SPEED_ACTUAL = -50.5% +- 1%
for k in 0..2
read 1 (k)
> 201 3D (k) 00
end
read 1 SPEED_ACTUAL = 50%
write 1 POS_DEST = 2.5turns
every 1 30 100ms
stop-every 1 30
lock 1
release 1
master read 1 STATUS = 0181
master write 1 C6 = 5.0A
master every 1 30 20ms
master stop-every 1 30
master start-up 1
";
    let text = format!("{HEADER}{lines}");
    let scenario: Scenario<Unitek> = parse(&source(&text)).expect("a scenario");
    assert_eq!(write(&scenario), text);
}

/// The other spelling of frames, with a comment after it.
#[test]
fn frames_as_candump_writes_them() {
    let lines = "drive 1\n\n> 201#520C00 # mask\n< 181#4085310000xx\n> 201#R3\n> 201#\n> 00000201#3D4000#\n";
    let text = format!("{HEADER}{lines}");
    let scenario: Scenario<Unitek> = parse(&source(&text)).expect("a scenario");
    let written = write(&scenario);
    let steps = written.split("\n\n").nth(1).expect("steps");
    let expected =
        "> 201 52 0C 00\n< 181 40 85 31 00 00 xx\n> 201 rtr 3\n> 201\n> x00000201 3D 40 00\n";
    assert_eq!(steps, expected);
}

/// The example of the language's core.
#[test]
fn the_core() {
    passes(
        "drive 1
rate 500
drive 1 register 52 = 3000
drive 1 register SPEED_RPMMAX = 3600rpm
drive 1 mode position
drive 1 property map-reply = native
drive 1 input run high
drive 1 force tol = 1
drive 1 force cal = 1
> 201 52 0C 00
> 201#511000
> 201 rtr 3
> x00000201 3D 40 00
drive 1 input limit1 high
< 181 40 85 31 00 00 xx
wait 50ms
? quiet
write 1 POS_SOLL = 11E1CA10
? drive 1 register 6E = 11E1CA10
drive 1 restart
write 1 SPEED_CMD = 10%
? drive 1 register 31 = 0CCD
every 1 SPEED_ACTUAL 10ms
< 181 30 xx xx xx
stop-every 1 SPEED_ACTUAL
lock 1
? drive 1 register 51 = 4
release 1
read 1 51 = 0
",
    );
}

#[test]
fn what_is_not_as_a_line_says_fails() {
    fails(
        "drive 1\n> 201 3D 1B 00\n< 181 1B D8 02 xx\n",
        "the master received 181 1B D8 01 00 where 181 1B D8 02 xx is expected",
    );
    fails("drive 1\n> 201 3D 1B 00\n", "181 1B D8 01 00 was received");
    fails(
        "drive 1\n> 201 3D 1B 00\n? quiet\n< 181 1B D8 01 xx\n",
        "no line asks for it",
    );
    fails(
        "drive 1\n> 201 3D 1B 00\n< 181 1B D8 01\n",
        "181 1B D8 01 00 where",
    );
    fails(
        "drive 1\n> 210 3D 1B 00\n< 190 1B D8 01 xx\n",
        "nothing more was received up to 1000",
    );
    fails(
        "drive 1\nread 1 1B = 01D9\n",
        "register 1B (FW-VERSION) reads 01D8 where 01D9 is expected",
    );
    fails(
        "drive 1\ndrive 1 force speed = 50%\nread 1 30 = 49%\n",
        "reads 4000 (50.0%) where 3EB8 (49.0%) is expected",
    );
    fails(
        "drive 1\n? drive 1 register 40 = 0180\n",
        "reads 00000101 where 00000180",
    );
    fails(
        "drive 1\n! drive 1: off\nread 1 1B\n",
        "(the bench noticed on the bus: no-acknowledge)",
    );
    passes("drive 1\ndrive 1 force speed = 50%\nread 1 30 = 49% +- 1.1%\n");
}

/// Faults of frames, counted over the segment, wherever their lines stand.
#[test]
fn faults() {
    passes(
        "drive 1\n> 201 3D 1B 00\n! frame 1: lost\nwait 5ms\n? quiet\n> 201 3D 1B 00\n< 181 1B D8 01 xx\n",
    );
    passes("drive 1\n! frame 2: lost\n> 201 3D 1B 00\nwait 5ms\n? quiet\n");
    passes("drive 1\n! frame 1: doubled\n> 201 3D 1B 00\n< 181 1B D8 01 xx\n< 181 1B D8 01 xx\n");
    passes("drive 1\n! frame 2: corrupt\n> 201 3D 1B 00\n< 181 1B D8 01 xx\n? quiet\n");
    passes("drive 1\n! frame 2: delay 3ms\n> 201 3D 1B 00\n+3ms..4ms < 181 1B D8 01 xx\n");
    passes(
        "drive 1\n! drive 1: off\n> 201 3D 1B 00\nwait 5ms\n? quiet\n! drive 1: on\n< 181 1B D8 01 xx\n",
    );
    passes("drive 1\n! drive 1: bus-off\n> 201 3D 1B 00\nwait 5ms\n? quiet\n");
    let (verdict, _) = played("drive 1\n! frame 9: lost\n> 201 52 00 00\n");
    assert_eq!(verdict, Verdict::Passed);
}

#[test]
fn mistakes_have_their_places() {
    let found = |lines: &str| {
        let (place, _, help) = mistake(lines);
        (place, help)
    };
    let near = |word: &str| format!("did you mean `{word}`?");
    assert_eq!(
        found("drive 1\nraed 1 STATUS\n"),
        ("raed".to_owned(), near("read"))
    );
    assert_eq!(
        found("drive 1\nread 1 SPEED_ACTUEL\n"),
        ("SPEED_ACTUEL".to_owned(), near("SPEED_ACTUAL"))
    );
    assert_eq!(
        found("drive 1 mode spede\n> 201\n"),
        ("spede".to_owned(), near("speed"))
    );
    assert_eq!(
        found("drive 1 proprety stuff = 00\n> 201\n").1,
        near("property")
    );
    assert_eq!(
        found("drive 1 property map-reply = natve\n> 201\n").1,
        near("native")
    );
    assert_eq!(found("drive 1 deviates no-lok\n> 201\n").1, near("no-lock"));
    assert_eq!(
        found("drive 1\n> 20 3D 40 00\n"),
        ("20".to_owned(), near("020"))
    );
    assert_eq!(
        found("drive 1\n> 801 3D 40 00\n").1,
        "identifiers of 11 bits end at 7FF"
    );
    assert_eq!(found("drive 1\n> 201#520C0\n").0, "520C0");
    assert!(
        found("drive 1\nwrite 1 31 = 0x0CCD\n")
            .1
            .contains("without 0x")
    );
    assert!(found("drive 1\nwrite 1 C6 = 5A\n").1.contains("`5.0A`"));
    assert!(
        found("drive 1\nwrite 1 31 = 10rmp\n")
            .1
            .contains("units are %")
    );
    assert!(
        found("drive 1\n> 201\nrate 500\n")
            .1
            .contains("move the line up")
    );
    assert!(
        found("drive 1\n> 201\ndrive 1 mode speed\n")
            .1
            .contains("move the line up")
    );
    assert!(found("> 201\n").1.contains("add a line such as `drive 1`"));
    let message = |lines: &str| mistake(lines).1;
    assert!(message("drive 1\nread 2 31\n").contains("the scenario has no drive 2"));
    assert!(message("drive 128\n> 201\n").contains("no drive 128"));
    assert!(message("drive 1\n> 201 1 2 3 4 5 6 7 8 9\n").contains("odd number of digits"));
    assert!(message("drive 1\n> 201 00*9\n").contains("at most 8 data bytes"));
    assert!(message("drive 1\n> 201 xx\n").contains("every byte must be known"));
    assert!(message("drive 1\nevery 1 30 255ms\n").contains("no interval"));
    assert!(message("drive 1\nwrite 1 31 = 12345\n").contains("which has 16 bits"));
    assert!(message("drive 1\nwrite 1 31 = 101%\n").contains("out of range"));
    assert!(message("drive 1\nwrite 1 31 = 10ms\n").contains("is not counted in ms"));
    assert!(message("drive 1 register CE = 0E10\n> 201\n").contains("cannot be set"));
    assert!(message("rate 0\ndrive 1\n> 201\n").contains("bit rate"));
}

/// Drives beside each other, with identifiers of their own.
#[test]
fn several_drives() {
    passes(
        "drive 1\ndrive 3 rx 210 tx 190\ndrive 3 register D4 = 12345678\n> 210 3D D4 00\n< 190 D4 78 56 34 12 xx\nread 3 D4 = 12345678\nread 1 D4 = 00000000\n",
    );
    passes("drive 1\ndrive 2\ndrive 3\nfor k in 1..N\nread (k) 1B = 01D8\nend\n");
}

/// Cycles that fill the bus hold the bench's own frame back for ever: the scenario ends all the same.
#[test]
fn a_full_bus_ends() {
    let lines = "rate 100\ndrive 1\nfor k in 1..8\n> 201 3D (k) 01\nend\n> 201 3D 01 FF\n? quiet\n";
    let source = source(&format!("{HEADER}{lines}"));
    let (_, plan) = settle::<Unitek>(&source, BenchSize::Own).expect("a scenario");
    let mut link = plan.simulate();
    let outcome = plan.play(&mut *link, harness_bench::scenario::run::AtMismatch::Stop);
    assert_eq!(outcome.verdict, Verdict::Failed);
    let seconds = outcome.took.as_nanos() / 1_000_000_000;
    assert!(seconds < 60, "{seconds} s");
}

/// Damaged scenarios are read, settled and played, or refused with a place inside the text; what is read comes back from the writer.
#[test]
fn damaged_scenarios() {
    let sources = harness_bench::scenario::files::sources(&[]).expect("built-in scenarios");
    let ours = sources
        .into_iter()
        .filter(|source| source.name.starts_with("unitek/"));
    let texts: Vec<_> = ours
        .map(|source| source.text.to_string())
        .filter(|text| text.len() < 700)
        .collect();
    let words = [
        " ",
        "#",
        "x",
        "xx",
        "(k)",
        "N",
        "0",
        "FFFFFFFF",
        "181",
        "-",
        "%",
        "5A",
        "ms",
        "drive 128 ",
        "rx 7FF ",
        "! frame 1: delay 1s\n",
        "for k in 0..3\n",
        "end\n",
        "@1ms ",
        "+1ms..2ms ",
        "master ",
        "= ",
        "rtr 9",
        "restart\n",
        "\n",
        "force ",
        "é",
    ];
    let mut state = 0x2545_F491_4F6C_DD17_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % below as u64).unwrap_or(0)
    };
    let (mut played, mut refused) = (0, 0);
    for _ in 0..3_000 {
        let mut text = texts[random(texts.len())].clone();
        for _ in 0..=random(3) {
            let places: Vec<_> = text.char_indices().map(|(at, _)| at).collect();
            if places.is_empty() {
                break;
            }
            let at = places[random(places.len())];
            match random(3) {
                0 => text.insert_str(at, words[random(words.len())]),
                1 => {
                    let end = places.iter().find(|place| **place > at + random(6));
                    text.replace_range(at..end.copied().unwrap_or(text.len()), "");
                }
                _ => text.truncate(at.max(1)),
            }
        }
        let source = source(&text);
        if bus(&source) != BusName::Unitek {
            continue;
        }
        if let Ok(scenario) = parse::<Unitek>(&source) {
            written(&scenario);
        }
        match settle::<Unitek>(&source, BenchSize::Own) {
            Ok((_, plan)) => {
                let mut link = plan.simulate();
                plan.play(&mut *link, harness_bench::scenario::run::AtMismatch::GoOn);
                played += 1;
            }
            Err(problems) => {
                let inside = |span: harness_bench::scenario::problem::TextSpan| {
                    text.get(span.start..span.end).is_some()
                };
                let mut spans = problems.all().iter().map(|problem| problem.span);
                assert!(spans.all(inside), "{text}");
                refused += 1;
            }
        }
    }
    assert!(played > 300 && refused > 300, "{played} {refused}");
}

/// `parse(write(x)) == x`.
#[test]
fn every_built_in_scenario_comes_back() {
    let mut all = sources(&[]).expect("the library");
    all.retain(|source| bus(source) == BusName::Unitek);
    assert!(all.len() > 100, "{}", all.len());
    for source in all {
        written(&parse::<Unitek>(&source).expect("a scenario"));
    }
}
