//! FIFOs, devices and symbolic links in place of files.

use crate::program::{Desk, ended, said};
use rustix::fs::{CWD, Mode, mkfifoat};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

fn fifo(path: &Path) {
    mkfifoat(CWD, path, Mode::RUSR | Mode::WUSR).expect("a FIFO");
}

/// A folder of evidence of one scenario.
fn kept() -> Desk {
    let desk = Desk::new("drives = 2\ntransport = \"sim\"\n");
    std::fs::write(
        desk.path("one.scn"),
        "title One\nsource nd21 9.2\nring 2\n> 80\n< 80\n",
    )
    .expect("room");
    let run = desk.run(&["run", "--rig", "desk.toml", "one.scn", "--evidence", "kept"]);
    ended(&run, 0, "1 passed");
    desk
}

#[test]
fn what_is_no_file_in_evidence_is_refused() {
    for name in ["run.jsonl", "rig.toml", "SHA256SUMS", "scenarios/one.scn"] {
        for link in [false, true] {
            let desk = kept();
            let path = desk.path("kept").join(name);
            std::fs::rename(&path, desk.path("there")).expect("a file");
            match link {
                true => symlink(desk.path("there"), &path).expect("a link"),
                false => fifo(&path),
            }
            let why = match link {
                true => "symbolic link",
                false => "not a regular file",
            };
            let verified = desk.run(&["verify", "kept"]);
            assert!(
                matches!(verified.status.code(), Some(1 | 2)),
                "{name}: {}",
                said(&verified)
            );
            let said = said(&verified);
            assert!(said.contains(why) && said.contains(name), "{name}: {said}");
        }
    }
    // A signature has no sum, and is no link either.
    let desk = kept();
    symlink("/etc/hostname", desk.path("kept/SHA256SUMS.sig")).expect("a link");
    ended(
        &desk.run(&["verify", "kept"]),
        1,
        "SHA256SUMS.sig is a symbolic link",
    );
    let desk = kept();
    std::fs::rename(desk.path("kept/scenarios"), desk.path("there")).expect("a folder");
    symlink(desk.path("there"), desk.path("kept/scenarios")).expect("a link");
    ended(
        &desk.run(&["verify", "kept"]),
        1,
        "scenarios is a symbolic link",
    );
    let desk = kept();
    symlink("/etc/hostname", desk.path("kept/captures/more.json")).expect("a link");
    ended(
        &desk.run(&["verify", "kept"]),
        1,
        "captures/more.json is a symbolic link",
    );
}

#[test]
fn scenarios_are_files_or_pipes_of_the_shell() {
    let desk = kept();
    fifo(&desk.path("fifo.scn"));
    for name in ["fifo.scn", "/dev/zero", "/dev/tty", "/proc/kmsg"] {
        let output = desk.run(&["check", name]);
        assert_eq!(output.status.code(), Some(2), "{name}");
    }
    let shell = format!("{} run <(cat one.scn)", env!("CARGO_BIN_EXE_drivebench"));
    let output = Command::new("bash")
        .args(["-c", &shell])
        .current_dir(desk.path(""))
        .output()
        .expect("bash");
    ended(&output, 0, "1 passed");
}

/// A link in place of a lock file or of what is kept beside it must not lead to a file of this user's.
#[test]
fn links_in_the_folder_of_locks_are_not_followed() {
    let desk = kept();
    let state = desk.path("state");
    std::fs::create_dir_all(&state).expect("a folder");
    std::fs::write(desk.path("precious"), "precious").expect("room");
    symlink(desk.path("precious"), state.join("desk.lock")).expect("a link");
    let text = std::fs::read_to_string(desk.path("desk.toml")).expect("a rig");
    let text = text.replace("\"sim\"\n", "\"tcp\"\nport = \"127.0.0.1:1\"\n");
    std::fs::write(desk.path("desk.toml"), text).expect("room");
    let output = desk.run(&["run", "--rig", "desk.toml", "one.scn"]);
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let left = std::fs::read_to_string(desk.path("precious")).expect("a file");
    assert_eq!(left, "precious");
}
