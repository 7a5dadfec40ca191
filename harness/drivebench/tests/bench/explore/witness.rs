//! The commands on whole ND21s.

use super::command::drivebench;
use crate::program::{ended, findings, name};

/// The same finding is made by the same seed, and is made small like any other.
#[test]
fn the_commands_on_whole_drives() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("sound");
    let run = ["fuzz", "run", "--whole", "--cases", "300", "--out"];
    let output = drivebench(&[&run[..], &[name(&out)]].concat());
    ended(&output, 0, "300 cases");
    let out = folder.path().join("two");
    let run = [&run[..], &[name(&out), "--rig", "sim:2,3"]].concat();
    ended(&drivebench(&run), 0, "300 cases");
    let power = ["fuzz", "power", "and-is-or", "--whole", "--seeds", "2"];
    ended(&drivebench(&power), 0, "1 of 1 found within 10000 cases");
    // What is found is made small like any other.
    let out = folder.path().join("found");
    let run = [
        "fuzz",
        "run",
        "--whole",
        "--cases",
        "3000",
        "--findings",
        "1",
    ];
    let run = [
        &run[..],
        &["--deviates", "0=and-is-or", "--out", name(&out)],
    ]
    .concat();
    ended(&drivebench(&run), 1, "1 found");
    let output = drivebench(&["shrink", name(&findings(&out)[0])]);
    ended(&output, 0, "nothing more can be taken away");
    ended(&output, 0, "ring    1\n");
}
