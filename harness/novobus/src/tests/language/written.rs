//! What the writer writes is what the parser reads: `parse(write(x)) == x`.

use crate::language::syntax::Scenario;
use crate::tests::{ROOT, built_in_sources};
use harness_bench::bus_name::BusName;
use harness_bench::fuzz::written;
use harness_bench::scenario::parse::{bus, parse};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use std::path::Path;

fn source(text: &str) -> Source {
    Source::from_bytes("test.scn".to_owned(), text.as_bytes().to_vec()).expect("a text")
}

fn read(text: &str) -> Result<Scenario, Problems> {
    parse(&source(text))
}

/// Whether a text is a scenario; the writer must give the same one.
#[track_caller]
fn comes_back(text: &str) -> bool {
    let Ok(scenario) = read(text) else {
        return false;
    };
    written(&scenario);
    true
}

#[test]
fn every_built_in_scenario_comes_back() {
    let mut all = built_in_sources().collect::<Vec<_>>();
    all.retain(|source| bus(source) == BusName::Novobus);
    assert!(all.len() > 200, "{}", all.len());
    for source in all {
        assert!(comes_back(&source.text), "{}", source.name);
    }
    let corpus = Path::new(ROOT).join("corpora/fuzz/scenario");
    let inputs = std::fs::read_dir(corpus).expect("inputs");
    let texts = inputs.filter_map(|entry| std::fs::read_to_string(entry.expect("one").path()).ok());
    assert!(texts.filter(|text| comes_back(text)).count() > 10);
}

/// Lines of a header and steps; `{...}` stands for what is put there.
const HEADERS: &[&str] = &[
    "title Any text, with {bytes}",
    "source nd21 9.7",
    "strict",
    "deadline {time}",
    "needs tap, memory",
    "line 9600",
    "master deviates {master}",
    "drive {drives} memory {cell} = {value}",
    "drive {drives} eeprom 47 = {bytes}",
    "drive {drives} eeprom EE_pole = {bytes}",
    "drive {drives} model nd21",
    "drive {drives} type 5615",
    "drive {drives} property time-out = {time}",
    "drive {drives} property read-long = printed",
    "drive {drives} deviates write-ignored",
    "drive {drives} input GPIN3 GPIN5 high",
    "drive {drives} cam GPIN4 {turns}..900turns",
    "drive {drives} analogue -2.5V",
    "drive {drives} cooler -3.7C",
    "drive {drives} load {quantity}",
    "drive {drives} power off",
];
const STEPS: &[&str] = &[
    "{when}> {bytes}",
    "{when}2> {bytes}",
    "{window}< {bytes}",
    "{window}2< {bytes}",
    "! {expr}->{expr} byte {expr}: flip 0 3 p s b",
    "! 2:master->last @{time}: delay {time}",
    "! 1->0: cut",
    "! drive {expr} @{time}: stuck 7F",
    "! drive 2:{expr}: error 0502",
    "? located {expr} within {expr} zeros",
    "? within 25 zeros",
    "? error 0502 at {expr}",
    "? corrected {expr}",
    "? named broken {expr}->master",
    "? ended twice",
    "? rules kept ring 2",
    "? sent {expr} bytes in {time}",
    "? received {expr} bytes",
    "? drive {drives} memory {cell} = {bytes}",
    "? drive {drives} {cell} {relation} {value}",
    "? drive {drives} {cell} = {value} +-{tolerance}",
    "? drive {drives} Flags2 & E0 = 20",
    "? drive {drives} not in error",
    "? drive {drives} analogue-output = {quantity} +-0.1V",
    "? drive {drives} encoder = -12 +-3",
    "? drive {drives} display 50C",
    "? drive {drives} mode go",
    "until drive {drives} nist > {quantity} within {time}",
    "{when}wait {time}",
    "{when}drive {drives} power on",
    "record drive {drives} {cell} every {time}",
    "record drive {drives} nist changes",
    "recover ring 2",
    "exchange {expr} 1234 = xx56",
    "{when}read-word {expr} {cell}+{expr} = {value}",
    "read-byte {expr} {cell} = {value} +-{tolerance}",
    "write-byte {expr} {cell} = {value}",
    "write-io {expr} = 01",
    "reset {expr}",
    "master count ring 2 = {expr}",
    "master once write-word {drives} {cell} = {value}; read-word {drives} {cell}",
    "master read-eeprom {drives} 47 = {bytes}; write-eeprom 1 EE_pole = 02",
    "master reference {drives}; write-ps 1 = by {turns}; write-ps 2 = {turns}; init-ps 0",
    "master exchange {drives} 1234 = 0000",
    "for k in {expr}..last",
    "end",
];

/// What can stand for a placeholder.
fn choices(name: &str) -> &'static [&'static str] {
    match name {
        "bytes" => &[
            "88 FB",
            "xx",
            "80*12",
            "1234*N",
            "(k-N)",
            "[EC 63]*3",
            "[5A 5A]",
            "00*(N+2)",
            "ae FF",
            "[[01 02]*2 (N)]*last",
        ],
        "time" => &[
            "5ms",
            "286.458us",
            "0.5s",
            "12 bytes",
            "1 byte",
            "000.050s",
            "17ns",
        ],
        "expr" => &[
            "0",
            "N-1",
            "last",
            "k",
            "(N-1)*2",
            "N-(1-k)",
            "7/2%3",
            "(N+1)&3|1",
            "N*(2/k)",
            "9^1",
        ],
        "drives" => &["1", "0..last", "2:0..last", "N/2..N-1", "2:k"],
        "cell" => &[
            "nist", "FE13", "fe10", "Flags2", "position", "nsoll", "imax", "Status",
        ],
        "value" => &[
            "1500rpm",
            "-2.5 A",
            "5 A",
            "[5A]",
            "5a",
            "88",
            "0102",
            "off",
            "1.25turns",
            "360deg",
            "2.50 rad/s2",
            "95°C",
        ],
        "quantity" => &["1500rpm", "2.5V", "5mA", "0.001 A", "-7 A", "12.5Aeff"],
        "turns" => &["0.5turns", "-3.000015turns", "90deg", "1turn"],
        "tolerance" => &["1%", "0.25%", "10rpm", "3 A"],
        "relation" => &["=", "<", ">=", "<=", ">"],
        "when" => &["", "+5ms ", "@1.5ms ", "+2 bytes "],
        "window" => &["", "+5..7ms ", "@1ms..2ms ", "+1byte "],
        "master" => &["sends-16-zeros"],
        _ => panic!("no such placeholder: {name}"),
    }
}

/// A line with a choice for each placeholder; `picks` says which.
fn line(templates: &[&str], picks: &[usize]) -> String {
    let mut picks = picks.iter().copied().cycle();
    let mut pick = |of: usize| picks.next().unwrap_or(0) % of;
    let template = templates[pick(templates.len())];
    let mut text = String::new();
    for (number, piece) in template.split(['{', '}']).enumerate() {
        match number % 2 {
            0 => text.push_str(piece),
            _ => text.push_str(choices(piece)[pick(choices(piece).len())]),
        }
    }
    text
}

#[test]
fn generated_scenarios_come_back() {
    let picks = || prop::collection::vec(0..10_000_usize, 8);
    let lines = (
        prop::collection::vec(picks(), 0..4),
        prop::collection::vec(picks(), 1..6),
    );
    let mut runner = TestRunner::new(Config {
        cases: 3_000,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(9),
        ..Config::default()
    });
    let parsed = std::cell::Cell::new(0);
    runner
        .run(&lines, |(headers, steps)| {
            // Lines that cannot be read are left out, so that most scenarios can.
            let alone = |line: &String| read(&format!("ring 3, 2\n{line}\n> 80\n")).is_ok();
            let headers = headers
                .iter()
                .map(|picks| line(HEADERS, picks))
                .filter(alone);
            let steps = steps.iter().map(|picks| line(STEPS, picks)).filter(alone);
            let text: Vec<_> = headers.chain(["> 80".to_owned()]).chain(steps).collect();
            let text = format!("ring 3..250 default 100, 2\n{}\n", text.join("\n"));
            parsed.set(parsed.get() + usize::from(comes_back(&text)));
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(parsed.get() > 2_000, "only {} could be read", parsed.get());
}
