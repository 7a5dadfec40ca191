//! The worked examples over a segment, with exact times, and the open points under each of their values.

use super::common::Desk;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::{Properties, Setting, UnitekProperty};
use harness_sim::unitek::Inputs;

fn with(name: &str, word: &str) -> Properties {
    let mut properties = Properties::default();
    assert!(
        UnitekProperty::of(name)
            .expect("a property of this name")
            .set(&mut properties, Setting::Word(word)),
        "{name}"
    );
    properties
}

/// ex 8: one reply, as soon as the bus is free.
#[test]
fn status_once() {
    let mut desk = Desk::default();
    assert_eq!(desk.ask("201#3D4000"), ["181#40010100"]);
    let [request, reply] = desk.record()[..] else {
        panic!("{:?}", desk.record());
    };
    // 77 bits at 500 kbit/s, then the reply without a gap.
    assert_eq!(request.start, Instant::START);
    assert_eq!(reply.start, Instant::START + Span::from_micros(154));
    // In position mode, out of tolerance, enabled: the value that the manual prints.
    assert_eq!(desk.ask("201#6E00000001"), [""; 0]);
    assert_eq!(desk.ask("201#3D4000"), ["181#40810100"]);
}

/// 5.3, ex 1 to 7: no write is answered.
#[test]
fn writes_are_never_answered() {
    let mut desk = Desk::default();
    for frame in [
        "201#510400",
        "201#31CD0C",
        "201#6EC0C62D00",
        "201#90FC3F",
        "201#35E803",
        "201#840000",
        "201#681002",
    ] {
        assert_eq!(desk.ask(frame), [""; 0], "{frame}");
    }
    // ex 1: from now on it listens at 210.
    assert_eq!(desk.ask("201#3D4000"), [""; 0]);
    assert_eq!(desk.ask("210#3D3100"), ["181#31CD0C00"]);
    // ex 6: the upper half, the torque ramp, is 0 now.
    assert_eq!(desk.ask("210#3D3500"), ["181#35E803000000"]);
}

/// ex 9 and 5.2 item 2: each 100 ms, the first after 100 ms, until FF.
#[test]
fn cycles() {
    let mut desk = Desk::default();
    assert_eq!(desk.ask("201#31FF7F"), [""; 0]);
    desk.wait(1_000);
    assert_eq!(desk.ask("201#3D3064"), [""; 0]);
    let heard = desk.wait(1_050);
    assert_eq!(heard.len(), 10);
    assert!(
        heard.iter().all(|frame| frame == "181#30FF7F00"),
        "{heard:?}"
    );
    let starts: Vec<_> = desk
        .record()
        .iter()
        .rev()
        .take(10)
        .map(|f| f.start)
        .collect();
    for pair in starts.windows(2) {
        assert_eq!(pair[0].since(pair[1]), Span::from_millis(100));
    }
    assert_eq!(desk.ask("201#3D30FF"), [""; 0]);
    assert_eq!(desk.wait(500), [""; 0]);
    // The print's other pair of identifiers (E15): a drive that was moved there.
    let mut moved = Desk::new(
        Properties::default(),
        Inputs::default(),
        &[(0x68, 0x210), (0x69, 0x190), (0x34, 0)],
    );
    assert_eq!(moved.ask("210#3D3064"), [""; 0]);
    assert_eq!(moved.wait(150), ["190#30000000"]);
}

/// App 8: eight registers; due in one millisecond, they go out in the order of their places.
#[test]
fn eight_places() {
    // Requests are 2 ms apart, and all are due in millisecond 100.
    let fill = |desk: &mut Desk, registers: &[u8]| {
        for (place, register) in registers.iter().enumerate() {
            let every = 100 - 2 * place;
            assert_eq!(
                desk.ask(&format!("201#3D{register:02X}{every:02X}")),
                [""; 0]
            );
        }
    };
    let registers = |heard: Vec<String>| -> Vec<String> {
        heard.iter().map(|frame| frame[4..6].to_string()).collect()
    };
    let eight = [0xE2, 0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9];
    let mut desk = Desk::default();
    // A ninth is refused.
    fill(&mut desk, &[&eight[..], &[0xEF]].concat());
    desk.ask("201#3DE3FF");
    // A suspended place is taken by the next request.
    desk.ask("201#3DF250");
    let order = ["E2", "F2", "E4", "E5", "E6", "E7", "E8", "E9"];
    assert_eq!(registers(desk.wait(82)), order);
    let mut oldest = Desk::with(with("table-full", "oldest"));
    // E2 is requested again, so that E3 was requested longest ago.
    fill(&mut oldest, &[&eight[..], &[0xE2, 0xEF]].concat());
    let order = ["E2", "EF", "E4", "E5", "E6", "E7", "E8", "E9"];
    assert_eq!(registers(oldest.wait(85)), order);
}

/// ex 10: STATUS by event when the position is in tolerance; mask 3000 after power-up.
#[test]
fn event_when_in_tolerance() {
    let mut desk = Desk::default();
    // Homing sets Cal and Tol (ex 12).
    desk.ask("201#780100");
    desk.ask("201#511000");
    assert_eq!(desk.wait(600), ["181#408131000000"]);
    // 3 turns at 3932 counts a millisecond: 50 ms.
    assert_eq!(desk.ask("201#6E00000300"), ["181#408111000000"]);
    assert_eq!(desk.wait(100), ["181#408131000000"]);
}

/// ex 10-1: a limit switch, with the mask that is meant (E19) and the printed one.
#[test]
fn event_by_limit_switch() {
    for (mask, seen) in [("201#520C00", 2), ("201#521200", 0)] {
        let mut desk = Desk::default();
        desk.ask("201#780100");
        desk.wait(600);
        desk.ask(mask);
        desk.ask("201#511000");
        desk.inputs(|inputs| inputs.limit1 = true);
        let on = desk.wait(5);
        desk.inputs(|inputs| inputs.limit1 = false);
        let off = desk.wait(5);
        assert_eq!(on.len() + off.len(), seen, "{mask}");
        if seen == 2 {
            assert_eq!(
                (on[0].as_str(), off[0].as_str()),
                ("181#408531000000", "181#408131000000")
            );
        }
    }
    // The printed mask 30 of ex 10 and 12 fires on Icns (E18).
    let mut desk = Desk::default();
    desk.ask("201#523000");
    desk.ask("201#511000");
    desk.inputs(|inputs| inputs.icns = true);
    assert_eq!(desk.wait(5), ["181#402101000000"]);
}

/// 5.2 item 3: the printed activation releases the lock; 51 14 00 keeps it.
#[test]
fn events_and_the_lock() {
    let mut desk = Desk::default();
    desk.ask("201#510400");
    assert_eq!(desk.ask("201#3D4000"), ["181#40000100"]);
    desk.ask("201#511400");
    assert_eq!(desk.ask("201#3D4000"), ["181#40000100"]);
    desk.ask("201#511000");
    assert_eq!(desk.ask("201#3D4000"), ["181#40010100"]);
}

/// ex 11 as printed, with its speeds.
#[test]
fn routine_for_speed() {
    let mut desk = Desk::default();
    assert_eq!(desk.ask("201#3DE200"), ["181#E2010000"]);
    desk.ask("201#510400");
    assert_eq!(desk.ask("201#3DE800"), ["181#E8010000"]);
    for frame in [
        "201#510000",
        "201#35F401",
        "201#EDE803",
        "201#31D403",
        "201#3D3064",
    ] {
        desk.ask(frame);
    }
    // 980 of 32767 with 500 ms for all of it: reached in 15 ms.
    assert_eq!(desk.wait(350), ["181#30D40300"; 3]);
    desk.ask("201#31A47F");
    desk.wait(600);
    assert_eq!(desk.wait(100), ["181#30A47F00"]);
    desk.ask("201#310000");
    desk.wait(1_000);
    assert_eq!(desk.wait(100), ["181#30000000"]);
    desk.ask("201#510400");
}

/// ex 12 with the corrected mask: every event.
#[test]
fn routine_for_position() {
    let mut desk = Desk::default();
    for frame in [
        "201#510400",
        "201#310000",
        "201#510000",
        "201#780100",
        "201#520030",
        "201#511000",
    ] {
        desk.ask(frame);
    }
    assert_eq!(desk.wait(600), ["181#408131000000"]);
    assert_eq!(desk.ask("201#6EC0C62D00"), ["181#408111000000"]);
    assert_eq!(desk.ask("201#3DF400"), ["181#F4000000"]);
    // 3000000 counts at 3932 a millisecond.
    assert_eq!(desk.wait(770), ["181#408131000000"]);
    assert_eq!(desk.ask("201#3DF400"), ["181#F4010000"]);
    assert_eq!(desk.ask("201#3D6D00"), ["181#6DC0C62D0000"]);
    assert_eq!(desk.ask("201#6E00000000"), ["181#408111000000"]);
    assert_eq!(desk.wait(800), ["181#408131000000"]);
    desk.ask("201#510400");
}

/// App 7: every register that it names, and all 256 once, with the width of the dump.
#[test]
fn every_register_once() {
    let mut desk = Desk::default();
    for number in 0..=255u8 {
        let row = harness_proto::unitek::Register::of(number);
        let replies = desk.ask(&format!("201#3D{number:02X}00"));
        let short = row.width.bits() == 16 || matches!(number, 0x40 | 0x8F);
        assert_eq!(replies.len(), 1, "{number:02X}");
        assert_eq!(
            replies[0].len(),
            if short { 12 } else { 16 },
            "{number:02X}"
        );
    }
    let mut dump = Desk::with(Properties::fw472());
    dump.inputs(|inputs| {
        inputs.run = false;
        inputs.dc_bus = false;
    });
    // The drive of the dump, at rest and without power.
    for (request, reply) in [
        ("201#3D4000", "181#408003000000"),
        ("201#3D8F00", "181#8F2000000000"),
        ("201#3DD800", "181#D8200000"),
        ("201#3DEB00", "181#EB010000"),
        ("201#3D1B00", "181#1BD80100"),
        ("201#3D5200", "181#5211F8000000"),
        ("201#3D6D00", "181#6DB986000000"),
        ("201#3D9100", "181#91B986000000"),
    ] {
        assert_eq!(dump.ask(request), [reply]);
    }
}

/// App 3: with bit 8 of DC all replies have 6 bytes, extended by sign.
#[test]
fn all_replies_wide() {
    let mut desk = Desk::default();
    desk.ask("201#DC3001");
    desk.ask("201#310180");
    assert_eq!(desk.ask("201#3D3100"), ["181#310180FFFF00"]);
    assert_eq!(desk.ask("201#3DDC00"), ["181#DC3001000000"]);
    assert_eq!(desk.ask("201#3D4000"), ["181#400101000000"]);
}

/// The supervision of the bus: D0 ms without an accepted frame, until 8E.
#[test]
fn time_out() {
    let mut desk = Desk::default();
    desk.ask("201#D06400");
    desk.wait(95);
    assert_eq!(desk.ask("201#3D8F00"), ["181#8F000000"], "re-armed");
    desk.wait(90);
    // A short frame and a foreign one do not count.
    desk.ask("201#3D8F");
    desk.ask("202#3D8F00");
    desk.wait(15);
    assert_eq!(desk.ask("201#3D8F00"), ["181#8F080000"]);
    assert_eq!(desk.ask("201#3DE200"), ["181#E2000000"]);
    desk.ask("201#8E444D");
    assert_eq!(desk.ask("201#3D8F00"), ["181#8F000000"]);
    assert_eq!(desk.ask("201#3DE200"), ["181#E2010000"]);
}

/// Open points, each value: request frames, and what comes of the last one.
#[test]
fn open_points() {
    for (name, word, frames, replies) in [
        (
            "map-reply",
            "short",
            &["201#3D8F00"][..],
            &["181#8F000000"][..],
        ),
        (
            "map-reply",
            "native",
            &["201#3D8F00"],
            &["181#8F0000000000"],
        ),
        ("stuff", "A5", &["201#3D1B00"], &["181#1BD801A5"]),
        (
            "dlc4",
            "as3",
            &["201#D4112200", "201#3DD400"],
            &["181#D41122000000"],
        ),
        (
            "dlc4",
            "ignore",
            &["201#D4112200", "201#3DD400"],
            &["181#D40000000000"],
        ),
        (
            "short-write",
            "extend",
            &["201#D444332211", "201#D4FFFF", "201#3DD400"],
            &["181#D4FFFFFFFF00"],
        ),
        (
            "short-write",
            "keep-high",
            &["201#D444332211", "201#D4FFFF", "201#3DD400"],
            &["181#D4FFFF221100"],
        ),
        ("cyclic-first", "after", &["201#3D1B64"], &[]),
        (
            "cyclic-first",
            "at-once",
            &["201#3D1B64"],
            &["181#1BD80100"],
        ),
        (
            "id-change",
            "immediate",
            &["201#681002", "210#3D1B00"],
            &["181#1BD80100"],
        ),
        (
            "id-change",
            "restart",
            &["201#681002", "201#3D6800"],
            &["181#68100200"],
        ),
        (
            "id-range",
            "any",
            &["201#680001", "100#3D1B00"],
            &["181#1BD80100"],
        ),
        (
            "id-range",
            "printed",
            &["201#680001", "201#3D6800"],
            &["181#68010200"],
        ),
        ("event-mask", "F811", &["201#3D5200"], &["181#5211F8000000"]),
        ("event-mask", "0030", &["201#3D5200"], &["181#523000000000"]),
        ("status-bits", "full", &["201#3D4000"], &["181#40114300"]),
        (
            "unknown-register",
            "face",
            &["201#3D8100"],
            &["181#81CEFA00"],
        ),
        ("unknown-register", "silent", &["201#3D8100"], &[]),
        (
            "lock-at-power-up",
            "yes",
            &["201#3D4000"],
            &["181#40000100"],
        ),
        (
            "lock-clears-command",
            "no",
            &["201#31CD0C", "201#510400", "201#3D3100"],
            &["181#31CD0C00"],
        ),
        (
            "lock-clears-command",
            "yes",
            &["201#31CD0C", "201#510400", "201#3D3100"],
            &["181#31000000"],
        ),
        (
            "power-up-mode",
            "position",
            &["201#3D4000"],
            &["181#40810100"],
        ),
        (
            "can-counters",
            "live",
            &["201#3D1B00", "201#R3", "201#3D9700"],
            &["181#97010000"],
        ),
    ] {
        let mut desk = Desk::with(with(name, word));
        let mut seen = Vec::new();
        for frame in frames {
            seen = desk.ask(frame);
        }
        assert_eq!(seen, replies, "{name} {word}");
    }
    // oneshot-stops, event-reply
    for (word, cyclic) in [("no", 1), ("yes", 0)] {
        let mut desk = Desk::with(with("oneshot-stops", word));
        desk.ask("201#3D1B64");
        assert_eq!(desk.ask("201#3D1B00").len(), 1);
        assert_eq!(desk.wait(120).len(), cyclic, "{word}");
    }
    for (word, frame) in [
        ("native", "181#402101000000"),
        ("as-map-reply", "181#40210100"),
    ] {
        let mut desk = Desk::with(with("event-reply", word));
        desk.ask("201#522000");
        desk.ask("201#511000");
        desk.inputs(|inputs| inputs.icns = true);
        assert_eq!(desk.wait(5), [frame]);
    }
}

/// What a drive should not get: nothing happens, and it goes on answering.
#[test]
fn frames_that_mean_nothing() {
    let mut desk = Desk::default();
    for frame in [
        "201#R3",
        "00000201#3D4000",
        "181#3D4000",
        "202#3D4000",
        "201#",
        "201#3D",
        "201#3D40",
        "201#CE0100",
        "201#000100",
        "201#780200",
        "201#170100",
        "201#840200",
        "201#680000",
        "201#680008",
        "201#690000",
        "201#3DFFFF",
    ] {
        assert_eq!(desk.ask(frame), [""; 0], "{frame}");
    }
    assert_eq!(desk.ask("201#3DCE00"), ["181#CE100E00"]);
    assert_eq!(desk.ask("201#3D6800"), ["181#68010200"]);
    assert_eq!(desk.ask("201#3D7800"), ["181#784D4400"]);
    // Longer frames are read as 5 bytes, 8000 as -32768.
    desk.ask("201#31008000112233");
    assert_eq!(desk.ask("201#3D3100"), ["181#31008000"]);
}

/// ex 7: what 84 stores, 83 brings back, and a restart keeps; level 1 is empty at first.
#[test]
fn eeprom_levels() {
    let mut desk = Desk::default();
    desk.ask("201#1C3412");
    desk.ask("201#830100");
    assert_eq!(desk.ask("201#3D1C00"), ["181#1C341200"], "level 1 is empty");
    desk.ask("201#840100");
    desk.ask("201#830000");
    assert_eq!(desk.ask("201#3D1C00"), ["181#1C0A0000"]);
    desk.ask("201#830100");
    assert_eq!(desk.ask("201#3D1C00"), ["181#1C341200"]);
    // The status mask is no parameter: it stays as it was written.
    let stored = desk.ask("201#3D5200");
    desk.ask("201#523412");
    let written = desk.ask("201#3D5200");
    assert_ne!(written, stored);
    desk.ask("201#830100");
    assert_eq!(desk.ask("201#3D5200"), written);
    desk.restart();
    assert_eq!(
        desk.ask("201#3D1C00"),
        ["181#1C0A0000"],
        "power-up loads level 0"
    );
}

/// Without its supply the drive is no station: nothing acknowledges. After it, cycles, lock and identifiers are as at power-up.
#[test]
fn switched_off_and_on() {
    let mut desk = Desk::default();
    for frame in ["201#3D1B0A", "201#510400", "201#681002"] {
        desk.ask(frame);
    }
    let now = desk.segment.now();
    desk.drive().switch_off(now);
    assert_eq!(desk.ask("210#3D1B00"), ["no-acknowledge"]);
    assert!(!desk.drive().is_powered());
    desk.restart();
    // The host repeats its frame until it is acknowledged; the drive listens at 201 again.
    assert_eq!(desk.wait(20), [""; 0]);
    assert_eq!(desk.ask("201#3D4000"), ["181#40010100"]);
}
