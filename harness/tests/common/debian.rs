//! Programs of others that tests use, from Debian. `.ci/tools` installs them; a test whose program is not there says so in one line, and
//! `DRIVEBENCH_TOOLS=required` makes that a failure.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Whether a program is on the path; if not, prints that the test `who` is skipped.
pub(crate) fn has(program: &str, who: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let there = std::env::split_paths(&path).any(|folder| folder.join(program).is_file());
    told(there, program, who)
}

/// Says that a test is skipped, or fails where nothing may be skipped.
pub(crate) fn told(there: bool, program: &str, who: &str) -> bool {
    let required = std::env::var("DRIVEBENCH_TOOLS").is_ok_and(|value| value == "required");
    assert!(
        there || !required,
        "{who}: {program} is not installed: `bash .ci/tools` does it"
    );
    if !there {
        // Past the test harness, which hides what passing tests print.
        let _unwritable = writeln!(
            std::io::stderr(),
            "skipped: {who}: {program} is not installed; `bash .ci/tools` does it"
        );
    }
    there
}

/// A Python that has python-can and pyserial: that of `DRIVEBENCH_PYTHON`, that of `.ci/tools`, or the system's. Without one, prints that
/// the test `who` is skipped.
pub(crate) fn python_can(who: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
    let given = std::env::var_os("DRIVEBENCH_PYTHON").map(PathBuf::from);
    let imports = |python: &PathBuf| {
        let mut command = Command::new(python);
        let output = command.args(["-c", "import can, serial"]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let all = given.into_iter().chain([own, "python3".into()]);
    let found = all.into_iter().find(imports);
    told(found.is_some(), "python-can", who);
    found
}
