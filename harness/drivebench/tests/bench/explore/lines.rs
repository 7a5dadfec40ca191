//! What fuzz runs, shrinking, replays and promotion have in common on every shared line, as processes.

use super::command::{drivebench, names};
use crate::program::{ended, name};
use std::path::{Path, PathBuf};

/// Drives of a bus.
struct Drives {
    bus: &'static str,
    rig: &'static str,
    /// A deviation that shows in the simulation, and one that shows behind an adapter.
    planted: [&'static str; 2],
    /// A table of its manual.
    table: &'static str,
}

const ALL: [Drives; 2] = [
    Drives {
        bus: "unitek",
        rig: "sim:unitek:1",
        planted: ["1=always-four-bytes", "1=always-four-bytes"],
        table: "unitek 4.5",
    },
    Drives {
        bus: "nordac",
        rig: "sim:nordac:1",
        planted: ["8=no-off2", "8=answers-broadcasts"],
        table: "nordac EN 1 FCB",
    },
];

/// Runs until something is found.
fn found(drives: &Drives, out: &Path, more: &[&str]) -> PathBuf {
    let run = [
        "fuzz",
        "run",
        "--rig",
        drives.rig,
        "--findings",
        "1",
        "--out",
        name(out),
    ];
    ended(
        &drivebench(&[&run[..], more].concat()),
        1,
        "1 found, 0 flaky",
    );
    out.join(&names(out)[0]).with_extension("json")
}

/// A finding becomes a scenario of the corpus, which right drives pass and the drives with the finding fail.
#[test]
fn findings_on_shared_lines_are_kept() {
    for drives in ALL {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let finding = found(&drives, &out, &["--deviates", drives.planted[0]]);
        ended(&drivebench(&["shrink", name(&finding)]), 0, "became");
        let small = PathBuf::from(finding.to_string_lossy().replace(".json", "-small.json"));
        let top = folder.path().join("top");
        for part in ["corpora/scenarios", "snapshots/scenarios"] {
            std::fs::create_dir_all(top.join(part).join(drives.bus)).expect("room");
        }
        let promote = |source: &str| {
            let names = [
                "--name",
                "9-kept",
                "--checkout",
                name(&top),
                "--source",
                source,
            ];
            drivebench(&[&["promote", name(&small)], &names[..]].concat())
        };
        ended(&promote("nd21 9.1"), 2, "the catalogue has no `nd21 9.1`");
        ended(
            &promote(drives.table),
            0,
            "the drives with the finding fail it",
        );
        ended(&promote(drives.table), 2, "is there already");
        let file = |part: &str, ending: &str| {
            top.join(part)
                .join(drives.bus)
                .join(format!("9-kept.{ending}"))
        };
        let scenario = file("corpora/scenarios", "scn");
        ended(&drivebench(&["run", name(&scenario)]), 0, "1 passed");
        let table = std::fs::read_to_string(file("snapshots/scenarios", "snap")).expect("a table");
        assert!(table.contains(&format!("pins {}", drives.table)), "{table}");
        assert!(table.contains("passed after"), "{table}");
    }
}

/// What a run has kept is played again: right drives show nothing, and a folder of another bus is refused.
#[test]
fn what_was_kept_on_shared_lines_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let outs = ALL.map(|drives| {
        let out = folder.path().join(drives.bus);
        let run = [
            "fuzz",
            "run",
            "--rig",
            drives.rig,
            "--cases",
            "40",
            "--out",
            name(&out),
        ];
        ended(&drivebench(&run), 0, "40 cases");
        let replay = ["fuzz", "replay", name(&out), "--rig", drives.rig];
        ended(&drivebench(&replay), 0, "kept to be played");
        ended(&drivebench(&replay), 0, "0 found, 0 flaky");
        let verify = ["verify", name(&out)];
        ended(&drivebench(&verify), 0, "0 things wrong");
        out
    });
    let other = ["fuzz", "replay", name(&outs[0]), "--rig", ALL[1].rig];
    assert_eq!(drivebench(&other).status.code(), Some(2));
}

/// Drives that are judged as behind an adapter: a finding rests on the rig, and is made small there.
#[test]
fn shared_lines_are_explored_as_behind_a_port() {
    for drives in ALL {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let port = ["--behind-port", "--allow-motion", "--wire-time", "300s"];
        let planted = ["--deviates", drives.planted[1]];
        let finding = found(&drives, &out, &[&port[..], &planted].concat());
        ended(&drivebench(&["verify", name(&out)]), 5, "unconfirmed");
        ended(
            &drivebench(&["shrink", name(&finding)]),
            2,
            "name it with --rig",
        );
        let shrink = ["shrink", name(&finding), "--allow-motion", "--rig"];
        let right = drivebench(&[&shrink[..], &[drives.rig]].concat());
        ended(&right, 5, "do not show this difference");
        let (drive, deviation) = drives.planted[1].split_once('=').expect("a deviation");
        let word = if drives.bus == "nordac" {
            "slave"
        } else {
            "drive"
        };
        let listed = drivebench(&["rig", "show", drives.rig]);
        let text = String::from_utf8(listed.stdout).expect("text");
        let line = format!("setup = [\"{word} {drive} deviates {deviation}\"]");
        let file = folder.path().join("wrong.toml");
        std::fs::write(&file, text.replace("setup = []", &line)).expect("room");
        let wrong = drivebench(&[&shrink[..], &[name(&file)]].concat());
        ended(&wrong, 0, "became");
    }
}
