//! `drivebench params`: saved, loaded and compared.

use super::*;

#[test]
fn parameters_are_saved_loaded_and_compared() {
    let folder = folder("params");
    let run = |line: &str| {
        let arguments: Vec<_> = line.split_whitespace().collect();
        drivebench_in(&folder, &arguments)
    };
    let ok = |line: &str| {
        let (code, stdout, stderr) = run(line);
        assert_eq!((code, stderr.as_str()), (0, ""), "{line}\n{stdout}");
        stdout
    };
    assert_eq!(
        ok("params save 0 p.toml"),
        "drive 0, serial number 000001: 32 parameters saved in p.toml\n"
    );
    let text = std::fs::read_to_string(folder.join("p.toml")).expect("a file");
    for line in [
        "[nd21]",
        "nMax             = \"3000.1 rpm\"     # FF68 14.5.3.2 maximum speed",
        "\"nRampe+\"        = \"9811.5 rpm/s\"   # FF6C 14.5.4   acceleration ramp",
        "emk0             = \"181.18 V\"       # FF7A 14.6.2   compensation of the back EMF",
        "RefLage0         = \"0.5 turns\"      # FD92 13.1.4   rotor position after a referencing run",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let files: Vec<_> = std::fs::read_dir(&folder).expect("a folder").collect();
    assert_eq!(files.len(), 1, "nothing is left beside the file");
    assert_eq!(
        ok("params diff 0 p.toml"),
        "drive 0 and p.toml are equal (32 parameters)\n"
    );
    assert_eq!(
        ok("params load 0 p.toml --yes"),
        "drive 0: nothing to change\n"
    );
    let head = text.find("[nd21]").expect("a table") + "[nd21]\n".len();
    std::fs::write(folder.join("none.toml"), &text[..head]).expect("a file");
    let (code, _, stderr) = run("params diff 0 none.toml");
    assert_eq!(code, 2);
    assert!(stderr.contains("the file has no parameters"), "{stderr}");
    let other = text
        .replace("3000.1 rpm", "1500rpm")
        .replace("\"0 turns\"        # FD90", "\"7turns\" # FD90")
        .replace("85.048", "60");
    std::fs::write(folder.join("q.toml"), other).expect("a file");
    let (code, stdout, _) = run("params diff 0 q.toml");
    assert_eq!(code, 1);
    assert_eq!(
        stdout,
        "\
MaxTempKK: drive 0 54 (85.048 °C), file 83 (59.776 °C)
nMax: drive 0 2C3D (3000.1 rpm), file 161E (1499.9 rpm)
RefUmdr0: drive 0 0000 (0 turns), file 0007 (7 turns)
drive 0 and q.toml differ in 3 (32 parameters)
"
    );
    let changes = "nMax: 2C3D (3000.1 rpm) -> 161E (1499.9 rpm)\nRefUmdr0: 0000 (0 turns) -> 0007 (7 turns)\n";
    let fixed = "note: MaxTempKK is read only (ND21 14.5.7.1) and stays 54 (85.048 °C)";
    let (code, stdout, stderr) = run("params load 0 q.toml");
    assert_eq!((code, stdout.as_str()), (2, changes));
    assert!(stderr.contains(fixed), "{stderr}");
    assert!(stderr.contains("2 parameters would change; nothing was written, add --yes"));
    let (code, stdout, stderr) = run("params load 0 q.toml --yes");
    let written = "drive 0: 2 parameters written and read back\n";
    assert_eq!((code, stdout), (0, format!("{changes}{written}")));
    assert!(
        stderr.contains("drive 0 is in go: its motor can turn"),
        "{stderr}"
    );
    let (code, stdout, _) = run("params load 0 q.toml --yes --store");
    assert_eq!(code, 0);
    assert!(
        stdout.ends_with("read back, all stored in the EEPROM\n"),
        "{stdout}"
    );
}

/// What the range of speeds of the file makes of its own numbers (14.3.2).
#[test]
fn a_file_with_another_range_of_speeds_is_loaded_in_its_own_scale() {
    let folder = folder("range");
    let text = "[nd21]\nSwVersion2 = \"7F\"\nnMax = \"3000 rpm\"\n";
    std::fs::write(folder.join("p.toml"), text).expect("a file");
    let line = ["params", "load", "0", "p.toml", "--yes"];
    let (code, stdout, stderr) = drivebench_in(&folder, &line);
    assert_eq!(code, 0, "{stdout}{stderr}");
    assert!(stderr.contains("p.toml has 2 of 32 parameters"), "{stderr}");
    assert!(stdout.contains("-> 161E (2999.8 rpm)"), "{stdout}");
}

#[test]
fn all_mistakes_of_a_file_of_parameters_are_shown_at_once() {
    let folder = folder("bad_params");
    let text = "[nd21]\nnMaxx = \"1 rpm\"\nnMax = 5\nimax = \"99A\"\nnKp = \"5\"\nnKi = \"0505\"\n\
        nist = \"5 rpm\"\ni0 = \"\\u0035A\"\n[other]\nx = 1\n";
    std::fs::write(folder.join("bad.toml"), text).expect("a file");
    let (code, stdout, stderr) = drivebench_in(&folder, &["params", "load", "0", "bad.toml"]);
    assert_eq!((code, stdout.as_str()), (2, ""));
    for part in [
        "bad.toml:2:1",
        "did you mean `nMax`?",
        "bad.toml:3:8",
        "a value of `nMax` is a text",
        "bad.toml:4:9",
        "at most 19.952 expected (ND21 14.5.1.2)",
        "`5` has an odd number of digits",
        "2 bytes where `nKi` has 1",
        "`nist` is not a parameter",
        "`5A` can be bytes or a number with a unit",
        "`other` is not the table of the parameters",
        "bad.toml: 8 mistakes",
    ] {
        assert!(stderr.contains(part), "{part}\n{stderr}");
    }
    for text in [
        "",
        "nd21 = 1\n",
        "x",
        "[nd21]\nnMax = \"1 rpm\"\nnMax = \"2 rpm\"\n",
        "[nd21\n",
    ] {
        std::fs::write(folder.join("bad.toml"), text).expect("a file");
        let (code, _, stderr) = drivebench_in(&folder, &["params", "diff", "0", "bad.toml"]);
        assert_eq!(code, 2, "{text:?}\n{stderr}");
        assert!(stderr.contains("bad.toml: 1 mistake"), "{text:?}\n{stderr}");
    }
    refused("params diff 0 no-such-file.toml", 2, &["failed to read"]);
    refused(
        "params save 0 /no/such/folder/p.toml",
        2,
        &["there is no folder /no/such/folder; make it first"],
    );
    refused("params save 0 /", 2, &["is not the name of a file"]);
}
