//! What helps a user who starts: `--help`, suggestions, completions, counts, and terminals without colours.

use crate::typed::{drivebench, stderr, stdout};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command
        .args(arguments)
        .current_dir(std::env::temp_dir())
        .stdin(Stdio::null());
    command
}

#[test]
fn commands_stand_in_groups() {
    for arguments in [&["--help"][..], &["-h"], &["help"]] {
        let output = drivebench(arguments);
        assert_eq!(output.status.code(), Some(0));
        let page = stdout(&output);
        let places: Vec<_> = [
            "\nPlay:\n  run ",
            "\nLook:\n  list ",
            "\nDrives:\n  info ",
            "\nBenches:\n  rig ",
            "\nFind:\n  fuzz ",
            "\nExchange:\n  import ",
            "\nMore:\n  completions ",
            "\nOptions:\n",
            "\nWhere to go on:\n",
        ]
        .iter()
        .map(|words| {
            page.find(words)
                .unwrap_or_else(|| panic!("{words}: {page}"))
        })
        .collect();
        assert!(places.is_sorted(), "{page}");
        assert!(!page.contains("\n  complete "), "{page}");
    }
}

#[test]
fn there_is_a_help_command() {
    for arguments in [&["help", "run"][..], &["help", "fuzz", "replay"]] {
        let output = drivebench(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let usage = format!("Usage: drivebench {}", arguments[1..].join(" "));
        assert!(stdout(&output).contains(&usage), "{}", stdout(&output));
    }
    assert_eq!(drivebench(&["help", "nonesuch"]).status.code(), Some(2));
}

#[test]
fn a_misspelt_word_gets_a_suggestion() {
    for (arguments, words) in [
        (&["rnu"][..], "a similar subcommand exists: 'run'"),
        (
            &["--color", "never", "rnu"],
            "a similar subcommand exists: 'run'",
        ),
        (&["fuzz", "rnu"], "a similar subcommand exists: 'run'"),
        (&["9.7-parity-error"], "`drivebench run 9.7-parity-error`"),
        (
            &["run", "9.7-parity-eror"],
            "did you mean `9.7-parity-error`?",
        ),
        (
            &["run", "9.2-synco", "--rig", "simm:3"],
            "did you mean `sim:3`?",
        ),
        (&["info", "--rig", "sim3"], "did you mean `sim:3`?"),
        (
            &["info", "--rig", "sim:nordca"],
            "did you mean `sim:nordac`?",
        ),
        (
            &["info", "--rig", "sim:Unitec:2"],
            "did you mean `sim:unitek:2`?",
        ),
        (
            &["info", "--rig", "sin:nordac:2"],
            "did you mean `sim:nordac:2`?",
        ),
        (&["info", "--rig", "unitek"], "did you mean `sim:unitek`?"),
        (&["info", "--rig", "SIM:2,3"], "did you mean `sim:2,3`?"),
        (
            &["fuzz", "run", "--deviates", "1=write-ignored"],
            "did you mean `writes-ignored`?",
        ),
        (&["read", "0", "nsit"], "did you mean `nist`?"),
        (&["write", "0", "nsol=0rpm"], "did you mean `nsoll`?"),
        (
            &["campaign", "9.7-singel-bits"],
            "did you mean `9.7-single-bits`?",
        ),
    ] {
        let output = drivebench(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(words),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    let nothing_near = stderr(&drivebench(&["zzzz"]));
    assert!(!nothing_near.contains("tip:"), "{nothing_near}");
}

/// A remedy can be used as it stands, in every command that takes a scenario.
#[test]
fn a_part_of_names_leads_to_the_scenarios_that_have_it() {
    let remedy = "`drivebench list --filter 9.7` shows them";
    for name in ["trace", "run", "check", "list"] {
        let said = stderr(&drivebench(&[name, "9.7"]));
        assert!(said.contains(remedy), "{name}: {said}");
    }
    let listed = stdout(&drivebench(&["list", "--filter", "9.7"]));
    assert!(listed.contains("9.7-parity-error"), "{listed}");
    let only = stderr(&drivebench(&["trace", "every-bad-sync"]));
    assert!(
        only.contains("did you mean `9.2-every-bad-sync-byte`?"),
        "{only}"
    );
}

#[test]
fn one_thing_is_singular() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("one.scn");
    std::fs::write(&path, "title one\nring 1\n> 80\n").expect("room");
    let path = path.to_str().expect("a name");
    let run = stdout(&drivebench(&["run", path]));
    assert!(
        run.contains(" 1 drive  ") && run.contains("(1 scenario, "),
        "{run}"
    );
    let checked = stdout(&drivebench(&["check", path]));
    assert!(checked.ends_with("no mistakes, 1 step\n"), "{checked}");
    let evidence = folder.path().join("evidence");
    let evidence = evidence.to_str().expect("a name");
    drivebench(&["run", path, "--rig", "sim:1", "--evidence", evidence]);
    let verified = stdout(&drivebench(&["verify", evidence]));
    assert!(
        verified.contains("1 attempt judged again, 0 things wrong"),
        "{verified}"
    );
}

/// Files that are no scenarios share the reader; its messages fit them all.
#[test]
fn a_rig_file_that_is_no_text_is_not_called_a_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, [b's', 0, b'=']).expect("room");
    let path = path.to_str().expect("a name");
    for arguments in [&["rig", "show", path][..], &["campaign", path]] {
        let said = stderr(&drivebench(arguments));
        assert!(
            said.contains("byte 1 is 00; a text file in UTF-8 is expected"),
            "{said}"
        );
        assert!(!said.contains("scenario"), "{said}");
    }
}

/// The bash script itself, at the end of a command line.
#[test]
fn bash_completes_names() {
    let script = stdout(&drivebench(&["completions", "bash"]));
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("9.7-own.scn"), "").expect("room");
    let completed = |line: &str| {
        let program = env!("CARGO_BIN_EXE_drivebench");
        let tail = "COMP_POINT=${#COMP_LINE}; _drivebench; printf '%s\\n' \"${COMPREPLY[@]}\"";
        let mut bash = Command::new("bash");
        bash.args(["--norc", "-c", &format!("{script}\n{tail}")])
            .env("COMP_LINE", format!("{program} {line}"))
            .current_dir(folder.path());
        let output = bash.output().expect("bash");
        assert_eq!(stderr(&output), "");
        stdout(&output)
    };
    let names = completed("run --ring 100 9.7-");
    assert!(names.contains("9.7-parity-error\n"), "{names}");
    assert!(names.contains("9.7-own.scn\n"), "{names}");
    assert_eq!(completed("read 0 nsollr"), "nsollrampe\n");
    assert_eq!(completed("deviat"), "deviations\n");
    // bash replaces what stands behind the last colon or equal sign.
    assert_eq!(completed("run --rig sim:1"), "1\n");
    assert_eq!(
        completed("fuzz run --deviates 1=writes-ig"),
        "writes-ignored\n"
    );
    assert!(completed("--color ").starts_with("auto\n"));
}

/// The scripts for the other shells, each run by its own shell.
#[test]
fn zsh_and_fish_complete_names() {
    // zsh completes in an editor only: the two calls by which the script gives names are printed.
    let in_zsh = "compdef() { }\ncompadd() { shift; print -l -- \"$@\" }\n_files() { local f; for f in \"${words[CURRENT]}\"*(N); do print -- $f; done }\n";
    let zsh = |script: &str, line: &str| {
        let count = line.split(' ').count();
        let script =
            format!("{in_zsh}{script}\nwords=({line}\"\")\nCURRENT={count}\n_drivebench\n");
        vec!["-f".to_owned(), "-c".to_owned(), script]
    };
    let fish = |script: &str, line: &str| {
        let script = format!("{script}\ncomplete -C '{line}'\n");
        vec!["--no-config".to_owned(), "-c".to_owned(), script]
    };
    type Arguments<'a> = &'a dyn Fn(&str, &str) -> Vec<String>;
    let shells: [(&str, Arguments<'_>); 2] = [("zsh", &zsh), ("fish", &fish)];
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("9.7-own.scn"), "").expect("room");
    let program = Path::new(env!("CARGO_BIN_EXE_drivebench"));
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", program.parent().expect("a folder").display());
    for (shell, arguments) in shells {
        if !crate::debian::has(shell, "zsh_and_fish_complete_names") {
            continue;
        }
        let script = stdout(&drivebench(&["completions", shell]));
        let completed = |line: &str| {
            let mut command = Command::new(shell);
            command
                .args(arguments(&script, &format!("drivebench {line}")))
                .env("PATH", &path)
                .env("HOME", folder.path())
                .current_dir(folder.path());
            let output = command.output().expect("the shell");
            assert_eq!(stderr(&output), "", "{shell}: {line}");
            stdout(&output)
        };
        let names = completed("run --ring 100 9.7-");
        assert!(names.contains("9.7-parity-error\n"), "{shell}: {names}");
        assert!(names.contains("9.7-own.scn\n"), "{shell}: {names}");
        assert_eq!(completed("read 0 nsollr"), "nsollrampe\n", "{shell}");
        assert_eq!(completed("deviat"), "deviations\n", "{shell}");
        assert_eq!(completed("run --rig sim:1"), "sim:1\n", "{shell}");
        let deviation = completed("fuzz run --deviates 1=writes-ig");
        assert_eq!(deviation, "1=writes-ignored\n", "{shell}");
    }
}

/// What the program writes to a terminal of 60 columns.
fn on_a_terminal(arguments: &[&str], term: &str) -> String {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pty");
    grantpt(&master)
        .and_then(|()| unlockpt(&master))
        .expect("a pty");
    let size = Winsize {
        ws_row: 24,
        ws_col: 60,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(&master, size).expect("a size");
    let name = ptsname(&master, Vec::new()).expect("a name");
    let slave = std::fs::File::options()
        .read(true)
        .write(true)
        .open(name.to_str().expect("text"))
        .expect("its other end");
    let mut command = command(arguments);
    command
        .stdout(slave.try_clone().expect("another"))
        .stderr(slave.try_clone().expect("another"))
        .env("TERM", term)
        // Where it is set, clap's own rule gives colours to every terminal.
        .env("CI", "true")
        .env_remove("NO_COLOR");
    let mut child = command.spawn().expect("the program starts");
    drop(command);
    let reader = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // Reading fails when the last program has closed the other end.
        let _closed = std::fs::File::from(master).read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    });
    child.wait().expect("it ends");
    drop(slave);
    reader.join().expect("no panic")
}

#[test]
fn a_list_fits_the_terminal() {
    for arguments in [
        &["list", "--filter", "9.7"][..],
        &["info", "--progress", "none"],
        &["read", "0", "nist", "Status"],
    ] {
        let shown = on_a_terminal(arguments, "xterm");
        let longest = shown.lines().map(|line| line.chars().count()).max();
        assert!(longest.is_some_and(|longest| longest <= 60), "{shown}");
    }
    let piped = stdout(&drivebench(&["list", "--filter", "9.7-parity-error"]));
    assert!(piped.lines().any(|line| line.len() > 100), "{piped}");
}

#[test]
fn a_dumb_terminal_gets_no_escape_sequences() {
    let arguments = ["run", "9.2-synco", "9.2-pause"];
    let coloured = on_a_terminal(&arguments, "xterm");
    assert!(coloured.contains("\x1b[32mpassed"), "{coloured}");
    let plain = on_a_terminal(&arguments, "dumb");
    assert!(
        plain.contains("passed 9.2-synco") && !plain.contains('\x1b'),
        "{plain}"
    );
    let usage = on_a_terminal(&["rnu"], "dumb");
    assert!(
        usage.contains("'run'") && !usage.contains('\x1b'),
        "{usage}"
    );
}
