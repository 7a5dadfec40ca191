//! Every line of every record is one by the schema, and a line that was changed is none.

use super::{Bench, program, said};
use crate::record::{valid, validator};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// A line of each kind that the program writes.
fn of_each_kind() -> BTreeMap<String, Value> {
    let bench = Bench::new("[retry]\nattempts = 2\n");
    let validator = validator();
    let scenario = "title Everything\nsource nd21 9.7\nring 2\n! master->1 byte 3: flip 0\n> 80*9\n? located 1\n";
    std::fs::write(bench.path("scn/everything.scn"), scenario).expect("room");
    let (_, run) = bench.play_all("run");
    let (output, qualified) = bench.play(&["qualify", "9.2-synco"], "qualified");
    assert!(output.status.success(), "{}", said(&output));
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
fn both_schemas_are_printed() {
    let output = program(&["schema", "rig"]).output().expect("the program");
    let rig: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(rig, harness::rig::schema());
    jsonschema::validator_for(&rig).expect("a schema");
    let none = program(&["schema", "weather"])
        .output()
        .expect("the program");
    assert_eq!(none.status.code(), Some(2));
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("snapshots/evidence/record.schema.json");
    let text = format!("{:#}\n", harness::evidence::schema());
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(&kept, &text).expect("written");
    }
    let before = std::fs::read_to_string(&kept).unwrap_or_default();
    assert!(
        before == text,
        "{} differs; UPDATE_SNAPSHOTS=1 writes it",
        kept.display()
    );
}
