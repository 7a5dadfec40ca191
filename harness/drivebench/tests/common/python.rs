//! Python with packages of others, which `.ci/tools` installs into a virtual environment in `target`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python that has these modules and pyserial: that of `DRIVEBENCH_PYTHON`, that of `.ci/tools`, or the system's. Without one, prints that
/// the test `who` is skipped.
pub(crate) fn with(modules: &str, who: &str) -> Option<PathBuf> {
    let installed = Path::new(env!("TREE")).join("target/python/bin/python");
    let given = std::env::var_os("DRIVEBENCH_PYTHON").map(PathBuf::from);
    let imports = |python: &PathBuf| {
        let mut command = Command::new(python);
        let import = format!("import {modules}, serial");
        let output = command.args(["-c", &import]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let all = given.into_iter().chain([installed, "python3".into()]);
    let found = all.into_iter().find(imports);
    crate::debian::told(found.is_some(), &format!("Python with {modules}"), who);
    found
}
