//! The program as a process: what it said, how it ended, and a folder with a rig file for it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder for a rig's file and evidence.
pub(crate) struct Desk {
    folder: tempfile::TempDir,
}

/// What every limit of a rig's file allows.
pub(crate) const ALL: &str = "[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n";

impl Desk {
    /// A rig with one ring, given by the lines of `[ring.1]` and what follows. It allows everything.
    pub(crate) fn new(ring: &str) -> Self {
        Self::limited(ring, ALL)
    }

    /// The same with these limits.
    pub(crate) fn limited(ring: &str, limits: &str) -> Self {
        Self::of_file(&format!(
            "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\n{ring}{limits}"
        ))
    }

    /// A rig given by the whole text of its file.
    pub(crate) fn of_file(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("desk.toml"), text).expect("room");
        Self { folder }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program in the folder, with pipes for what it says.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env("DRIVEBENCH_STATE", self.path("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs it to its end.
    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program")
    }
}

/// Judges a folder of evidence.
pub(crate) fn verify(folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.arg("verify").arg(folder);
    command.output().expect("the program")
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

pub(crate) fn name(path: &Path) -> &str {
    path.to_str().expect("a name")
}

/// The files of the findings in a folder.
pub(crate) fn findings(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut all: Vec<_> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    all.sort();
    all
}
