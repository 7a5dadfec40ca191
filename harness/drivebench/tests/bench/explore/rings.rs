//! The commands on rigs of two rings.

use super::command::{begin_and_kill, drivebench, names, settled};
use crate::program::{ended, name};

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
