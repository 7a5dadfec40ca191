//! The commands as a stranger uses them.

use super::file;
use crate::typed::{code, drivebench, stderr, stdout};
use std::process::{Command, Output, Stdio};

#[test]
fn every_form_goes_into_a_file_and_comes_back() {
    // A folder of its own: other tests write their files into the shared one meanwhile.
    let folder = file("forms");
    std::fs::create_dir_all(&folder).expect("a folder");
    for form in ["table", "json", "svg", "vcd", "pcapng", "csv"] {
        let path = folder.join(format!("program.{form}"));
        let place = path.to_str().expect("a plain path");
        let piped = drivebench(&["trace", "10.1-read-byte", "--format", form]);
        assert_eq!(code(&piped), 0, "{}", stderr(&piped));
        let filed = drivebench(&[
            "trace",
            "10.1-read-byte",
            "--format",
            form,
            "--output",
            place,
        ]);
        assert_eq!(
            (code(&filed), filed.stdout.len()),
            (0, 0),
            "{}",
            stderr(&filed)
        );
        assert_eq!(
            std::fs::read(&path).expect("a file"),
            piped.stdout,
            "{form}"
        );
        if ["json", "pcapng"].contains(&form) {
            let again = drivebench(&["import", place, "--format", "csv"]);
            let rows = drivebench(&["trace", "10.1-read-byte", "--format", "csv"]);
            let plain = |output: &Output| {
                stdout(output)
                    .lines()
                    .map(|l| l.rsplit_once(',').expect("a mark").0.to_owned())
                    .collect::<Vec<_>>()
            };
            assert_eq!(plain(&again), plain(&rows), "{form}");
        }
    }
    let left = std::fs::read_dir(&folder).expect("readable");
    let parts = left.filter(|entry| {
        entry
            .as_ref()
            .expect("one")
            .path()
            .to_string_lossy()
            .ends_with(".part")
    });
    assert_eq!(parts.count(), 0, "nothing half-written is left");
}

#[test]
fn a_file_that_cannot_be_written_is_told() {
    let output = drivebench(&[
        "trace",
        "10.1-read-byte",
        "--format",
        "svg",
        "-o",
        "/no/such/folder/x.svg",
    ]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("failed to write /no/such/folder/x.svg"));
}

#[test]
fn captures_are_judged_compared_and_played_again() {
    let capture = file("judged.pcapng");
    let capture = capture.to_str().expect("a plain path");
    drivebench(&[
        "trace",
        "9.7-parity-error",
        "--format",
        "pcapng",
        "-o",
        capture,
    ]);
    let judged = drivebench(&["import", capture]);
    assert_eq!(code(&judged), 0, "{}", stderr(&judged));
    assert!(stdout(&judged).starts_with("passed judged.pcapng: 3030 bytes on 101 links"));
    assert!(
        stderr(&judged).contains("taken to hold the first value"),
        "{}",
        stderr(&judged)
    );
    let played = file("judged.scn");
    let scenario = played.to_str().expect("a plain path");
    assert_eq!(
        code(&drivebench(&[
            "import",
            capture,
            "--scenario",
            "-o",
            scenario
        ])),
        0
    );
    assert_eq!(code(&drivebench(&["run", scenario])), 0);
    let same = drivebench(&["diff", capture, scenario]);
    assert_eq!(code(&same), 0, "{}", stdout(&same));
    let other = drivebench(&["diff", capture, "9.8-check-sequence"]);
    assert_eq!(code(&other), 1);
    assert!(stdout(&other).starts_with("first difference: link "));
    // Where neither side has a byte, nothing is the same.
    let silent = file("silent.scn");
    std::fs::write(
        &silent,
        "title silent\nring 2\nwait 1ms\ndrive 0 input GPIN3 high\n",
    )
    .expect("a file");
    let silent = silent.to_str().expect("a plain path");
    let nothing = drivebench(&["diff", silent, silent]);
    assert_eq!(code(&nothing), 5, "{}", stdout(&nothing));
    assert_eq!(code(&drivebench(&["diff", silent, scenario])), 1);
}

#[test]
fn what_is_no_capture_is_refused() {
    let path = file("none.pcapng");
    std::fs::write(&path, [0x0A, 0x0D, 0x0D, 0x0A, 0, 0]).expect("a file");
    let path = path.to_str().expect("a plain path");
    let output = drivebench(&["import", path]);
    assert_eq!((code(&output), stdout(&output).as_str()), (2, ""));
    assert!(stderr(&output).contains("at byte "), "{}", stderr(&output));
    let output = drivebench(&["import", "/no/such/file"]);
    assert_eq!(code(&output), 2);
    let output = drivebench(&["import", path, "--line", "115200"]);
    assert!(stderr(&output).contains("38400, 19200 or 9600 is expected"));
    let output = drivebench(&["diff", path, "no-such-thing"]);
    assert_eq!(code(&output), 2);
}

/// pcapng is not thrown at a terminal: `script` gives the program one, where it is installed.
#[test]
fn a_terminal_gets_no_pcapng() {
    let program = env!("CARGO_BIN_EXE_drivebench");
    let command = format!("{program} trace 10.1-read-byte --format pcapng");
    if !crate::debian::has("script", "pcapng at a terminal") {
        return;
    }
    let output = Command::new("script")
        .args(["-qec", &command, "/dev/null"])
        .stdin(Stdio::null())
        .output()
        .expect("it is there");
    assert_eq!(code(&output), 2, "{}", stdout(&output));
    assert!(
        stdout(&output).contains("pcapng is not a text"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn the_dissector_is_printed() {
    let output = drivebench(&["dissector"]);
    assert_eq!(code(&output), 0);
    assert!(stdout(&output).contains("Proto(\"novobus\", \"NOVOBUS\")"));
}
