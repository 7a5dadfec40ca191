//! What a run leaves for programs: its record against the schema, JUnit's XML against its rules, and records that are damaged.

mod damaged;
mod junit;
mod schema;

use std::path::PathBuf;
use std::process::{Command, Output};

/// What makes the drives of a simulated rig its own, which all scenarios share.
const OWN: &str = "[sim]\nsetup = [\"drive 0 memory FE20 = 00\"]\n";

/// A folder with a rig of two simulated drives of its own that may do everything, played with right and wrong scenarios.
struct Bench {
    folder: tempfile::TempDir,
}

/// Scenarios that come to every end that a simulated rig can have. The last has a name and a title that no XML can hold as they are.
const SCENARIOS: [(&str, &str); 4] = [
    (
        "passes.scn",
        "title A read\nsource nd21 10.1\nring 2\nread-byte 1 FE13 = 00\n",
    ),
    (
        "fails.scn",
        "title A wrong byte ]]> <&>\nsource nd21 9.1\nring 2\n> 80*3\n< 80 80 42\n",
    ),
    (
        "skipped.scn",
        "title Three drives\nsource nd21 9.1\nring 3\n> 80\n",
    ),
    (
        "9&1 <]]>\u{FFFE}\u{1F980} \".scn",
        "title \u{FFFE}\u{85}crab \u{1F980} ]]>\nsource nd21 9.1\nring 2\n> 80\n",
    ),
];

impl Bench {
    fn new(more: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!(
            "schema = 1 # this one is kept as it is\n[rig]\nid = \"two\"\n[ring.1]\ndrives = 2\ntransport = \"sim\"\n{OWN}[limits]\nallow_motion = true\n\
             allow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n{more}"
        );
        std::fs::write(folder.path().join("two.toml"), text).expect("room");
        std::fs::create_dir(folder.path().join("scn")).expect("room");
        for (name, text) in SCENARIOS {
            std::fs::write(folder.path().join("scn").join(name), text).expect("room");
        }
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the program with the evidence in a folder of this name, which it gives back.
    fn play(&self, arguments: &[&str], evidence: &str) -> (Output, PathBuf) {
        let evidence = self.path(evidence);
        let mut command = program(arguments);
        command.arg("--rig").arg(self.path("two.toml"));
        command.arg("--evidence").arg(&evidence);
        (command.output().expect("the program"), evidence)
    }

    /// All of its scenarios.
    fn play_all(&self, evidence: &str) -> (Output, PathBuf) {
        let scenarios = self.path("scn");
        self.play(&["run", scenarios.to_str().expect("a name")], evidence)
    }
}

fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(arguments).stdin(std::process::Stdio::null());
    command
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8_lossy(&text).into_owned()
}
