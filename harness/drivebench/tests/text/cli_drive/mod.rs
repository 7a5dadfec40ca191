//! The commands on a bus as a user at a machine runs them: output, refusals, exit codes.

mod params;
mod plot;
mod scope;
mod unitek;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Exit code, standard output and standard error.
type End = (i32, String, String);

fn drivebench_in(folder: &Path, arguments: &[&str]) -> End {
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("the program starts");
    (
        output.status.code().expect("the program ended by itself"),
        String::from_utf8(output.stdout).expect("text"),
        String::from_utf8(output.stderr).expect("text"),
    )
}

fn drivebench(line: &str) -> End {
    let arguments: Vec<_> = line.split_whitespace().collect();
    drivebench_in(&std::env::temp_dir(), &arguments)
}

/// The output of a command that does its work and has nothing to remark.
fn shown(line: &str) -> String {
    let (code, stdout, stderr) = drivebench(line);
    assert_eq!((code, stderr.as_str()), (0, ""), "{line}\n{stdout}");
    stdout
}

/// A command that does not do it: its exit code and what it says; nothing but that.
#[track_caller]
fn refused(line: &str, code: i32, parts: &[&str]) {
    let (found, stdout, stderr) = drivebench(line);
    assert_eq!((found, stdout.as_str()), (code, ""), "{line}\n{stderr}");
    for part in parts {
        assert!(stderr.contains(part), "{line}\n{part}\n{stderr}");
    }
}

/// A folder of this test's own, empty.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    // From an earlier run.
    let _gone = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(&shown(line)).expect("JSON")
}

#[test]
fn read_shows_cells_with_units_and_bits() {
    assert_eq!(
        shown("read 1 nMax SwVersion2 Flags2 position EE_Seriennummer FF0C FF68:2 ee:44:2 ee:nMax"),
        "\
drive  cell             address  raw       value                   section   meaning
1      nMax             FF68     2C3D      3000.1 rpm              14.5.3.2  maximum speed
1      SwVersion2       FF63     FF                                14.3.2    configuration byte
1      Flags2           FF57     02        NOVOBUS OK              14.4.3    status byte
1      position         FF16     00000000  0 turns                 14.5.5    rotation, actual value
1      EE_Seriennummer  ee:01    000001    1                       14.8.1    serial number
1      FF0C             FF0C     00                                14.5.3.1  spin speed, actual value
1      FF68             FF68     2C3D      3000.1 rpm              14.5.3.2  maximum speed
1      ee:44            ee:44    0400      1024 impulses per turn  14.7.1.1  encoder emulation
1      ee:nMax          ee:28    2C3D      3000.1 rpm              14.5.3.2  maximum speed
"
    );
    let found = json("read 0..1 nist Flags2 EE_InitDatum --format json");
    assert_eq!(found["schema"], 1);
    assert_eq!(found["cells"].as_array().map(Vec::len), Some(6));
    assert_eq!(found["cells"][0]["value"], 0.0);
    assert_eq!(found["cells"][0]["unit"], "rpm");
    assert_eq!(found["cells"][1]["bits"][0], "NOVOBUS OK");
    assert_eq!(found["cells"][2]["memory"], "eeprom");
    assert_eq!(found["cells"][2]["value"], "1996-01-01");
    assert_eq!(found["cells"][3]["axis"], "1");
}

#[test]
fn all_mistakes_in_cells_are_shown_at_once() {
    refused(
        "read 0 nits EE_Pole ABCD ee:FF:9 FF0C:0 FF0C:999999999999999999999",
        2,
        &[
            "did you mean `nist`?",
            "did you mean `EE_pole`?",
            "no memory at ABCD",
            "beyond the EEPROM",
            "1 to 256 expected here",
            "command line: 6 mistakes",
        ],
    );
    refused(
        "write 0 nist=5rpm Flags=00 EE_BetriebStd=0000 FF80=00 nsoll=0x07 nMax=99999rpm nMax=0x5A",
        2,
        &[
            "`nist` is read only (ND21 14.5.3.1)",
            "`Flags` is read only (ND21 14.4.2)",
            "`EE_BetriebStd` is read only (ND21 14.8.2)",
            "`FF80` cannot be written",
            "command line: 4 mistakes",
        ],
    );
    refused(
        "write 0 nsoll=0x07 nMax=99999rpm",
        2,
        &[
            "1 byte where `nsoll` has 2",
            "at most 8000 expected (ND21 14.5.3.2)",
        ],
    );
    refused(
        "write 0 nMax",
        2,
        &["`=` is missing at the end of the line"],
    );
}

#[test]
fn benches_and_drives_that_are_not_there_are_refused() {
    for (line, part) in [
        ("read 0 nist --rig cabinet", "nor a rig of that name"),
        ("read 0 nist --rig cabinet", "and sim:N"),
        ("read 0 nist --rig sim:", "not a number of drives"),
        ("read 0 nist --rig sim:251", "1 to 250 (ND21 8.4)"),
        ("read 0 nist --rig sim:1,2,3", "one ring or two (ND21 12.2)"),
        (
            "read 3 nist",
            "no drive 3 in a ring of 3: 0 to 2 expected (ND21 8.5)",
        ),
        ("read 2:0 nist", "the bus has no ring 2"),
        ("read 2..1 nist", "ends before it begins"),
        ("read -1 nist", "unexpected argument"),
        ("read 1..x nist", "`1..x` is not a drive"),
        ("read 3:0 nist", "`3:0` is not a drive"),
        ("position 0..1 --by 1turn", "one drive expected"),
        (
            "info --setup no-such-file.scn",
            "failed to read no-such-file.scn",
        ),
    ] {
        refused(line, 2, &[part]);
    }
}

#[test]
fn write_shows_before_and_after() {
    assert_eq!(
        shown("write 0..1 nRampe+=off VCOlin=4080rpm EE_pole=08 Status=80"),
        "\
drive 0 nRampe+: 0010 (9811.5 rpm/s) -> 7FFF (off)
drive 0 VCOlin: 32 (3000 rpm) -> 44 (4080 rpm)
drive 0 EE_pole: 06 (6) -> 08 (8)
drive 0 Status: 00 -> 80 (stop)
drive 1 nRampe+: 0010 (9811.5 rpm/s) -> 7FFF (off)
drive 1 VCOlin: 32 (3000 rpm) -> 44 (4080 rpm)
drive 1 EE_pole: 06 (6) -> 08 (8)
drive 1 Status: 00 -> 80 (stop)
"
    );
    // The error code is taken as an order (14.10.1), and the drive says so.
    let (code, stdout, stderr) = drivebench("write 0 errorcode=00AF");
    assert_eq!(code, 0, "{stdout}{stderr}");
}

/// A cell with a unit takes a number with its unit or marked bytes: `1500` alone would be read as the bytes 15 00.
#[test]
fn a_cell_with_a_unit_needs_one() {
    for (line, digits, both) in [
        (
            "write 0 nsoll=1500",
            "1500",
            "`nsoll=1500rpm` for a number with its unit, `nsoll=0x1500` for the bytes",
        ),
        (
            "write 0 nsoll=05DC",
            "05DC",
            "`nsoll=100rpm` for a number with its unit, `nsoll=0x05DC` for the bytes",
        ),
        ("write 0 VCOlin=44", "44", "`VCOlin=44rpm`"),
        ("write 0 FF08:2=1500", "1500", "`FF08:2=0x1500`"),
        ("write 0 FF08=1500", "1500", "`FF08=0x1500`"),
        ("write 0 ee:nMax=1500", "1500", "`ee:nMax=0x1500`"),
        ("write 0 EE_RefV1=0100", "0100", "`EE_RefV1=0x0100`"),
        ("scope 0 nist --then nsoll=1500", "1500", "`nsoll=1500rpm`"),
    ] {
        refused(line, 2, &[&format!("`{digits}` has no unit"), both]);
    }
    let blocked = "write 0 Status=81 nsoll=0x161E ps_v0=[1000] nsoll=1500rpm VCOlin=0x44 EE_pole=06 HwVersion=0xC4 --move";
    assert_eq!(
        drivebench(blocked).1,
        "\
drive 0 Status: 00 -> 81 (stop, block)
drive 0 nsoll: 0000 (0 rpm) -> 161E (1499.9 rpm)
drive 0 ps_v0: 2C3D (3000.1 rpm) -> 1000 (1085.1 rpm)
drive 0 nsoll: 161E (1499.9 rpm) -> 161E (1499.9 rpm)
drive 0 VCOlin: 32 (3000 rpm) -> 44 (4080 rpm)
drive 0 EE_pole: 06 (6) -> 06 (6)
drive 0 HwVersion: C4 -> C4
"
    );
}

#[test]
fn what_can_turn_a_motor_needs_leave_and_says_so_first() {
    for (line, part) in [
        (
            "write 2 nsoll=1500rpm",
            "drive 2 is in go, and nsoll orders a motion",
        ),
        ("write 2 FF08:2=0x1000", "FF08 orders a motion"),
        ("write 2 Flags2=80", "Flags2 orders a motion"),
        ("write 2 umdrsoll=10turns", "umdrsoll orders a motion"),
        ("write 2 Status=00", "Status releases it"),
        ("scope 2 nist --then nsoll=1rpm", "nsoll orders a motion"),
        ("go 0 2", "go: drives 0, 2: their motors may turn"),
        ("reset 1", "reset: drive 1: its motor may turn"),
        (
            "position 1 --by -50deg --init",
            "drive 1 stands at 0 turns and will turn: by -50 deg",
        ),
        (
            "position 1 --reference",
            "a referencing run (RefV1 200.01 rpm, RefV2 -50.068 rpm), at most at 3000.1 rpm",
        ),
    ] {
        refused(line, 2, &[part, "nothing was", "add --move to allow it"]);
    }
    let (code, stdout, stderr) = drivebench("write 2 nsoll=1500rpm --move");
    assert_eq!(code, 0);
    assert_eq!(stdout, "drive 2 nsoll: 0000 (0 rpm) -> 161E (1499.9 rpm)\n");
    let said = "drive 2 is in go, and nsoll orders a motion: its motor can turn\n";
    assert_eq!(stderr, said);
    // A blocked drive may be given a speed, and nothing keeps a drive from being stopped.
    let folder = folder("blocked");
    std::fs::write(folder.join("a.scn"), "drive 0 input GPIN3 low\n").expect("a file");
    let line = ["write", "0", "nsoll=1500rpm", "--setup", "a.scn"];
    assert_eq!(drivebench_in(&folder, &line).0, 0);
    shown("write 0 Status=81");
}

#[test]
fn info_shows_every_drive() {
    assert_eq!(
        shown("info --rig sim:2,1"),
        "\
drive  serial  mode  speed  position  cooler     motor       hours  blocked  started     changed     EE_Version  error
0      000001  go    0 rpm  0 turns   24.755 °C  998.67 ohm  0 h    0 h      1996-01-01  1996-01-01  00          -
1      000001  go    0 rpm  0 turns   24.755 °C  998.67 ohm  0 h    0 h      1996-01-01  1996-01-01  00          -
2:0    000001  go    0 rpm  0 turns   24.755 °C  998.67 ohm  0 h    0 h      1996-01-01  1996-01-01  00          -
3 drives on the bus, 0 errors corrected
"
    );
    let folder = folder("info");
    let setup = "ring 2..5 default 4\ndrive 1 eeprom EE_Seriennummer = 004711\ndrive 1 cooler 95C\n\
        drive 3 input GPIN3 GPIN5 high\nread-byte 0 nist = 00\n";
    std::fs::write(folder.join("a.scn"), setup).expect("a file");
    let info = |more: &[&str]| {
        let line = [&["info", "--setup", "a.scn"], more].concat();
        drivebench_in(&folder, &line)
    };
    let (code, stdout, stderr) = info(&["--format", "json"]);
    assert_eq!((code, stderr.as_str()), (0, ""), "{stdout}");
    let found: serde_json::Value = serde_json::from_str(&stdout).expect("JSON");
    assert_eq!(found["drives"].as_array().map(Vec::len), Some(4));
    assert_eq!(found["drives"][1]["serial_number"], 4711);
    assert_eq!(found["drives"][1]["mode"], "error");
    assert_eq!(found["drives"][1]["error"]["code"], "0400");
    assert_eq!(found["drives"][2]["mode"], "block");
    assert_eq!(found["drives"][3]["mode"], "go");
    assert_eq!(found["drives"][3]["error"], serde_json::Value::Null);
    let (code, stdout, _) = info(&["--rig", "sim:5"]);
    assert_eq!(code, 0);
    assert!(stdout.contains("0400 "), "{stdout}");
    assert!(stdout.contains("5 drives on the bus"), "{stdout}");
    // What the header does not allow.
    for rig in ["sim:2", "sim:6", "sim:4,2"] {
        assert_eq!(info(&["--rig", rig]).0, 2, "{rig}");
    }
    std::fs::write(folder.join("a.scn"), "drvie 0 model nd21\n").expect("a file");
    let (code, _, stderr) = info(&[]);
    assert_eq!(code, 2);
    assert!(stderr.contains("drvie"), "{stderr}");
}

#[test]
fn watch_shows_values_again_and_again() {
    assert_eq!(
        shown("watch 0 nist ps_status --every 50ms --for 100ms"),
        "    0.000 ms  drive 0  nist 0 rpm  ps_status 00\n   50.000 ms  drive 0  nist 0 rpm  ps_status 00\n  \
         100.000 ms  drive 0  nist 0 rpm  ps_status 00\n"
    );
    assert_eq!(
        shown("watch 0..1 nist Status --format csv --for 100ms"),
        "time_ms,0 nist [rpm],0 Status [hex],1 nist [rpm],1 Status [hex]\n0.000,0.0,00,0.0,00\n100.000,0.0,00,0.0,00\n"
    );
    let folder = folder("watch");
    let setup = "drive 0..last input GPIN3 GPIN5 high\ndrive 0 memory nsoll = 100rpm\n";
    std::fs::write(folder.join("a.scn"), setup).expect("a file");
    let line = ["watch", "0", "nist", "--for", "0s", "--setup", "a.scn"];
    let (_, stdout, _) = drivebench_in(&folder, &line);
    assert!(
        stdout.contains("nist 99.") || stdout.contains("nist 100"),
        "{stdout}"
    );
    refused("watch 0 nist --every 0ms", 2, &["--every must be longer"]);
    for rig in ["sim:3", "sim:unitek:1", "sim:nordac"] {
        let line = format!("top --rig {rig} --once --every 0ms");
        refused(&line, 2, &["--every must be longer"]);
    }
    refused("watch 0 nist --every 1ns", 2, &["at most 1000000 times"]);
    refused(
        "watch 0 nist --every 1rpm",
        2,
        &["`rpm` is not a unit of time"],
    );
}

/// ND21 13.2: a referencing run, a position, a path.
#[test]
fn positions() {
    let folder = folder("position");
    let setup = "drive 0..last input GPIN3 GPIN5 high\ndrive 0..last cam GPIN4 3turns..3.5turns\n";
    std::fs::write(folder.join("cam.scn"), setup).expect("a file");
    let line = "position 0 --reference --to 10.25turns --speed 500rpm --move --setup cam.scn";
    let arguments: Vec<_> = line.split_whitespace().collect();
    let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
    assert_eq!(code, 0, "{stderr}");
    assert_eq!(
        stderr,
        "drive 0 stands at 0 turns and will turn: a referencing run (RefV1 200.01 rpm, RefV2 -50.068 rpm), then to 10.25 turns, at most at 500 rpm (ps_v0)\n"
    );
    assert!(stdout.starts_with("drive 0 stands at 10.2"), "{stdout}");
    let (code, stdout, _) = drivebench("position 1 --by -50deg --init --move");
    assert_eq!(code, 0);
    assert!(stdout.starts_with("drive 1 stands at -0.138"), "{stdout}");
    refused(
        "position 0 --to 1turn --move",
        1,
        &["not initialised (ps_status 00)", "--reference"],
    );
    refused("position 0 --to 99999turns", 2, &["13.1.9"]);
    refused("position 0 --by 5rpm", 2, &["turns or deg"]);
    refused("position 0 --by 5deg --speed 0rpm", 2, &["more than 0 rpm"]);
    refused("position 0", 2, &["--to"]);
    // There is no reference switch: the search ends, and the drive with it.
    let (code, stdout, stderr) = drivebench("position 0 --reference --move");
    assert_eq!((code, stdout.as_str()), (1, ""));
    assert!(
        stderr.contains("for the referencing run of drive 0"),
        "{stderr}"
    );
    assert!(
        stderr.contains("drive 0 was stopped (software stop)\nerror: waited"),
        "{stderr}"
    );
    std::fs::write(folder.join("a.scn"), "drive 0 input GPIN3 low\n").expect("a file");
    let line = [
        "position", "0", "--by", "1turn", "--init", "--move", "--setup", "a.scn",
    ];
    let (code, _, stderr) = drivebench_in(&folder, &line);
    assert_eq!(code, 1);
    assert!(
        stderr.contains("drive 0 is in block; positioning needs a drive in go"),
        "{stderr}"
    );
}

#[test]
fn modes_of_drives() {
    assert_eq!(
        shown("stop all"),
        "drive 0 is in stop\ndrive 1 is in stop\ndrive 2 is in stop\n"
    );
    assert_eq!(
        shown("block 2:0 1 --rig sim:2,1"),
        "drive 2:0 is in block\ndrive 1 is in block\n"
    );
    assert_eq!(
        shown("delete-error 0 0..1"),
        "drive 0 is in go\ndrive 1 is in go\n"
    );
    let (code, stdout, stderr) = drivebench("go 0..1 --move");
    assert_eq!(
        (code, stdout.as_str()),
        (0, "drive 0 is in go\ndrive 1 is in go\n")
    );
    assert_eq!(stderr, "go: drives 0, 1: their motors may turn\n");
    let (code, stdout, stderr) = drivebench("reset 1 --move");
    assert_eq!((code, stdout.as_str()), (0, "drive 1 is in go\n"));
    assert_eq!(stderr, "reset: drive 1: its motor may turn\n");
    refused("stop", 2, &["DRIVE"]);
}

/// A drive that is not as it was asked to be has failed (ND21 11.8).
#[test]
fn a_drive_that_does_not_obey_has_failed() {
    let folder = folder("disobeys");
    for (command, lines, is) in [
        ("block", "drive 1 deviates or-spares-bit-0", "go"),
        ("stop", "drive 1 deviates stop-ignored", "go"),
        (
            "go",
            "drive 1 memory FF00 = 80\ndrive 1 deviates and-spares-bit-7",
            "stop",
        ),
    ] {
        let setup = format!("drive 1 input GPIN3 GPIN5 high\n{lines}\n");
        std::fs::write(folder.join("setup.scn"), setup).expect("a file");
        let run = |line: &str| {
            let line = format!("{line} --rig sim:2 --setup setup.scn");
            let arguments: Vec<_> = line.split(' ').collect();
            drivebench_in(&folder, &arguments)
        };
        let leave = match command {
            "go" => " --move",
            _ => "",
        };
        let (code, _, stderr) = run(&format!("{command} 1{leave}"));
        let (remedy, exit) = match (command, is) {
            ("block", _) => (
                ": the safe state is NOT confirmed; use the emergency stop",
                7,
            ),
            (_, "go") => ("; use the emergency stop", 1),
            _ => ("", 1),
        };
        assert_eq!(code, exit, "{command}: {stderr}");
        let words =
            format!("drive 1: `{command}` was sent, and it is in {is} (ND21 11.8){remedy}\n");
        assert!(stderr.contains(&words), "{stderr}");
    }
}

#[test]
fn recover_counts_the_drives() {
    assert_eq!(
        shown("recover"),
        "ring 1: no fault reported; 3 drives answered after the check sequence\n"
    );
    assert_eq!(
        json("recover --rig sim:250,1 --format json")["rings"],
        serde_json::json!([
            {"reported": null, "missed_master": null, "drives": 250, "still": null, "zeros_unasked": false, "heard": ""},
            {"reported": null, "missed_master": null, "drives": 1, "still": null, "zeros_unasked": false, "heard": ""},
        ])
    );
    let folder = folder("recover");
    std::fs::write(folder.join("off.scn"), "drive 1 power off\n").expect("a file");
    let (code, stdout, _) = drivebench_in(&folder, &["recover", "--setup", "off.scn"]);
    assert_eq!(code, 3);
    assert!(
        stdout.contains("nothing comes back behind the check sequence"),
        "{stdout}"
    );
    let (code, stdout, stderr) = drivebench_in(&folder, &["info", "--setup", "off.scn"]);
    assert_eq!((code, stdout.as_str()), (3, ""));
    assert!(
        stderr.contains("a drive is not ready for operation"),
        "{stderr}"
    );
}

#[test]
fn every_command_explains_itself() {
    for command in [
        "read",
        "write",
        "info",
        "watch",
        "params",
        "params save",
        "params load",
        "params diff",
        "scope",
        "position",
        "go",
        "stop",
        "block",
        "reset",
        "delete-error",
        "recover",
    ] {
        let help = shown(&format!("{command} --help"));
        assert!(help.contains("Usage: drivebench"), "{command}");
    }
    for command in ["read", "info", "recover"] {
        assert!(
            shown(&format!("{command} --help")).contains("\"schema\": 1"),
            "{command}"
        );
    }
}

/// The commands on drives that the guide lists run on a simulated ring.
#[test]
fn the_commands_of_the_guide_work() {
    let page = Path::new(env!("TREE")).join("harness/docs/commands.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let section = page.split("## Drives").nth(1).expect("the section");
    let block = section.split("```").nth(1).expect("the commands");
    let folder = folder("commands");
    let mut count = 0;
    for line in block.lines() {
        let line = line.split('#').next().unwrap_or_default();
        let Some(arguments) = line.strip_prefix("drivebench ") else {
            continue;
        };
        let arguments: Vec<_> = arguments.split_whitespace().collect();
        let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
        assert_eq!(code, 0, "{line}\n{stdout}{stderr}");
        count += 1;
    }
    assert!(count > 8, "{count} commands");
}
