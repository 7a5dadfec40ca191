//! The schemas that the program prints. The crate `harness-judges` holds records against them.

use super::program;
use serde_json::Value;
use std::path::Path;

#[test]
fn both_schemas_are_printed() {
    let output = program(&["schema", "rig"]).output().expect("the program");
    let rig: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(rig, harness::rig::schema());
    let none = program(&["schema", "weather"])
        .output()
        .expect("the program");
    assert_eq!(none.status.code(), Some(2));
    let kept = Path::new(env!("TREE")).join("snapshots/evidence/record.schema.json");
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
