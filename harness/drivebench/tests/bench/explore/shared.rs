//! Fuzz runs on drives that share a line, as processes.

use super::command::{drivebench, names};
use crate::program::{ended, name};
use std::path::Path;

/// A simulated rig of a bus, and one of its deviations.
struct Explored {
    rig: &'static str,
    /// How `--deviates` names the deviation, and the line of a scenario.
    deviates: [&'static str; 2],
    /// What `shrink` ends with.
    small: &'static str,
    /// A key of a finding.
    key: &'static str,
}

const UNITEK: Explored = Explored {
    rig: "sim:unitek:2",
    deviates: ["2=always-four-bytes", "drive 2 deviates always-four-bytes"],
    small: "nothing more can be taken away",
    key: "\"frame\": ",
};

const NORDAC: Explored = Explored {
    rig: "sim:nordac:1",
    deviates: ["8=no-off2", "slave 8 deviates no-off2"],
    small: "became",
    key: "\"telegram\": ",
};

fn fuzz(arguments: &[&str], out: &Path) -> std::process::Output {
    drivebench(&[&["fuzz", "run"], arguments, &["--out", name(out)]].concat())
}

impl Explored {
    /// A seed, a finding, a small scenario that the model passes and the drive fails; the folder is judged again and an edit is found. Gives the
    /// small scenario.
    fn a_finding_becomes_small(&self) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        let [out, again] = ["run", "again"].map(|own| folder.path().join(own));
        for out in [&out, &again] {
            let run = ["--rig", self.rig, "--deviates", self.deviates[0]];
            let run = [&run[..], &["--findings", "1"]].concat();
            ended(&fuzz(&run, out), 1, "1 found, 0 flaky");
        }
        let record = |folder: &Path| std::fs::read(folder.join("run.jsonl")).expect("a record");
        assert_eq!(record(&out), record(&again), "one seed, one run");
        let found = out.join(&names(&out)[0]).with_extension("json");
        let small = drivebench(&["shrink", name(&found)]);
        ended(&small, 0, self.small);
        let text = String::from_utf8(small.stdout).expect("a text");
        let scenario = found.to_string_lossy().replace(".json", "-small.scn");
        ended(&drivebench(&["run", &scenario]), 0, "passed");
        let deviating = text.replacen("\n# ", &format!("\n{}\n\n# ", self.deviates[1]), 1);
        let wrong = folder.path().join("wrong.scn");
        std::fs::write(&wrong, deviating).expect("room");
        ended(&drivebench(&["run", name(&wrong)]), 1, "failed");
        ended(&drivebench(&["verify", name(&out)]), 0, "found again");
        let edited = std::fs::read_to_string(&found).expect("a finding");
        let edited = edited.replacen(self.key, &format!("{}1", self.key), 1);
        std::fs::write(&found, edited).expect("room");
        ended(
            &drivebench(&["verify", name(&out)]),
            1,
            "does not differ as the finding says",
        );
        text
    }
}

#[test]
fn drives_on_can_are_explored() {
    let text = UNITEK.a_finding_becomes_small();
    let frames = text.lines().filter(|line| line.contains(" > "));
    assert!(frames.count() <= 3, "{text}");
}

#[test]
fn inverters_are_explored() {
    NORDAC.a_finding_becomes_small();
}

#[test]
fn a_run_goes_on_and_a_right_drive_is_not_accused() {
    for rig in ["sim:unitek:1", "sim:nordac:2"] {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let first = fuzz(&["--rig", rig, "--cases", "30"], &out);
        ended(&first, 0, "30 cases");
        let more = ["fuzz", "run", "--resume", name(&out), "--cases", "50"];
        ended(&drivebench(&more), 0, "50 cases");
    }
}

#[test]
fn deviations_of_other_buses_are_refused() {
    for (rig, deviates, words) in [
        (
            "sim:2",
            "1=no-lock",
            "drives on a ring have no deviation `no-lock`",
        ),
        (
            "sim:unitek:1",
            "1=writes-ignored",
            "UNITEK drives have no deviation `writes-ignored`",
        ),
        (
            "sim:nordac:1",
            "8=writes-ignored",
            "NORDAC inverters have no deviation `writes-ignored`",
        ),
    ] {
        let refused = fuzz(&["--rig", rig, "--deviates", deviates], Path::new("x"));
        ended(&refused, 2, words);
    }
}
