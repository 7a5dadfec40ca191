//! Captures in which no drive says anything: of every bus and many formats, none of them passes.

use super::file;
use std::process::Command;

/// A name, contents, and the exit code of `import`: 5 where nothing was compared, 2 where the file is no capture or names no drive.
fn files() -> Vec<(&'static str, Vec<u8>, i32)> {
    let asc = "date Mon Jan 1 00:00:00 2024\nbase hex  timestamps absolute\n";
    let block = |kind: u32, body: &[u8]| {
        let length = u32::try_from(body.len() + 12)
            .expect("a short block")
            .to_le_bytes();
        [&kind.to_le_bytes()[..], &length, body, &length].concat()
    };
    let section = block(
        0x0A0D_0D0A,
        &[
            0x4D, 0x3C, 0x2B, 0x1A, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255,
        ],
    );
    let pcapng = |packet: &[u8]| {
        let interface = block(1, &[227, 0, 0, 0, 255, 255, 0, 0]);
        let size = u32::try_from(packet.len())
            .expect("a short packet")
            .to_le_bytes();
        let padding = vec![0; packet.len().next_multiple_of(4) - packet.len()];
        let packet = [&[0; 12][..], &size, &size, packet, &padding].concat();
        [section.clone(), interface, block(6, &packet)].concat()
    };
    let pcap = |link: u8| {
        let mut header = vec![0; 24];
        header[..8].copy_from_slice(&[0xD4, 0xC3, 0xB2, 0xA1, 2, 0, 4, 0]);
        (header[16], header[20]) = (0xFF, link);
        header
    };
    let text = |text: &str| text.as_bytes().to_vec();
    vec![
        ("nothing.log", Vec::new(), 2),
        ("line.log", text("\n"), 2),
        ("zeros.log", vec![0; 512], 2),
        ("comment.log", text("# candump\n"), 2),
        (
            "errors.log",
            text("(1.0) can0 20000088#0000000000000000\n"),
            5,
        ),
        (
            "others.log",
            text("(1.0) can0 700#05\n(1.1) can0 00000201#3DE200\n"),
            2,
        ),
        ("header.asc", text(asc), 5),
        ("errors.asc", text(&format!("{asc}1.1 1  ErrorFrame\n")), 5),
        (
            "others.asc",
            text(&format!("{asc}1.1 1  700  Rx  d 1 05\n")),
            2,
        ),
        (
            "header.trc",
            text(";$FILEVERSION=2.0\n;$STARTTIME=45000.5\n;$COLUMNS=N,O,T,I,d,l,D\n"),
            5,
        ),
        (
            "header.csv",
            text("t_ns,from,id,remote,dlc,data,ended\n"),
            5,
        ),
        (
            "gvret.csv",
            text("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"),
            5,
        ),
        ("frames.json", text(r#"{"schema":2,"frames":[]}"#), 5),
        (
            "ring.json",
            text(
                r#"{"schema":1,"ring":1,"links":[{"from":"master","to":"0","bytes":[]}],"marks":[]}"#,
            ),
            5,
        ),
        ("section.pcapng", section.clone(), 2),
        (
            "errors.pcapng",
            pcapng(&[0x20, 0, 0, 0x88, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
            5,
        ),
        ("others.pcapng", pcapng(&[0, 0, 7, 0, 1, 0, 0, 0, 5]), 2),
        ("can.pcap", pcap(227), 5),
        ("any.pcap", pcap(113), 5),
        ("octets.pcap", pcap(147), 5),
        ("serial.pcap", pcap(250), 5),
        ("levels.csv", text("Time [s],Channel 0\n0.0,1\n"), 2),
        (
            "levels.vcd",
            text(
                "$timescale 1us $end\n$var wire 1 ! TX $end\n$enddefinitions $end\n#0\n1!\n#100000\n",
            ),
            2,
        ),
    ]
}

#[test]
fn no_empty_capture_passes() {
    for (name, bytes, expected) in files() {
        let path = file(name);
        std::fs::write(&path, bytes).expect("room");
        let links: &[&str] = match name.split_once('.') {
            Some(("octets" | "serial" | "levels", _)) => &["--link=bus", "--link=0->master"],
            _ => &[""],
        };
        for link in links {
            let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
            command.arg("import").arg(&path);
            command.args(Some(link).filter(|own| !own.is_empty()));
            let output = command.output().expect("the program");
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(expected), "{name} {link} {said}");
        }
    }
}
