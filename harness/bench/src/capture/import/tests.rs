//! Files as other programs write them, typed by what their documents say.

use super::super::{Capture, read_with};
use super::*;
use crate::report::pcapng::name;
use harness_proto::line::{LineError, Parity, Rate};
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::fmt::Write as _;

pub(super) fn settings(links: &[&str]) -> ReadSettings {
    let links = links.iter().map(|link| link.parse().expect("a link"));
    ReadSettings {
        links: links.collect(),
        ..ReadSettings::default()
    }
}

fn with_uart(links: &[&str], uart: &str) -> ReadSettings {
    ReadSettings {
        uart: Some(uart.parse().expect("a format")),
        ..settings(links)
    }
}

fn imported(file: impl AsRef<[u8]>, settings: &ReadSettings) -> ImportedCapture {
    read_with(file.as_ref(), settings).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(file: impl AsRef<[u8]>, settings: &ReadSettings) -> String {
    read_with(file.as_ref(), settings)
        .expect_err("refused")
        .to_string()
}

fn shared(trace: &Trace) -> bool {
    let mut channels = trace.channels.iter();
    channels.any(|channel| channel.from.is_none() && channel.to.is_none())
}

/// What channels carried: `98->97: 88 FE! ...`, with `!` after a damaged octet.
fn shown(capture: &Capture) -> String {
    let mut text = String::new();
    for (ring, trace) in capture.traces.iter().enumerate() {
        for channel in &trace.channels {
            let _infallible = match (channel.from, channel.to) {
                (from, None) if shared(trace) => write!(text, "{from:?}:"),
                _ => write!(text, "{}:", name(ring, channel)),
            };
            for octet in channel.octets() {
                let mark = match octet.error {
                    None => "",
                    Some(LineError::Parity) => "p",
                    Some(LineError::Framing) => "f",
                    Some(LineError::Break) => "b",
                    Some(LineError::Overrun) => "o",
                };
                let byte = octet.received.unwrap_or_default();
                let _infallible = write!(text, " {byte:02X}{mark}");
            }
            for frame in channel.frames() {
                let _infallible = write!(text, " {}", frame.frame);
            }
            text.push('\n');
        }
    }
    text
}

/// The changes of a line that carries octets at these bit times: time in bits, level.
pub(super) fn drawn(octets: &[u8], parity: Parity, gap: u64) -> Vec<(u64, bool)> {
    let mut changes = vec![(0, true)];
    let mut at = 20;
    for byte in octets {
        let odd = byte.count_ones() % 2 == 0;
        let mut bits: Vec<bool> = vec![false];
        bits.extend((0..8).map(|bit| byte >> bit & 1 == 1));
        match parity {
            Parity::None => {}
            Parity::Odd => bits.push(odd),
            Parity::Even => bits.push(!odd),
        }
        bits.push(true);
        for bit in bits {
            if changes.last().is_some_and(|(_, last)| *last != bit) {
                changes.push((at, bit));
            }
            at += 1;
        }
        at += gap;
    }
    changes
}

/// Octets with every number of ones, in an order in which both parities occur.
pub(super) fn many() -> Vec<u8> {
    (0..200_u32).map(|place| (place * 73 % 256) as u8).collect()
}

fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!(" {octet:02X}")).collect()
}

/// A digital.csv of Logic 2 with one channel.
pub(super) fn digital(changes: &[(u64, bool)], rate: f64) -> String {
    let mut text = "Time [s],Line\n".to_owned();
    for (bits, level) in changes {
        let _infallible = writeln!(text, "{:.12},{}", *bits as f64 / rate, u8::from(*level));
    }
    text
}

#[test]
fn levels_become_octets_at_every_rate_of_a_ring() {
    for rate in Rate::ALL {
        for inverted in [false, true] {
            let changes = drawn(&many(), Parity::Odd, 3);
            let changes: Vec<_> = changes
                .iter()
                .map(|(at, level)| (*at, *level != inverted))
                .collect();
            let file = digital(&changes, f64::from(rate.bits_per_second()));
            let found = imported(&file, &settings(&["1->0=Line"]));
            assert_eq!(shown(&found.capture), format!("1->0:{}\n", hex(&many())));
            assert_eq!(found.capture.rate, rate);
            let word = if inverted { " inverted" } else { "" };
            let bits = rate.bits_per_second();
            assert!(
                found.notes[0].starts_with(&format!("the line is {bits} 8O1{word} with 0 of")),
                "{:?}",
                found.notes
            );
        }
    }
}

/// The parity is that of the bus: octets of a station with another one are damaged.
#[test]
fn another_parity_is_not_taken_for_right() {
    let file = digital(&drawn(&many(), Parity::Even, 3), 38_400.0);
    let found = imported(&file, &settings(&["1->0=Line"]));
    let octets = found.capture.traces[0].channels[0].octets();
    let damaged = octets.iter().filter(|octet| octet.error.is_some()).count();
    assert_eq!((octets.len(), damaged), (200, 200));
    assert!(
        found.notes[0].contains("explains it better: 38400 8E1 with 0 of 200"),
        "{:?}",
        found.notes
    );
    let given = imported(&file, &with_uart(&["1->0=Line"], "38400 8E1"));
    assert_eq!(shown(&given.capture), format!("1->0:{}\n", hex(&many())));
    // Half of the rate of the line fits no format.
    let file = digital(&drawn(&many(), Parity::Odd, 0), 31_250.0);
    let words = refused(&file, &settings(&["1->0=Line"]));
    assert!(
        words.contains("no format of the bus fits the line"),
        "{words}"
    );
    assert!(words.contains("--uart"), "{words}");
}

/// A bad stop bit, a break of twelve bits, a pulse that is no start bit, and a part that was not recorded.
#[test]
fn what_a_receiver_sees() {
    let file = "Time [s],1->0\n0,1\n0.001,0\n0.002,1\n0.030,0\n0.0301,1\n0.040,0\n0.043,X\n0.05,1\n0.060,0\n0.061,1\n";
    let found = imported(file, &with_uart(&[], "1000 8N1"));
    assert_eq!(shown(&found.capture), "1->0: FF FF\n");
    let low = "Time [s],1->0\n0,1\n0.001,0\n0.013,1\n0.020,0\n0.023,1\n0.029,0\n0.0308,1\n0.05,1\n";
    let found = imported(low, &with_uart(&[], "1000 8N1"));
    assert_eq!(shown(&found.capture), "1->0: 00b FCf\n");
    let at = found.capture.traces[0].channels[0].octets()[1].at;
    assert_eq!(at, Instant::START + Span::from_millis(30));
}

#[test]
fn vcd_of_any_writer() {
    // One line, no $dumpvars, a fractional time, an identifier of two names, vectors, reals, comments, and an end within a number.
    let mut text = "$comment made by hand $end $timescale 1 us $end $scope module top $end $var wire 1 ! tx $end $var wire 1 ! alias $end \
                    $var wire 8 % bus $end $var real 64 & volts $end $upscope $end $enddefinitions $end #0 1! bx % r1.5 & "
        .to_owned();
    for (bits, level) in drawn(&[0x88, 0xFE, 0x01], Parity::Odd, 2) {
        let us = (bits + 1) as f64 / 0.0096;
        let _infallible = write!(text, "#{us:.3} b{}  ! $comment x $end ", u8::from(level));
    }
    text.push_str("#99999 #12");
    for name in ["tx", "alias", "top.alias"] {
        let found = imported(&text, &settings(&[&format!("master->1={name}")]));
        assert_eq!(shown(&found.capture), "master->1: 88 FE 01\n", "{name}");
        assert!(found.notes[0].contains("ends in the middle of `#12`"));
    }
    let words = refused(&text, &settings(&[]));
    assert!(words.contains("none of `tx` is named as a link"), "{words}");
    for (file, expected) in [
        ("$timescale 3 ns $end", "a time scale of `3ns`"),
        ("$var wire 1 ! a $end", "`$enddefinitions` is expected"),
        (
            "$enddefinitions $end #5 #3 ",
            "before the one in front of it",
        ),
        (
            "$var wire 1 ! a $end $enddefinitions $end #x 1!",
            "`#x` is no time",
        ),
        (
            "$var wire 1 ! a $end $enddefinitions $end #0 7! ",
            "`7` is no level",
        ),
    ] {
        let words = refused(file, &settings(&[]));
        assert!(words.contains(expected), "{file}: {words}");
    }
}

/// `libsigrok` writes all values of a time on one line (0.5.2).
#[test]
fn vcd_of_sigrok() {
    let mut text = "META samplerate: 1000000\n$timescale 1 us $end\n$scope module libsigrok $end\n$var wire 1 ! 1->0 $end\n$var wire 1 \" B $end\n$upscope $end\n\
                    $enddefinitions $end\n#0 1! 0\"\n"
        .to_owned();
    for (bits, level) in drawn(&[0x12], Parity::Odd, 2) {
        let _infallible = writeln!(text, "#{} {}!", bits * 104 + 1, u8::from(level));
    }
    text.push_str("#9000\n");
    let found = imported(&text, &settings(&[]));
    assert_eq!(shown(&found.capture), "1->0: 12\n");
    assert!(found.notes[0].contains("1 channel not read: no link is named for `B`"));
}

/// The text of the analyser, in Logic 1 and Logic 2.
#[test]
fn octets_of_an_analyser() {
    let file = "Time [s],Value,Parity Error,Framing Error\r\n-0.001,0x88,,\r\n-0.000713542,0xFE,Error,\r\n0.0,0x00,,Error\r\n";
    let found = imported(file, &settings(&["98->97"]));
    assert_eq!(shown(&found.capture), "98->97: 88 FEp 00f\n");
    let octets = found.capture.traces[0].channels[0].octets();
    // The table has the time of the start bit.
    assert_eq!(octets[0].at, Instant::START + Span::from_nanos(286_458));
    assert_eq!(octets[2].at.since(octets[0].at), Span::from_millis(1));
    for (file, expected) in [
        (
            "Time [s],Value,Parity Error,Framing Error\n0,a,,\n",
            "export with radix Hex",
        ),
        (
            "Time [s],Value,Parity Error,Framing Error\n0,16,,\n",
            "export with radix Hex",
        ),
        (
            "Time [s],Value,Parity Error,Framing Error\n0,\"\n\",,\n",
            "export with radix Hex",
        ),
        (
            "Time [s],Value,Parity Error,Framing Error\n0,0x1,maybe,\n",
            "nothing or `Error`",
        ),
        (
            "Time [s],Value,Parity Error,Framing Error\n1,0x1,,\n0,0x1,,\n",
            "line 3: this octet is before",
        ),
        (
            "Time [s],Packet ID,Address,Data,Framing Error\n0,1,0x1,0x2,\n",
            "multiprocessor mode",
        ),
    ] {
        let words = refused(file, &settings(&["98->97"]));
        assert!(words.contains(expected), "{file}: {words}");
    }
}

/// The table of Logic 2: columns by name, several analysers, rows of other types, seconds or dates.
#[test]
fn a_table_of_octets() {
    let file = "name,type,start_time,duration,\"data\",\"error\"\n\
                \"98->97\",\"data\",0.001,0.000260417,0x88,\n\
                I2C,start,0.0011,0,,\n\
                \"97->96\",\"data\",0.0012,0.000260417,0xFE,\"parity\"\n";
    let found = imported(file, &settings(&[]));
    assert_eq!(shown(&found.capture), "98->97: 88\n97->96: FEp\n");
    assert!(found.notes[0].contains("1 row not read"));
    let dated = "data,start_time,type,duration\n0x12,2022-01-05T12:00:00.000+01:00,data,0\n0x13,2022-01-05T12:00:00.002+01:00,data,0\n";
    let found = imported(dated, &settings(&["1->0"]));
    assert_eq!(shown(&found.capture), "1->0: 12 13\n");
    let octets = found.capture.traces[0].channels[0].octets();
    assert_eq!(octets[1].at.since(octets[0].at), Span::from_millis(2));
    let ascii = "name,type,start_time,duration,\"data\"\nA,data,0.001,0.0002,\"\n\"\n";
    assert!(refused(ascii, &settings(&["1->0=A"])).contains("line 2: `data` is \"\\n\""));
    assert!(
        refused(file, &settings(&["1->0=B"]))
            .contains("no channel is named `B`; the file has `98->97`")
    );
}

pub(super) fn saleae(version: u32, parts: &[(u32, f64, f64, &[f64])]) -> Vec<u8> {
    let mut file = b"<SALEAE>".to_vec();
    file.extend(version.to_le_bytes());
    file.extend(0_u32.to_le_bytes());
    if version == 1 {
        file.extend((parts.len() as u64).to_le_bytes());
    }
    for (state, begin, end, times) in parts {
        file.extend(state.to_le_bytes());
        if version == 1 {
            file.extend(25e6_f64.to_le_bytes());
        }
        file.extend(begin.to_le_bytes());
        file.extend(end.to_le_bytes());
        file.extend((times.len() as u64).to_le_bytes());
        file.extend(times.iter().flat_map(|time| time.to_le_bytes()));
    }
    file
}

#[test]
fn binary_levels() {
    of_binary_levels(11);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn binary_levels_cut_anywhere() {
    of_binary_levels(1);
}

/// Files that are cut at every `step`-th place are refused.
fn of_binary_levels(step: usize) {
    let changes = drawn(&many(), Parity::Odd, 1);
    let times: Vec<f64> = changes[1..]
        .iter()
        .map(|(at, _)| *at as f64 / 19_200.0)
        .collect();
    for version in [0, 1] {
        let file = saleae(version, &[(1, 0.0, 1.0, &times)]);
        let found = imported(&file, &settings(&["0->master"]));
        assert_eq!(
            shown(&found.capture),
            format!("0->master:{}\n", hex(&many()))
        );
        assert_eq!(found.capture.rate, Rate::Baud19200);
        for length in (0..file.len()).step_by(step).chain([file.len() - 1]) {
            assert!(read_with(&file[..length], &settings(&["0->master"])).is_err());
        }
    }
    // Between two parts nothing was recorded: the octet that the first one ends in is not read.
    let parts = [
        (1, 0.0, 0.004, [0.001].as_slice()),
        (1, 0.02, 0.1, &[0.03, 0.031]),
    ];
    let found = imported(saleae(1, &parts), &with_uart(&["0->master"], "1000 8N1"));
    assert_eq!(shown(&found.capture), "0->master: FF\n");
    let wrong = saleae(0, &[(1, 0.0, 1.0, &[0.5, 0.4])]);
    assert!(refused(wrong, &settings(&["0->master"])).contains("before the one in front of it"));
    let wrong = saleae(0, &[(1, 0.0, f64::NAN, &[])]);
    assert!(
        refused(wrong, &settings(&["0->master"])).contains("NaN seconds are no time of a capture")
    );
}

/// The csv of libsigrok 0.5.2.
#[test]
fn samples_of_sigrok() {
    let mut text = "; CSV generated by libsigrok 0.5.2\n; from unknown on Mon Nov 23 16:04:20 2026\n; Channels (2/2): A, 1->0\n\
                    META samplerate: 96000\nlogic,logic\n"
        .to_owned();
    let changes = drawn(&[0x88, 0x01], Parity::Odd, 5);
    for sample in 0..600 {
        let now = changes.iter().rev().find(|(at, _)| *at * 10 <= sample);
        let level = now.is_none_or(|(_, level)| *level);
        let _infallible = writeln!(text, "0,{}", u8::from(level));
    }
    let found = imported(&text, &settings(&[]));
    assert_eq!(shown(&found.capture), "1->0: 88 01\n");
    assert_eq!(found.capture.rate, Rate::Baud9600);
    let without = text.replace("META samplerate: 96000\n", "");
    assert!(refused(&without, &settings(&[])).contains("--samples"));
    let given = ReadSettings {
        samples: Some(96_000),
        ..settings(&[])
    };
    assert_eq!(imported(&without, &given).capture, found.capture);
    let commented = text.replace("META samplerate: 96000", "; Samplerate: 96 kHz");
    assert_eq!(imported(&commented, &settings(&[])).capture, found.capture);
    let (head, _) = text.split_once("0,1\n").expect("rows");
    let left_out: String = (0..200).map(|row| format!("0,{}\n", row % 2)).collect();
    assert!(refused(format!("{head}{left_out}"), &settings(&[])).contains("dedup"));
}

/// PROFIBUS at one place of the line: the telegrams name their senders.
#[test]
fn a_line_that_stations_share() {
    let ask = [0x10, 8, 2, 0x49, 0x53, 0x16];
    let reply = [0x10, 2, 8, 0x00, 0x0A, 0x16];
    let mut changes = drawn(&ask, Parity::Even, 0);
    for (bits, level) in drawn(&reply, Parity::Even, 0).into_iter().skip(1) {
        changes.push((bits + 6 * 11 + 20, level));
    }
    let file = digital(&changes, 500_000.0);
    let found = imported(&file, &settings(&["bus=Line"]));
    let expected = "None: 10 08 02 49 53 16\nSome(8): 10 02 08 00 0A 16\n";
    assert_eq!(shown(&found.capture), expected);
    let words = refused(&file, &settings(&["98->96=Line"][..0]));
    assert!(words.contains("--link \"98->97=Line\""), "{words}");
    assert!("98->96=Line".parse::<NamedLink>().is_err());
}

/// Files of types that are not read are named.
#[test]
fn what_a_file_looks_like() {
    for (file, expected) in [
        (b"PK\x03\x04abc".as_slice(), "a zip archive"),
        (b"\x1F\x8B\x08", "gunzip"),
        (b"LOGG\x90", "BLF"),
        (b"timestamp,arbitration_id,ext", "can_logconvert FILE.csv"),
        (b"\xFF\xFET\0i\0", "UTF-16"),
        (
            b"hello world\nsecond",
            "text that begins with \"hello world\"",
        ),
        (b"\x00\x01\x02", "the bytes 00 01 02"),
        (b"", "it is empty"),
    ] {
        let words = refused(file, &settings(&[]));
        assert!(words.contains(expected), "{words}");
        assert!(words.contains("ASC (Vector)"), "{words}");
    }
    // The mark in front of UTF-8.
    let file = "\u{FEFF}Time [s],Value,Parity Error,Framing Error\n0,0x12,,\n";
    assert_eq!(
        shown(&imported(file, &settings(&["1->0"])).capture),
        "1->0: 12\n"
    );
}

/// A log as CANoe writes it, with hexadecimal and decimal numbers, absolute and relative times, a German heading.
#[test]
fn asc() {
    let log = "date Mit Nov 23 10:00:00.000 2026\nbase hex  timestamps absolute\nno internal events logged\n// version 8.0.0\n\
               Begin Triggerblock Mon Nov 23 10:00:00.000 am 2026\n   0.000000 Start of measurement\n\
               0.001000 1  201             Tx   d 3 3D 40 00  Length = 228000 BitCount = 118 ID = 513\n\
               0.001500 1  ErrorFrame\n\
               0.002000 1  1FFFFFFFx       Rx   r 8\n\
               0.003000 1  181             Rx   d 4 40 81 01 00\nEnd TriggerBlock\n";
    let found = imported(log, &settings(&[]));
    let expected = "_: 201#3D4000 1FFFFFFF#R8 181#40810100\n";
    let frames = |capture: &Capture| frames_of(&shown(capture));
    assert_eq!(frames(&found.capture), frames_of(expected));
    assert!(found.notes[0].contains("1 error frame"));
    let at = |capture: &Capture| -> Vec<u64> {
        let frames = capture.traces[0].channels[0].frames();
        frames
            .iter()
            .map(|frame| frame.at.since_start().as_nanos() / 1_000)
            .collect()
    };
    assert_eq!(at(&found.capture), [1_000, 2_000, 3_000]);
    // BUSMASTER writes all on one line; times since the event before, and one of them is an error frame's.
    let log = "base dec  no internal events logged timestamps relative\n0.0010 1 513 Rx d 3 61 64 0\n0.0005 1 ErrorFrame\n0.0005 1 385x Rx d 0\n";
    let found = imported(log, &settings(&[]));
    assert_eq!(
        frames(&found.capture),
        frames_of("_: 201#3D4000 00000181#\n")
    );
    assert_eq!(at(&found.capture), [1_000, 2_000]);
    // Times before 0, two channels, CAN FD, a wrong radix.
    let two = "base hex timestamps absolute\n-0.001 1 201 Rx d 0\n0.001 2 202 Rx d 0\n";
    assert!(refused(two, &settings(&[])).contains("--link bus=1"));
    let found = imported(two, &settings(&["bus=2"]));
    assert_eq!(frames(&found.capture), frames_of("_: 202#\n"));
    assert_eq!(at(&found.capture), [2_000]);
    for (line, expected) in [
        ("0.1 CANFD 1 Rx 201 0 0 8 8", "CAN FD"),
        ("0.1 1 FFF Rx d 0", "too large"),
        ("0.1 1 201 Rx d 3 3D 40", "3 data bytes expected"),
        ("0.1 1 20Z Rx d 0", "no hexadecimal identifier"),
    ] {
        let words = refused(
            format!("base hex timestamps absolute\n{line}\n"),
            &settings(&[]),
        );
        assert!(
            words.contains(expected) && words.contains("line 2"),
            "{words}"
        );
    }
}

fn frames_of(text: &str) -> Option<String> {
    text.split_once(": ").map(|(_, frames)| frames.to_owned())
}

/// The log of candump: padded interfaces, directions, times from 0, raw length codes, several interfaces.
#[test]
fn candump() {
    let log = "(0000000000.000000)  vcan0 201#3D.40.00 R\n(0000000000.000123456) vcan0 00000181#R8_F T\n\
               (0000000000.000200) vcan0 20000004#0004000000000000\n(0.0003) vcan0 201#1122334455667788_9\n";
    let found = imported(log, &settings(&[]));
    assert!(shown(&found.capture).ends_with(": 201#3D4000 00000181#R8 201#1122334455667788\n"));
    assert!(
        found.notes[0].contains("1 error frame not read"),
        "{:?}",
        found.notes
    );
    let two = "(0.1) can0 201#\n(0.2) can1 202#\n";
    assert!(
        refused(two, &settings(&[]))
            .contains("2 interfaces; choose one of can0, can1, as in `--link bus=can0`")
    );
    let found = imported(two, &settings(&["bus=can1"]));
    assert!(shown(&found.capture).ends_with(": 202#\n"));
    assert_eq!(found.notes, ["1 frame of other interfaces not read"]);
}

/// pcap in both orders of bytes, with times in microseconds and nanoseconds.
#[test]
fn pcap() {
    let file = |big: bool, magic: u32, link: u32, data: &[u8]| {
        let number = |value: u32| {
            if big {
                value.to_be_bytes()
            } else {
                value.to_le_bytes()
            }
        };
        let mut file = number(magic).to_vec();
        file.extend(if big { [0, 2, 0, 4] } else { [2, 0, 4, 0] });
        file.extend([0; 8]);
        file.extend(number(65_535));
        file.extend(number(link));
        for value in [1, 5, data.len() as u32, data.len() as u32] {
            file.extend(number(value));
        }
        file.extend(data);
        file
    };
    let frame = [0, 0, 2, 1, 3, 0, 0, 0, 0x3D, 0x40, 0];
    let octet = [0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0x88];
    for big in [false, true] {
        for (magic, nanos) in [(0xA1B2_C3D4, 1_000_005_000), (0xA1B2_3C4D, 1_000_000_005)] {
            let found = imported(file(big, magic, 227, &frame), &settings(&[]));
            assert!(shown(&found.capture).ends_with(": 201#3D4000\n"));
            let at = found.capture.traces[0].channels[0].frames()[0].at;
            assert_eq!(at.since_start().as_nanos(), nanos);
            let found = imported(file(big, magic, 250, &octet), &settings(&["1->0"]));
            assert_eq!(shown(&found.capture), "1->0: 88\n");
        }
    }
    let whole = file(false, 0xA1B2_C3D4, 250, &octet);
    assert!(refused(&whole, &settings(&[])).contains("--link \"98->97\""));
    assert!(refused(file(false, 0xA1B2_C3D4, 1, &octet), &settings(&[])).contains("link type 1"));
    for length in 25..whole.len() {
        assert!(read_with(&whole[..length], &settings(&["1->0"])).is_err());
    }
}

/// Parts of one capture follow each other; of files with a channel each, the name of the file is that of the channel.
#[test]
fn files_of_one_capture() {
    let files = |all: &[(&str, &str)], links: &[&str]| {
        let all = all
            .iter()
            .map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()));
        read_files(all.collect(), &settings(links)).map(|imported| shown(&imported.capture))
    };
    let first = ("a", "(0.1) can0 201#3D4000\n");
    let log = files(&[first, ("b", "(0.2) can0 202#\n")], &[]);
    assert!(log.expect("a log").ends_with(": 201#3D4000 202#\n"));
    let octets = "Time [s],Value,Parity Error,Framing Error\n0.001,0x88,,\n";
    let taps = [("in", octets), ("out", octets)];
    let both = files(&taps, &["1->0=in", "0->master=out"]).expect("links");
    assert_eq!(both, "1->0: 88\n0->master: 88\n");
    let other = files(&[first, taps[0]], &[]).expect_err("two formats");
    assert!(
        other.to_string().contains("files of one format expected"),
        "{other}"
    );
    let json = ("c", "{}");
    let alone = files(&[json, json], &[]).expect_err("no parts");
    assert!(alone.to_string().contains("cannot be joined"), "{alone}");
}
