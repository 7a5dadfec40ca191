//! The inverter against its reference model, in random exchanges, faults and tasks.

use super::common::{property, setup};
use harness_proto::nordac::{Pkw, PpoType};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::Inverter;
use harness_sim::nordac::inverter::Outputs;
use harness_sim::nordac::reference::ReferenceInverter;
use proptest::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeSet;

#[derive(Clone, Debug)]
enum Step {
    Take(u16, u16, u16),
    Wait(u64),
    Task(u16, u16, u32, bool),
    Cause(Option<u8>),
}

/// Control words that lead somewhere, and any.
fn control_word() -> impl Strategy<Value = u16> {
    let word = prop_oneof![
        8 => Just(0x047F_u16),
        4 => Just(0x047E),
        1 => Just(0x047B),
        1 => Just(0x047D),
        1 => Just(0x0477),
        1 => Just(0x046F),
        1 => Just(0x045F),
        1 => Just(0x043F),
        1 => Just(0x04FE),
        1 => Just(0x0000),
        2 => any::<u16>(),
    ];
    let set = prop_oneof![6 => Just(0_u16), 1 => 0..4_u16];
    let direction = prop_oneof![4 => Just(0_u16), 1 => (0..4_u16).prop_map(|bits| bits << 11)];
    (word, set, direction).prop_map(|(word, set, direction)| word | set << 14 | direction)
}

fn setpoint() -> impl Strategy<Value = u16> {
    prop_oneof![
        Just(0_u16),
        Just(0x2000),
        Just(0x4000),
        Just(0xE000),
        Just(0xC000),
        any::<u16>()
    ]
}

/// Numbers whose change restarts the module, loads the factory settings, or is left open by the text; and ramp times and maximum frequencies
/// for which the reference has its own small choice.
const NOT_CHANGED: [u16; 11] = [
    970, 971, 1202, 1203, 1205, 1602, 1615, 1616, 1619, 1622, 1624,
];

fn task() -> impl Strategy<Value = Step> {
    let numbers: Vec<u16> = harness_proto::nordac::PARAMETERS
        .iter()
        .map(|parameter| parameter.number)
        .collect();
    let number = prop_oneof![20 => proptest::sample::select(numbers), 1 => 0..0x800_u16];
    let ind = prop_oneof![4 => Just(0_u16), 4 => (0..4_u16).prop_map(|set| set << 8), 2 => (0..26_u16).prop_map(|element| element << 8), 1 => any::<u16>()];
    let value = prop_oneof![4 => 0..4_u32, 4 => 0..1_500_u32, 1 => any::<u32>()];
    (0..16_u16, number, ind, value, any::<bool>()).prop_map(|(ak, number, ind, value, ppo1)| {
        let open = NOT_CHANGED.contains(&number) && matches!(ak, 2 | 3 | 7 | 8);
        // Elements of the fault memory other than the code, currents of 1813 and position 0 of 970 are left open.
        let open = open || (1801..=1805).contains(&number) || number == 1813;
        let (ak, ind) = if open { (1, 0) } else { (ak, ind) };
        Step::Task(ak << 12 | number, ind, value, ppo1)
    })
}

/// A ramp time, a quick-stop time or a maximum frequency with a small denominator.
fn ramp_task() -> impl Strategy<Value = Step> {
    let number = proptest::sample::select(vec![
        (1202_u16, vec![20_u32, 40, 100]),
        (1203, vec![20, 40, 100]),
        (1205, vec![500, 700, 900]),
    ]);
    (number, 0..3_usize, 0..4_u16).prop_map(|((number, values), place, set)| {
        Step::Task(0x2000 | number, set << 8, values[place], false)
    })
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        10 => (control_word(), setpoint(), setpoint()).prop_map(|(stw, hsw, pzd4)| Step::Take(stw, hsw, pzd4)),
        5 => prop_oneof![0..100_000_000_u64, 0..6_000_000_000_u64, Just(300_000_000_u64)].prop_map(Step::Wait),
        5 => task(),
        2 => ramp_task(),
        1 => proptest::option::of(1..=25_u8).prop_map(Step::Cause),
    ]
}

/// Status word, actual values and answers agree.
#[test]
fn agrees_with_the_reference() {
    let interface =
        prop_oneof![6 => Just(2_i32), 2 => Just(3), 1 => Just(5), 1 => Just(6), 1 => Just(0)];
    let timeout = prop_oneof![2 => Just(0_i32), 1 => 1..20_i32];
    // Bits of the state and of OFF3, and whether the motor turns.
    let states = RefCell::new(BTreeSet::new());
    let cases = (
        interface,
        timeout,
        0..2_i32,
        0..11_i32,
        0..3_i32,
        proptest::collection::vec(step(), 1..60),
    );
    property(
        "agrees_with_the_reference",
        600,
        &cases,
        |(interface, timeout, reaction, output, second, steps)| {
            let parameters = [
                (1621, interface),
                (1625, timeout),
                (1614, reaction),
                (1517, output),
                (1504, second),
                (1615, 20),
            ];
            // Four sets have the same values.
            let mut settings = setup(8, &[]);
            for (number, value) in parameters {
                for set in 0..4 {
                    let index = harness_proto::nordac::pkw::Index { element: 0, set };
                    settings.parameters.push((number, index, value));
                }
            }
            let mut inverter = Inverter::new(&settings, Instant::START);
            let mut plain: Vec<(u16, i64)> = parameters
                .iter()
                .map(|&(number, value)| (number, value.into()))
                .collect();
            plain.push((1624, 8));
            let mut reference = ReferenceInverter::new(&plain);
            let mut now = Instant::START;
            let first = Step::Take(0x047E, 0, 0);
            for step in std::iter::once(&first).chain(&steps) {
                match *step {
                    Step::Take(stw, hsw, pzd4) => {
                        inverter.take(
                            now,
                            &Outputs {
                                stw,
                                hsw,
                                pzd3: 0,
                                pzd4,
                            },
                        );
                        reference.take(stw, hsw, pzd4);
                    }
                    Step::Wait(units) => {
                        now += Span::from_units(units);
                        inverter.advance(now);
                        reference.advance(now.since_start().units());
                    }
                    Step::Task(pke, ind, pwe, ppo1) => {
                        let ppo = if ppo1 { PpoType::One } else { PpoType::Two };
                        let answer = inverter.task(now, Pkw { pke, ind, pwe }, ppo);
                        let expected = reference.task(pke, ind, pwe, ppo1);
                        prop_assert_eq!((answer.ak(), answer.pwe()), expected, "{:?}", step);
                    }
                    Step::Cause(code) => {
                        inverter.set_cause(now, code);
                        reference.cause(code);
                    }
                }
                let inputs = inverter.inputs(now);
                states
                    .borrow_mut()
                    .insert((inputs.zsw & 0x6F, inputs.hiw != 0));
                let seen = (inputs.zsw, inputs.hiw, inputs.pzd4);
                let expected = (reference.zsw(), reference.hiw(), reference.actual_2());
                prop_assert_eq!(
                    seen,
                    expected,
                    "{:04X?} for {:04X?}, at {} behind {:?}",
                    seen,
                    expected,
                    now,
                    step
                );
            }
            Ok(())
        },
    );
    let states = states.into_inner();
    for state in [
        (0x60, false),
        (0x21, false),
        (0x23, false),
        (0x27, false),
        (0x27, true),
        (0x07, true),
        (0x2F, true),
        (0x28, false),
    ] {
        assert!(
            states.contains(&state),
            "{state:02X?} was never reached: {states:02X?}"
        );
    }
}
