//! The guard: classes, the lock, load, new identifiers (what a write may do to a physical drive).

use super::super::guard::{
    Class, Denial, FastWrite, FrameGate, HighestSpeed, Limits, Missing, NAMED, ValueRange, class,
};
use super::*;
use alloc::vec;

fn gate(limits: Limits) -> FrameGate {
    FrameGate::new(
        limits,
        BitRate::K500,
        &[(DEFAULT_RX, DEFAULT_TX), (0x202, 0x182)],
    )
}

fn denied(gate: &mut FrameGate, text: &str) -> Option<Denial> {
    gate.admit(Instant::START, &frame(text)).err()
}

fn missing(register: u8, missing: Missing) -> Option<Denial> {
    Some(Denial::NotPermitted { register, missing })
}

/// every register that takes writes has a class of its own but the ones listed here.
#[test]
fn classes_cover_the_table() {
    let unlisted: Vec<u8> = REGISTERS
        .iter()
        .filter(|r| matches!(r.access, Access::RW | Access::SP | Access::FN))
        .filter(|r| class(r.number) == Class::Unlisted && r.number != super::super::frame::READ)
        .map(|r| r.number)
        .collect();
    assert_eq!(unlisted, Vec::<u8>::new());
    for r in &REGISTERS {
        match r.access {
            Access::RO => assert_eq!(class(r.number), Class::Unlisted, "{:02X}", r.number),
            Access::UK => assert_eq!(class(r.number), Class::Never, "{:02X}", r.number),
            _ => {}
        }
    }
    for number in NAMED {
        assert_eq!(class(number), Class::Named);
    }
}

/// With no permission at all.
#[test]
fn without_permissions() {
    let mut gate = gate(Limits::default());
    for text in [
        "201#3D4000",
        "201#3D30FF",
        "201#510400",
        "201#511400",
        "201#520C00",
        "201#R3",
        "201#3D",
        "201#100100",
    ] {
        assert_eq!(denied(&mut gate, text), None, "{text}");
    }
    // Locked: stopping is harmless. 10..16 too, but not the read only 11.
    for text in ["201#310000", "201#900000", "201#170100", "201#180100"] {
        assert_eq!(denied(&mut gate, text), None, "{text}");
    }
    for (text, register, what) in [
        ("201#511000", 0x51, Missing::Motion),
        ("201#510000", 0x51, Missing::Motion),
        ("201#510500", 0x51, Missing::All),
        ("201#310100", 0x31, Missing::Motion),
        ("201#6E00000000", 0x6E, Missing::Motion),
        ("201#8E0000", 0x8E, Missing::Motion),
        ("201#840000", 0x84, Missing::Eeprom),
        ("201#C80000", 0xC8, Missing::Eeprom),
        ("201#681002", 0x68, Missing::BusSettings),
        ("201#D02C01", 0xD0, Missing::BusSettings),
        ("201#110000", 0x11, Missing::All),
        ("201#850100", 0x85, Missing::Named),
        // Wider frames, as the drive reads them.
        ("201#5110000000", 0x51, Missing::Motion),
        ("201#51000000FFFFFFFF", 0x51, Missing::Motion),
        ("201#51000000", 0x51, Missing::Motion),
    ] {
        assert_eq!(denied(&mut gate, text), missing(register, what), "{text}");
    }
    for register in [0xB0, 0x04, 0xB7, 0x5A, 0x62, 0x67, 0x00, 0xFF] {
        let text = format!("201#{register:02X}0000");
        assert_eq!(denied(&mut gate, &text), Some(Denial::Never { register }));
        let mut open = super::guarding::gate(Limits::unlimited());
        assert_eq!(denied(&mut open, &text), Some(Denial::Never { register }));
    }
    for text in ["203#3D4000", "181#40810100", "00000201#3D4000", "000#0000"] {
        assert_eq!(denied(&mut gate, text), Some(Denial::Identifier), "{text}");
    }
}

/// A lock counts only if every drive reads the frame so, and no longer than another master or a restart leaves it.
#[test]
fn a_lock_that_is_in_force() {
    let motion = missing(0x31, Missing::Motion);
    let stop = "201#310000";
    let mut fresh = gate(Limits::default());
    assert_eq!(denied(&mut fresh, stop), motion);
    assert_eq!(denied(&mut fresh, "201#51040000"), None);
    assert_eq!(denied(&mut fresh, stop), motion, "4 bytes may be ignored");
    assert_eq!(denied(&mut fresh, "202#510400"), None);
    assert_eq!(denied(&mut fresh, stop), motion, "the other drive");
    assert_eq!(denied(&mut fresh, "201#510400"), None);
    assert_eq!(denied(&mut fresh, stop), None);
    let mut other = fresh.clone();
    other.overhear(&frame("201#51000000"));
    assert_eq!(
        denied(&mut other, stop),
        motion,
        "another master released it"
    );
    let mut restarted = fresh.clone();
    restarted.doubt();
    assert_eq!(denied(&mut restarted, stop), motion);
}

/// cycles up to half of the bit rate, with the longest replies.
#[test]
fn cycles_load_the_bus() {
    let mut gate = gate(Limits::default());
    // 115 bits of 500 a millisecond are 23 %.
    assert_eq!(denied(&mut gate, "201#3D3001"), None);
    assert_eq!(denied(&mut gate, "202#3D3001"), None);
    assert_eq!(denied(&mut gate, "201#3D2010"), None);
    assert_eq!(
        denied(&mut gate, "201#3D2701"),
        Some(Denial::Load { permille: 704 })
    );
    assert_eq!(
        denied(&mut gate, "201#3D300A"),
        None,
        "a longer interval replaces it"
    );
    assert_eq!(denied(&mut gate, "201#3D2701"), None);
    assert_eq!(denied(&mut gate, "201#3D28FF"), None);
    assert_eq!(
        gate.cycles().collect::<Vec<_>>(),
        [(0x201, 0x20), (0x201, 0x30), (0x201, 0x27), (0x202, 0x30)]
    );
    // 4 bytes may be ignored: the cycle goes on for the gate.
    assert_eq!(denied(&mut gate, "202#3D30FF00"), None);
    assert_eq!(gate.cycles().count(), 4);
    assert_eq!(denied(&mut gate, "202#3D30FF"), None);
    assert_eq!(gate.cycles().count(), 3);
}

/// The guard follows a drive to its new identifier, and asks before it is stored.
#[test]
fn a_drive_that_moves() {
    let mut gate = gate(Limits {
        bus_settings: true,
        eeprom: true,
        ..Limits::default()
    });
    assert_eq!(denied(&mut gate, "201#681002"), None);
    assert_eq!(
        denied(&mut gate, "210#510000"),
        missing(0x51, Missing::Motion)
    );
    assert_eq!(
        denied(&mut gate, "201#510000"),
        missing(0x51, Missing::Motion)
    );
    let places: Vec<_> = gate.places().map(|drive| (drive.rx, drive.tx)).collect();
    assert_eq!(
        places,
        [
            ([0x201, 0x210].to_vec(), [0x181].to_vec()),
            ([0x202].to_vec(), [0x182].to_vec())
        ]
    );
    assert_eq!(denied(&mut gate, "210#840000"), Some(Denial::LostDrive));
    assert_eq!(
        denied(&mut gate, "210#732540"),
        missing(0x73, Missing::WayBack)
    );
    // It may not have taken that.
    assert_eq!(denied(&mut gate, "210#680102"), None);
    assert!(gate.places().any(|drive| drive.has_moved()));
    gate.settled(0x201);
    assert!(!gate.places().any(|drive| drive.has_moved()));
    // That it answers on its first identifiers does not show what 84 would store.
    assert!(gate.has_moved(0x201));
    assert_eq!(denied(&mut gate, "201#840000"), Some(Denial::LostDrive));
    gate.moved_back(0x201);
    assert!(!gate.has_moved(0x201));
    assert_eq!(denied(&mut gate, "201#840000"), None);
}

/// UNITEK 3.1: an identifier has one drive and one direction, from the moment it may be in use until the drive is found elsewhere.
#[test]
fn an_identifier_has_one_drive() {
    let limits = Limits {
        bus_settings: true,
        ..Limits::default()
    };
    let mut gate = gate(limits);
    let taken = |register, identifier| {
        Some(Denial::Taken {
            register,
            identifier,
        })
    };
    for (text, register, identifier) in [
        ("201#680202", 0x68, 0x202),
        ("201#688201", 0x68, 0x182),
        ("201#698201", 0x69, 0x182),
        ("201#690202", 0x69, 0x202),
        ("201#8802020000", 0x88, 0x202),
        ("201#898201", 0x89, 0x182),
        // Its own, for the other direction.
        ("201#688101", 0x68, 0x181),
        ("201#690102", 0x69, 0x201),
        ("201#68020200", 0x68, 0x202),
    ] {
        assert_eq!(
            denied(&mut gate, text),
            taken(register, identifier),
            "{text}"
        );
    }
    for text in ["201#681002", "210#680102", "201#691002"] {
        let denied = denied(&mut gate, text);
        assert_eq!(denied.is_some(), text == "201#691002", "{text}");
    }
    // Drive 1 may still be there: it would obey what is meant for drive 2.
    for (text, register) in [("202#681002", 0x68), ("202#8810020000", 0x88)] {
        assert_eq!(denied(&mut gate, text), taken(register, 0x210), "{text}");
    }
    gate.settled(0x201);
    assert_eq!(denied(&mut gate, "202#681002"), None);
    assert_eq!(denied(&mut gate, "201#681002"), taken(0x68, 0x210));
}

/// A lock counts where the drive is known to receive: after a new identifier, on neither of the two until it has answered there.
#[test]
fn a_lock_is_booked_where_the_drive_is() {
    let limits = Limits {
        bus_settings: true,
        ..Limits::default()
    };
    let stop = missing(0x31, Missing::Motion);
    let mut gate = gate(limits);
    for text in ["201#681002", "201#510400", "210#510400"] {
        assert_eq!(denied(&mut gate, text), None);
        assert_eq!(denied(&mut gate, "201#310000"), stop, "{text}");
    }
    gate.found(0x201, 0x210);
    assert_eq!(denied(&mut gate, "201#510400"), None);
    assert_eq!(denied(&mut gate, "210#310000"), stop);
    assert_eq!(denied(&mut gate, "210#510400"), None);
    assert_eq!(denied(&mut gate, "210#310000"), None);
}

/// No value outside of the range that the rig's file states for a register, and no part of it: what that leaves there is open.
#[test]
fn values_within_a_stated_range() {
    let range = |register, least, most| ValueRange {
        register,
        least,
        most,
    };
    let (offset, position) = (range(0x76, -3, 200), range(0xD4, 0, 70_000));
    let mut gate = gate(Limits {
        ranges: vec![offset, position],
        ..Limits::unlimited()
    });
    for text in ["201#76FDFF", "201#76C800", "201#D470110100", "201#77FFFF"] {
        assert_eq!(denied(&mut gate, text), None, "{text}");
    }
    for text in ["201#76FCFF", "201#76C900"] {
        assert_eq!(
            denied(&mut gate, text),
            Some(Denial::Range(offset)),
            "{text}"
        );
    }
    for text in ["201#D471110100", "201#D4FFFFFFFF", "201#D40100"] {
        assert_eq!(
            denied(&mut gate, text),
            Some(Denial::Range(position)),
            "{text}"
        );
    }
    // What the drive held at first is set back, and nothing else.
    gate.held_before(0x201, vec![(0x76, 0x0200)]);
    assert_eq!(denied(&mut gate, "201#760002"), None);
    assert_eq!(denied(&mut gate, "201#760102"), Some(Denial::Range(offset)));
    assert_eq!(denied(&mut gate, "202#760002"), Some(Denial::Range(offset)));
    let words = Denial::Range(offset).to_string();
    assert!(
        words.contains("76 (SPEED_CALIB_F) is permitted from -3 to 200"),
        "{words}"
    );
}

/// 84 at most once a minute; 35 and ED only whole.
#[test]
fn wear_and_ramps() {
    let mut gate = gate(Limits::unlimited());
    let at = |s: u64| Instant::START + Span::from_millis(1000 * s);
    let store = frame("201#840000");
    assert_eq!(gate.admit(at(0), &store), Ok(()));
    assert_eq!(gate.admit(at(59), &store), Err(Denial::EepromWear));
    assert_eq!(gate.admit(at(60), &store), Ok(()));
    assert_eq!(gate.eeprom_writes(), 2);
    for register in [0x35, 0xED] {
        assert_eq!(
            denied(&mut gate, &format!("201#{register:02X}E803")),
            Some(Denial::HalfRamp { register })
        );
        assert_eq!(
            denied(&mut gate, &format!("201#{register:02X}E8030100")),
            None
        );
    }
}

/// A highest speed bounds speed commands by their value, and everything else that turns the motor by 34.
#[test]
fn the_highest_speed() {
    let limits = |max_speed| Limits {
        motion: true,
        max_speed: Some(max_speed),
        ..Limits::default()
    };
    let fast = |register, fast| Some(Denial::Speed { register, fast });
    let most = 3277;
    let above = |register| fast(register, FastWrite::Above { most });
    let unknown = |register| fast(register, FastWrite::LimitUnknown { most });
    let mut share = gate(limits(HighestSpeed::Raw(most)));
    // 10 % is 3277 (0CCD), -10 % is F333.
    assert_eq!(denied(&mut share, "201#31CE0C"), above(0x31));
    assert_eq!(denied(&mut share, "201#3132F3"), above(0x31));
    assert_eq!(denied(&mut share, "201#31CE0C00000000"), above(0x31));
    assert_eq!(denied(&mut share, "201#510000"), unknown(0x51));
    for (text, register) in [
        ("201#90FF7F", 0x90),
        ("201#6E00000000", 0x6E),
        ("201#780100", 0x78),
        ("201#8E0000", 0x8E),
    ] {
        assert_eq!(denied(&mut share, text), unknown(register), "{text}");
    }
    assert_eq!(denied(&mut share, "201#900000"), None);
    assert_eq!(denied(&mut share, "201#510000"), None, "no torque");
    assert_eq!(denied(&mut share, "201#31CD0C"), None);
    assert_eq!(denied(&mut share, "201#510000"), None, "31 is within it");
    assert_eq!(denied(&mut share, "201#340080"), above(0x34));
    assert_eq!(denied(&mut share, "201#34CD0C"), None);
    for text in ["201#90FF7F", "201#510000", "201#31FF7F", "201#6E00000000"] {
        assert_eq!(denied(&mut share, text), None, "34 bounds {text}");
    }
    share.overhear(&frame("201#34FF7F"));
    assert_eq!(
        denied(&mut share, "201#90FF7F"),
        unknown(0x90),
        "34 changed"
    );
    let mut rpm = gate(limits(HighestSpeed::Rpm(360)));
    assert_eq!(
        denied(&mut rpm, "201#310100"),
        fast(0x31, FastWrite::FullUnknown)
    );
    assert_eq!(denied(&mut rpm, "201#310000"), None);
    rpm.learn(0x201, 3600, 0x7FFF);
    assert_eq!(denied(&mut rpm, "201#31CE0C"), above(0x31));
    assert_eq!(denied(&mut rpm, "201#31CD0C"), None);
    assert_eq!(
        denied(&mut rpm, "202#31CC0C"),
        fast(0x31, FastWrite::FullUnknown)
    );
    rpm.doubt();
    assert_eq!(
        denied(&mut rpm, "201#31CD0C"),
        fast(0x31, FastWrite::FullUnknown)
    );
    let mut scale = gate(Limits {
        max_speed: Some(HighestSpeed::Rpm(360)),
        ..Limits::unlimited()
    });
    for (text, register) in [("201#C8100E", 0xC8), ("201#830000", 0x83)] {
        assert_eq!(denied(&mut scale, text), fast(register, FastWrite::Scale));
    }
}

/// Frames that no drive of the rig file receives need a permission of their own.
#[test]
fn other_identifiers() {
    let mut open = gate(Limits {
        other_identifiers: true,
        ..Limits::default()
    });
    for text in ["203#510000", "00000201#510000", "203#R3"] {
        assert_eq!(denied(&mut open, text), None, "{text}");
    }
    assert_eq!(
        denied(&mut open, "201#510000"),
        missing(0x51, Missing::Motion)
    );
}

/// A drive may obey frames on the identifier in 88 (`second-identifiers`): they need the permissions of its first one, and lock nothing.
#[test]
fn second_identifiers() {
    let mut gate = gate(Limits {
        bus_settings: true,
        ..Limits::default()
    });
    assert_eq!(denied(&mut gate, "27E#3D1B00"), Some(Denial::Identifier));
    assert_eq!(denied(&mut gate, "201#887E020000"), None);
    assert_eq!(denied(&mut gate, "27E#3D1B00"), None);
    assert_eq!(
        denied(&mut gate, "27E#510000"),
        missing(0x51, Missing::Motion)
    );
    assert_eq!(denied(&mut gate, "27E#510400"), None);
    assert_eq!(
        denied(&mut gate, "201#310000"),
        missing(0x31, Missing::Motion)
    );
    assert_eq!(denied(&mut gate, "201#510400"), None);
    assert_eq!(denied(&mut gate, "201#310000"), None);
}

proptest! {
    /// Without permissions no frame that passes writes to anything but harmless registers, however the drive reads it.
    #[test]
    fn nothing_dangerous_passes(frames in prop::collection::vec((prop_oneof![Just(0x201u16), Just(0x202), 0..0x800u16], prop::collection::vec(any::<u8>(), 0..=8)), 0..30)) {
        let mut gate = gate(Limits::default());
        let mut locked = [false; 2];
        for (id, data) in frames {
            let frame = Frame::base(id, &data).unwrap();
            if gate.admit(Instant::START, &frame).is_err() {
                continue;
            }
            let place = usize::from(id) - 0x201;
            for dlc4 in [Dlc4::As3, Dlc4::Ignore] {
                let Ok(Request::Write { register, data }) = Request::decode(&frame, id, dlc4) else { continue };
                let value = data.bits() & 0xFFFF;
                match register {
                    0x51 => {
                        prop_assert_eq!(value & !0x10, 4);
                        locked[place] |= frame.dlc() != 4;
                    }
                    0x31 | 0x90 => prop_assert!(value == 0 && locked[place]),
                    0x17 | 0x18 => prop_assert!(locked[place]),
                    0x52 | 0x10 | 0x12..=0x16 => {}
                    _ => prop_assert!(false, "{} passed", frame),
                }
            }
        }
    }
}
