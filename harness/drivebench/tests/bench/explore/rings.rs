//! The commands on rigs of two rings.

use super::command::{begin_and_kill, drivebench, empty_checkout, names, settled};
use crate::program::{ended, findings, name};
use std::path::Path;

/// From a seed to a scenario that is kept, with a drive of ring 2; the page shows it.
#[test]
fn the_commands_on_two_rings() {
    let folder = tempfile::tempdir().expect("a folder");
    let (out, html) = (folder.path().join("run"), folder.path().join("page.html"));
    let output = drivebench(&[
        "fuzz",
        "run",
        "--rig",
        "sim:3,5",
        "--deviates",
        "2:4=and-is-or",
        "--findings",
        "1",
        "--out",
        name(&out),
        "--html",
        name(&html),
    ]);
    ended(&output, 1, "1 found, 0 flaky");
    let page = std::fs::read_to_string(&html).expect("a page");
    assert!(page.contains("drive 2:4 deviates and-is-or"));
    let found = findings(&out);
    let scenario = found[0].with_extension("scn");
    let run = ["run", name(&scenario), "--rig", "sim:3,5"];
    ended(&drivebench(&run), 0, "1 passed");
    let output = drivebench(&["shrink", name(&found[0])]);
    ended(&output, 0, "nothing more can be taken away");
    // Both are promoted: with its ring beside another, and alone.
    let top = folder.path().join("top");
    empty_checkout(&top);
    let stem = found[0].file_stem().and_then(|stem| stem.to_str());
    let small = format!("{}-small.json", stem.expect("a name"));
    let small = found[0].with_file_name(small);
    for (finding, own) in [(&found[0], "two"), (&small, "one")] {
        let promote = [
            "promote",
            name(finding),
            "--name",
            own,
            "--checkout",
            name(&top),
        ];
        ended(
            &drivebench(&promote),
            0,
            "the drives with the finding fail it",
        );
        let kept = top.join(format!("corpora/scenarios/novobus/{own}.scn"));
        ended(&drivebench(&["run", name(&kept)]), 0, "1 passed");
    }
}

/// What was kept on two rings is tried on one, and the other way round.
#[test]
fn what_was_kept_is_replayed_on_other_rings() {
    let folder = tempfile::tempdir().expect("a folder");
    let kept = |rig: &str| {
        let out = folder.path().join(rig.replace([':', ','], "-"));
        let run = ["fuzz", "run", "--cases", "200", "--rig", rig, "--out"];
        let output = drivebench(&[&run[..], &[name(&out)]].concat());
        ended(&output, 0, "200 cases");
        out
    };
    let (two, one) = (kept("sim:2,3"), kept("sim:3"));
    let replay = |folder: &Path, rig: &str| {
        drivebench(&[
            "fuzz",
            "replay",
            name(folder),
            "--wire-time",
            "2s",
            "--rig",
            rig,
        ])
    };
    ended(&replay(&two, "sim:3"), 0, "0 found");
    ended(&replay(&two, "sim:3,3"), 0, "0 found");
    ended(&replay(&one, "sim:3,4"), 0, "0 found");
    ended(
        &replay(&one, "sim:5,4"),
        4,
        "no case for a ring of 5 or of 4",
    );
    // A run goes on with the rig that it began with.
    let record = two.join(harness::explore::RECORD);
    let text = std::fs::read_to_string(&record).expect("a record");
    let other = text.replacen("\"second\":3", "\"second\":4", 1);
    assert_ne!(other, text);
    std::fs::write(&record, other).expect("room");
    let resume = ["fuzz", "run", "--cases", "300", "--resume", name(&two)];
    ended(&drivebench(&resume), 2, "begin another run");
}

/// Killed between two cases a run on two rings goes on, and comes to what an undisturbed one comes to.
#[test]
fn a_killed_run_on_two_rings_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (killed, whole) = (folder.path().join("killed"), folder.path().join("whole"));
    let run = [
        "fuzz",
        "run",
        "--rig",
        "sim:2,3",
        "--deviates",
        "2:1=process-data-ignored",
        "--seed",
        "5",
        "--findings",
        "99",
        "--cases",
        "2000",
        "--out",
    ];
    let undisturbed = drivebench(&[&run[..], &[name(&whole)]].concat());
    ended(&undisturbed, 1, "2000 cases");
    begin_and_kill(&[&run[..], &[name(&killed)]].concat(), &killed);
    let resume = ["fuzz", "run", "--cases", "2000", "--findings", "99"];
    let resumed = drivebench(&[&resume[..], &["--resume", name(&killed)]].concat());
    ended(&resumed, 1, "2000 cases");
    assert_eq!(settled(&killed), settled(&whole));
    assert_eq!(names(&killed), names(&whole));
    assert!(!names(&killed).is_empty());
}
