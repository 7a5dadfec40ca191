//! The commands that messages advise for formats which are not read: each is run as it is printed, and what it gives is read.

use super::{built_in, file, written};
use crate::{debian, python};
use harness::report::vcd::Signals;
use harness::shown::FileForm;
use std::path::Path;
use std::process::{Command, Output};

/// A format: the ending of its files, the program that the advice needs, how a file is made of `FILE.log` or `FILE.vcd`, and what the advised
/// command leaves.
const ROUTES: [(&str, &str, &str, &str); 8] = [
    (
        "gz",
        "gunzip",
        "gzip -c FILE.log > FILE.gz; rm FILE.log",
        "FILE",
    ),
    ("zst", "unzstd", "zstd -q FILE.log -o FILE.zst", "FILE"),
    ("bz2", "bunzip2", "bzip2 -c FILE.log > FILE.bz2", "FILE"),
    (
        "blf",
        "can_logconvert",
        "can_logconvert FILE.log FILE.blf",
        "FILE.log",
    ),
    (
        "csv",
        "can_logconvert",
        "can_logconvert FILE.log FILE.csv",
        "FILE.log",
    ),
    (
        "db",
        "can_logconvert",
        "can_logconvert FILE.log FILE.db",
        "FILE.log",
    ),
    (
        "txt",
        "awk",
        "printf '# Logger type: CANLogger1000\\nTimestamp;Type;ID;Data\\n01T000000000;0;201;3de200\\n01T000000001;0;181;e2010000\\n' > FILE.txt",
        "FILE.log",
    ),
    (
        "sr",
        "sigrok-cli",
        "sigrok-cli -i FILE.vcd -I vcd -O srzip -o FILE.sr",
        "FILE.vcd",
    ),
];

/// Runs a command in a folder, with the programs of python-can where they are.
fn shell(command: &str, folder: &Path, programs: Option<&Path>) -> Output {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let all = programs.map(Path::to_owned).into_iter();
    let all = std::env::join_paths(all.chain(std::env::split_paths(&path))).expect("paths");
    let mut shell = Command::new("sh");
    shell
        .args(["-c", command])
        .current_dir(folder)
        .env("PATH", all);
    let output = shell.output().expect("a shell");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {errors}");
    output
}

fn import(path: &Path) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    let output = command
        .arg("import")
        .arg(path)
        .output()
        .expect("the program");
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.code(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

#[test]
fn every_advised_command_leads_to_a_capture() {
    let can = python::with("can", "commands that messages advise");
    let can = can.as_deref().and_then(Path::parent);
    let capture = built_in("10.1-read-byte");
    let levels = written(&capture, FileForm::Vcd(Signals::Lines), "");
    for (ending, program, make, left) in ROUTES {
        let there = match program {
            "can_logconvert" => can.is_some(),
            _ => debian::has(program, "commands that messages advise"),
        };
        if !there {
            continue;
        }
        let folder = file("routes").join(ending);
        let _none = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("room");
        let log = "(1.000000) can0 201#3DE200\n(1.000400) can0 181#E2010000\n";
        std::fs::write(folder.join("FILE.log"), log).expect("room");
        std::fs::write(folder.join("FILE.vcd"), &levels).expect("room");
        shell(make, &folder, can);
        for given in ["FILE.log", "FILE.vcd"] {
            let _made_of = std::fs::remove_file(folder.join(given));
        }
        let (code, said) = import(&folder.join(format!("FILE.{ending}")));
        assert_eq!(code, Some(2), "{ending}: {said}");
        let advice = said.split('`').skip(1).step_by(2);
        let mut advice = advice.filter(|command| command.contains(&format!("FILE.{ending}")));
        let advice = advice
            .next()
            .unwrap_or_else(|| panic!("{ending}: no command in {said}"));
        shell(advice, &folder, can);
        let (code, said) = import(&folder.join(left));
        assert_eq!(code, Some(0), "{advice}: {said}");
    }
}
