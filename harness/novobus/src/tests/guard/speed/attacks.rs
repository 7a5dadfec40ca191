//! Ways in which a master can make a motor turn faster, one by one, in the manual's order of sections where there is one.

use super::{FoundDrive, GO, MOST, OVERSHOOT, and, bench, byte, limits, or, play, telegram, word};
use harness_bench::link::Line;
use harness_proto::nd21::ram;
use harness_proto::novobus::guard::Limits;

/// Each attack: what was left in the drive, what is sent, and the telegram that must not pass.
fn attacks() -> Vec<(&'static str, FoundDrive, Vec<Vec<u8>>, usize)> {
    let left = FoundDrive::default;
    let analogue = FoundDrive {
        configuration: [0xC4, 0xFF, 0x40, 0xFF],
        ..left()
    };
    let frequency = FoundDrive {
        configuration: [0x44, 0xFF, 0x42, 0xFF],
        ..left()
    };
    let reversing = FoundDrive {
        configuration: [0xC4, 0xFF, 0xC3, 0xFF],
        cells: vec![(ram::NSOLL, 8_000)],
        ..left()
    };
    let stepping = FoundDrive {
        configuration: [0xCC, 0xFF, 0x43, 0xFF],
        inputs: 1,
        ..left()
    };
    let s_ramp = FoundDrive {
        configuration: [0xC4, 0xFD, 0x43, 0xFB],
        ..left()
    };
    let calculated = FoundDrive {
        cells: vec![(ram::PS_POSITION_H, 0x0010)],
        ..left()
    };
    let go = || and(ram::STATUS, GO);
    let cell = |address: u16, high: u8| vec![go(), byte(address, high)];
    vec![
        (
            "analogue input",
            analogue,
            vec![byte(ram::VCO_LIN, 0xFF), go()],
            0,
        ),
        (
            "analogue input, as it is",
            FoundDrive {
                configuration: [0xC4, 0xFF, 0x40, 0xFF],
                ..left()
            },
            vec![go()],
            0,
        ),
        (
            "switch to the analogue input",
            left(),
            vec![go(), byte(ram::SW_VERSION, 0x40)],
            1,
        ),
        (
            "the same by And",
            left(),
            vec![go(), and(ram::SW_VERSION, 0xFC)],
            1,
        ),
        ("frequency input", frequency, vec![go()], 0),
        ("reversing mode", reversing, vec![go()], 0),
        (
            "positioning at ps_v0",
            left(),
            vec![
                go(),
                word(ram::PS_POSITION_H, 0x0010),
                or(ram::FLAGS2, 0x08),
                or(ram::PS_STATUS, 0x10),
            ],
            2,
        ),
        (
            "relative positioning",
            left(),
            vec![
                go(),
                word(ram::PS_UMDREHUNG, 50),
                or(ram::PS_STATUS, 0x40),
                or(ram::PS_STATUS, 0x10),
            ],
            2,
        ),
        (
            "both bits at once",
            left(),
            vec![
                go(),
                word(ram::PS_UMDREHUNG, 50),
                byte(ram::PS_STATUS, 0x50),
            ],
            2,
        ),
        (
            "calculated by another",
            calculated,
            vec![or(ram::FLAGS2, 0x08), go()],
            0,
        ),
        ("referencing", left(), vec![go(), or(ram::FLAGS2, 0x80)], 1),
        (
            "referencing by a byte",
            left(),
            vec![go(), byte(ram::FLAGS2, 0x80)],
            1,
        ),
        (
            "referencing by a word",
            left(),
            vec![go(), word(ram::FLAGS2, 0x8000)],
            1,
        ),
        (
            "referencing from a step",
            left(),
            vec![go(), and(ram::FLAGS2, 0x9F)],
            1,
        ),
        (
            "RefV1 alone",
            left(),
            vec![go(), word(ram::REF_V1, 100), or(ram::FLAGS2, 0x80)],
            2,
        ),
        ("resolver", left(), cell(ram::D_RESOLVER, 0x40), 1),
        ("pole jump", left(), cell(ram::POLE_JUMP, 0x40), 1),
        ("stepping", stepping, vec![go()], 0),
        (
            "order of the cycle control",
            left(),
            cell(ram::AS_COMMAND, 1),
            1,
        ),
        ("S-ramp", s_ramp, vec![go()], 0),
        (
            "nominal position",
            left(),
            vec![go(), word(ram::UMDRSOLL, 20)],
            1,
        ),
        (
            "actual position",
            left(),
            vec![go(), word(ram::UMDRIST, 20)],
            1,
        ),
        (
            "shift of the position",
            left(),
            vec![go(), word(ram::D_LAGE, 0x7000)],
            1,
        ),
        ("position gain", left(), cell(ram::LKP, 0x7F), 1),
        (
            "integrator",
            left(),
            vec![go(), word(ram::N_INTEGRATOR, 0x7000)],
            1,
        ),
        (
            "measured speed",
            left(),
            vec![go(), word(ram::NIST, 0x8000)],
            1,
        ),
        ("tacho filter", left(), cell(ram::N_FILTER, 0x7F), 1),
        (
            "speed behind the ramp",
            left(),
            vec![go(), word(ram::NSOLLRAMPE, 8_000)],
            1,
        ),
        (
            "range of speeds",
            left(),
            vec![go(), and(ram::SW_VERSION2, 0x7F)],
            1,
        ),
        ("nsoll", left(), vec![go(), word(ram::NSOLL, 1_300)], 1),
        (
            "nsoll by its halves",
            left(),
            vec![go(), byte(ram::NSOLL, 0x04)],
            1,
        ),
        ("nsoll by Or", left(), vec![go(), or(ram::NSOLL, 0x10)], 1),
        (
            "a word over nsoll and its neighbour",
            left(),
            vec![go(), word(ram::NSOLL + 1, 0)],
            1,
        ),
        (
            "a word up to nsoll",
            left(),
            vec![go(), word(ram::IBIST, 0x0010)],
            1,
        ),
        (
            "left nsoll",
            FoundDrive {
                cells: vec![(ram::NSOLL, 8_000)],
                ..left()
            },
            vec![go()],
            0,
        ),
        (
            "process data",
            left(),
            vec![go(), vec![0x85, 0xFF, 0x05, 0x14]],
            1,
        ),
        (
            "process data to VCOlin",
            FoundDrive {
                data_in: 0x78,
                ..left()
            },
            vec![go(), vec![0x85, 0xFF, 0x01, 0x00]],
            1,
        ),
        (
            "process data to Flags2",
            FoundDrive {
                data_in: 0x57,
                ..left()
            },
            vec![go(), vec![0x85, 0xFF, 0x00, 0x00]],
            1,
        ),
        ("DataIn", left(), vec![go(), byte(ram::DATA_IN, 0x62)], 1),
        (
            "confirmed error",
            FoundDrive {
                cells: vec![(ram::NSOLL, 8_000)],
                ..left()
            },
            vec![byte(ram::ERRORCODE, 0xAF)],
            0,
        ),
        (
            "the EEPROM and a reset",
            left(),
            vec![
                byte(ram::EEPROM_BUFFER, 0x22),
                byte(ram::EEPROM_BUFFER + 1, 0x40),
                byte(ram::EEPROM_CONTROL, 0x82),
            ],
            2,
        ),
        (
            "the EEPROM by a word over data and command",
            left(),
            vec![
                byte(ram::EEPROM_BUFFER, 0x22),
                word(ram::EEPROM_BUFFER + 1, 0x4082),
            ],
            1,
        ),
        (
            "an EEPROM cell that is not known",
            left(),
            vec![byte(ram::EEPROM_CONTROL, 0x82)],
            0,
        ),
        (
            "a reset into the analogue input",
            FoundDrive {
                configuration: [0xC4, 0xFF, 0x40, 0xFF],
                ..left()
            },
            vec![telegram(&[0xDD, 0x21])],
            0,
        ),
    ]
}

/// Each attack is denied where it must be, and the motor stays within the limit.
#[test]
fn attacks_are_denied() {
    for (name, left, telegrams, denied) in attacks() {
        let mut line = bench(&left, limits());
        let (stopped, most) = play(&mut line, &left, &telegrams);
        let why = line.trouble().map(ToString::to_string).unwrap_or_default();
        assert_eq!(stopped, Some(denied), "{name}: {why}");
        assert!(why.contains("max_speed"), "{name}: {why}");
        assert!(most <= f64::from(MOST) + OVERSHOOT, "{name}: {most} rpm");
    }
}

/// The same attacks turn the motor faster where nothing is limited: the simulated drive can show what the guard prevents.
#[test]
fn attacks_are_attacks() {
    let fast = [
        "analogue input",
        "switch to the analogue input",
        "frequency input",
        "reversing mode",
        "positioning at ps_v0",
        "referencing",
        "stepping",
        "nsoll",
        "process data",
        "left nsoll",
    ];
    for (name, left, telegrams, _) in attacks() {
        if !fast.contains(&name) {
            continue;
        }
        let mut line = bench(&left, Limits::unlimited());
        // The zeros of the recovery have put the drive in error (9.8).
        let mut all = vec![byte(ram::ERRORCODE, 0xAF)];
        all.extend(telegrams);
        let (stopped, most) = play(&mut line, &left, &all);
        assert_eq!(stopped, None, "{name}");
        assert!(most > f64::from(MOST) + OVERSHOOT, "{name}: {most} rpm");
    }
}
