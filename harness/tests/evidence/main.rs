//! Folders of evidence: untouched ones verify, changed ones do not.

#[path = "../debian/mod.rs"]
mod debian;
mod edits;
#[path = "../served/ring.rs"]
mod ring;
mod served;
mod special;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder for a rig's file and evidence.
pub(crate) struct Desk {
    folder: tempfile::TempDir,
}

/// What every limit of a rig's file allows.
const ALL: &str = "[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n";

impl Desk {
    /// A rig with one ring, given by the lines of `[ring.1]` and what follows.
    pub(crate) fn new(ring: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!("schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\n{ring}{ALL}");
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the program in the folder.
    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        program(self.folder.path(), arguments)
    }
}

/// Runs the program in a folder.
pub(crate) fn program(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(arguments)
        .current_dir(folder)
        .env("DRIVEBENCH_STATE", folder.join("state"))
        .output()
        .expect("the program")
}

pub(crate) fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8_lossy(&text).into_owned()
}

/// The program ended with this exit code and said this.
#[track_caller]
pub(crate) fn ended(output: &Output, code: i32, words: &str) {
    let said = said(output);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(said.contains(words), "{words:?} is not in {said}");
}
