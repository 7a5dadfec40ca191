//! The parameter channel: the examples of 3.4, every parameter, every error in its order.

use super::{Bench, first, pkw};
use crate::nordac::{Inverter, InverterSetup};
use harness_proto::nordac::parameter::{Flag, Limit};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{
    Answer, PARAMETERS, Parameter, Pkw, PkwError, PpoType, Properties, Task,
};
use harness_proto::time::Instant;

fn posicon(ppo: PpoType) -> Bench {
    let mut bench = Bench::with(Properties::default(), true, &[]);
    bench.ppo = ppo;
    bench
}

/// The examples of section 8 of the reading, of which the manual prints the parts.
#[test]
fn examples() {
    let mut bench = Bench::new(&[]);
    bench.ppo = PpoType::One;
    for (task, answer) in [
        ("14B2 0000 0000 0000", "14B2 0000 0000 0064"),
        ("24B5 0200 0000 01F4", "14B5 0200 0000 01F4"),
        ("14B5 0200 0000 0000", "14B5 0200 0000 01F4"),
        ("14B5 0000 0000 0000", "14B5 0000 0000 02BC"),
        ("244E 0200 0000 03E8", "744E 0200 0000 0000"),
        ("670E 0900 0000 0000", "470E 0900 0000 0000"),
        ("9709 0000 0000 0000", "6709 0000 0000 0007"),
        ("1001 0000 0000 0000", "7001 0000 0000 0000"),
        ("44B2 0000 0000 0000", "74B2 0000 0000 0009"),
        ("54B2 0000 0000 0000", "74B2 0000 0000 0007"),
        ("A4B2 0000 0000 0000", "74B2 0000 0000 00C9"),
        ("0000 0000 0000 0000", "0000 0000 0000 0000"),
        ("04B2 0100 0000 0007", "0000 0000 0000 0000"),
    ] {
        assert_eq!(bench.task(task), answer, "{task}");
    }
    let mut bench = posicon(PpoType::Two);
    assert_eq!(bench.task("66B4 1500 0000 0000"), "56B4 1500 0000 0000");
}

/// Element and set in IND (3.4.2): element 5, set 2 is 15h; element 21, set 4 is 57h.
#[test]
fn elements_and_sets() {
    let mut bench = posicon(PpoType::Two);
    assert_eq!(bench.task("86B4 1500 FFFF FFFE"), "56B4 1500 FFFF FFFE");
    assert_eq!(bench.task("86B4 5700 0001 0000"), "56B4 5700 0001 0000");
    let position = Parameter::of(1716).unwrap();
    let stored =
        |bench: &Bench, element, set| bench.inverter.parameter(position, Index { element, set });
    assert_eq!(
        (stored(&bench, 5, 1), stored(&bench, 21, 3)),
        (Some(-2), Some(65_536))
    );
    assert_eq!(
        (stored(&bench, 5, 0), stored(&bench, 64, 0)),
        (Some(0), None)
    );
    assert_eq!(bench.task("96B4 FF00 0000 0000"), "66B4 FF00 0000 0040");
}

/// Each error, and which one wins where several apply.
#[test]
fn errors_in_their_order() {
    let cases = [
        // AK above 9 before everything else.
        ("F001 FF00 0000 0000", "7001 FF00 0000 00C9"),
        // An unknown number before the task; 5.6 without PosiCon too.
        ("4001 0000 0000 0000", "7001 0000 0000 0000"),
        ("16A5 0000 0000 0000", "76A5 0000 0000 0000"),
        ("15EF 0000 0000 0000", "75EF 0000 0000 0000"),
        // No array, before the index.
        ("64B2 FF00 0000 0000", "74B2 FF00 0000 0004"),
        ("74B2 0000 0000 0001", "74B2 0000 0000 0004"),
        ("94B2 0000 0000 0000", "74B2 0000 0000 0004"),
        // The index: an element of no array, a set of a parameter without sets, behind the last element.
        ("14B2 0400 0000 0000", "74B2 0400 0000 0003"),
        ("1657 0100 0000 0000", "7657 0100 0000 0003"),
        ("6709 0700 0000 0000", "7709 0700 0000 0003"),
        ("7709 0700 0000 0000", "7709 0700 0000 0003"),
        // Read-only before the width and the limits.
        ("2708 0000 0000 0001", "7708 0000 0000 0001"),
        ("3708 0000 0000 0001", "7708 0000 0000 0001"),
        ("23C7 0000 0000 047F", "73C7 0000 0000 0001"),
        ("7709 0000 0000 0001", "7709 0000 0000 0001"),
        // The width before the limits.
        ("34B2 0000 0000 0000", "74B2 0000 0000 00C9"),
        // The limits.
        ("24B2 0000 0000 0000", "74B2 0000 0000 0002"),
        ("24B2 0000 0000 7D01", "74B2 0000 0000 0002"),
        ("24B2 0000 0000 FFFF", "74B2 0000 0000 0002"),
    ];
    for (task, answer) in cases {
        let mut bench = Bench::new(&[]);
        assert_eq!(bench.task(task), answer, "{task}");
    }
    let mut bench = posicon(PpoType::One);
    for (task, answer) in [
        ("36AD 0000 0000 0001", "76AD 0000 0000 00C9"),
        ("26AD 0000 0000 0001", "76AD 0000 0000 00C9"),
        ("16AD 0000 0000 0000", "76AD 0000 0000 00CA"),
        ("66B4 0000 0000 0000", "76B4 0000 0000 00CA"),
        ("96B4 0000 0000 0000", "66B4 0000 0000 0040"),
        ("36C6 0000 0000 0001", "76C6 0000 0000 0001"),
    ] {
        assert_eq!(bench.task(task), answer, "{task}");
    }
}

/// Without flag O a parameter cannot be changed while the output is on; the width comes first, the limits after.
#[test]
fn changes_while_running() {
    let mut bench = Bench::new(&[(1615, 200)]);
    bench.run(0x4000);
    for (task, answer) in [
        ("24B2 0000 0000 0005", "14B2 0000 0000 0005"),
        ("2657 0000 0000 0003", "7657 0000 0000 0001"),
        ("2657 0000 0000 0063", "7657 0000 0000 0001"),
        ("3657 0000 0000 0003", "7657 0000 0000 00C9"),
        ("23CA 0000 0000 0000", "73CA 0000 0000 0001"),
    ] {
        assert_eq!(bench.task(task), answer, "{task}");
    }
    assert_eq!(
        bench.send(0x047B, 0).task("264F 0000 0000 0001"),
        "764F 0000 0000 0001"
    );
    assert_eq!(
        bench.send(0x047D, 0).task("264F 0000 0000 0001"),
        "164F 0000 0000 0001"
    );
}

/// Limits that are other parameters of the same set.
#[test]
fn symbolic_limits() {
    let mut bench = Bench::new(&[]);
    for (task, answer) in [
        ("24B4 0100 0000 02BC", "14B4 0100 0000 02BC"),
        ("24B4 0100 0000 02BD", "74B4 0100 0000 0002"),
        ("24B5 0100 0000 02BB", "74B5 0100 0000 0002"),
        ("24B5 0000 0000 02BB", "14B5 0000 0000 02BB"),
        ("2645 0000 0000 FD45", "1645 0000 0000 FD45"),
        ("2645 0000 0000 FD44", "7645 0000 0000 0002"),
        ("2645 0100 0000 FD44", "1645 0100 0000 FD44"),
        ("2579 0000 0000 0053", "7579 0000 0000 0002"),
        ("257A 0000 0000 004C", "757A 0000 0000 0002"),
    ] {
        assert_eq!(bench.task(task), answer, "{task}");
    }
}

/// Every parameter reads its factory setting in every set and element, with both tasks.
#[test]
fn every_parameter_reads() {
    let setup = InverterSetup {
        posicon: true,
        parameters: vec![first(1622, 1)],
        ..InverterSetup::default()
    };
    let mut inverter = Inverter::new(&setup, Instant::START);
    let mut read = 0;
    for parameter in &PARAMETERS {
        for set in 0..parameter.sets() {
            for element in 0..u16::from(parameter.count) {
                let index = Index { element, set };
                let ind = index.ind(parameter);
                let task = Pkw::of(Task::Request.ak(), parameter.number, ind, 0);
                let plain = inverter.task(Instant::START, task, PpoType::Two);
                let expected = match (parameter.number, element) {
                    (918, _) => 126,
                    (967, _) => 6,
                    (968, _) => 0x0970,
                    (1622, _) => 1,
                    (1825, 0) => 25,
                    (1825, 1) => 2,
                    (1825, 2) => 540,
                    _ => i64::from(parameter.default),
                };
                let raw = parameter.raw_of(expected).unwrap();
                assert_eq!(
                    plain,
                    Answer::value(parameter, false, raw),
                    "{}",
                    parameter.number
                );
                let task = Pkw::of(Task::RequestArray.ak(), parameter.number, ind, 0);
                let array = inverter.task(Instant::START, task, PpoType::Two);
                let expected = if parameter.is_array() {
                    Answer::value(parameter, true, raw)
                } else {
                    Answer::Error(PkwError::NoArray)
                };
                assert_eq!(array, expected, "{}", parameter.number);
                read += 1;
            }
        }
    }
    assert!(read > 1_000, "{read} values");
}

/// Every parameter takes its two limits, or refuses a change; one below and one above is refused.
#[test]
fn every_parameter_is_limited() {
    for parameter in &PARAMETERS {
        if matches!(parameter.number, 970 | 1602) {
            continue;
        }
        let limit =
            |limit: Limit| limit.resolve(|number| Parameter::of(number).unwrap().default.into());
        let (least, most) = (limit(parameter.least), limit(parameter.most));
        for (value, within) in [
            (least, true),
            (most, true),
            (least - 1, false),
            (most + 1, false),
        ] {
            let Some(raw) = parameter.raw_of(value) else {
                continue;
            };
            let mut bench = posicon(PpoType::Two);
            let task = Pkw::of(Task::change(parameter).ak(), parameter.number, 0, raw);
            let answer = bench.inverter.task(bench.now, task, bench.ppo);
            let expected = match (parameter.has(Flag::ReadOnly), within) {
                (true, _) => Answer::Error(PkwError::ReadOnly),
                (false, true) => Answer::value(parameter, parameter.is_array(), raw),
                (false, false) => Answer::Error(PkwError::Limit),
            };
            assert_eq!(answer, expected, "{} = {value}", parameter.number);
        }
    }
}

/// An answer that is repeated carries the current value, and repeating changes nothing.
#[test]
fn repeated_answers_are_current() {
    let mut bench = Bench::new(&[]);
    let task = pkw("1715 0000 0000 0000");
    bench.send(0x047E, 0).send(0x047F, 0x4000);
    for (millis, tenths) in [(0, 0), (1_000, 140), (1_001, 280)] {
        bench.wait(millis);
        assert_eq!(
            bench.inverter.current(bench.now, task, bench.ppo),
            Answer::Word(tenths)
        );
    }
    let change = pkw("24B2 0000 0000 0005");
    bench.inverter.task(bench.now, change, bench.ppo);
    bench.task("24B2 0000 0000 0009");
    assert_eq!(
        bench.inverter.current(bench.now, change, bench.ppo),
        Answer::Word(9)
    );
}

/// 970 and 1602 load the factory settings, other values do nothing; the module restarts (4.1.3).
#[test]
fn factory_settings() {
    for (task, loads) in [
        ("23CA 0000 0000 0000", true),
        ("23CA 0000 0000 0001", false),
        ("2642 0000 0000 0001", true),
        ("2642 0000 0000 0000", false),
    ] {
        let mut bench = Bench::new(&[(1624, 8), (1600, 3)]);
        bench.task("24B2 0300 0000 0007");
        let before = bench.inverter.settings();
        bench.task(task);
        let settings = bench.inverter.settings();
        assert_eq!(settings != before, loads, "{task}");
        let expected = if loads {
            (126, PpoType::One, 0, 0)
        } else {
            (8, PpoType::Two, 3, 2)
        };
        assert_eq!(
            (
                settings.address,
                settings.ppo,
                bench.read(1600),
                bench.read(1621)
            ),
            expected,
            "{task}"
        );
        assert_eq!(
            bench.task("14B2 0300 0000 0000").ends_with("0064"),
            loads,
            "{task}"
        );
        assert_eq!((bench.read(970), bench.read(1602)), (1, 0), "{task}");
    }
}

/// 1619, 1622 and 1624 take effect at once when they change to another value.
#[test]
fn the_module_begins_anew() {
    for (task, anew) in [
        ("2658 0000 0000 0009", true),
        ("2658 0000 0000 0008", false),
        ("2656 0000 0000 0003", true),
        ("2656 0000 0000 0001", false),
        ("2653 0000 0000 0001", true),
        ("2659 0000 0000 0001", false),
    ] {
        let mut bench = Bench::new(&[(1624, 8)]);
        let before = bench.inverter.settings();
        bench.task(task);
        assert_eq!(bench.inverter.settings() != before, anew, "{task}");
    }
}
