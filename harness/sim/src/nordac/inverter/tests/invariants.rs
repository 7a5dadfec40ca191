//! Properties that hold for all words, tasks and times (section 13 of the reading).

use super::super::super::property::property;
use super::{Bench, InverterInputs, Outputs, State};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{Choices, NordacProperty, PROPERTIES, Properties};
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{PARAMETERS, Pkw, PpoType};
use harness_proto::time::Span;
use proptest::prelude::*;

/// What happens to an inverter.
#[derive(Clone, Debug)]
enum InverterStep {
    Words(Outputs),
    Task(Pkw),
    Wait(u64),
    Cause(Option<u8>),
    Link(bool),
    Watchdog,
    PowerUp,
}

/// Control words that come near to a start, and any others.
fn control() -> impl Strategy<Value = u16> {
    let near = prop::sample::select(vec![
        0x047E, 0x047F, 0x047F, 0x0477, 0x047D, 0x047B, 0x046F, 0x045F, 0x043F, 0x0476, 0x04FF,
        0x147F, 0x447F, 0x007F, 0x0000,
    ]);
    prop_oneof![8 => near, 1 => any::<u16>()]
}

fn words() -> impl Strategy<Value = Outputs> {
    (control(), any::<u16>(), any::<u16>(), any::<u16>()).prop_map(|(stw, hsw, pzd3, pzd4)| {
        Outputs {
            stw,
            hsw,
            pzd3,
            pzd4,
        }
    })
}

/// Tasks on parameters that exist, with values that often lie within the limits.
fn task() -> impl Strategy<Value = Pkw> {
    let numbers: Vec<u16> = PARAMETERS
        .iter()
        .map(|parameter| parameter.number)
        .collect();
    let moving = vec![
        1202, 1203, 1205, 1615, 1625, 1614, 1504, 1509, 1517, 1621, 1617, 1602,
    ];
    let number = prop_oneof![2 => prop::sample::select(moving), 1 => prop::sample::select(numbers), 1 => 0..2048_u16];
    let value = prop_oneof![4 => 0..10_u32, 2 => 0..1_000_u32, 1 => any::<u32>()];
    let ak = prop_oneof![3 => Just(2_u8), 1 => 0..16_u8];
    (ak, number, 0..4_u16, value)
        .prop_map(|(ak, number, set, value)| Pkw::of(ak, number, set << 8, value))
}

fn time() -> impl Strategy<Value = u64> {
    prop_oneof![
        0..3_000_u64,
        0..3_000_000_000_u64,
        Just(300_000_000_u64),
        Just(60_000_000_000_u64)
    ]
}

fn step() -> impl Strategy<Value = InverterStep> {
    prop_oneof![
        8 => words().prop_map(InverterStep::Words),
        4 => task().prop_map(InverterStep::Task),
        6 => time().prop_map(InverterStep::Wait),
        1 => prop::option::of(1..=25_u8).prop_map(InverterStep::Cause),
        1 => any::<bool>().prop_map(InverterStep::Link),
        1 => Just(InverterStep::Watchdog),
        1 => Just(InverterStep::PowerUp),
    ]
}

/// Some properties, each with any of its values.
fn open() -> impl Strategy<Value = Properties> {
    let one = (
        prop::sample::select(PROPERTIES),
        any::<prop::sample::Index>(),
    );
    prop::collection::vec(one, 0..6).prop_map(|all| {
        let mut properties = Properties::default();
        for (property, index) in all {
            set_any(&property, index, &mut properties);
        }
        properties
    })
}

fn set_any(property: &NordacProperty, index: prop::sample::Index, properties: &mut Properties) {
    if let Choices::Words(words) = property.accepts {
        assert!(property.set(properties, words[index.index(words.len())]));
    }
}

impl Bench {
    fn step(&mut self, step: &InverterStep, cut: u64) {
        match *step {
            InverterStep::Words(outputs) => self.inverter.take(self.now, &outputs),
            InverterStep::Task(task) => _ = self.inverter.task(self.now, task, PpoType::Two),
            InverterStep::Wait(units) => {
                // The same time in pieces.
                let part = units / (cut + 1);
                for _ in 0..cut {
                    self.now += Span::from_units(part);
                    self.inverter.advance(self.now);
                    let _looked = self.inputs();
                }
                self.now += Span::from_units(units - part * cut);
                self.inverter.advance(self.now);
            }
            InverterStep::Cause(code) => self.inverter.set_cause(self.now, code),
            InverterStep::Link(true) => self.inverter.link_found(self.now),
            InverterStep::Link(false) => self.inverter.link_lost(self.now),
            InverterStep::Watchdog => self.inverter.watchdog_expired(self.now),
            InverterStep::PowerUp => self.inverter.power_up(self.now),
        }
    }

    /// Everything that a master or a scenario can see.
    fn seen(&self) -> (InverterInputs, State, Vec<Option<i64>>) {
        let all = PARAMETERS.iter();
        let values = all.map(|parameter| self.inverter.parameter(parameter, Index::default()));
        (self.inputs(), self.state(), values.collect())
    }
}

fn steps(most: usize) -> impl Strategy<Value = Vec<InverterStep>> {
    prop::collection::vec(step(), 0..most)
}

#[test]
fn cutting_the_time_changes_nothing() {
    let cuts = prop::collection::vec(0..5_u64, 1..8);
    property(
        "cutting_the_time_changes_nothing",
        &(open(), steps(40), cuts),
        |(properties, steps, cuts)| {
            let mut whole = Bench::with(properties, true, &[(1625, 3)]);
            let mut cut = Bench::with(properties, true, &[(1625, 3)]);
            for (step, pieces) in steps.iter().zip(cuts.iter().cycle()) {
                whole.step(step, 0);
                cut.step(step, *pieces);
                assert_eq!(whole.seen(), cut.seen(), "{step:?}");
            }
        },
    );
}

/// What happens by itself happens at the announced instant, and nothing but the frequency changes before it.
#[test]
fn the_next_action_is_exact() {
    let seen = |bench: &Bench| (bench.state(), bench.read(1800), bench.element(1806, 9));
    property(
        "the_next_action_is_exact",
        &(open(), steps(30)),
        |(properties, steps)| {
            let mut bench = Bench::with(properties, false, &[(1625, 3)]);
            for step in &steps {
                bench.step(step, 0);
                let Some(next) = bench.inverter.next_action() else {
                    continue;
                };
                assert!(next > bench.now, "{next:?} {:?}", bench.now);
                let before = seen(&bench);
                bench.now = next - Span::from_units(1);
                bench.inverter.advance(bench.now);
                assert_eq!(seen(&bench), before, "{step:?}");
                bench.now = next;
                bench.inverter.advance(next);
                assert!(
                    seen(&bench) != before || bench.state() == State::Fault,
                    "{step:?}"
                );
            }
        },
    );
}

/// No task switches the output on; only a valid word does.
#[test]
fn no_task_switches_the_output_on() {
    property("no_task_switches_the_output_on", &steps(60), |steps| {
        let mut bench = Bench::new(&[]);
        for step in &steps {
            let before = bench.state();
            bench.step(step, 0);
            let switched = !before.output_on() && bench.state().output_on();
            let by_words =
                matches!(step, InverterStep::Words(outputs) if outputs.stw & stw::VALID != 0);
            assert!(!switched || by_words, "{step:?}");
            assert!(bench.state().output_on() || bench.actual() == 0);
        }
    });
}

/// The actual value stays within 100 % while the maximum frequency and the set stay.
#[test]
fn the_actual_value_stays_within_100_percent() {
    let steps = prop::collection::vec((words(), time()), 1..40);
    property(
        "the_actual_value_stays_within_100_percent",
        &(steps, 1..=6),
        |(steps, interface)| {
            let mut bench = Bench::new(&[(1621, interface), (1504, 1), (1509, 999)]);
            for (outputs, units) in steps {
                let stw = outputs.stw & 0x3FFF;
                bench.step(&InverterStep::Words(Outputs { stw, ..outputs }), 0);
                bench.step(&InverterStep::Wait(units), 3);
                assert!(bench.actual().cast_signed().unsigned_abs() <= 0x4000);
            }
        },
    );
}

/// After a valid OFF2 the output is off.
#[test]
fn off2_switches_off() {
    property(
        "off2_switches_off",
        &(steps(40), control()),
        |(steps, word)| {
            let mut bench = Bench::new(&[]);
            for step in &steps {
                bench.step(step, 0);
            }
            if bench.read(1621) == 2 {
                bench.send((word | stw::VALID) & !stw::NO_OFF2, 0x4000);
                assert_eq!((bench.zsw() & 6, bench.actual()), (0, 0));
            }
        },
    );
}

/// The motor stands until OFF1 alone and then a start have come in valid words.
#[test]
fn no_start_without_the_sequence() {
    let steps = prop::collection::vec((words(), task(), time()), 1..40);
    property("no_start_without_the_sequence", &steps, |steps| {
        let mut bench = Bench::new(&[]);
        let mut prepared = false;
        for (outputs, task, units) in steps {
            let valid = outputs.stw & stw::VALID != 0;
            let starts = valid && outputs.stw & 0x7F == 0x7F;
            if prepared && starts && outputs.hsw != 0 {
                break;
            }
            prepared |= valid && outputs.stw & 7 == 6;
            bench.step(&InverterStep::Words(outputs), 0);
            if task.number() != 1621 {
                bench.step(&InverterStep::Task(task), 0);
            }
            bench.step(&InverterStep::Wait(units), 0);
            assert_eq!(bench.actual(), 0);
        }
    });
}

/// A setup may store values beyond the limits; the model stays within its numbers.
#[test]
fn any_stored_values() {
    let numbers = vec![
        1202, 1203, 1205, 1301, 1302, 1304, 1309, 1504, 1509, 1517, 1615, 1621, 1625,
    ];
    let value = prop_oneof![Just(0), Just(1), Just(0x7FFF), Just(0xFFFF), any::<i32>()];
    let stored = prop::collection::vec((prop::sample::select(numbers), value), 0..13);
    property(
        "any_stored_values",
        &(open(), stored, steps(30)),
        |(properties, stored, steps)| {
            let mut bench = Bench::with(properties, true, &stored);
            for step in &steps {
                bench.step(step, 2);
                let _shown = bench.seen();
            }
        },
    );
}
