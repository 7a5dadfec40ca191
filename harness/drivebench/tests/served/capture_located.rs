//! `capture` at a ring of 100 drives with a fault between drives 98 and 97 (the figures of ND21 9.7 and 9.8).

use crate::capture::{Listener, port, send};
use crate::program::{Desk, ended, name};
use rustix::fd::OwnedFd;
use rustix::process::Signal;

const LINKS: [&str; 3] = ["master->99", "98->97", "0->master"];

/// What the links carry from the fault to the repeated telegrams, as PARMRK gives it.
fn carried(desk: &Desk) -> [Vec<u8>; 3] {
    let trace = desk.run(&["trace", "9.8-check-sequence", "--format", "csv"]);
    let text = String::from_utf8(trace.stdout).expect("a text");
    LINKS.map(|link| {
        let rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
        let rows = rows.filter(|row| row.get(2) == Some(&link));
        rows.flat_map(|row| {
            let byte = u8::from_str_radix(row[5], 16).expect("a byte");
            match (row[6], byte) {
                ("ok", 0xFF) => vec![0xFF, 0xFF],
                ("ok", _) => vec![byte],
                _ => vec![0xFF, 0, byte],
            }
        })
        .collect()
    })
}

/// A capture of the three links with these options.
fn capture(desk: &Desk, options: &[&str]) -> (Listener, Vec<OwnedFd>) {
    let (far, taps): (Vec<_>, Vec<_>) = LINKS
        .iter()
        .map(|link| {
            let (far, path) = port();
            (far, format!("{link}={}", name(&path)))
        })
        .unzip();
    let mut all = vec!["capture", "--in-band"];
    all.extend(taps.iter().flat_map(|tap| ["--tap", tap.as_str()]));
    all.extend(options);
    (Listener::start(desk.command(&all)), far)
}

/// A capture ends where the ring has spelled out the drive behind the damaged cable. What comes of the zeros of the check sequence, 62, names no drive.
#[test]
fn it_ends_when_the_fault_is_located() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let (listener, far) = capture(&desk, &["--until", "located", "-o", "until.pcapng"]);
    for (far, bytes) in far.iter().zip(carried(&desk)) {
        send(far, &bytes);
    }
    let (_, said) = listener.end();
    let cable = "located: drive 97 saw a fault first: the fault is on the cable between drive 98 and drive 97";
    assert!(said.contains(cable), "{said}");
    assert!(!said.contains("drive 98 saw"), "{said}");
}

/// The files of one capture, joined, hold every byte.
#[test]
fn its_files_are_joined() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let options = ["--size", "1000", "--files", "90", "-o", "ring.pcapng"];
    let (mut listener, far) = capture(&desk, &options);
    for (link, (far, bytes)) in LINKS.iter().zip(far.iter().zip(carried(&desk))) {
        let (front, end) = bytes.split_at(bytes.len() / 2);
        send(far, front);
        // Each file begins between two reads.
        listener.hears(link);
        send(far, end);
    }
    listener.hears("0->master 88 63 C0 13 88 A5");
    listener.signal(Signal::TERM);
    let (_, said) = listener.end();
    let files: Vec<String> = (1..90)
        .map(|number| format!("ring_{number:05}.pcapng"))
        .take_while(|file| desk.path(file).exists())
        .collect();
    assert!(files.len() > 2, "{said}");
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let joined = desk.run(&[&["import"], &files[..]].concat());
    let text = String::from_utf8(joined.stdout.clone()).expect("a text");
    assert!(text.contains("231 bytes on 3 links"), "{text}");
    let alone = desk.run(&["import", files[0]]);
    assert!(!String::from_utf8_lossy(&alone.stdout).contains("231 bytes"));
    let twice = desk.run(&["import", files[0], files[0]]);
    ended(&twice, 2, "is given twice");
}

/// A pseudo terminal behind a link that stays when it goes, as udev's names do.
fn plugged(link: &std::path::Path) -> OwnedFd {
    let (far, path) = port();
    let _gone = std::fs::remove_file(link);
    std::os::unix::fs::symlink(path, link).expect("a link");
    far
}

/// A serial adapter that comes back is taken up again.
#[test]
fn an_adapter_that_comes_back_is_heard() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let link = desk.path("adapter");
    let far = plugged(&link);
    let tap = format!("0->master={}", name(&link));
    let arguments = ["capture", "--tap", &tap, "-o", "back.pcapng"];
    let mut listener = Listener::start(desk.command(&arguments));
    send(&far, &[0x42]);
    listener.hears("0->master 42");
    drop(far);
    listener.hears("0->master the adapter was pulled out");
    let far = plugged(&link);
    listener.hears("0->master the adapter is back");
    send(&far, &[0x43]);
    listener.hears("0->master 43");
    listener.signal(Signal::TERM);
    let (_, said) = listener.end();
    assert!(said.contains("2 bytes, 0 damaged"), "{said}");
}

/// Nothing is kept before the line of `--trigger`; with it come the bytes in front of it. The point of a line's time is no text of it.
#[test]
fn a_trigger_begins_the_file() {
    let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
    let cases = [
        ("43", &[0x42][..], 0),
        (".", &[0x42], 0),
        ("43", &[0x42, 0x43], 2),
    ];
    for (trigger, sent, kept) in cases {
        let (far, path) = port();
        let tap = format!("0->master={}", name(&path));
        let arguments = [
            "capture",
            "--tap",
            &tap,
            "--trigger",
            trigger,
            "-o",
            "t.pcapng",
        ];
        let mut listener = Listener::start(desk.command(&arguments));
        send(&far, sent);
        listener.hears(if kept > 0 { " 43" } else { " 42" });
        listener.signal(Signal::TERM);
        let (_, said) = listener.end();
        assert!(said.contains("not judged"), "{said}");
        let file = std::fs::read(desk.path("t.pcapng")).expect("a file");
        // Packets of a byte (link type 250) are blocks of type 6.
        let (mut rest, mut packets) = (&file[..], 0);
        while let [k0, k1, k2, k3, l0, l1, l2, l3, ..] = *rest {
            packets += u32::from(u32::from_le_bytes([k0, k1, k2, k3]) == 6);
            rest = &rest[u32::from_le_bytes([l0, l1, l2, l3]) as usize..];
        }
        assert_eq!(packets, kept, "{said}");
    }
}
