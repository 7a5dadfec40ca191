//! The package for Python: its own tests, with the program of this build, and what `python -m build` makes of it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The folder of the package.
fn package() -> PathBuf {
    Path::new(env!("TREE")).join("harness/python")
}

/// A command of this Python on the package, with the program of this build first on the path.
fn python(python: impl AsRef<Path>, words: &[&str]) -> Command {
    let program = Path::new(env!("CARGO_BIN_EXE_drivebench"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folder = program.parent().map(Path::to_owned);
    let folders = folder.into_iter().chain(std::env::split_paths(&path));
    let mut command = Command::new(python.as_ref());
    command
        .args(words)
        .current_dir(package())
        .env("PATH", std::env::join_paths(folders).expect("a path"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("DRIVEBENCH", program);
    command
}

#[track_caller]
fn passed(output: &Output, words: &str) -> String {
    let said = crate::program::said(output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains(words), "{words:?} is not in {said}");
    said
}

/// Nothing but the standard library is needed.
#[test]
fn the_python_package_works() {
    if !crate::debian::has("python3", "the_python_package_works") {
        return;
    }
    let words = ["-W", "error", "-m", "unittest", "discover", "-s", "tests"];
    let mut command = python("python3", &words);
    command
        .args(["-p", "test_drivebench.py"])
        .env("PYTHONPATH", "src");
    // `discover` without tests would pass too.
    passed(&command.output().expect("python3"), "Ran 13 tests");
}

/// The plugin for pytest, and the driver for labgrid with a coordinator and an exporter.
#[test]
fn pytest_and_labgrid_work() {
    let who = "pytest_and_labgrid_work";
    let Some(found) = crate::python::with("drivebench, labgrid, pytest", who) else {
        return;
    };
    let words = ["-W", "error", "-m", "pytest", "-W", "error"];
    let mut command = python(found, &words);
    command.args(["-q", "-p", "no:cacheprovider", "tests"]);
    passed(&command.output().expect("Python"), "25 passed");
}

#[test]
fn the_package_is_built_and_typed() {
    let who = "the_package_is_built_and_typed";
    let Some(found) = crate::python::with("build, hatchling, mypy", who) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let place = crate::program::name(folder.path());
    let words = ["-m", "build", "--no-isolation", "--outdir", place, "."];
    let built = python(&found, &words).output().expect("Python");
    let said = passed(
        &built,
        "drivebench-0.1.0.tar.gz and drivebench-0.1.0-py3-none-any.whl",
    );
    let wheel = format!("{place}/drivebench-0.1.0-py3-none-any.whl");
    let listed = python(&found, &["-m", "zipfile", "--list", &wheel]);
    let listed = passed(&{ listed }.output().expect("Python"), "drivebench/py.typed");
    for file in ["__init__.py", "labgrid.py", "pytest_plugin.py"] {
        assert!(listed.contains(&format!("drivebench/{file}")), "{listed}");
    }
    assert!(!listed.contains("tests/"), "{listed}\n{said}");
    let install = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index"];
    let target = format!("{place}/installed");
    let mut installed = python(&found, &install);
    installed.args(["--target", &target, &wheel]);
    passed(&installed.output().expect("pip"), "");
    let entry = "from importlib.metadata import distribution as d; print(d('drivebench').entry_points, d('drivebench').requires)";
    let mut named = python(&found, &["-I", "-c"]);
    named.arg(format!(
        "import sys; sys.path.insert(0, {target:?}); {entry}"
    ));
    let named = passed(&named.output().expect("Python"), "drivebench.pytest_plugin");
    assert!(
        named.contains("labgrid<27,>=26; extra == 'labgrid'"),
        "{named}"
    );
    let cache = format!("--cache-dir={place}/mypy");
    let typed = python(&found, &["-m", "mypy", &cache]).output();
    passed(&typed.expect("mypy"), "no issues found");
}
