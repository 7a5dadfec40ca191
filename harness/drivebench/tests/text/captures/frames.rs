//! Captures of a CAN bus: written in every form, read back, compared, and read by tshark with the dissector.

use super::{ended, file, plain, said};
use crate::debian::has;
use crate::typed::drivebench;
use std::process::Command;

/// Requests, replies, writes, a cycle, an event, every unit, and lengths that the manual does not print.
const EVERY_KIND: &str = "\
title   Every kind of frame
source  unitek 5.4 ex 8
bus     unitek
drive 1
drive 2 rx 210 tx 190

> 201 3D 40 00
< 181 40 01 01 xx
> 201 31 33 F3
> 201 3D 31 00
< 181 31 33 F3 xx
> 201 ED 0A 00 00 00
> 201 3D 30 14
< 181 30 xx xx xx
< 181 30 xx xx xx
> 201 3D 30 FF
> 201 52 01 00
> 201 51 10 00
wait 5ms
> 201 51 14 00
< 181 40 00 01 00 00 xx
> 201 90 55 D5
> 201 6E 00 00 FE FF
> 201 3D C6 00
< 181 C6 32 00 xx
> 201 3D C8 00
< 181 C8 10 0E xx
> 201 D4 11 22 33 44
> 210 3D 6E 00
< 190 6E 00 00 00 00 xx
> 201 31 00 00 00
> 201 3D
";

/// The scenario as a file.
fn scenario(name: &str) -> std::path::PathBuf {
    let path = file(name);
    std::fs::write(&path, EVERY_KIND).expect("room");
    path
}

/// Every form that can be read gives the same frames, and what differs is named.
#[test]
fn frames_are_written_read_and_compared() {
    let scenario = scenario("frames.scn");
    let [pcapng, candump, json] = ["pcapng", "candump", "json"].map(|form| {
        let path = file(&format!("frames.{form}"));
        let written = drivebench(&[
            "trace",
            plain(&scenario),
            "--format",
            form,
            "-o",
            plain(&path),
        ]);
        ended(&written, 0);
        path
    });
    let table = said(&drivebench(&["trace", plain(&scenario)]));
    for capture in [&pcapng, &candump, &json] {
        let same = drivebench(&[
            "diff",
            plain(&scenario),
            plain(capture),
            "--tolerance",
            "1us",
        ]);
        let said = ended(&same, 0);
        assert!(said.starts_with("same: 25 frames in both"), "{said}");
        let shown = ended(
            &drivebench(&["import", plain(capture), "--format", "table"]),
            0,
        );
        // A log does not say which drive has sent with an identifier that is not one of 3.1.
        let own = |text: &str| {
            text.lines()
                .filter(|line| !line.contains(" 190 "))
                .collect::<Vec<_>>()
                .join("\n")
        };
        if capture == &candump {
            assert_eq!(shown.lines().count(), table.lines().count());
            assert!(shown.contains("drive 1   181"), "{shown}");
        } else {
            assert_eq!(own(&shown), own(&table));
        }
    }
    let log = std::fs::read_to_string(&candump).expect("a log");
    let fewer: Vec<_> = log
        .lines()
        .filter(|line| !line.contains("181#31"))
        .collect();
    let short = file("frames-short.log");
    std::fs::write(&short, fewer.join("\n")).expect("room");
    let said = ended(&drivebench(&["diff", plain(&candump), plain(&short)]), 1);
    assert!(
        said.contains("only in frames.candump: ") && said.contains("181#3133F300"),
        "{said}"
    );
    let said = ended(&drivebench(&["diff", plain(&candump), "10.1-read-byte"]), 2);
    assert!(said.contains("bytes of a ring"), "{said}");
    let said = ended(
        &drivebench(&["import", plain(&candump), "--format", "svg"]),
        2,
    );
    assert!(
        said.contains("use table, json, csv, candump or pcapng"),
        "{said}"
    );
}

/// What tshark says of each frame: kind, drive, register and value, and of lengths that the manual does not print.
#[test]
fn tshark_reads_frames_of_drives() {
    if !has("tshark", "frames of UNITEK drives") {
        return;
    }
    let scenario = scenario("dissected.scn");
    let [capture, script] = ["dissected.pcapng", "unitek.lua"].map(file);
    let written = drivebench(&[
        "trace",
        plain(&scenario),
        "--format",
        "pcapng",
        "-o",
        plain(&capture),
    ]);
    ended(&written, 0);
    let dissector = ended(&drivebench(&["dissector", "--bus", "unitek"]), 0);
    std::fs::write(&script, dissector).expect("room");
    let mut command = Command::new("tshark");
    command.args([
        "-X",
        &format!("lua_script:{}", plain(&script)),
        "-r",
        plain(&capture),
    ]);
    command.args([
        "-o",
        "unitek.pairs:210:190",
        "-T",
        "fields",
        "-E",
        "separator=|",
    ]);
    let fields = [
        "frame.interface_name",
        "unitek.kind",
        "unitek.drive",
        "unitek.register",
        "unitek.value",
        "unitek.interval",
        "_ws.expert",
    ];
    command.args(fields.iter().flat_map(|field| ["-e", field]));
    let output = command.output().expect("it is there");
    let rows = said(&output);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        !rows.contains("Lua Error") && !errors.contains("Lua:"),
        "{rows}{errors}"
    );
    let rows: Vec<_> = rows.lines().collect();
    let odd = |count| {
        format!(
            "Expert Info (Warning/Protocol): {count} data bytes: 3 or 5 to a drive, 4 or 6 of one (4.1)"
        )
    };
    let expected = [
        "master|request|1|0x40||0|",
        "drive 1|reply|1|0x40|Ena N-I||",
        "master|write|1|0x31|-10.0%||",
        "master|request|1|0x31||0|",
        "drive 1|reply|1|0x31|-10.0%||",
        "master|write|1|0xed|10 ms||",
        "master|request cycle|1|0x30||20|",
        "drive 1|cycle|1|0x30|",
        "drive 1|cycle|1|0x30|",
        "master|stop|1|0x30||255|",
        "master|write|1|0x52|Ena||",
        "master|write|1|0x51|EVENT||",
        "master|write|1|0x51|LOCK EVENT||",
        "drive 1|event|1|0x40|N-I||",
        "master|write|1|0x90|-50.0%||",
        "master|write|1|0x6e|-2.000 turns||",
        "master|request|1|0xc6||0|",
        "drive 1|reply|1|0xc6|5.0 A||",
        "master|request|1|0xc8||0|",
        "drive 1|reply|1|0xc8|3600 rpm||",
        "master|write|1|0xd4|1144201745||",
        "master|request|210|0x6e||0|",
        "drive 2|reply|210|0x6e|0.000 turns||",
        &format!("master|write|1|0x31|0.0%||{}", odd(4)),
        &format!("master|ignored|1||||{}", odd(1)),
    ];
    for (row, expected) in rows.iter().zip(expected) {
        assert!(row.starts_with(expected), "{row}\n{expected}");
    }
    assert_eq!(rows.len(), expected.len());
}

/// A scenario made of a capture plays as the run that was captured; one of identifiers that are not those of 3.1 needs a header.
#[test]
fn a_scenario_is_made_of_a_capture() {
    let scenario = scenario("replayed.scn");
    let faults = std::fs::read_to_string(&scenario).expect("a scenario") + "! frame 5: corrupt\n";
    std::fs::write(&scenario, faults).expect("room");
    let [capture, again] = ["replayed.pcapng", "again.scn"].map(file);
    let written = drivebench(&[
        "trace",
        plain(&scenario),
        "--format",
        "pcapng",
        "-o",
        plain(&capture),
    ]);
    ended(&written, 0);
    let said = ended(&drivebench(&["import", "--scenario", plain(&capture)]), 2);
    assert!(
        said.contains("drive 2 sends on 190") && said.contains("--setup"),
        "{said}"
    );
    let made = drivebench(&[
        "import",
        "--scenario",
        plain(&capture),
        "--setup",
        plain(&scenario),
        "-o",
        plain(&again),
    ]);
    ended(&made, 0);
    ended(&drivebench(&["run", plain(&again)]), 0);
    let same = drivebench(&["diff", plain(&capture), plain(&again), "--tolerance", "1ms"]);
    assert!(ended(&same, 0).starts_with("same: "));
    let log = file("replayed.log");
    std::fs::write(
        &log,
        "(1436509052.000148) can0 203#3D1B00\n(1436509052.000316) can0 183#1BD80100\n",
    )
    .expect("room");
    let text = ended(&drivebench(&["import", "--scenario", plain(&log)]), 0);
    assert!(
        text.contains("drive 3\n\n@0.000000ms > 203 3D 1B 00\n< 183 1B D8 01 xx\n"),
        "{text}"
    );
}

/// A capture is judged: what a right drive sends passes, and what differs is named with its frame, register and section.
#[test]
fn frames_are_judged() {
    let scenario = scenario("judged.scn");
    for form in ["pcapng", "candump", "json"] {
        let capture = file(&format!("judged.{form}"));
        let form = ["trace", plain(&scenario), "--format", form, "-o"];
        ended(&drivebench(&[&form[..], &[plain(&capture)]].concat()), 0);
        let judge = ["import", plain(&capture), "--setup", plain(&scenario)];
        let said = ended(&drivebench(&judge), 0);
        assert!(
            said.starts_with("passed judged.") && said.contains("8 of 8 replies compared"),
            "{said}"
        );
    }
    let log = std::fs::read_to_string(file("judged.candump")).expect("a log");
    let setup = ["--setup", plain(&scenario)];
    let judged = |name: &str, log: &str, code: i32| {
        let path = file(name);
        std::fs::write(&path, log).expect("room");
        ended(
            &drivebench(&[&["import", plain(&path)], &setup[..]].concat()),
            code,
        )
    };
    let other = judged("value.log", &log.replacen("181#3133F3", "181#3133F4", 1), 1);
    let wanted =
        "frame 5, drive 1 (UNITEK App 5): register 31 (SPEED_CMD) reads F433, and F333 is expected";
    assert!(
        other.starts_with("failed value.log") && other.contains(wanted),
        "{other}"
    );
    let long = judged(
        "length.log",
        &log.replacen("181#3133F300", "181#3133F30000", 1),
        1,
    );
    assert!(
        long.contains("(UNITEK 4.5): 181 31 33 F3 00 00 is no reply"),
        "{long}"
    );
    let none: String = log
        .lines()
        .filter(|line| !line.contains(" 1"))
        .map(|line| format!("{line}\n"))
        .collect();
    let silent = judged(
        "none.log",
        &none.replace(" 18", " 28").replace(" 190", " 290"),
        5,
    );
    assert!(silent.contains("nothing was compared"), "{silent}");
}
