//! Rig files, locks, quarantine, hooks and the commands for them.

use harness::buses::{RIG_BUSES, find_rig_in as find, parse_rig as parse};
use harness::file::values::{MaxSpeed, Speed};
use harness::rig::file::{LineFormat, Transport};
use harness::rig::hook::{self, HookError};
use harness::rig::lock::{self, RigLock};
use harness::rig::{Rig, scan, schema};
use harness::scenario::source::Source;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

mod locks;
mod port;

fn root() -> &'static Path {
    Path::new(env!("TREE"))
}

fn read(text: &str) -> Result<Rig, Vec<String>> {
    let source = Source::from_bytes("lab.toml".to_owned(), text.as_bytes().to_vec()).expect("text");
    parse(&source).map_err(|problems| {
        let shown = problems.all().iter().map(|problem| {
            let before = &text[..problem.span.start.min(text.len())];
            let line = before.matches('\n').count() + 1;
            let column = before.len() - before.rfind('\n').map_or(0, |at| at + 1) + 1;
            let help = problem.help.as_deref().map(|help| format!(" ({help})"));
            let (message, expected) = (&problem.message, &problem.expected);
            format!(
                "{line}:{column}: {message}; {expected}{}",
                help.unwrap_or_default()
            )
        });
        shown.collect()
    })
}

fn good(text: &str) -> Rig {
    read(text).unwrap_or_else(|problems| panic!("{problems:#?}\n{text}"))
}

/// A rig of three drives at a serial port, with more behind it.
fn serial(more: &str) -> String {
    format!(
        "schema = 1\n[rig]\nid = \"lab\"\n[ring.1]\ndrives = 3\ntransport = \"serial\"\nport = \"/dev/ttyS9\"\n{more}\n"
    )
}

/// Compares with a file that is kept; `UPDATE_SNAPSHOTS=1` writes it.
fn kept(name: &str, text: &str) {
    let path = root().join("snapshots/rigs").join(name);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(&path, text).expect("written");
    }
    let before = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        before == text,
        "{} differs; UPDATE_SNAPSHOTS=1 writes it:\n{text}",
        path.display()
    );
}

#[test]
fn every_rig_file_parses_and_its_name_is_its_id() {
    let mut count = 0;
    for folder in ["rigs", "rigs/examples"] {
        for entry in std::fs::read_dir(root().join(folder)).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|ending| ending == "toml") {
                let rig = good(&std::fs::read_to_string(&path).expect("text"));
                let name = path
                    .file_stem()
                    .and_then(|name| name.to_str())
                    .expect("a name");
                assert!(folder != "rigs" || rig.id() == name, "{}", path.display());
                assert_eq!(rig.is_simulated(), folder == "rigs", "{}", path.display());
                count += 1;
            }
        }
    }
    assert!(count >= 7, "{count}");
}

#[test]
fn what_a_file_says_is_what_is_read() {
    let rig =
        good(&std::fs::read_to_string(root().join("rigs/examples/serial.toml")).expect("text"));
    let ring = rig.file.rings().next().expect("a ring");
    assert_eq!(
        (ring.drives, ring.endpoint.transport),
        (3, Transport::Serial)
    );
    assert_eq!(
        (ring.endpoint.line, ring.endpoint.line.baud()),
        (LineFormat::Baud38400, 38_400)
    );
    assert_eq!(ring.time_tolerance.0, Duration::from_millis(3));
    assert_eq!(ring.endpoint.udev["ID_SERIAL_SHORT"], "EXAMPLE1");
    let limits = &rig.file.limits;
    assert!(
        limits.allow_motion && !limits.allow_eeprom && !limits.allow_reset && !limits.allow_outputs
    );
    let most = MaxSpeed::Rpm(Speed(300.0));
    assert_eq!(limits.max_speed, Some(most));
    assert_eq!(
        limits.max_run.map(|time| time.0),
        Some(Duration::from_secs(3600))
    );
    assert_eq!(rig.file.interlock.len(), 2);
}

#[test]
fn where_nothing_is_said_nothing_is_allowed() {
    let limits = good(&serial("")).file.limits;
    assert!(
        !limits.allow_motion
            && !limits.allow_eeprom
            && !limits.allow_reset
            && !limits.allow_outputs
            && !limits.allow_monitoring
    );
}

#[test]
fn mistakes_are_shown_with_line_and_column() {
    let sim = "schema = 1\n[rig]\nid = \"s\"\n[ring.1]\ndrives = 2\ntransport = \"sim\"\n";
    let cases = [
        ("no TOML", "schema = 1\n[rig\n".to_owned()),
        ("an empty file", String::new()),
        (
            "another schema",
            serial("").replace("schema = 1", "schema = 3"),
        ),
        ("a key that is not known", serial("baud = 9600")),
        ("a key nearly right", serial("tranport = \"tcp\"")),
        (
            "two at once",
            serial("lien = 1\n[limits]\nallow_moton = true"),
        ),
        (
            "a third ring",
            serial("[ring.3]\ndrives = 1\ntransport = \"sim\""),
        ),
        (
            "no such transport",
            serial("").replace("\"serial\"", "\"serail\""),
        ),
        (
            "a number of drives as a text",
            serial("").replace("= 3", "= \"3\""),
        ),
        ("too many drives", serial("").replace("= 3", "= 251")),
        (
            "an id for a path",
            serial("").replace("\"lab\"", "\"../lab\""),
        ),
        (
            "a line that the drive has not got",
            serial("line = \"38400 8N1\""),
        ),
        ("a time without a unit", serial("time_tolerance = \"3\"")),
        ("a time in rpm", serial("time_tolerance = \"3rpm\"")),
        ("no time at all", serial("time_tolerance = \"0ms\"")),
        (
            "a negative speed",
            serial("[limits]\nmax_speed = \"-5rpm\""),
        ),
        (
            "port and match",
            serial("match = { ID_SERIAL_SHORT = \"A\" }"),
        ),
        (
            "neither port nor match",
            serial("").replace("port = \"/dev/ttyS9\"\n", ""),
        ),
        ("marks on a serial port", serial("marks = \"in-band\"")),
        (
            "a socket without a port number",
            serial("").replace("serial\"\nport = \"/dev/ttyS9", "tcp\"\nport = \"localhost"),
        ),
        ("a port for a simulated ring", format!("{sim}port = \"x\"")),
        ("[sim] on a real ring", serial("[sim]\nsetup = []")),
        (
            "a setup line that is none",
            format!("{sim}[sim]\nsetup = [\"drive 0 modle nd21\"]"),
        ),
        (
            "a step for a setup line",
            format!(
                "{sim}[sim]\nsetup = [\n  \"drive 0 input GPIN3 high\",\n  \"> 80\",\n  \"wait 5ms\",\n]"
            ),
        ),
        (
            "a setup line of another bus",
            format!("{sim}[sim]\nsetup = [\"drive 0 input GPIN3 high\", \"bus unitek\"]"),
        ),
        (
            "a setup line for a ring of another size",
            format!("{sim}[sim]\nsetup = [\"drive 0 input GPIN3 high\", \"ring 5\"]"),
        ),
        (
            "a setup of a drive that is not there",
            format!("{sim}[sim]\nsetup = [\"drive 2:0 input GPIN3 high\"]"),
        ),
        (
            "one ring simulated",
            serial("[ring.2]\ndrives = 1\ntransport = \"sim\""),
        ),
        (
            "a tap on no link",
            serial("[[tap]]\nlink = \"2->0\"\ntransport = \"serial\"\nport = \"/dev/b\""),
        ),
        (
            "a tap at the ring's own port",
            serial("[[tap]]\nlink = \"2->1\"\ntransport = \"serial\"\nport = \"/dev/ttyS9\""),
        ),
        (
            "an arrow the wrong way",
            serial("[[tap]]\nlink = \"2<-1\"\ntransport = \"serial\"\nport = \"/dev/b\""),
        ),
        (
            "an interposer in ring 2",
            serial(
                "[[interposer]]\nring = 2\nlink = \"2->1\"\nupstream = { transport = \"pty\", port = \"/dev/b\" }\n\
             downstream = { transport = \"sim\" }",
            ),
        ),
        (
            "a drive that is not there",
            serial("[[drive]]\naddress = 3"),
        ),
        (
            "a drive described twice",
            serial("[[drive]]\naddress = 1\n[[drive]]\naddress = 1"),
        ),
        (
            "a cell that is not there",
            serial("[[interlock]]\ndrive = 0\ncell = \"TempKk\"\nmax = \"75C\""),
        ),
        (
            "a bound in another unit",
            serial("[[interlock]]\ndrive = 0\ncell = \"TempKK\"\nmax = \"75rpm\""),
        ),
        (
            "an interlock without bounds",
            serial("[[interlock]]\ndrive = 0\ncell = \"TempKK\""),
        ),
        (
            "an interlock on nothing",
            serial("[[interlock]]\ndrive = 0"),
        ),
        (
            "an input that is not there",
            serial("[[interlock]]\ndrive = 0\ninput = \"GPIN9\"\nlevel = \"high\""),
        ),
        (
            "telegrams behind the power",
            serial(
                "[power.main]\non = [\"on\"]\noff = [\"off\"]\n[safe_state]\norder = [\"power-off\", \"stop\"]",
            ),
        ),
        (
            "no power to switch off",
            serial("[safe_state]\norder = [\"stop\", \"stop\", \"power-off\"]"),
        ),
        ("no command", serial("[hooks.before]\ncommand = []")),
        (
            "a command as one text",
            serial("[hooks.before]\ncommand = \"true\""),
        ),
        (
            "a quarantine without a date",
            serial("[quarantine]\nsince = \"yesterday\"\nreason = \"it smells\""),
        ),
    ];
    kept("mistakes.txt", &mistakes(&cases));
}

/// A page with the mistakes of each text.
fn mistakes(cases: &[(&str, String)]) -> String {
    let mut page = String::new();
    for (what, text) in cases {
        let problems = read(text).expect_err(what);
        assert!(!problems.is_empty(), "{what}");
        writeln!(page, "{what}").expect("a String");
        for problem in problems {
            writeln!(page, "    {problem}").expect("a String");
        }
    }
    page
}

#[test]
fn the_schema_is_the_one_that_is_kept() {
    kept("schema.json", &format!("{:#}\n", schema()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    /// No text makes it panic, and one that is taken is taken again when it is printed.
    #[test]
    fn cut_and_changed_files_are_taken_or_refused(cut in 0..900_usize, at in 0..900_usize, new in "[ -~]{0,3}") {
        let text = std::fs::read_to_string(root().join("rigs/examples/serial.toml")).expect("text");
        let mut text: String = text.chars().filter(char::is_ascii).skip(cut % 200).collect();
        let at = at % text.len();
        text.replace_range(at..(at + new.len()).min(text.len()), &new);
        if let Ok(rig) = read(&text) {
            prop_assert!(rig.ring_size() > 0);
        }
    }
}

#[test]
fn what_is_shown_is_read_as_the_same() {
    let rig =
        good(&std::fs::read_to_string(root().join("rigs/examples/serial.toml")).expect("text"));
    let shown = toml::to_string(&rig.file).expect("TOML");
    assert_eq!(good(&shown).file, rig.file);
}

#[test]
fn a_rig_is_found_by_size_file_folder_and_name() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("lab.toml"), serial("")).expect("written");
    let drives = |name: &str| -> Vec<u8> {
        let rig = find(name, folder.path()).unwrap_or_else(|error| panic!("{error}"));
        rig.rings().map(|(_, ring)| ring.drives).collect()
    };
    assert_eq!(drives("sim:250"), [250]);
    assert_eq!(drives("sim:2,3"), [2, 3]);
    assert_eq!(drives("lab"), [3]);
    assert_eq!(
        drives(&folder.path().join("lab.toml").display().to_string()),
        [3]
    );
    assert_eq!(drives("sim-two-rings"), [4, 3]);
    let refused = |name: &str| find(name, folder.path()).expect_err(name).to_string();
    assert!(
        refused("sim-40").contains("did you mean `sim-4`?"),
        "{}",
        refused("sim-40")
    );
    assert!(refused("x").contains("lab, sim-1, "), "{}", refused("x"));
    assert!(refused("sim:0").contains("sim:0") && refused("sim:1,2,3").contains("one ring or two"));
}

#[test]
fn hooks_are_bounded_and_know_their_rig() {
    let rig = good(&serial(""));
    let run = |words: &[&str], timeout| {
        let words: Vec<_> = words.iter().map(|word| (*word).to_owned()).collect();
        hook::run(&rig, "before", &words, timeout)
    };
    let minute = Duration::from_secs(60);
    let said = run(
        &["sh", "-c", "echo $DRIVEBENCH_RIG $DRIVEBENCH_HOOK"],
        minute,
    )
    .expect("runs");
    assert_eq!(said.stdout, "lab before\n");
    run(&["true"], minute).expect("runs");
    assert!(matches!(
        run(&["false"], minute),
        Err(HookError::Failed { .. })
    ));
    assert!(matches!(
        run(&["no-such-program-here"], minute),
        Err(HookError::Start { .. })
    ));
    assert!(matches!(run(&[], minute), Err(HookError::Start { .. })));
    // On a busy machine the hook may not have begun when its time is over.
    let late = [1, 10, 100].into_iter().find(|seconds| {
        let late = run(
            &["sh", "-c", "echo slow >&2; sleep 3600"],
            Duration::from_secs(*seconds),
        );
        let Err(HookError::TimeOut { stderr, .. }) = late else {
            panic!("{late:?}");
        };
        stderr == "slow\n"
    });
    assert!(
        late.is_some(),
        "what it said is kept, and its children end too"
    );
    let long =
        run(&["sh", "-c", "head -c 1000000 /dev/zero"], minute).expect("it does not stand still");
    assert_eq!(long.stdout.len() as u64, hook::MAX_OUTPUT);
}

fn tree() -> tempfile::TempDir {
    let root = tempfile::tempdir().expect("a folder");
    let put = |path: &str, text: &str| {
        let path = root.path().join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    };
    let tty = |name: &str, dev: &str| {
        put(&format!("sys/class/tty/{name}/device/uevent"), "");
        put(&format!("sys/class/tty/{name}/dev"), &format!("{dev}\n"));
    };
    put("sys/class/tty/tty1/dev", "4:1\n");
    for (name, kind) in [
        ("can10", "280"),
        ("vcan2", "280"),
        ("can2", "280"),
        ("lo", "772"),
    ] {
        put(&format!("sys/class/net/{name}/type"), &format!("{kind}\n"));
    }
    tty("ttyS0", "4:64");
    put("sys/class/tty/ttyS0/type", "0\n");
    tty("ttyS1", "4:65");
    put("sys/class/tty/ttyS1/type", "4\n");
    put("sys/class/tty/console/active", "tty0 ttyS2\n");
    tty("ttyS2", "4:66");
    put("sys/class/tty/ttyS2/type", "4\n");
    for (name, dev, serial) in [("ttyUSB10", "188:10", "B2"), ("ttyUSB2", "188:2", "A1")] {
        tty(name, dev);
        let text = format!(
            "S:serial/by-id/x\nE:ID_VENDOR_ID=0403\nE:ID_MODEL=FT\"232\nE:ID_SERIAL_SHORT={serial}\nE:OTHER=1\n"
        );
        put(&format!("run/udev/data/c{dev}"), &text);
    }
    root
}

#[test]
fn scan_finds_ports_and_what_udev_says_of_them() {
    let root = tree();
    let ports = scan::scan(root.path());
    let names: Vec<_> = ports
        .iter()
        .map(|port| port.device.display().to_string())
        .collect();
    assert_eq!(names, ["/dev/ttyS1", "/dev/ttyUSB2", "/dev/ttyUSB10"]);
    let text = scan::propose(&ports, &RIG_BUSES);
    for block in text.split("\n\n") {
        let rig = good(&format!("schema = 1\n[rig]\nid = \"new\"\n{block}"));
        let lines = block.lines().skip_while(|line| *line != "# [port.1]");
        let port: Vec<_> = lines.map(|line| line.trim_start_matches("# ")).collect();
        let can = good(&format!(
            "schema = 2\n[rig]\nid = \"new\"\n{}",
            port.join("\n")
        ));
        assert!(can.port().is_some_and(|port| port.slcan.is_some()));
        let udev = &rig.file.rings().next().expect("a ring").endpoint.udev;
        if let Some(serial) = udev.get("ID_SERIAL_SHORT") {
            let device = scan::resolve(&ports, udev).expect("one");
            assert_eq!(
                device,
                PathBuf::from(if serial == "A1" {
                    "/dev/ttyUSB2"
                } else {
                    "/dev/ttyUSB10"
                })
            );
        }
    }
    let vendor = [("ID_VENDOR_ID".to_owned(), "0403".to_owned())].into();
    let two = scan::resolve(&ports, &vendor).expect_err("two").to_string();
    assert!(
        two.contains("/dev/ttyUSB2, /dev/ttyUSB10 have them"),
        "{two}"
    );
    let none =
        scan::resolve(&ports, &[("ID_PATH".to_owned(), "x".to_owned())].into()).expect_err("none");
    assert!(none.to_string().contains("none of /dev/ttyS1"), "{none}");
    assert!(scan::scan(Path::new("/no/such/folder")).is_empty());
    let names = scan::interfaces(root.path());
    assert_eq!(names, ["can2", "can10", "vcan2"]);
    let text = scan::propose_interfaces(&names[..1], &RIG_BUSES);
    let can = good(&format!("schema = 2\n[rig]\nid = \"new\"\n{text}"));
    assert!(
        can.port()
            .is_some_and(|port| port.socketcan.as_deref() == Some("can2"))
    );
}

fn program(folder: &Path, arguments: &[&str]) -> (Output, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(["rig"]).args(arguments).current_dir(folder);
    command
        .env("DRIVEBENCH_STATE", folder.join("state"))
        .env("DRIVEBENCH_RIGS", folder);
    let output = command.output().expect("runs");
    let text = [output.stdout.as_slice(), &output.stderr].concat();
    (output, String::from_utf8(text).expect("text"))
}

/// Another process holds a rig, or has reserved it; `snapshots/console/rigs.md` shows the commands of one.
#[test]
fn the_commands_name_who_has_a_rig() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("lab.toml"), serial("")).expect("written");
    let state = folder.path().join("state");
    let check = |arguments: &[&str], code: i32, expected: &str| {
        let (output, text) = program(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        assert!(text.contains(expected), "{arguments:?}: {text}");
    };
    check(&["list"], 0, "lab                  free");
    let anna = locks::someone("anna", 4_000_000);
    let held = RigLock::acquire_in(&state, "lab", &anna, Duration::ZERO).expect("free");
    check(
        &["lock", "lab", "--purpose", "x"],
        75,
        "rig lab is held by anna (pid ",
    );
    check(&["unlock", "lab", "--force"], 75, "held by anna");
    drop(held);
    lock::reserve(&state, "lab", &anna).expect("free");
    check(&["unlock", "lab"], 75, "rig lab is reserved by anna");
    check(&["unlock", "lab", "--force"], 0, "it was reserved by anna");
}

/// What a profile and `[sim]` say of drives is one header. A mistake is placed at its line of `[sim]`, or at the profile's name.
#[test]
fn a_mistake_in_a_setup_has_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let profile = |line: &str| {
        let text = format!(
            "schema = 1\nrig = \"lab\"\ndate = \"2026-03-14\"\nrings = [3]\n\
             [property.self-test-time]\nvalue = \"50ms\"\nsection = \"nd21 11.8\"\nsetup = [{line:?}]\n"
        );
        std::fs::write(folder.path().join("profile.toml"), text).expect("written");
    };
    let path = folder.path().join("lab.toml");
    let text = "schema = 1\n[rig]\nid = \"lab\"\nprofile = \"profile.toml\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n[sim]\n\
                setup = [\n\"line 19200\",\n\"drive 0 model plain\",\n\"drive 3 input GPIN3 high\",\n]\n";
    let wrong = || {
        let source = Source {
            name: path.display().to_string(),
            text: text.into(),
        };
        let problems = parse(&source).expect_err("mistakes");
        let placed = problems.all().iter().map(|problem| {
            let line = text[..problem.span.start].matches('\n').count() + 1;
            (line, problem.message.clone())
        });
        placed.collect::<Vec<_>>()
    };
    profile("drive 0 property self-test-time = 50ms");
    let found = wrong();
    assert_eq!(found.len(), 2, "{found:?}");
    assert_eq!(found[0].0, 4, "{found:?}");
    assert!(found[0].1.contains("its model is `plain`"), "{found:?}");
    assert_eq!(found[1].0, 12, "{found:?}");
    assert!(found[1].1.contains("drive 3"), "{found:?}");
    // A line that is none is placed in the profile itself.
    profile("drive 0 property self-test = 50ms");
    let found = wrong();
    assert_eq!(found[0].0, 4, "{found:?}");
    assert!(found[0].1.contains("line 8, column"), "{found:?}");
}
