//! Files and folders on the command line that cannot be used.

use std::process::{Command, Stdio};

/// A file or folder that is not there, or is the other of both, is named with what to do, in words of ours: exit code 2, nothing is played.
#[test]
fn places_that_cannot_be_used_are_named_with_a_remedy() {
    let desk = tempfile::tempdir().expect("a folder");
    std::fs::write(desk.path().join("file"), "text").expect("room");
    std::fs::create_dir(desk.path().join("empty")).expect("room");
    let no_run = "name the folder in which a command has kept its run";
    let absent = &format!("there is no such folder; {no_run}")[..];
    let a_file = &format!("it is a file; {no_run}")[..];
    let bare = &format!("there is no run.jsonl in it; {no_run}")[..];
    let no_folder = "there is no folder absent; make it first";
    let part = "a part of this path is a file; name a folder in its place";
    let built_in = "`drivebench list` shows the built-in ones";
    for (line, words) in [
        ("verify absent", absent),
        (
            "verify emty",
            "there is no such folder; did you mean `empty`?",
        ),
        ("verify file", a_file),
        ("verify file/x", part),
        ("verify empty", bare),
        ("merge absent -o all", absent),
        ("merge empty -o all", bare),
        ("report absent --html a.html", absent),
        (
            "report empty --html absent/a.html",
            "there is no such folder; make it first",
        ),
        ("run --rerun absent --rig sim:2 10.3-and", absent),
        ("fuzz replay absent --rig sim:unitek:1", absent),
        ("fuzz replay file --rig sim:2", part),
        (
            "fuzz run --out file --cases 1",
            "there is a file of this name; name another one",
        ),
        ("shrink absent", "name a file `finding-....json`"),
        ("diff absent absent", built_in),
        ("check absent.scn", built_in),
        ("trace absent", built_in),
        (
            "trace 10.3-and --output absent/x",
            "there is no such folder; make it first",
        ),
        (
            "trace 10.3-and --output empty",
            "it is a folder; name a file in it",
        ),
        (
            "import absent",
            "no such file, and no similar name is in its folder",
        ),
        ("import absent/x", "no such file: there is no folder absent"),
        ("import fil", "did you mean `file`?"),
        ("import file/x", part),
        ("import empty", "it is not a regular file"),
        ("plot absent", "no such file"),
        ("campaign absent", "neither a file nor a built-in campaign"),
        ("params save 8 absent/x --rig sim:nordac:1", no_folder),
        ("params load 8 absent --rig sim:nordac:1", "no such file"),
        ("params diff 1 absent --rig sim:unitek:1", "no such file"),
        (
            "qualify --rig sim:unitek:1 --evidence file",
            "there is a file of this name; name another one",
        ),
        ("run 10.3-and --rig sim:2 --evidence file/x", part),
        (
            "run 10.3-and --junit absent/x.xml",
            "there is no such folder; make it first",
        ),
        (
            "run 10.3-and --html empty",
            "it is a folder; name a file in it",
        ),
        (
            "run 10.3-and --rig absent",
            "neither a file nor a rig of that name",
        ),
        (
            "sim --bus nordac --tcp 127.0.0.1:0 --setup absent",
            "no such file",
        ),
        ("man absent", "absent is not a folder; make it first"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args(line.split(' '))
            .current_dir(desk.path())
            .env("DRIVEBENCH_STATE", desk.path().join("state"))
            .stdin(Stdio::null())
            .output()
            .expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(words), "{line}: {said}");
        assert!(!said.contains("os error"), "{line}: {said}");
        assert_eq!(output.status.code(), Some(2), "{line}: {said}");
        assert!(
            !String::from_utf8_lossy(&output.stdout).contains("passed"),
            "{line}"
        );
    }
}
