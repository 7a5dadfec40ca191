//! Fuzz runs on NORDAC inverters as processes.

use super::command::{drivebench, names};
use crate::program::{ended, name};

/// A seed, a finding, a small scenario that the model passes and the inverter fails; the folder is judged again and an edit is found.
#[test]
fn inverters_are_explored() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let run = [
        "fuzz",
        "run",
        "--rig",
        "sim:nordac:1",
        "--deviates",
        "8=no-off2",
        "--findings",
        "1",
        "--out",
        name(&out),
    ];
    ended(&drivebench(&run), 1, "1 found, 0 flaky");
    let found = out.join(&names(&out)[0]).with_extension("json");
    let small = drivebench(&["shrink", name(&found)]);
    ended(&small, 0, "became");
    let text = String::from_utf8(small.stdout).expect("a text");
    let scenario = found.to_string_lossy().replace(".json", "-small.scn");
    ended(&drivebench(&["run", &scenario]), 0, "passed");
    let deviating = text.replacen("\n# ", "\nslave 8 deviates no-off2\n\n# ", 1);
    let wrong = folder.path().join("wrong.scn");
    std::fs::write(&wrong, deviating).expect("room");
    ended(&drivebench(&["run", name(&wrong)]), 1, "failed");
    ended(&drivebench(&["verify", name(&out)]), 0, "found again");
    let edited = std::fs::read_to_string(&found).expect("a finding");
    let edited = edited.replacen("\"telegram\": ", "\"telegram\": 1", 1);
    std::fs::write(&found, edited).expect("room");
    ended(
        &drivebench(&["verify", name(&out)]),
        1,
        "does not differ as the finding says",
    );
}

#[test]
fn a_run_goes_on_and_a_right_inverter_is_not_accused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let first = [
        "fuzz",
        "run",
        "--rig",
        "sim:nordac:2",
        "--cases",
        "30",
        "--out",
        name(&out),
    ];
    ended(&drivebench(&first), 0, "30 cases");
    let more = ["fuzz", "run", "--resume", name(&out), "--cases", "50"];
    ended(&drivebench(&more), 0, "50 cases");
    let other = [
        "fuzz",
        "run",
        "--rig",
        "sim:nordac:1",
        "--deviates",
        "8=writes-ignored",
        "--out",
        "x",
    ];
    ended(
        &drivebench(&other),
        2,
        "NORDAC inverters have no deviation `writes-ignored`",
    );
}
