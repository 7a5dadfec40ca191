//! What we write, read by programs that we did not write: sigrok-cli and tshark.

use super::{DAMAGED, built_in, file, pcapng, root, run, status, written};
use crate::debian::has;
use harness::capture::{Capture, read};
use harness::report::vcd::Signals;
use harness::shown::FileForm;
use std::collections::BTreeMap;
use std::process::Command;

/// What a program prints; `None` where it is not installed.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    if !has(program, "what it reads of captures") {
        return None;
    }
    let output = Command::new(program).args(arguments).output();
    let output = output.expect("it is there");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}: {errors}");
    assert!(
        !text.contains("Lua Error") && !errors.contains("Lua:"),
        "{text}{errors}"
    );
    Some(text)
}

/// sigrok reads our VCD and writes it again as VCD and as csv: both are read back as the same bytes.
#[test]
fn what_sigrok_writes_is_read() {
    let capture = built_in("10.1-read-byte");
    let lines = written(&capture, FileForm::Vcd(Signals::Lines), "");
    let ours = file("sigrok.vcd");
    std::fs::write(&ours, &lines).expect("room");
    for form in ["vcd", "csv"] {
        let arguments = [
            "-i",
            ours.to_str().expect("a name"),
            "-I",
            "vcd",
            "-O",
            form,
        ];
        let Some(text) = output("sigrok-cli", &arguments) else {
            return;
        };
        let again = read(text.as_bytes(), None).unwrap_or_else(|error| panic!("{form}: {error}"));
        let received = |capture: &Capture| -> Vec<Vec<Option<u8>>> {
            let links = capture.traces.iter().flat_map(|trace| &trace.channels);
            links
                .map(|channel| {
                    channel
                        .octets()
                        .iter()
                        .map(|octet| octet.received)
                        .collect()
                })
                .collect()
        };
        assert_eq!(received(&again), received(&capture), "{form}");
        assert_eq!(again.rate, capture.rate);
    }
}

/// Bytes and what is wrong with them, as sigrok's decoder says for one line.
fn decoded(path: &str, line: &str) -> Option<Vec<(u8, &'static str)>> {
    let decoder = format!("uart:rx={line}:baudrate=38400:parity=odd");
    let text = output(
        "sigrok-cli",
        &[
            "-i",
            path,
            "-I",
            "vcd",
            "-P",
            &decoder,
            "-A",
            "uart=rx-data:rx-parity-err:rx-warnings:rx-break",
        ],
    )?;
    let mut read: Vec<(u8, &'static str)> = Vec::new();
    for line in text.lines() {
        let what = line
            .split_once(": ")
            .map_or("", |(_, what)| what)
            .trim_matches('"');
        match what {
            "Parity error" => read.last_mut().expect("a byte").1 = "parity",
            "Frame error" => read.last_mut().expect("a byte").1 = "framing",
            "Break condition" => read.last_mut().expect("a byte").1 = "break",
            byte if byte.len() == 2 => {
                read.extend(u8::from_str_radix(byte, 16).ok().map(|byte| (byte, "ok")));
            }
            _ => {}
        }
    }
    Some(read)
}

#[test]
fn sigrok_reads_the_lines() {
    let small = "title s\nring 3\n! 2->1 byte 4: flip 1\n> 88 FE C0 13 FE D1\n> 80*30\n";
    let captures = [
        ("damaged", run(DAMAGED)),
        ("small", run(small)),
        ("recovered", built_in("9.8-two-check-sequences")),
    ];
    for (name, capture) in captures {
        let path = file(&format!("{name}.vcd"));
        let dump = written(&capture, FileForm::Vcd(Signals::Lines), "");
        std::fs::write(&path, dump).expect("a file");
        // Of a large ring some links are enough.
        let links = &capture.traces[0].channels;
        for link in links.iter().step_by(links.len().div_ceil(8)) {
            let end = |end: Option<u8>| end.map_or("master".to_owned(), |drive| drive.to_string());
            let line = format!("{}_to_{}_line", end(link.from), end(link.to));
            let Some(read) = decoded(path.to_str().expect("a plain path"), &line) else {
                return;
            };
            let expected: Vec<_> = link
                .octets()
                .iter()
                .filter_map(|byte| {
                    // A line does not show that its receiver was slow.
                    let seen = if status(byte) == "overrun" {
                        "ok"
                    } else {
                        status(byte)
                    };
                    Some((byte.received?, seen))
                })
                .collect();
            assert_eq!(read, expected, "{name} {line}");
        }
    }
}

const FIELDS: [&str; 8] = [
    "frame.time_epoch",
    "novobus.link",
    "novobus.number",
    "novobus.byte",
    "novobus.status",
    "novobus.role",
    "novobus.drive",
    "novobus.cell",
];

/// The fields of the dissector, a row a packet.
fn dissected(name: &str, capture: &Capture) -> Option<Vec<String>> {
    let path = file(&format!("{name}.pcapng"));
    std::fs::write(&path, pcapng(capture)).expect("a file");
    let script = root().join("harness/novobus/src/report/novobus.lua");
    let script = format!("lua_script:{}", script.display());
    let path = path.to_str().expect("a plain path");
    let mut arguments = vec![
        "-r",
        path,
        "-X",
        &script,
        "-d",
        "rtacser.data,novobus",
        "-t",
        "e",
        "-T",
        "fields",
        "-E",
        "separator=,",
    ];
    arguments.extend(FIELDS.iter().flat_map(|field| ["-e", field]));
    let text = output("tshark", &arguments)?;
    // Where nothing arrived there is no byte for a dissector.
    let arrived = text.lines().filter(|row| !row.ends_with(",,,,,,,"));
    Some(arrived.map(str::to_owned).collect())
}

/// The same rows from our own reading; a capture that was read back has no marks, as the dissector has none.
fn our_rows(capture: &Capture) -> Vec<String> {
    let capture = read(&pcapng(capture), None).expect("a capture");
    let rows = written(&capture, FileForm::Csv, "");
    let text = String::from_utf8(rows).expect("text");
    let mut ours = Vec::new();
    let mut lost: BTreeMap<String, usize> = BTreeMap::new();
    for row in text.lines().skip(1) {
        let mut columns: Vec<&str> = row.split(',').collect();
        let nanos: u64 = columns[1].parse().expect("a time");
        let at = format!("{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
        let byte = match columns[5] {
            "" => String::new(),
            byte => format!("0x{}", byte.to_lowercase()),
        };
        let cell = columns.split_off(9).join(",");
        let cell = cell
            .split_once(" of ")
            .and_then(|(_, rest)| rest.get(..4))
            .filter(|cell| cell.chars().all(|c| c.is_ascii_hexdigit()))
            .map_or_else(String::new, |cell| format!("0x{}", cell.to_lowercase()));
        let (link, status, role, drive) = (columns[2], columns[6], columns[7], columns[8]);
        let lost = lost.entry(link.to_owned()).or_default();
        if status == "dropped" {
            *lost += 1;
            continue;
        }
        let number = columns[3].parse::<usize>().expect("a number") - *lost;
        ours.push(format!(
            "{at},{link},{number},{byte},{status},{role},{drive},{cell}"
        ));
    }
    ours
}

#[test]
fn tshark_reads_packets_and_telegrams() {
    let captures = [
        ("tshark-damaged", run(DAMAGED)),
        ("tshark-parity", built_in("9.7-parity-error")),
        ("tshark-check", built_in("9.8-check-sequence")),
        ("tshark-commands", built_in("10.1-read-word-wrong")),
        ("tshark-writes", built_in("10.2-write-word")),
        ("tshark-short", built_in("9.2-next-drive")),
    ];
    for (name, capture) in captures {
        let Some(rows) = dissected(name, &capture) else {
            return;
        };
        let ours = our_rows(&capture);
        let first = rows
            .iter()
            .zip(&ours)
            .position(|(theirs, ours)| theirs != ours);
        let shown = first.map(|place| (&rows[place], &ours[place]));
        assert_eq!((shown, rows.len()), (None, ours.len()), "{name}");
    }
}
