//! Captures of PROFIBUS: written, read back, compared, made into a scenario, and read by tshark with the dissector.

use super::{ended, file, plain, said};
use crate::debian::has;
use crate::typed::drivebench;
use std::path::{Path, PathBuf};
use std::process::Command;

/// FDL status, every service of a start, PPO1 and PPO4, tasks and refusals, Global_Control, a token, a repetition, and telegrams that are none:
/// a lost byte, a wrong FCS, a wrong parity bit, lengths that differ, an end that is missing.
const EVERY_KIND: &str = "\
title   Every kind of telegram
source  nordac 3.3
bus     nordac
slave 8
slave 9 ppo 4
slave 8 parameter 1621 = 3
! slave 8 byte 8: drop

> 10 08 02 49 53 16
< 10 02 08 00 0A 16
> 10 08 02 49 53 16
< 10 08 00 0A 16
> 10 08 02 49 54 16
> 10 08 02 49 53 16 bad 3
> DC 02 02
> 68 04 05 68 08 02 49 53 16
> 68 05 05 68 88 82 5C
> 68 07 07 68 FF 82 46 3A 3E 02 00 41 16
> 68 07 07 68 88 82 6C 3E 3E F3 F1 D6 16
< 10 02 08 03 0D 16
> 68 05 05 68 88 82 5C 3B 3E DF 16
< 68 07 07 68 82 88 08 3E 3B F3 F1 6F 16
> 68 05 05 68 88 82 5C 3B 3E DF 16
< 68 07 07 68 82 88 08 3E 3B F3 F1 6F 16
start 8 ppo 1 watchdog 300ms
exchange 8 STW=047E
exchange 8 STW=047F HSW=50%
read 8 1202
write 8 1205.3 = 50.0Hz
read 8 1001 error 0
write 8 1202 = 0 error 2
read 8 1605
read 8 1813.2
start 9 ppo 4
exchange 9 STW=047E HSW=-12.5%
";

/// A scenario as a file, and its capture.
fn captured(name: &str, scenario: &str) -> [PathBuf; 2] {
    let [path, capture] = ["scn", "pcapng"].map(|ending| file(&format!("{name}.{ending}")));
    std::fs::write(&path, scenario).expect("room");
    let written = drivebench(&[
        "trace",
        plain(&path),
        "--format",
        "pcapng",
        "-o",
        plain(&capture),
    ]);
    ended(&written, 0);
    [path, capture]
}

/// A capture that is read back shows the same bytes, times and errors, and what differs is named.
#[test]
fn telegrams_are_written_read_and_compared() {
    for (name, rate) in [("telegrams", ""), ("telegrams-fast", "rate 1500\n")] {
        let scenario = EVERY_KIND.replace("slave 8\n", &format!("{rate}slave 8\n"));
        let [path, capture] = captured(name, &scenario);
        let same = ended(&drivebench(&["diff", plain(&path), plain(&capture)]), 0);
        assert!(same.contains("the same: "), "{same}");
        for form in ["table", "csv"] {
            let of_run = ended(&drivebench(&["trace", plain(&path), "--format", form]), 0);
            let read = ended(
                &drivebench(&["import", plain(&capture), "--format", form]),
                0,
            );
            assert_eq!(of_run, read);
        }
        let again = file(&format!("{name}-again.pcapng"));
        let arguments = ["import", plain(&capture), "--format", "pcapng", "-o"];
        let written = drivebench(&[arguments.as_slice(), &[plain(&again)]].concat());
        ended(&written, 0);
        let read = |path: &Path| std::fs::read(path).expect("a capture");
        assert!(read(&capture) == read(&again), "{name}");
    }
    let [path, capture] = captured("telegrams-other", EVERY_KIND);
    let other = EVERY_KIND.replace("HSW=-12.5%", "HSW=-25%");
    let changed = file("telegrams-changed.scn");
    std::fs::write(&changed, other).expect("room");
    let said = ended(&drivebench(&["diff", plain(&capture), plain(&changed)]), 1);
    assert!(said.contains("first difference: telegram "), "{said}");
    let said = ended(&drivebench(&["diff", plain(&path), "10.1-read-byte"]), 2);
    assert!(
        said.contains("telegrams of PROFIBUS and the other bytes of a ring"),
        "{said}"
    );
}

/// The octets that a wire of a value change dump carries, 8E1, by the levels in the middle of each bit.
fn drawn(dump: &str, wire: &str, bit: u64) -> Vec<u8> {
    let code = dump
        .lines()
        .find_map(|line| line.strip_suffix(&format!(" {wire} $end")));
    let code = code.and_then(|own| own.rsplit(' ').next()).expect("a wire");
    let mut now = 0;
    let mut changes = Vec::new();
    for line in dump.lines() {
        match line.strip_prefix('#') {
            Some(time) => now = time.parse().expect("a time"),
            None if line == format!("0{code}") => changes.push((now, 0)),
            None if line == format!("1{code}") => changes.push((now, 1)),
            None => {}
        }
    }
    let level = |at: u64| {
        changes
            .iter()
            .rev()
            .find(|own| own.0 <= at)
            .map_or(1, |own| own.1)
    };
    let mut octets = Vec::new();
    let mut free = 0;
    for &(at, start) in &changes {
        if start == 1 || at < free {
            continue;
        }
        let bits: Vec<u8> = (0..11)
            .map(|place| level(at + place * bit + bit / 2))
            .collect();
        let octet = (0..8).map(|place| bits[1 + place] << place).sum();
        let ones: u8 = bits[1..10].iter().sum();
        assert_eq!(
            (bits[0], ones % 2, bits[10]),
            (0, 0, 1),
            "octet {octet:02X} at {at}"
        );
        octets.push(octet);
        free = at + 21 * bit / 2;
    }
    octets
}

/// Every station has a wire, on which its octets stand with even parity; a parity error is a wrong parity bit.
#[test]
fn a_line_is_drawn_for_logic_analysers() {
    for (rate, bit) in [("", 200), ("rate 9.6\n", 10_416)] {
        let talk = format!(
            "title Drawn\nsource nordac EN 1 FCB\nbus nordac\n{rate}slave 8\n\n> 10 08 02 49 53 16\n< 10 02 08 00 0A 16\n"
        );
        let path = file("drawn.scn");
        std::fs::write(&path, &talk).expect("room");
        let dump = ended(&drivebench(&["trace", plain(&path), "--format", "vcd"]), 0);
        assert_eq!(
            drawn(&dump, "master_line", bit),
            [0x10, 8, 2, 0x49, 0x53, 0x16],
            "{rate}"
        );
        assert_eq!(
            drawn(&dump, "drive_8_line", bit),
            [0x10, 2, 8, 0, 0x0A, 0x16],
            "{rate}"
        );
        assert!(dump.contains("drive_8_byte") && !dump.contains("_state"));
        let lines = ended(
            &drivebench(&["trace", plain(&path), "--format", "vcd", "--lines-only"]),
            0,
        );
        assert!(!lines.contains("_byte"));
    }
}

/// A slave is accused of what no right one does, and of nothing else.
#[test]
fn telegrams_of_a_capture_are_judged() {
    let talk = "title Judged\nsource nordac 3.2.1\nbus nordac\nslave 8\n\nstart 8\nread 8 1202\nexchange 8 STW=047E\n";
    let [_, right] = captured("telegrams-right", talk);
    let said = ended(&drivebench(&["import", plain(&right)]), 0);
    assert!(
        said.contains("passed") && said.contains("replies compared"),
        "{said}"
    );
    let wrong = talk.replace("slave 8\n", "slave 8\nslave 8 deviates hides-prm-req\n");
    let [_, wrong] = captured("telegrams-wrong", &wrong);
    let said = ended(&drivebench(&["import", plain(&wrong)]), 1);
    assert!(
        said.contains("slave 8: Slave_Diag: Prm_Req and the address of a master contradict each other (NORDAC EN 2)"),
        "{said}"
    );
    // What a setup says would be ignored.
    let [path, right] = captured("telegrams-with-setup", talk);
    let refused = drivebench(&["import", plain(&right), "--setup", plain(&path)]);
    let said = ended(&refused, 2);
    assert!(said.contains("--setup changes nothing"), "{said}");
}

/// A scenario made of a capture plays as the run that was captured, faults of the line included.
#[test]
fn a_scenario_is_made_of_a_capture() {
    let [path, capture] = captured("telegrams-replayed", EVERY_KIND);
    let again = file("telegrams-again.scn");
    let made = drivebench(&[
        "import",
        "--scenario",
        plain(&capture),
        "--setup",
        plain(&path),
        "-o",
        plain(&again),
    ]);
    ended(&made, 0);
    ended(&drivebench(&["run", plain(&again)]), 0);
    let same = drivebench(&["diff", plain(&capture), plain(&again)]);
    assert!(ended(&same, 0).contains("the same: "));
    // Without --setup the slaves are those that sent; the inverter is not controlled by the bus then.
    let alone = ended(&drivebench(&["import", "--scenario", plain(&capture)]), 0);
    assert!(
        alone.contains("slave 8 ppo 1\nslave 9 ppo 4\n")
            && alone.contains("! slave 8 byte 8: drop\n! master byte 21: flip p\n"),
        "{alone}"
    );
}

/// The rows that tshark prints of a capture, with these fields.
fn dissected(capture: &Path, options: &[&str], fields: &[&str]) -> Vec<String> {
    // Two tests that ran at once wrote one file, and tshark read it half written.
    let script = capture.with_extension("lua");
    let dissector = ended(&drivebench(&["dissector", "--bus", "nordac"]), 0);
    std::fs::write(&script, dissector).expect("room");
    let mut command = Command::new("tshark");
    let script = format!("lua_script:{}", plain(&script));
    command.args(["-X", &script, "-d", "rtacser.data,nordac"]);
    command.args(["-r", plain(capture), "-T", "fields", "-E", "separator=|"]);
    command.args(options);
    command.args(fields.iter().flat_map(|field| ["-e", field]));
    let output = command.output().expect("it is there");
    let rows = said(&output);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && !rows.contains("Lua Error") && !errors.contains("Lua:"),
        "{rows}{errors}"
    );
    rows.lines().map(str::to_owned).collect()
}

/// The dissector says of every telegram what the table says, and its fields have the values.
#[test]
fn tshark_reads_telegrams() {
    if !has("tshark", "telegrams of NORDAC inverters") {
        return;
    }
    let [path, capture] = captured("telegrams-dissected", EVERY_KIND);
    let rows = dissected(&capture, &[], &["nordac.service", "nordac.meaning"]);
    let csv = ended(&drivebench(&["trace", plain(&path), "--format", "csv"]), 0);
    let said = csv.lines().skip(1).map(|line| {
        let (_, words) = line.split_once('"').expect("a service");
        let words = words.strip_suffix('"').expect("a meaning");
        words.replace("\",\"", "|")
    });
    let said: Vec<String> = said.collect();
    for (row, said) in rows.iter().zip(&said) {
        assert_eq!(row, said);
    }
    assert_eq!(rows.len(), said.len());
    let shown = [
        "nordac.stw.on",
        "nordac.zsw.start_disable",
        "nordac.hsw",
        "nordac.ppo",
        "nordac.pkw.parameter",
        "nordac.pkw.value",
        "nordac.pkw.error",
    ];
    let find = |filter: &str| dissected(&capture, &["-Y", filter], &shown);
    assert_eq!(
        find("nordac.stw && nordac.da == 8")[..2],
        ["0||0|1|||", "1||50|1|||"]
    );
    assert_eq!(find("nordac.stw && nordac.da == 9"), ["0||-12.5|4|||"]);
    assert_eq!(find("nordac.zsw && nordac.sa == 9"), ["|1||4|||"]);
    assert_eq!(find("nordac.pkw.error == 2")[0], "|0||1|1202||2");
    let value = find("nordac.pkw.parameter == 1205 && nordac.pkw.answer");
    assert_eq!(value[0], "|0||1|1205|500 (50.0 Hz)|");
    let marked = |expert: &str| dissected(&capture, &["-Y", expert], &["_ws.col.Info"]).len();
    let counts = [
        ("nordac.bad_fcs", 2),
        ("nordac.bad_status", 1),
        ("nordac.no_telegram", 2),
        ("nordac.repeated", 1),
        ("nordac.refused", 7),
    ];
    for (expert, count) in counts {
        assert_eq!(marked(expert), count, "{expert}");
    }
}

/// Without a Chk_Cfg 12 bytes are PPO1 where they begin with a parameter channel that can be one, and else PPO4; a preference decides too.
#[test]
fn tshark_tells_ppo_types_of_one_length_apart() {
    if !has("tshark", "PPO types of NORDAC inverters") {
        return;
    }
    let refused = "< 10 02 08 03 0D 16\n";
    let one = "> 68 0F 0F 68 08 02 5D 14 B2 00 00 00 00 00 00 04 7F 20 00 D0 16\n";
    let four = "> 68 0F 0F 68 08 02 7D 04 7F 20 00 00 00 00 00 00 00 00 00 2A 16\n";
    let scenario = format!(
        "title   Early\nsource  nordac 3.1\nbus     nordac\nslave 8\n\n{one}{refused}{four}{refused}"
    );
    let [_, capture] = captured("telegrams-early", &scenario);
    let fields = ["nordac.ppo", "nordac.hsw", "nordac.pkw.parameter"];
    let only = ["-Y", "nordac.stw"];
    assert_eq!(dissected(&capture, &only, &fields), ["1|50|1202", "4|50|"]);
    let four = [only.as_slice(), &["-o", "nordac.ppo:4"]].concat();
    assert_eq!(dissected(&capture, &four, &fields), ["4|0|", "4|50|"]);
}

/// A request and its reply in one packet, as an adapter gives them: both are shown where the interface is no station's.
#[test]
fn tshark_reads_several_telegrams_of_a_packet() {
    if !has("tshark", "telegrams of one packet") {
        return;
    }
    let status = [
        0x10, 0x08, 0x02, 0x49, 0x53, 0x16, 0x10, 0x02, 0x08, 0x00, 0x0A, 0x16,
    ];
    let mut bytes = [
        0xA1B2_C3D4_u32,
        0x0004_0002,
        0,
        0,
        0xFFFF,
        250,
        1,
        0,
        24,
        24,
    ]
    .map(u32::to_le_bytes)
    .concat();
    bytes.extend([0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
    bytes.extend(status);
    let path = file("telegrams-together.pcap");
    std::fs::write(&path, bytes).expect("room");
    let fields = ["nordac.service", "nordac.meaning", "nordac.sa"];
    assert_eq!(
        dissected(&path, &[], &fields),
        ["FDL status,FDL status|,OK|2,8"]
    );
    let said = ended(&drivebench(&["import", plain(&path), "--link", "bus"]), 0);
    assert!(said.contains("1 of 1 reply compared"), "{said}");
}
