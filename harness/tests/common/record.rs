//! The lines of records against their schema.

use jsonschema::Validator;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

pub(crate) fn validator() -> Validator {
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["schema", "record"])
        .output()
        .expect("the program");
    let schema: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(schema, harness::evidence::schema());
    jsonschema::validator_for(&schema).expect("a schema")
}

/// The lines of a record; half a line is none.
fn lines(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("run.jsonl")).expect("a record");
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let read = |line| serde_json::from_str(line).expect("JSON");
    whole.lines().map(read).collect()
}

#[track_caller]
pub(crate) fn valid(validator: &Validator, folder: &Path) -> Vec<Value> {
    let lines = lines(folder);
    assert!(!lines.is_empty());
    for line in &lines {
        assert!(
            validator.is_valid(line),
            "{line}: {:?}",
            validator.validate(line)
        );
    }
    lines
}
