//! Control word, status word, setpoints, actual values, time-outs and faults (3.2, 3.3, 2.6).

use super::{Bench, Outputs, State};
use harness_proto::time::{Instant, Span};

/// The telegrams of section 6 of the reading.
#[test]
fn from_power_up_to_half_speed() {
    let mut bench = Bench::new(&[]);
    assert_eq!((bench.zsw(), bench.actual()), (0x0B70, 0));
    bench.send(0x047E, 0);
    assert_eq!((bench.zsw(), bench.actual()), (0x0B31, 0));
    bench.send(0x047F, 0x2000);
    assert_eq!((bench.zsw(), bench.actual()), (0x0A37, 0));
    bench.wait(1_250);
    assert_eq!((bench.zsw(), bench.actual()), (0x0E37, 0x1000));
    bench.wait(1_250);
    assert_eq!((bench.zsw(), bench.actual()), (0x0F37, 0x2000));
}

#[test]
fn a_setpoint_that_waits_shows_in_every_state() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.send(0x047C, 0x2000).zsw(), 0x0A60);
    assert_eq!(bench.send(0x047E, 0x2000).zsw(), 0x0A31);
    assert_eq!(bench.send(0x043E, 0x2000).zsw(), 0x0B31);
}

/// Each rule of the state machine by the words that cause it: state, words, state, status word at once.
#[test]
fn every_transition() {
    type Row = (u8, fn(&mut Bench), u16, State, u16);
    let at_half: fn(&mut Bench) = |bench| {
        bench.run(0x2000);
    };
    let cases: [Row; 14] = [
        (1, |_| (), 0x047F, State::StartDisable, 0x0B70),
        (2, |_| (), 0x047E, State::ReadyToStart, 0x0B31),
        (
            3,
            |b| _ = b.send(0x047E, 0),
            0x0477,
            State::ReadyForOperation,
            0x0B33,
        ),
        (
            4,
            |b| _ = b.send(0x047E, 0).send(0x0477, 0),
            0x047F,
            State::OperationEnabled,
            0x0B37,
        ),
        (5, |b| _ = b.run(0), 0x047E, State::ReadyToStart, 0x0B31),
        (
            6,
            |b| _ = b.send(0x047E, 0).send(0x0477, 0),
            0x047E,
            State::ReadyToStart,
            0x0B31,
        ),
        (7, at_half, 0x0477, State::ReadyForOperation, 0x0B33),
        (8, at_half, 0x047D, State::StartDisable, 0x0B60),
        (
            8,
            |b| _ = b.send(0x047E, 0),
            0x047D,
            State::StartDisable,
            0x0B60,
        ),
        (
            8,
            |b| _ = b.run(0x2000).send(0x047B, 0),
            0x0479,
            State::StartDisable,
            0x0B40,
        ),
        (9, at_half, 0x047B, State::QuickStop, 0x0E17),
        (11, |b| _ = b.run(0), 0x047B, State::StartDisable, 0x0B50),
        (
            11,
            |b| _ = b.send(0x047E, 0),
            0x047B,
            State::StartDisable,
            0x0B50,
        ),
        (13, |b| b.fail(), 0x04FE, State::StartDisable, 0x0B70),
    ];
    for (rule, prepare, word, state, zsw) in cases {
        let mut bench = Bench::new(&[]);
        prepare(&mut bench);
        bench.send(word, 0);
        assert_eq!(bench.state(), state, "rule {rule}, {word:04X}");
        assert_eq!(
            bench.zsw(),
            zsw,
            "rule {rule}, {word:04X}: {:04X}",
            bench.zsw()
        );
    }
}

impl Bench {
    /// A fault whose cause has gone again.
    fn fail(&mut self) {
        self.inverter.set_cause(self.now, Some(3));
        self.inverter.set_cause(self.now, None);
    }
}

/// Rule 5: OFF1 ramps down with 1203 and switches off at 0; ON resumes.
#[test]
fn off1_ramps_down() {
    let mut bench = Bench::new(&[(1203, 40)]);
    bench.run(0x4000).send(0x047E, 0x4000).wait(500);
    assert_eq!(
        (bench.state(), bench.actual()),
        (State::OperationEnabled, 0x3000)
    );
    bench.send(0x047F, 0x4000).wait(625);
    assert_eq!(bench.actual(), 0x3800);
    bench.send(0x047E, 0x4000).wait(1_749);
    assert_eq!(bench.state(), State::OperationEnabled);
    bench.wait(1);
    assert_eq!((bench.state(), bench.zsw()), (State::ReadyToStart, 0x0A31));
}

/// Rules 9 and 10: a quick stop with 1615 that nothing but OFF2 or a fault ends, and start-disable until the next word.
#[test]
fn quick_stop() {
    let mut bench = Bench::new(&[(1615, 40)]);
    bench.run(0x4000).send(0x047B, 0).wait(1_000);
    assert_eq!((bench.state(), bench.actual()), (State::QuickStop, 0x2000));
    bench.send(0x047F, 0x4000).wait(999);
    assert_eq!((bench.state(), bench.zsw()), (State::QuickStop, 0x0A17));
    bench.send(0x047E, 0).wait(1);
    assert_eq!((bench.state(), bench.zsw()), (State::StartDisable, 0x0B70));
    bench.wait(1_000);
    assert_eq!(bench.state(), State::StartDisable);
    assert_eq!(bench.send(0x047E, 0).state(), State::ReadyToStart);
}

/// Bits 4, 5 and 6: ramp generator to zero with 1615, held, setpoint 0 with 1203.
#[test]
fn bits_of_the_ramp_generator() {
    for (word, after_one_second, zsw) in [
        (0x046F, 0x2000, 0x0E37),
        (0x045F, 0x4000, 0x0F37),
        (0x043F, 0x3000, 0x0E37),
    ] {
        let mut bench = Bench::new(&[(1203, 80), (1615, 40)]);
        bench.run(0x4000).send(word, 0x4000).wait(1_000);
        assert_eq!(
            (bench.actual(), bench.zsw()),
            (after_one_second, zsw),
            "{word:04X}"
        );
    }
    // Bit 0 = 0 goes first, then bit 4, then bit 5.
    for (word, after_one_second) in [(0x040E, 0x3000), (0x040F, 0x2000), (0x041F, 0x4000)] {
        let mut bench = Bench::new(&[(1203, 80), (1615, 40)]);
        bench.run(0x4000).send(word, 0x4000).wait(1_000);
        assert_eq!(bench.actual(), after_one_second, "{word:04X}");
    }
    // A frequency that is held is held where it is.
    let mut bench = Bench::new(&[]);
    bench.send(0x047E, 0).send(0x047F, 0x4000).wait(1_250);
    bench.send(0x045F, 0x4000).wait(5_000);
    assert_eq!((bench.actual(), bench.zsw()), (0x1000, 0x0E37));
}

/// Sign of the setpoint, bits 11 and 12 (3.2.1).
#[test]
fn direction() {
    for (word, hsw, hiw, direction) in [
        (0x047F, 0x2000, 0x2000, 0x0800),
        (0x0C7F, 0x2000, 0x2000, 0x0800),
        (0x147F, 0x2000, 0xE000, 0x1000),
        (0x1C7F, 0x2000, 0x2000, 0x0800),
        (0x047F, 0xE000, 0xE000, 0x1000),
        (0x147F, 0xE000, 0x2000, 0x0800),
        (0x047F, 0x8000, 0xC000, 0x1000),
        (0x147F, 0x8000, 0x4000, 0x0800),
    ] {
        let mut bench = Bench::new(&[]);
        bench.send(0x047E, 0).send(word, hsw).wait(10_000);
        assert_eq!(bench.actual(), hiw, "{word:04X} {hsw:04X}");
        assert_eq!(bench.zsw(), 0x0737 | direction, "{word:04X} {hsw:04X}");
    }
}

/// Bits 14 and 15 choose the parameter set, and the status word shows it.
#[test]
fn parameter_sets() {
    let mut bench = Bench::new(&[]);
    for (number, set, value) in [
        (1205, "01", "015E"),
        (1205, "02", "0578"),
        (1202, "03", "000A"),
    ] {
        bench.task(&format!("2{number:03X} {set}00 0000 {value}"));
    }
    bench.run(0x2000);
    assert_eq!(bench.read(1813), 350);
    bench.send(0x447F, 0x2000).wait(10_000);
    assert_eq!(
        (bench.zsw(), bench.read(1813), bench.actual()),
        (0x4F37, 175, 0x2000)
    );
    bench.send(0x847F, 0x2000).wait(10_000);
    assert_eq!(
        (bench.zsw(), bench.read(1813), bench.actual()),
        (0x8F37, 700, 0x2000)
    );
    bench.send(0xC47F, 0x4000).wait(0);
    assert_eq!((bench.zsw(), bench.actual()), (0xCF37, 0x4000));
}

/// 1621: which words the inverter takes, and who controls it.
#[test]
fn interface() {
    for (interface, state, zsw) in [
        (0, State::StartDisable, 0x0970),
        (1, State::StartDisable, 0x0970),
        (2, State::OperationEnabled, 0x0F37),
        (3, State::OperationEnabled, 0x0F37),
        (4, State::StartDisable, 0x0970),
        (5, State::OperationEnabled, 0x0F37),
        (6, State::OperationEnabled, 0x0F37),
    ] {
        let mut bench = Bench::new(&[(1621, interface)]);
        bench.run(0x2000);
        assert_eq!(
            (bench.state(), bench.zsw()),
            (state, zsw),
            "1621 = {interface}"
        );
        let taken = if interface == 0 { 0 } else { 0x2000 };
        assert_eq!(bench.inverter.words().hsw, taken, "1621 = {interface}");
    }
}

/// Interfaces 4, 5 and 6 limit the setpoint to 0 to 100 %, before PZD4 and the direction.
#[test]
fn limited_setpoint() {
    for (word, hsw, pzd4, hiw) in [
        (0x047F, 0x6000, 0, 0x4000),
        (0x047F, 0xE000, 0, 0),
        (0x147F, 0x2000, 0, 0xE000),
        (0x047F, 0xE000, 0x2000, 0x16DB),
    ] {
        let mut bench = Bench::new(&[(1621, 6), (1504, 1), (1509, 50)]);
        bench
            .with_second(0x047E, 0, 0)
            .with_second(word, hsw, pzd4)
            .wait(20_000);
        assert_eq!(bench.actual(), hiw, "{word:04X} {hsw:04X} {pzd4:04X}");
    }
}

/// PZD4 by 1504: added, subtracted, or only stored (3.2.4). 25 Hz of 70 Hz are 16DBh.
#[test]
fn second_setpoint() {
    for (interface, function, hiw) in [
        (2, 1, 0x2000),
        (3, 0, 0x2000),
        (3, 1, 0x36DB),
        (3, 2, 0x0925),
        (3, 3, 0x2000),
        (6, 1, 0x36DB),
    ] {
        let mut bench = Bench::new(&[(1621, interface), (1504, function), (1509, 50)]);
        bench
            .with_second(0x047E, 0, 0)
            .with_second(0x047F, 0x2000, 0x2000)
            .wait(20_000);
        assert_eq!(bench.actual(), hiw, "1621 = {interface}, 1504 = {function}");
    }
    // The sum is cut at the maximum frequency.
    let mut bench = Bench::new(&[(1621, 3), (1504, 1), (1509, 50)]);
    bench
        .with_second(0x047E, 0, 0)
        .with_second(0x047F, 0x4000, 0x4000)
        .wait(20_000);
    assert_eq!((bench.actual(), bench.zsw()), (0x4000, 0x0F37));
}

/// Actual value 2 by 1517; the three printed examples, and the others from the motor's data (3.2.6).
#[test]
fn second_actual_value() {
    type Row<'a> = (i32, &'a [(u16, i32)], u16, u16);
    let cases: [Row<'_>; 13] = [
        (3, &[(1309, 1_255)], 0x2000, 0x04E7),
        (1, &[(1205, 675)], 0x4000, 0x02A3),
        (0, &[], 0x4000, 0),
        (1, &[], 0xE000, 350),
        (2, &[], 0xE000, 0xFEA2),
        (4, &[], 0x2000, 280),
        (4, &[], 0x4000, 400),
        (5, &[], 0x4000, 0),
        (6, &[], 0x2000, 80),
        (7, &[], 0x2000, 0),
        (8, &[], 0x2000, 0),
        (9, &[], 0xE000, 997),
        (10, &[], 0xE000, 0xFC1B),
    ];
    for (selected, parameters, hsw, pzd4) in cases {
        let mut bench = Bench::new(parameters);
        bench.task(&format!("25ED 0000 0000 {selected:04X}"));
        assert_eq!(bench.inputs().pzd4, 0, "1517 = {selected}, output off");
        bench.run(hsw);
        assert_eq!(bench.inputs().pzd4, pzd4, "1517 = {selected}");
    }
    let mut bench = Bench::new(&[(1301, 0), (1517, 4)]);
    assert_eq!(bench.run(0x2000).inputs().pzd4, 0);
    let mut bench = Bench::new(&[(1301, 0), (1517, 9)]);
    assert_eq!(bench.run(0x2000).inputs().pzd4, 0);
}

/// The maximum frequency moves an enabled motor at once; lowered, the actual value is cut until the ramp has followed.
#[test]
fn maximum_frequency_while_running() {
    let mut bench = Bench::new(&[(1203, 1_000)]);
    bench.run(0x4000);
    assert_eq!(bench.task("24B5 0000 0000 0064"), "14B5 0000 0000 0064");
    assert_eq!((bench.actual(), bench.zsw() & 0x0100), (0x7FFF, 0));
    // 10 Hz in 50 s: from 70 Hz to 10 Hz in 300 s.
    bench.wait(299_999);
    assert_ne!(bench.actual(), 0x4000 - 1);
    assert_eq!(bench.zsw() & 0x0100, 0);
    bench.wait(1);
    assert_eq!((bench.actual(), bench.zsw()), (0x4000, 0x0F37));
    // Without maximum frequency there is none, and OFF1 ends at once.
    bench.task("24B5 0000 0000 0000");
    assert_eq!(
        (bench.actual(), bench.state(), bench.zsw()),
        (0, State::OperationEnabled, 0x0B37)
    );
    let mut bench = Bench::new(&[]);
    bench
        .run(0x4000)
        .send(0x047E, 0)
        .task("24B5 0000 0000 0000");
    assert_eq!(bench.state(), State::ReadyToStart);
}

/// The reference value of bit 10 is 1617, while the output is on.
#[test]
fn reference_value() {
    let mut bench = Bench::new(&[(1617, 100), (1202, 140)]);
    bench.send(0x047E, 0).send(0x047F, 0x4000).wait(999);
    assert_eq!((bench.zsw() & 0x0400, bench.read(1811)), (0, 0));
    bench.wait(1);
    assert_eq!((bench.zsw() & 0x0400, bench.read(1811)), (0x0400, 1));
    assert_eq!(bench.send(0x047D, 0).zsw() & 0x0400, 0);
}

/// Bus time-out 1625: armed by the first valid words, restarted by each, fault 10.
#[test]
fn bus_timeout() {
    let mut bench = Bench::new(&[(1625, 10)]);
    assert_eq!(bench.wait(5_000).state(), State::StartDisable);
    bench.send(0x007E, 0).wait(5_000);
    assert_eq!(bench.state(), State::StartDisable);
    bench
        .send(0x047E, 0)
        .wait(600)
        .send(0x047F, 0x4000)
        .wait(600)
        .send(0x007F, 0)
        .wait(399);
    assert_eq!(
        (bench.state(), bench.actual()),
        (State::OperationEnabled, 0x0CCA)
    );
    assert_eq!(
        bench.inverter.next_action(),
        Some(bench.now + Span::from_millis(1))
    );
    bench.wait(1);
    assert_eq!((bench.state(), bench.zsw()), (State::Fault, 0x0A38));
    assert_eq!(
        (bench.read(1800), bench.element(1806, 9), bench.actual()),
        (10, 1, 0)
    );
    // The word that acknowledges arms it again.
    bench.send(0x04FE, 0);
    assert_eq!(
        (bench.state(), bench.read(1800), bench.read(947)),
        (State::StartDisable, 0, 10)
    );
    assert_eq!(bench.wait(1_000).state(), State::Fault);
    let mut local = Bench::new(&[(1625, 10), (1621, 0)]);
    assert_eq!(
        local.send(0x047E, 0).wait(5_000).state(),
        State::StartDisable
    );
    assert_eq!(local.inverter.next_action(), None);
}

/// 1614: a fault of a running motor starts a quick stop first (rule 12).
#[test]
fn fault_reaction() {
    let mut bench = Bench::new(&[(1614, 1), (1615, 40), (1625, 10)]);
    bench.send(0x047E, 0).send(0x047F, 0x4000);
    for _ in 0..10 {
        bench.wait(900).send(0x047F, 0x4000);
    }
    bench.wait(2_000);
    assert_eq!(
        (bench.state(), bench.zsw(), bench.actual()),
        (State::FaultReaction, 0x0E3F, 0x2000)
    );
    bench.wait(999);
    assert_eq!(bench.state(), State::FaultReaction);
    bench.wait(1);
    assert_eq!((bench.state(), bench.zsw()), (State::Fault, 0x0A38));
    assert_eq!(
        [0, 2, 3, 4, 5, 6].map(|n| bench.element(1801, n)),
        [10, 700, 400, 20, 250, 0]
    );
    // OFF2 ends the reaction, and a motor that stands has none.
    let mut bench = Bench::new(&[(1614, 1)]);
    bench.run(0x4000);
    bench.fault(5);
    assert_eq!(bench.state(), State::FaultReaction);
    assert_eq!(bench.send(0x047D, 0).state(), State::Fault);
    let mut bench = Bench::new(&[(1614, 1)]);
    bench.run(0).fault(5);
    assert_eq!(bench.state(), State::Fault);
}

/// Rule 13: an edge of bit 7 between two valid words, and the cause has gone.
#[test]
fn acknowledge() {
    let mut bench = Bench::new(&[]);
    bench.run(0x2000);
    bench.fault(7);
    assert_eq!((bench.state(), bench.zsw()), (State::Fault, 0x0A38));
    for (word, cause, state) in [
        (0x04FF, Some(7), State::Fault),
        (0x04FF, None, State::Fault),
        (0x047F, None, State::Fault),
        (0x00FF, None, State::Fault),
        (0x04FE, None, State::StartDisable),
        (0x04FE, None, State::ReadyToStart),
    ] {
        bench.inverter.set_cause(bench.now, cause);
        assert_eq!(bench.send(word, 0).state(), state, "{word:04X} {cause:?}");
    }
    // In the state "fault" a further one is not recorded.
    bench.fail();
    bench.fault(9);
    assert_eq!(
        (bench.read(1800), bench.read(1801), bench.read(1802)),
        (3, 3, 7)
    );
}

/// Module and inverter apart: fault 10 after 100 ms (2.6).
#[test]
fn lost_module() {
    let mut bench = Bench::new(&[]);
    bench.run(0x2000);
    bench.link(false);
    bench.wait(60).link(true);
    bench.wait(60).link(false);
    assert_eq!(bench.wait(99).state(), State::OperationEnabled);
    assert_eq!(
        (bench.wait(1).state(), bench.read(1800)),
        (State::Fault, 10)
    );
    assert_eq!(bench.send(0x04FF, 0).state(), State::Fault);
    bench.link(true);
    assert_eq!(
        bench.send(0x047F, 0).send(0x04FF, 0).state(),
        State::StartDisable
    );
    // With 1614 a quick stop comes first.
    let mut bench = Bench::new(&[(1614, 1)]);
    bench.run(0x4000).link(false).wait(100);
    assert_eq!(
        (bench.state(), bench.wait(100).state()),
        (State::FaultReaction, State::Fault)
    );
}

/// Displays of 5.7 with the output on and off.
#[test]
fn displays() {
    let mut bench = Bench::new(&[(1609, 1)]);
    let shown = [
        (1813, 0),
        (1813, 1),
        (1813, 2),
        (1825, 0),
        (1825, 1),
        (1825, 2),
        (1808, 0),
        (1812, 1),
        (1807, 4),
        (965, 0),
        (927, 0),
    ];
    let values = |bench: &Bench| shown.map(|(number, element)| bench.element(number, element));
    assert_eq!(values(&bench), [0, 0, 0, 25, 1, 540, 0, 0, 0, 768, 1]);
    bench.run(0xE001);
    assert_eq!(values(&bench), [349, 20, 0, 25, 1, 540, 0, 0, 0, 768, 1]);
    assert_eq!(
        (bench.read(967), bench.read(968)),
        (0x047F, bench.zsw().into())
    );
    assert_eq!((bench.read(918), bench.read(947)), (126, 0));
}

/// Power-up forgets words, state and a pending fault; parameters and past faults stay.
#[test]
fn power_up() {
    let mut bench = Bench::new(&[]);
    bench.task("24B2 0000 0000 0007");
    bench.run(0x2000).fail();
    bench.inverter.power_up(bench.now);
    assert_eq!((bench.zsw(), bench.actual()), (0x0B70, 0));
    assert_eq!(
        (bench.read(1800), bench.read(1801), bench.read(1202)),
        (0, 3, 7)
    );
    bench.fault(3);
    bench.inverter.power_up(bench.now);
    assert_eq!(bench.state(), State::Fault);
}

/// What happens at one instant and what a look at the clock can change: nothing.
#[test]
fn words_that_are_not_valid_change_nothing() {
    let mut bench = Bench::new(&[(1621, 3), (1504, 1)]);
    bench.run(0x2000);
    for outputs in [
        Outputs::default(),
        Outputs {
            stw: 0x007D,
            hsw: 0,
            pzd3: 1,
            pzd4: 0x1000,
        },
        Outputs {
            stw: 0xFBFF,
            hsw: 0xFFFF,
            pzd3: 0,
            pzd4: 0,
        },
    ] {
        let before = (bench.inputs(), bench.inverter.words());
        bench.inverter.take(bench.now, &outputs);
        bench.wait(1_000);
        assert_eq!(
            (bench.inputs(), bench.inverter.words()),
            before,
            "{outputs:?}"
        );
    }
    assert!(bench.now > Instant::START);
}
