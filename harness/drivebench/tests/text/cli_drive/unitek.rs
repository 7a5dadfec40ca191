//! The commands on simulated UNITEK drives.

use super::*;

/// Registers by name, number and alias, with units and bits, for people and for tools.
#[test]
fn registers_are_read_by_every_name() {
    let text = shown("read 1 speed_ist 0x40 8F CAN_BTR --rig sim:unitek");
    assert_eq!(
        text,
        "drive  reg  name          raw   value           origin  label\n\
         1      30   SPEED_ACTUAL  0000  0.0% (0.0 rpm)  App 7   N actual\n\
         1      40   STATUS        0101  Ena N-I         App 7   Status map\n\
         1      8F   ERR_BITMAP1   0000                  App 7   Warning-Error map\n\
         1      73   CAN_BTR       4025                  3.1     NBT\n"
    );
    let all = shown("read 1 all --rig sim:unitek");
    assert_eq!(all.lines().count(), 257);
    let json = json("read all STATUS --rig sim:unitek:2 --format json");
    let registers = json["registers"].as_array().expect("a list");
    assert_eq!(registers.len(), 2);
    assert_eq!(registers[1]["drive"], 2);
    assert_eq!(registers[1]["bits"], serde_json::json!(["Ena", "N-I"]));
    assert_eq!(registers[1]["bytes"], 4);
    refused(
        "read 1 SPEED_ACTUL --rig sim:unitek",
        2,
        &["did you mean `SPEED_ACTUAL`?"],
    );
    refused(
        "read 1 SPEED_DELTAMA --rig sim:unitek",
        2,
        &["several registers have this name"],
    );
    refused(
        "read 2 STATUS --rig sim:unitek",
        2,
        &["the rig has no drive 2: 1 expected"],
    );
    refused("read 2:1 STATUS --rig sim:unitek", 2, &["no ring 2"]);
    refused(
        "read 1 STATUS --rig sim:unitek:128",
        2,
        &["1 to 127 expected"],
    );
}

/// For programs, a value stands below its unit as exactly as it was read.
#[test]
fn columns_name_their_units() {
    let folder = folder("unitek-watch");
    let setup = "bus unitek\ndrive 1 register 31 = 0CCD\n";
    std::fs::write(folder.join("a.setup"), setup).expect("room");
    let line =
        "watch 1 SPEED_CMD STATUS CAN_BTR --for 0s --format csv --rig sim:unitek --setup a.setup";
    let arguments: Vec<_> = line.split_whitespace().collect();
    let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
    assert_eq!((code, &*stderr), (0, ""));
    assert_eq!(
        stdout,
        "time_ms,1 SPEED_CMD [%],1 STATUS [hex],1 CAN_BTR\n0.000,10.000916,0101,16421\n"
    );
}

/// Header lines of a scenario set simulated drives up.
#[test]
fn simulated_drives_are_set_up() {
    let folder = folder("unitek-setup");
    let put = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("room");
    let run = |line: &str| {
        let arguments: Vec<_> = line.split_whitespace().collect();
        drivebench_in(&folder, &arguments)
    };
    put(
        "wide.setup",
        "bus unitek\ndrive 1 property map-reply native\ndrive 1 register 31 = 10%\n",
    );
    let (code, stdout, stderr) = run("read 1 STATUS SPEED_CMD --rig sim:unitek --setup wide.setup");
    assert_eq!(code, 0, "{stderr}");
    assert!(
        stdout.contains("STATUS     00000101") && stdout.contains("0CCD"),
        "{stdout}"
    );
    put(
        "wrong.setup",
        "bus unitek\ndrive 1 property map-reply nativ\n",
    );
    let (code, _, stderr) = run("read 1 STATUS --rig sim:unitek --setup wrong.setup");
    assert_eq!(code, 2);
    assert!(
        stderr.contains("wrong.setup:2") && stderr.contains("did you mean `native`?"),
        "{stderr}"
    );
    put(
        "bench.toml",
        "schema = 2\n[rig]\nid = \"bench\"\n[port.1]\nbus = \"unitek\"\ndrives = [{ rx = 0x210, tx = 0x190 }]\n[sim]\nbus = \"unitek\"\nsetup = [\"drive 1 register 31 = 10%\"]\n",
    );
    let (code, stdout, stderr) = run("read 1 SPEED_CMD --rig bench.toml");
    assert_eq!(code, 0, "{stderr}");
    assert!(stdout.contains("0CCD"), "{stdout}");
    assert_eq!(
        run("read 1 STATUS --rig bench.toml --setup wide.setup").0,
        2
    );
}

/// Every write has a unit, is read back, and is judged before the first one leaves.
#[test]
fn registers_are_written_with_units() {
    let text = shown("write 1 SPEED_CMD=-10% TORQUE_SETPOI=50% 35=0x000101F4 --rig sim:unitek");
    assert_eq!(
        text,
        "drive 1 31 SPEED_CMD = F333 -10.0% (-360.0 rpm)\n\
         drive 1 90 TORQUE_SETPOI = 2AAA 50.0%\n\
         drive 1 35 SPEED_DELTAMA = 000101F4 500 ms\n"
    );
    refused(
        "write 1 SPEED_CMD=10% B0=1 --rig sim:unitek",
        2,
        &["nothing was written", "can make the drive unusable"],
    );
    refused(
        "write 1 SPEED_CMD=10 --rig sim:unitek",
        2,
        &["a number with its unit, such as 1%"],
    );
    let (code, stdout, stderr) = drivebench("write 1 FUN_PARAWRITE=0 --rig sim:unitek");
    assert_eq!((code, stderr.as_str()), (0, ""));
    assert!(stdout.contains("a write is never answered"), "{stdout}");
}

/// Release, motion, stop and lock; what a ring's commands do not have is refused.
#[test]
fn drives_are_moved() {
    refused("go 1 --rig sim:unitek", 2, &["add --move"]);
    let (code, stdout, _) = drivebench("go 1 --move --rig sim:unitek");
    assert_eq!((code, stdout.as_str()), (0, "drive 1: released; ready\n"));
    let (code, stdout, _) =
        drivebench("position 1 --reference --to 2turns --move --rig sim:unitek");
    assert_eq!(
        (code, stdout.as_str()),
        (0, "drive 1: homed\ndrive 1: arrived at 2.000 turns\n")
    );
    let both = shown("stop all --rig sim:unitek:2");
    assert_eq!(both.lines().count(), 2);
    assert_eq!(
        shown("block 1 --rig sim:unitek"),
        "drive 1: locked, with commands 0; ready\n"
    );
    refused(
        "recover --rig sim:unitek",
        2,
        &["for drives of another bus"],
    );
    let played = shown("run unitek-ex-3-speed unitek-inputs --rig sim:unitek");
    assert!(played.contains("2 passed, 0 failed"), "{played}");
}

#[test]
fn parameters_are_saved_compared_and_loaded() {
    let folder = folder("unitek-params");
    let run = |line: &str| {
        let arguments: Vec<_> = line.split_whitespace().collect();
        drivebench_in(&folder, &arguments)
    };
    assert_eq!(run("params save 1 p.toml --rig sim:unitek").0, 0);
    let text = std::fs::read_to_string(folder.join("p.toml")).expect("a file");
    assert!(text.contains("0x2C = \"000A\"     # SPEED_KP\n"), "{text}");
    assert!(
        text.contains("0xC8 = \"0E10\"     # SPEED_RPMMAX   3600.0 rpm\n"),
        "{text}"
    );
    assert_eq!(
        run("params diff 1 p.toml --rig sim:unitek"),
        (0, String::new(), String::new())
    );
    let other = text.replace("0x2C = \"000A\"", "0x2C = \"0014\"");
    std::fs::write(folder.join("q.toml"), other).expect("room");
    let line = "2C SPEED_KP       file 0014  drive 000A\n";
    assert_eq!(
        run("params diff 1 q.toml --rig sim:unitek"),
        (1, line.to_owned(), String::new())
    );
    let (code, stdout, stderr) = run("params load 1 q.toml --rig sim:unitek");
    assert_eq!((code, stdout.as_str()), (0, line));
    assert!(stderr.contains("--yes writes it"), "{stderr}");
    let (code, _, stderr) = run("params load 1 q.toml --yes --rig sim:unitek");
    assert_eq!(
        (code, stderr.as_str()),
        (0, "1 parameter written and read back\n")
    );
    std::fs::write(folder.join("q.toml"), "[unitek]\n0x30 = \"0000\"\n").expect("room");
    let (code, _, stderr) = run("params diff 1 q.toml --rig sim:unitek");
    assert_eq!(code, 2);
    assert!(stderr.contains("is no parameter (RO)"), "{stderr}");
}

/// All drives on one page, without a terminal.
#[test]
fn drives_are_shown_in_rows() {
    assert_eq!(
        shown("top --once --rig sim:unitek:2"),
        "drive  ready  enable  mode      speed           position     status   errors\n\
         1      yes    yes     released  0.0% (0.0 rpm)  0.526 turns  Ena N-I  none\n\
         2      yes    yes     released  0.0% (0.0 rpm)  0.526 turns  Ena N-I  none\n"
    );
    refused("top --rig sim:unitek", 2, &["use `top --once`"]);
}

#[test]
fn registers_are_listed() {
    let one = shown("cells --bus unitek 31");
    assert!(one.contains("SPEED_CMD"), "{one}");
    assert_eq!(shown("cells --bus unitek").lines().count(), 256);
    refused("cells --bus unitek zzzz", 4, &["no register"]);
    refused(
        "cells --bus unitek --eeprom",
        2,
        &["--eeprom is for the bus novobus"],
    );
}

/// An error whose cause is there stays, and the command has failed (unitek dump, register 8E).
#[test]
fn an_error_that_stays_is_not_cleared() {
    let folder = folder("an-error-stays");
    std::fs::write(
        folder.join("setup.scn"),
        "drive 1\ndrive 1 input dc-bus low\n",
    )
    .expect("a file");
    let line = "delete-error 1 --move --rig sim:unitek:1 --setup setup.scn";
    let arguments: Vec<_> = line.split(' ').collect();
    let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
    assert_eq!(code, 1, "{stdout}{stderr}");
    assert!(stdout.contains("errors POWERVOLTAGE"), "{stdout}");
    assert!(stderr.contains("drive 1: its errors stay"), "{stderr}");
}
