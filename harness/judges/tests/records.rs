//! The lines of records against their schema, by the crate jsonschema: every line that the program writes is valid, and one that was
//! changed is not.

use jsonschema::Validator;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// What every limit of a rig's file allows, and drives of its own.
const REST: &str = "[limits]\nallow_motion = true\nallow_eeprom = true\n[retry]\nattempts = 2\n";

fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_judged"));
    command.args(arguments).stdin(Stdio::null());
    command
}

fn validator() -> Validator {
    let output = program(&["schema", "record"])
        .output()
        .expect("the program");
    let schema: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    jsonschema::validator_for(&schema).expect("a schema")
}

/// The lines of a record, each of them valid; half a line at the end is none.
#[track_caller]
fn valid(validator: &Validator, evidence: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(evidence.join("run.jsonl")).expect("a record");
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let read = |line| serde_json::from_str(line).expect("JSON");
    let lines: Vec<Value> = whole.lines().map(read).collect();
    assert!(!lines.is_empty());
    for line in &lines {
        let said = validator.validate(line);
        assert!(said.is_ok(), "{line}: {said:?}");
    }
    lines
}

/// A folder with a rig's file.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    /// The rig's file says this of its ring or port.
    fn new(schema: u8, line: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!("schema = {schema}\n[rig]\nid = \"desk\"\n{line}{REST}");
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str], evidence: &str) -> Command {
        let mut command = program(arguments);
        command
            .current_dir(self.folder.path())
            .env("DRIVEBENCH_STATE", self.path("state"))
            .args(["--rig", "desk.toml", "--evidence", evidence])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn play(&self, arguments: &[&str], evidence: &str) -> (Output, PathBuf) {
        let output = self.command(arguments, evidence).output();
        (output.expect("the program"), self.path(evidence))
    }
}

const FAILS: &str = "title A wrong byte ]]> <&>\nsource nd21 9.1\nring 2\n> 80*3\n< 80 80 42\n";
const SKIPPED: &str = "title Three drives\nsource nd21 9.1\nring 3\n> 80\n";

/// A line of each kind that the program writes.
fn of_each_kind() -> BTreeMap<String, Value> {
    let bench = Desk::new(
        1,
        "[ring.1]\ndrives = 2\ntransport = \"sim\"\n[sim]\nsetup = [\"drive 0 memory FE20 = 00\"]\n",
    );
    let validator = validator();
    let scenario = "title Everything\nsource nd21 9.7\nring 2\n! master->1 byte 3: flip 0\n> 80*9\n? located 1\n";
    std::fs::create_dir(bench.path("scn")).expect("room");
    for (name, text) in [
        ("everything", scenario),
        ("fails", FAILS),
        ("skipped", SKIPPED),
    ] {
        std::fs::write(bench.path("scn").join(name).with_extension("scn"), text).expect("room");
    }
    let (_, run) = bench.play(&["run", "scn"], "run");
    let (output, qualified) = bench.play(&["qualify", "9.2-synco"], "qualified");
    assert!(output.status.success(), "{output:?}");
    let mut kinds = BTreeMap::new();
    for line in [valid(&validator, &run), valid(&validator, &qualified)].concat() {
        let kind = line["kind"].as_str().expect("a kind").to_owned();
        // Of several the one that says most.
        let most: &mut Value = kinds.entry(kind).or_insert(Value::Null);
        if line.as_object().map(serde_json::Map::len) > most.as_object().map(serde_json::Map::len) {
            *most = line;
        }
    }
    kinds
}

#[test]
fn a_changed_line_is_none() {
    let validator = validator();
    let kinds = of_each_kind();
    let names: Vec<_> = kinds.keys().map(String::as_str).collect();
    let trouble = json!({"kind": "trouble", "cause": "lost", "text": "gone"});
    assert!(validator.is_valid(&trouble));
    for kind in [
        "begin", "end", "fault", "received", "run", "scenario", "sent", "step", "verdict",
    ] {
        assert!(names.contains(&kind), "{kind} is not among {names:?}");
    }
    let optional = [
        "error",
        "at",
        "finding",
        "safe",
        "unplaced",
        "own_rings",
        "purpose",
        "selected",
        "opening",
    ];
    for line in kinds.values().chain([&trouble]) {
        let refused = |changed: Value| {
            assert!(!validator.is_valid(&changed), "{changed}");
        };
        let keys: Vec<String> = line
            .as_object()
            .expect("an object")
            .keys()
            .cloned()
            .collect();
        for key in keys {
            let changed = |value: Value| {
                let mut changed = line.clone();
                changed[&key] = value;
                changed
            };
            refused(changed(json!({"no": "value"})));
            refused(changed(json!(-1)));
            refused(changed(json!([[]])));
            let mut without = line.clone();
            without.as_object_mut().expect("an object").remove(&key);
            let may_miss = match key.as_str() {
                "byte" => line["kind"] != "received",
                // Records of schema 1 have no sum of a case.
                "sha256" => line["kind"] == "case",
                key => optional.contains(&key),
            };
            assert_eq!(validator.is_valid(&without), may_miss, "{without}");
        }
        let mut more = line.clone();
        more["more"] = json!(1);
        refused(more);
        let mut other = line.clone();
        other["kind"] = json!("weather");
        refused(other);
    }
}

/// Values of the right type that cannot be.
#[test]
fn words_that_cannot_be_are_refused() {
    let validator = validator();
    let kinds = of_each_kind();
    for (kind, key, value) in [
        ("run", "schema", json!(3)),
        ("run", "rate", json!(115_200)),
        ("run", "rings", json!([])),
        ("run", "rings", json!([251])),
        ("run", "rings", json!([1, 2, 3])),
        ("run", "rig_sha256", json!("0")),
        ("scenario", "attempt", json!(0)),
        ("sent", "ring", json!(3)),
        ("sent", "bytes", json!("8")),
        ("sent", "bytes", json!("8g")),
        ("received", "byte", json!("8000")),
        ("received", "error", json!("noise")),
        ("verdict", "verdict", json!("great")),
        ("end", "verdicts", json!(["great"])),
        ("fault", "what", json!(["explode", 0])),
        ("fault", "what", json!(["flip"])),
        ("fault", "what", json!(["flip", 0, 0])),
    ] {
        let mut line = kinds[kind].clone();
        line[key] = value;
        assert!(!validator.is_valid(&line), "{line}");
    }
}

#[test]
fn the_schema_of_rig_files_is_a_schema() {
    let output = program(&["schema", "rig"]).output().expect("the program");
    let rig: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    jsonschema::validator_for(&rig).expect("a schema");
}

/// A run and a qualification on each bus.
#[test]
fn every_bus_leaves_valid_lines() {
    let validator = validator();
    for (bus, filter, drives) in [
        ("unitek", "unitek-3", "{ node = 1 }"),
        ("nordac", "nordac-2", "{ address = 8, ppo = 1 }"),
    ] {
        let line = format!(
            "[port.1]\nbus = \"{bus}\"\ndrives = [{drives}]\n[sim]\nbus = \"{bus}\"\nsetup = []\n"
        );
        let desk = Desk::new(2, &line);
        for command in ["run", "qualify"] {
            let (output, evidence) = desk.play(&[command, "--filter", filter], command);
            assert_eq!(
                output.status.code().map(|code| code < 2 || code == 5),
                Some(true),
                "{output:?}"
            );
            let lines = valid(&validator, &evidence);
            let attempts = lines
                .iter()
                .filter(|line| line["kind"] == "verdict")
                .count();
            assert!(attempts > 0, "{bus}: {command} judged nothing: {output:?}");
        }
    }
}

/// ND21 9.1: a run over a port that is killed in the middle keeps what it saw.
#[test]
fn a_killed_run_over_a_port() {
    let mut ring = program(&[
        "sim",
        "--rig",
        "sim:2",
        "--marks",
        "in-band",
        "--tcp",
        "127.0.0.1:0",
    ])
    .stdout(Stdio::piped())
    .spawn()
    .expect("the program");
    let mut first = String::new();
    BufReader::new(ring.stdout.take().expect("a pipe"))
        .read_line(&mut first)
        .expect("a line");
    let place = first.trim().rsplit(" at ").next().expect("a place");
    let desk = Desk::new(
        1,
        &format!(
            "[ring.1]\ndrives = 2\ntransport = \"tcp\"\nport = \"{place}\"\nmarks = \"in-band\"\n"
        ),
    );
    let mut run = desk
        .command(&["run", "--allow-motion"], "kept")
        .spawn()
        .expect("the program");
    let record = desk.path("kept").join("run.jsonl");
    let end = Instant::now() + Duration::from_secs(60);
    let verdicts = |text: String| {
        text.lines()
            .filter(|line| line.contains("\"verdict\""))
            .count()
    };
    while std::fs::read_to_string(&record).map_or(0, verdicts) < 2 {
        assert!(Instant::now() < end, "it does not begin");
        std::thread::sleep(Duration::from_millis(10));
    }
    for child in [&mut run, &mut ring] {
        child.kill().expect("a process");
        child.wait().expect("its end");
    }
    valid(&validator(), &desk.path("kept"));
}
