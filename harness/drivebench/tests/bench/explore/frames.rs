//! Fuzz runs on UNITEK drives as processes.

use super::command::{drivebench, names};
use crate::program::{ended, name};

/// A seed, a finding, a small scenario that the model passes and the drive fails; the folder is judged again and an edit is found.
#[test]
fn drives_on_can_are_explored() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let run = |out: &std::path::Path| {
        drivebench(&[
            "fuzz",
            "run",
            "--rig",
            "sim:unitek:2",
            "--deviates",
            "2=always-four-bytes",
            "--findings",
            "1",
            "--out",
            name(out),
        ])
    };
    ended(&run(&out), 1, "1 found, 0 flaky");
    let again = folder.path().join("again");
    ended(&run(&again), 1, "1 found, 0 flaky");
    let record =
        |folder: &std::path::Path| std::fs::read(folder.join("run.jsonl")).expect("a record");
    assert_eq!(record(&out), record(&again), "one seed, one run");
    let found = out.join(&names(&out)[0]).with_extension("json");
    let small = drivebench(&["shrink", name(&found)]);
    ended(&small, 0, "nothing more can be taken away");
    let text = String::from_utf8(small.stdout).expect("a text");
    let frames = text.lines().filter(|line| line.contains(" > "));
    assert!(frames.count() <= 3, "{text}");
    let scenario = found.to_string_lossy().replace(".json", "-small.scn");
    ended(&drivebench(&["run", &scenario]), 0, "passed");
    let deviating = text.replacen("\n# ", "\ndrive 2 deviates always-four-bytes\n\n# ", 1);
    let wrong = folder.path().join("wrong.scn");
    std::fs::write(&wrong, deviating).expect("room");
    ended(&drivebench(&["run", name(&wrong)]), 1, "failed");
    ended(&drivebench(&["verify", name(&out)]), 0, "found again");
    let edited = std::fs::read_to_string(&found).expect("a finding");
    let edited = edited.replacen("\"frame\": ", "\"frame\": 1", 1);
    std::fs::write(&found, edited).expect("room");
    ended(
        &drivebench(&["verify", name(&out)]),
        1,
        "does not differ as the finding says",
    );
}

#[test]
fn a_run_goes_on_and_a_right_drive_is_not_accused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let first = [
        "fuzz",
        "run",
        "--rig",
        "sim:unitek:1",
        "--cases",
        "60",
        "--out",
        name(&out),
    ];
    ended(&drivebench(&first), 0, "60 cases");
    let more = ["fuzz", "run", "--resume", name(&out), "--cases", "90"];
    ended(&drivebench(&more), 0, "90 cases");
    let ring = [
        "fuzz",
        "run",
        "--rig",
        "sim:2",
        "--deviates",
        "1=no-lock",
        "--out",
        "x",
    ];
    ended(
        &drivebench(&ring),
        2,
        "drives on a ring have no deviation `no-lock`",
    );
    let other = [
        "fuzz",
        "run",
        "--rig",
        "sim:unitek:1",
        "--deviates",
        "1=writes-ignored",
        "--out",
        "x",
    ];
    ended(
        &drivebench(&other),
        2,
        "UNITEK drives have no deviation `writes-ignored`",
    );
}
