//! Programs of others that tests use, from Debian. `.ci/tools` installs them; a test whose program is not there says so in one line, and
//! `DRIVEBENCH_TOOLS=required` makes that a failure.

use std::io::Write as _;

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
