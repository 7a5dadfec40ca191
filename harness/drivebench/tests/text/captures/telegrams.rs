//! A PROFIBUS line as a value change dump, which logic analysers read.

use super::{ended, file, plain};
use crate::typed::drivebench;

/// The octets that a wire of a value change dump carries, 8E1, by the levels in the middle of each bit.
fn drawn(dump: &str, wire: &str, bit: u64) -> Vec<u8> {
    let code = dump
        .lines()
        .find_map(|line| line.strip_suffix(&format!(" {wire} $end")));
    let code = code.and_then(|row| row.rsplit(' ').next()).expect("a wire");
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
            .find(|change| change.0 <= at)
            .map_or(1, |change| change.1)
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
