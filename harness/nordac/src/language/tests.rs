//! The language of this bus: reading, writing, mistakes and verdicts.

use super::Nordac;
use harness_bench::bus_name::BusName;
use harness_bench::fuzz::written;
use harness_bench::scenario::files::sources;
use harness_bench::scenario::parse::{bus, parse};
use harness_bench::scenario::settled::{BenchSize, settle};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_bench::scenario::verdict::Verdict;
use harness_bench::scenario::write::write;

const HEADER: &str = "title   Telegrams\nsource  nordac 3.2.1\nbus     nordac\n";

fn source(text: &str) -> Source {
    Source::new("nordac.scn", text)
}

/// The verdict of these lines after the common header, and what was wrong.
fn played(lines: &str) -> (Verdict, String) {
    let found = settle::<Nordac>(&source(&format!("{HEADER}{lines}")), BenchSize::Own);
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
    let found = settle::<Nordac>(&source, BenchSize::Own).expect_err(lines);
    let first = found.all()[0].clone();
    let place = source.text[first.span.start..first.span.end].to_owned();
    let said = format!("{}; {}", first.message, first.expected);
    (place, said, first.help.unwrap_or_default())
}

/// Every line of the language is written as it was read.
#[test]
fn lines_are_written_as_they_are_read() {
    let lines = "rate    93.75
slave 8
slave 8 ppo 2
slave 9 ppo 2 posicon
slave 10 posicon
slave 8 parameter 1205 = 700
slave 8 parameter 1205.3 = 70.0Hz
slave 8 parameter \"Maximum frequ.\" = 70.0Hz
slave 9 parameter 1716.5.2 = -1000
slave 8 parameter 1510 = 50.0%
slave 8 property pzd-invalid = hold
slave 8 property 967-write = taken
slave 8 property position-count = 32
slave 8 deviates no-off2
master deviates master-gaps

> 10 08 02 49 53 16
> 68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16 bad 3
> 10 08 02 49 53 16 bad 3 stop bad 4 flip 0 7 p bad 5 gap 2bytes
+11us < 10 02 08 00 0A 16
< 10 xx*5
< E5 bad 1
! byte 3: flip 0
! byte 4: flip b 0
! master byte 3: replace 16
! slave 8 byte 4: drop
! slave 8 byte 4: insert 16
! byte 5: duplicate
! byte 5: delay 1ms
! telegram 3: lost
! master telegram 4: doubled
! slave 8 telegram 2: former
! slave 8 telegram 2: delay 3ms
! slave 8: off
@5ms ! slave 8: on
slave 8 link lost
slave 8 link found
slave 8 fault on
slave 8 fault 5 on
slave 8 fault off
slave 8 restart
wait 100ms
? quiet
? slave 8 parameter 1202 = 100
start 8
start 8 ppo 1
start 8 ppo 2 watchdog 300ms
exchange 8 STW=047F HSW=50%
exchange 8 STW=047F HSW=-12.5% PZD3=0000 PZD4=0400 -> ZSW=0Fxx HIW=2000 PZD4=xxxx
exchange 8 PKW=14B2000000000000 STW=047E
exchange 8 -> PKW=14B2000000000064
for k in 0..3
exchange 8 HSW=(k*256)
read 8 (k+1202).(k+1)
end
read 8 1202
read 8 1202 = 5s
read 8 1202.3 = 100
read 8 1001 error 0
write 8 1205.3 = 50.0Hz
write 8 1205 = 0 error 2
on 8
off 8
quick-stop 8
acknowledge 8
";
    let text = format!("{HEADER}{lines}");
    let scenario: Scenario<Nordac> = parse(&source(&text)).expect("a scenario");
    assert_eq!(write(&scenario), text);
}

/// The whole telegrams of section 2: status, diagnosis, parameters, configuration.
#[test]
fn telegrams_by_hand() {
    let lines = "slave 8
> 10 08 02 49 53 16
+1byte..3bytes < 10 02 08 00 0A 16
> 68 05 05 68 88 82 6C 3C 3E F0 16
< 68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16
> 68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16
< E5
> 68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16
< E5
? quiet
";
    passes(lines);
}

/// Each form of damage keeps a telegram from being answered.
#[test]
fn damaged_telegrams_are_not_answered() {
    for bad in [
        "bad 3",
        "bad 1 stop",
        "bad 6 flip 4",
        "bad 5 gap 2bytes",
        "bad 2 bad 4",
    ] {
        let request = "> 10 08 02 49 53 16";
        let reply = "< 10 02 08 00 0A 16";
        passes(&format!(
            "slave 8\n{request} {bad}\nwait 5ms\n? quiet\n{request}\n{reply}\n"
        ));
    }
}

/// Words of the reply may stand without the arrow; the writer puts it there.
#[test]
fn an_exchange_without_an_arrow() {
    let lines = "slave 8\nstart 8\nexchange 8 STW=047E ZSW=0970 HSW=0% HIW=0000\n";
    passes(lines);
    let scenario: Scenario<Nordac> =
        parse(&source(&format!("{HEADER}{lines}"))).expect("a scenario");
    let written = write(&scenario);
    let expected = "exchange 8 STW=047E HSW=0% -> ZSW=0970 HIW=0000\n";
    assert!(written.ends_with(expected), "{written}");
}

/// Faults of octets and telegrams are counted over all stations, or those of one.
#[test]
fn faults_on_the_line() {
    let asks = "> 10 08 02 49 53 16\n";
    let answers = "< 10 02 08 00 0A 16\n";
    passes(&format!(
        "slave 8\n! telegram 1: lost\n{asks}wait 5ms\n? quiet\n{asks}{answers}"
    ));
    passes(&format!(
        "slave 8\n! slave 8 telegram 1: doubled\n{asks}{answers}{answers}"
    ));
    passes(&format!(
        "slave 8\n! slave 8 byte 2: flip p\n{asks}< 10 02 08 00 0A 16 bad 2\n"
    ));
    let late = format!("slave 8\n! slave 8 telegram 1: delay 3ms\n{asks}+3ms..3.1ms {answers}");
    passes(&late);
    fails(
        &format!("slave 8\n! byte 8: replace 03\n{asks}{answers}"),
        "the master received 03 where 02",
    );
    fails(&format!("slave 8\n{asks}"), "no line asks for it");
    fails(
        &format!("slave 8\n{asks}< 10 02 08 03 0D 16\n"),
        "10 02 08 00 0A 16",
    );
}

/// A mistake says where it is and what was expected.
#[test]
fn mistakes() {
    let rows = [
        ("> 10\n", "", "the scenario has no slave", "slave 8"),
        (
            "rate 45.45\nslave 8\n> 10\n",
            "45.45",
            "a rate in kbit/s (9.6, 19.2",
            "",
        ),
        ("slave 127\n> 10\n", "127", "there is no slave 127", ""),
        ("slave 8 ppo 5\n> 10\n", "5", "a PPO type, 1 to 4", ""),
        (
            "slave 8 ppo 1 ppo 2\n> 10\n",
            "ppo",
            "it is given twice",
            "",
        ),
        (
            "slave 8 property pzd-invald = hold\n> 10\n",
            "pzd-invald",
            "a property",
            "pzd-invalid",
        ),
        (
            "slave 8 property pzd-invalid = hald\n> 10\n",
            "hald",
            "hold or setpoint-only or stop",
            "hold",
        ),
        (
            "slave 8 parameter 1201 = 5\n> 10\n",
            "1201",
            "there is no parameter 1201",
            "",
        ),
        (
            "slave 8 parameter \"Accel time\" = 5\n> 10\n",
            "\"Accel",
            "a parameter",
            "Accel. time",
        ),
        (
            "slave 8 parameter 1202.5 = 5\n> 10\n",
            "5",
            "5 is no parameter set",
            "",
        ),
        ("slave 8 parameter 1202 = 5Hz\n> 10\n", "5Hz", "", ""),
        ("slave 8 parameter 1202 = 5.02s\n> 10\n", "5.02s", "", ""),
        (
            "slave 8\n> 10 08 bad 3\n",
            "3",
            "the telegram has no byte 3",
            "",
        ),
        ("slave 8\n> 10 xx\n", "10 xx", "`xx`", ""),
        (
            "slave 8\n> 10 08 bad 1 flop\n",
            "flop",
            "parity, stop, flip, gap",
            "",
        ),
        (
            "slave 8\nread 9 1202\n",
            "9",
            "the scenario has no slave 9",
            "slave 9",
        ),
        (
            "slave 8\nexchange 8 STW=47F\n",
            "47F",
            "four hexadecimal digits",
            "",
        ),
        (
            "slave 8\nexchange 8 STW=04xx\n",
            "04xx",
            "every byte must be known",
            "",
        ),
        ("slave 8\nexchange 8 HSW=201%\n", "201%", "does not fit", ""),
        (
            "slave 8\nstart 8 watchdog 5ms\n",
            "5ms",
            "no time of a DP watchdog",
            "",
        ),
        (
            "slave 8\n! slave 8 telegram 0: lost\n",
            "0",
            "counted from 1",
            "",
        ),
        (
            "slave 8\n> 10\nslave 9\n",
            "slave",
            "comes after the first step",
            "move the line up",
        ),
        ("slave 8\nstrat 8\n", "strat", "", "did you mean `start`?"),
    ];
    for (lines, place, says, help) in rows {
        let (found, said, helped) = mistake(lines);
        assert_eq!(found, place, "{lines}{said}");
        assert!(said.contains(says), "{lines}{said}");
        assert!(helped.contains(help), "{lines}{helped}");
    }
}

/// A slave or a master that deviates fails where the right one passes.
#[test]
fn deviations() {
    let status = "> 10 08 02 49 53 16\n< 10 02 08 00 0A 16\n";
    passes(&format!("slave 8\n{status}"));
    fails(
        &format!("slave 8\nslave 8 deviates no-fdl-status\n{status}"),
        "",
    );
    fails(
        &format!("slave 8\nmaster deviates master-gaps\n{status}"),
        "",
    );
    let (place, said, help) = mistake("slave 8\nslave 8 deviates no-of2\n");
    assert_eq!(place, "no-of2");
    assert!(said.contains("a deviation of a slave"), "{said}");
    assert!(help.contains("no-off2"), "{help}");
    let (place, ..) = mistake("slave 8\n> E5\nmaster deviates master-gaps\n");
    assert_eq!(place, "master");
}

/// `parse(write(x)) == x`.
#[test]
fn every_built_in_scenario_comes_back() {
    let mut all = sources(&[]).expect("the library");
    all.retain(|source| bus(source) == BusName::Nordac);
    assert!(all.len() > 100, "{}", all.len());
    for source in all {
        written(&parse::<Nordac>(&source).expect("a scenario"));
    }
}
