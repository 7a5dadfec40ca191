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
