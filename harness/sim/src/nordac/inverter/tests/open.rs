//! Every open point of the inverter under each of its values (section 11 of the reading).

use super::{Bench, Outputs, State, properties};
use harness_proto::nordac::PpoType;

#[test]
fn pzd_invalid() {
    // Nothing is taken; the control word is taken, and the setpoint held; OFF1 is in force.
    for (word, stw, state, hiw) in [
        ("hold", 0x007F, State::OperationEnabled, 0x2000),
        ("hold", 0x007D, State::OperationEnabled, 0x2000),
        ("setpoint-only", 0x007F, State::OperationEnabled, 0x2000),
        ("setpoint-only", 0x007D, State::StartDisable, 0),
        ("stop", 0x007F, State::ReadyToStart, 0),
    ] {
        let mut bench = Bench::open("pzd-invalid", word, &[]);
        bench.run(0x2000).send(stw, 0x4000).wait(10_000);
        assert_eq!(
            (bench.state(), bench.actual()),
            (state, hiw),
            "{word} {stw:04X}"
        );
        // None of them prepares a start.
        let mut bench = Bench::open("pzd-invalid", word, &[]);
        assert_eq!(bench.send(0x007E, 0).state(), State::StartDisable, "{word}");
    }
}

#[test]
fn timeout_counts() {
    for (word, state) in [
        ("valid-pzd", State::Fault),
        ("any-data-exchange", State::ReadyToStart),
    ] {
        let mut bench = Bench::open("timeout-counts", word, &[(1625, 10)]);
        bench.send(0x047E, 0).wait(600).send(0, 0).wait(600);
        assert_eq!(bench.state(), state, "{word}");
    }
}

#[test]
fn timeout_exactly() {
    for (word, state) in [("expires", State::Fault), ("survives", State::ReadyToStart)] {
        let mut bench = Bench::open("timeout-exactly", word, &[(1625, 10)]);
        bench.send(0x047E, 0).wait(1_000).send(0x047E, 0);
        assert_eq!(bench.state(), state, "{word}");
        assert_eq!(bench.wait(1_001).state(), State::Fault, "{word}");
    }
}

#[test]
fn timeout_with_1614() {
    for (word, state) in [("ramp", State::FaultReaction), ("off", State::Fault)] {
        let mut bench = Bench::open(
            "timeout-with-1614",
            word,
            &[(1614, 1), (1202, 1), (1625, 10)],
        );
        bench.send(0x047E, 0).send(0x047F, 0x4000).wait(1_000);
        assert_eq!(bench.state(), state, "{word}");
        let mut bench = Bench::open("timeout-with-1614", word, &[(1614, 1)]);
        bench.run(0x4000).fault(5);
        assert_eq!(bench.state(), State::FaultReaction, "{word}");
    }
}

/// The module calls it only where the property says so.
#[test]
fn watchdog_action() {
    let mut bench = Bench::new(&[]);
    bench.run(0x2000).watchdog();
    assert_eq!(bench.wait(10_000).state(), State::ReadyToStart);
    let mut bench = Bench::new(&[]);
    bench.watchdog();
    assert_eq!(bench.zsw(), 0x0B70);
}

#[test]
fn ramp_of_bit_4() {
    for (word, after_one_second) in [
        ("quick-stop", 0x2000),
        ("deceleration", 0x3000),
        ("at-once", 0),
    ] {
        let mut bench = Bench::open("bit4-ramp", word, &[(1203, 80), (1615, 40)]);
        bench.run(0x4000).send(0x046F, 0x4000).wait(1_000);
        assert_eq!(
            (bench.state(), bench.actual()),
            (State::OperationEnabled, after_one_second),
            "{word}"
        );
        bench.send(0x047F, 0x4000).wait(10_000);
        assert_eq!(bench.actual(), 0x4000, "{word}");
    }
}

#[test]
fn off1_beats_disable() {
    for (word, state) in [
        ("yes", State::OperationEnabled),
        ("no", State::ReadyToStart),
    ] {
        let mut bench = Bench::open("off1-beats-disable", word, &[]);
        assert_eq!(
            bench.run(0x2000).send(0x0476, 0x2000).state(),
            state,
            "{word}"
        );
    }
}

#[test]
fn status_while_off1_ramps() {
    for (word, zsw) in [("7", 0x0F37), ("3", 0x0F33), ("1", 0x0F31)] {
        let mut bench = Bench::open("off1-zsw-while-ramping", word, &[]);
        bench.run(0x2000);
        assert_eq!(bench.zsw(), 0x0F37, "{word}");
        assert_eq!(bench.send(0x047E, 0x2000).zsw(), zsw, "{word}");
    }
}

#[test]
fn status_in_quick_stop_and_fault_reaction() {
    for (word, quick_stop, reaction) in [("1", 0x0F17, 0x0F3F), ("0", 0x0F15, 0x0F3D)] {
        let mut bench = Bench::open("zsw1-in-qs-fr", word, &[(1614, 1)]);
        assert_eq!(
            bench.run(0x2000).send(0x047B, 0x2000).zsw(),
            quick_stop,
            "{word}"
        );
        let mut bench = Bench::open("zsw1-in-qs-fr", word, &[(1614, 1)]);
        bench.run(0x2000).fault(1);
        assert_eq!(bench.zsw(), reaction, "{word}");
    }
}

#[test]
fn both_directions() {
    for (word, hiw) in [("clockwise", 0x2000), ("stop", 0), ("inverted", 0xE000)] {
        let mut bench = Bench::open("both-directions", word, &[]);
        bench.send(0x047E, 0).send(0x1C7F, 0x2000).wait(10_000);
        assert_eq!(
            (bench.actual(), bench.zsw() & 0x0100),
            (hiw, 0x0100),
            "{word}"
        );
    }
}

#[test]
fn above_100_percent() {
    for (word, hiw) in [("limited", 0x4000), ("allowed", 0x6000)] {
        let mut bench = Bench::open("over-100", word, &[]);
        assert_eq!(bench.run(0x6000).actual(), hiw, "{word}");
        // Without maximum frequency there is no frequency in either case.
        bench.task("24B5 0000 0000 0000");
        assert_eq!((bench.actual(), bench.read(1813)), (0, 0), "{word}");
    }
}

#[test]
fn position_words() {
    for (word, position) in [("hsw-high", 0x1234_5678), ("reversed", 0x5678_1234)] {
        let mut bench = Bench::with(properties("position-words", word), true, &[(1704, 3)]);
        let outputs = Outputs {
            stw: 0x047E,
            hsw: 0x1234,
            pzd3: 0x5678,
            pzd4: 0,
        };
        bench.inverter.take(bench.now, &outputs);
        assert_eq!(bench.read(1734), position, "{word}");
    }
    let mut bench = Bench::with(properties("position-words", "reversed"), true, &[(1704, 2)]);
    assert_eq!(bench.send(0x047E, 0x1234).read(1734), 0);
}

#[test]
fn status_bit_8() {
    for (word, start_disable, waiting, running) in [
        ("always", 0x0B70, 0x0A31, 0x0F37),
        ("only-when-enabled", 0x0A70, 0x0A31, 0x0F37),
    ] {
        let mut bench = Bench::open("zsw8", word, &[]);
        assert_eq!(bench.zsw(), start_disable, "{word}");
        assert_eq!(bench.send(0x047E, 0x2000).zsw(), waiting, "{word}");
        assert_eq!(bench.run(0x2000).zsw(), running, "{word}");
    }
}

#[test]
fn status_bit_9() {
    for (word, local) in [("by-interface", 0x0970), ("always", 0x0B70)] {
        assert_eq!(
            Bench::open("zsw9", word, &[(1621, 0)]).zsw(),
            local,
            "{word}"
        );
        assert_eq!(
            Bench::open("zsw9", word, &[(1621, 2)]).zsw(),
            0x0B70,
            "{word}"
        );
    }
}

#[test]
fn status_bit_10() {
    for (word, on_the_way, there) in [
        ("relay-2", 0x0E37, 0x0F37),
        ("setpoint-reached", 0x0A37, 0x0F37),
    ] {
        let mut bench = Bench::open("zsw10", word, &[]);
        bench.send(0x047E, 0).send(0x047F, 0x4000).wait(2_000);
        assert_eq!(bench.zsw(), on_the_way, "{word}");
        assert_eq!(bench.wait(10_000).zsw(), there, "{word}");
    }
}

#[test]
fn status_bit_11_at_rest() {
    for (word, zsw) in [("1", 0x0B70), ("0", 0x0370)] {
        let mut bench = Bench::open("zsw11-at-rest", word, &[]);
        assert_eq!(bench.zsw(), zsw, "{word}");
        assert_eq!(bench.run(0x2000).zsw(), 0x0F37, "{word}");
    }
}

#[test]
fn status_bits_4_and_5_before_the_first_word() {
    for (word, zsw) in [("1", 0x0B70), ("0", 0x0B40)] {
        let mut bench = Bench::open("initial-zsw-4-5", word, &[]);
        assert_eq!(bench.zsw(), zsw, "{word}");
        assert_eq!(bench.send(0x047E, 0).zsw(), 0x0B31, "{word}");
    }
}

/// Property, value, and tasks with their answers, one after the other.
type ChannelCase = (
    &'static str,
    &'static str,
    &'static [(&'static str, &'static str)],
);

const CHANNEL: [ChannelCase; 28] = [
    (
        "address-range",
        "1..126",
        &[("2658 0000 0000 0001", "1658 0000 0000 0001")],
    ),
    (
        "address-range",
        "2..126",
        &[
            ("2658 0000 0000 0001", "7658 0000 0000 0002"),
            ("2658 0000 0000 0002", "1658 0000 0000 0002"),
        ],
    ),
    (
        "load-default-value",
        "0",
        &[
            ("2640 0000 0000 0003", "1640 0000 0000 0003"),
            ("23CA 0000 0000 0001", "13CA 0000 0000 0001"),
            ("1640 0000 0000 0000", "1640 0000 0000 0003"),
            ("23CA 0000 0000 0000", "13CA 0000 0000 0001"),
            ("1640 0000 0000 0000", "1640 0000 0000 0000"),
        ],
    ),
    (
        "load-default-value",
        "1",
        &[
            ("2640 0000 0000 0003", "1640 0000 0000 0003"),
            ("23CA 0000 0000 0000", "13CA 0000 0000 0000"),
            ("1640 0000 0000 0000", "1640 0000 0000 0003"),
            ("23CA 0000 0000 0001", "13CA 0000 0000 0001"),
            ("1640 0000 0000 0000", "1640 0000 0000 0000"),
        ],
    ),
    (
        "negative-pwe1",
        "0000",
        &[
            ("2587 0000 0000 FFFF", "1587 0000 0000 FFFF"),
            ("1587 0000 0000 0000", "1587 0000 0000 FFFF"),
        ],
    ),
    (
        "negative-pwe1",
        "FFFF",
        &[
            ("2587 0000 0000 FFFF", "1587 0000 FFFF FFFF"),
            ("2587 0000 0000 0001", "1587 0000 0000 0001"),
            ("13C7 0000 0000 0000", "13C7 0000 0000 0006"),
        ],
    ),
    (
        "pwe1-of-word-task",
        "ignored",
        &[("2587 0000 1234 FFFF", "1587 0000 0000 FFFF")],
    ),
    (
        "pwe1-of-word-task",
        "checked",
        &[
            ("2587 0000 0000 FFFF", "7587 0000 0000 0002"),
            ("2587 0000 FFFF FFFF", "1587 0000 0000 FFFF"),
            ("24B2 0000 0001 0005", "74B2 0000 0000 0002"),
        ],
    ),
    (
        "ind-low-byte",
        "ignored",
        &[("14B2 00FF 0000 0000", "14B2 00FF 0000 0064")],
    ),
    (
        "ind-low-byte",
        "error-3",
        &[
            ("14B2 0001 0000 0000", "74B2 0001 0000 0003"),
            ("14B2 0100 0000 0000", "14B2 0100 0000 0064"),
        ],
    ),
    (
        "subindex-bits",
        "8..15",
        &[
            ("670E 0480 0000 0000", "470E 0480 0000 0000"),
            ("6721 0080 0000 0000", "4721 0080 0000 0019"),
        ],
    ),
    (
        "subindex-bits",
        "7..15",
        &[
            ("6721 0080 0000 0000", "4721 0080 0000 0002"),
            ("6721 0100 0000 0000", "4721 0100 0000 021C"),
            ("6721 0200 0000 0000", "7721 0200 0000 0003"),
            ("14B2 0100 0000 0000", "14B2 0100 0000 0064"),
        ],
    ),
    (
        "plain-task-subindex",
        "used",
        &[("1721 0200 0000 0000", "1721 0200 0000 021C")],
    ),
    (
        "plain-task-subindex",
        "ignored",
        &[
            ("1721 0200 0000 0000", "1721 0200 0000 0019"),
            ("6721 0200 0000 0000", "4721 0200 0000 021C"),
            ("24B5 0200 0000 01F4", "14B5 0200 0000 01F4"),
            ("14B5 0000 0000 0000", "14B5 0000 0000 02BC"),
        ],
    ),
    (
        "position-count",
        "64",
        &[
            ("96B4 0000 0000 0000", "66B4 0000 0000 0040"),
            ("66B4 2800 0000 0000", "56B4 2800 0000 0000"),
        ],
    ),
    (
        "position-count",
        "10",
        &[
            ("96B5 0000 0000 0000", "66B5 0000 0000 000A"),
            ("66B4 2800 0000 0000", "76B4 2800 0000 0003"),
            ("66B4 2700 0000 0000", "56B4 2700 0000 0000"),
        ],
    ),
    (
        "width-error",
        "201",
        &[("34B2 0000 0000 0005", "74B2 0000 0000 00C9")],
    ),
    (
        "width-error",
        "5",
        &[
            ("34B2 0000 0000 0005", "74B2 0000 0000 0005"),
            ("26AD 0000 0000 0005", "76AD 0000 0000 0005"),
        ],
    ),
    (
        "description-error-order",
        "number-first",
        &[("4001 0000 0000 0000", "7001 0000 0000 0000")],
    ),
    (
        "description-error-order",
        "task-first",
        &[
            ("4001 0000 0000 0000", "7001 0000 0000 0009"),
            ("5001 0000 0000 0000", "7001 0000 0000 0007"),
            ("A001 0000 0000 0000", "7001 0000 0000 00C9"),
        ],
    ),
    (
        "spm",
        "ignored",
        &[("1CB2 0000 0000 0000", "14B2 0000 0000 0064")],
    ),
    (
        "spm",
        "error",
        &[
            ("1CB2 0000 0000 0000", "74B2 0000 0000 00C9"),
            ("0CB2 0000 0000 0000", "0000 0000 0000 0000"),
        ],
    ),
    (
        "1732-write",
        "taken",
        &[("36C4 0000 0000 0005", "26C4 0000 0000 0005")],
    ),
    (
        "1732-write",
        "refused",
        &[
            ("36C4 0000 0000 0005", "76C4 0000 0000 0001"),
            ("36C5 0000 0000 0005", "76C5 0000 0000 0001"),
        ],
    ),
    (
        "967-write",
        "refused",
        &[("23C7 0000 0000 047E", "73C7 0000 0000 0001")],
    ),
    (
        "967-write",
        "taken",
        &[
            ("23C7 0000 0000 047E", "13C7 0000 0000 047E"),
            ("13C8 0000 0000 0000", "13C8 0000 0000 0B31"),
        ],
    ),
    (
        "947-elements",
        "same",
        &[("63B3 0100 0000 0000", "43B3 0100 0000 0005")],
    ),
    (
        "947-elements",
        "newest-first",
        &[
            ("63B3 0100 0000 0000", "43B3 0100 0000 0003"),
            ("63B3 0000 0000 0000", "43B3 0000 0000 0005"),
            ("63B3 0300 0000 0000", "43B3 0300 0000 0000"),
        ],
    ),
];

#[test]
fn parameter_channel() {
    for (name, word, tasks) in CHANNEL {
        let mut bench = Bench::with(properties(name, word), true, &[]);
        if name == "947-elements" {
            for code in [3, 5] {
                bench.inverter.set_cause(bench.now, Some(code));
                bench.inverter.set_cause(bench.now, None);
                bench.send(0x047E, 0).send(0x04FE, 0);
            }
        }
        for &(task, answer) in tasks {
            assert_eq!(bench.task(task), answer, "{name} = {word}: {task}");
        }
    }
}

#[test]
fn changes_while_running() {
    for (word, answer) in [("1", "7657 0000 0000 0001"), ("17", "7657 0000 0000 0011")] {
        let mut bench = Bench::open("online-error", word, &[]);
        assert_eq!(bench.run(0).task("2657 0000 0000 0002"), answer);
    }
}

#[test]
fn double_words_under_ppo1() {
    for (word, read, change) in [
        ("refused", "76AD 0000 0000 00CA", "76AD 0000 0000 00C9"),
        ("allowed", "26AD 0000 0000 0000", "26AD 0000 0001 0005"),
    ] {
        let mut bench = Bench::with(properties("ppo1-double-words", word), true, &[]);
        bench.ppo = PpoType::One;
        assert_eq!(bench.task("16AD 0000 0000 0000"), read);
        assert_eq!(bench.task("36AD 0000 0001 0005"), change);
    }
}

#[test]
fn reinit() {
    for (word, address) in [("at-once", 9), ("at-power-up", 8)] {
        let mut bench = Bench::open("reinit", word, &[(1624, 8)]);
        bench.task("2658 0000 0000 0009");
        assert_eq!(bench.inverter.settings().address, address, "{word}");
        assert_eq!(
            (bench.read(918), bench.read(1624)),
            (address.into(), 9),
            "{word}"
        );
        bench.inverter.power_up(bench.now);
        assert_eq!(bench.inverter.settings().address, 9, "{word}");
    }
}
