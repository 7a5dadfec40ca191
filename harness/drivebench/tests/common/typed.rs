//! The program as it is typed: how it ended, and what it said.

use std::process::{Command, Output, Stdio};

/// From this folder.
pub(crate) fn in_folder(folder: impl AsRef<std::path::Path>, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("the program starts")
}

/// From a folder outside every checkout.
pub(crate) fn drivebench(arguments: &[&str]) -> Output {
    in_folder(std::env::temp_dir(), arguments)
}

/// From the folder of tests: its exit code, standard output and standard error.
#[track_caller]
pub(crate) fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = in_folder(env!("CARGO_TARGET_TMPDIR"), arguments);
    (code(&output), stdout(&output), stderr(&output))
}

#[track_caller]
pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().expect("it ended by itself")
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("text")
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("text")
}
