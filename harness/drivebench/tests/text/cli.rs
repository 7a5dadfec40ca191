//! Commands that no transcript can show: into a closed pipe, and from the guide.

use crate::typed::{code, in_folder, stderr, stdout};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A file in a folder of this test's own.
fn file(test: &str, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .arg("manual")
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    // But a failure stays one.
    let path = file("closed_pipe", "a.scn", "ring 1\n> 80\n< A0\n");
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["run", text(&path), "9.7-parity-error"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
}

/// The commands on drives that the guide lists run on a simulated ring.
#[test]
fn the_commands_of_the_guide_work() {
    let page = Path::new(env!("TREE")).join("harness/docs/commands.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let section = page.split("## Drives").nth(1).expect("the section");
    let block = section.split("```").nth(1).expect("the commands");
    let folder = tempfile::tempdir().expect("a folder");
    let mut count = 0;
    for line in block.lines() {
        let line = line.split('#').next().unwrap_or_default();
        let Some(arguments) = line.strip_prefix("drivebench ") else {
            continue;
        };
        let arguments: Vec<_> = arguments.split_whitespace().collect();
        let output = in_folder(&folder, &arguments);
        let said = stdout(&output) + &stderr(&output);
        assert_eq!(code(&output), 0, "{line}\n{said}");
        count += 1;
    }
    assert!(count > 8, "{count} commands");
}
