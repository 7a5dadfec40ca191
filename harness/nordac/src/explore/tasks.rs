//! Tasks of the parameter channel.

use super::act::TelegramAct;
use super::wire::Wire;
use harness_bench::explore::Dice;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{PARAMETERS, Parameter, Pkw, Task};

/// Parameters that decide who controls the inverter and where its module is, and those that load the factory settings.
const OF_THE_BUS: [u16; 8] = [1602, 1619, 1621, 1622, 1624, 1625, 970, 971];

/// Exchanges until an answer has come, and one more.
const PATIENCE: u8 = 4;

/// A task, until its answer has come.
pub(super) fn read(wire: Wire, task: Pkw) -> [TelegramAct; 2] {
    let words = [stw::READY, 0, 0, 0, 0, 0];
    let mut asks = wire.exchange(words, task);
    asks.times = PATIENCE;
    [asks, wire.exchange(words, Pkw::default())]
}

/// A change, and a request of the same parameter after it.
pub(super) fn change_and_read(wire: Wire, task: Pkw) -> Vec<TelegramAct> {
    let is_array = task.task().is_array();
    let again = Pkw::of(if is_array { 6 } else { 1 }, task.number(), task.ind, 0);
    [read(wire, task), read(wire, again)].concat()
}

/// A parameter of those that do not change the bus, or one that does.
fn parameter(of_the_bus: bool, dice: &mut Dice) -> Option<&'static Parameter> {
    if of_the_bus {
        return Parameter::of(*dice.pick(&OF_THE_BUS)?);
    }
    // What changes the course of the motor, or shows it, is asked for more often.
    const TELLING: [u16; 14] = [
        1202, 1203, 1205, 1415, 1504, 1509, 1517, 1614, 1615, 1700, 1801, 1806, 1813, 947,
    ];
    let known = if dice.percent(40) {
        Parameter::of(*dice.pick(&TELLING)?)
    } else {
        dice.pick(&PARAMETERS)
    };
    known.filter(|parameter| !OF_THE_BUS.contains(&parameter.number))
}

/// IND for a set and an element that the parameter has, or just not.
fn index(parameter: &Parameter, dice: &mut Dice) -> u16 {
    let index = Index {
        element: dice.below(usize::from(parameter.count) + 1) as u16,
        set: dice.below(usize::from(parameter.sets())) as u8,
    };
    let ind = index.ind(parameter);
    match dice.below(20) {
        0 => ind | u16::from(dice.byte()),
        1 => dice.word(),
        _ => ind,
    }
}

/// A task that only reads.
pub(super) fn reading(dice: &mut Dice) -> Pkw {
    let Some(parameter) = parameter(false, dice) else {
        return Pkw::of(1, dice.word() & Pkw::LAST_NUMBER, dice.word(), 0);
    };
    let ak = match dice.below(10) {
        0 => *dice.pick(&[4, 5, 10, 15, 0]).unwrap_or(&4),
        1 => 9,
        2 => 6,
        3 => 1,
        _ => Task::read(parameter).ak(),
    };
    spiced(
        Pkw::of(ak, parameter.number, index(parameter, dice), 0),
        dice,
    )
}

/// A task that changes a value.
pub(super) fn changing(of_the_bus: bool, dice: &mut Dice) -> Pkw {
    let Some(parameter) = parameter(of_the_bus, dice) else {
        return reading(dice);
    };
    let usual = |number: u16| Parameter::of(number).map_or(0, |parameter| parameter.default.into());
    let (least, most) = parameter.limits(usual);
    let number = match dice.below(9) {
        0 => least,
        1 => most,
        2 => least - 1,
        3 => most + 1,
        4 => parameter.default.into(),
        5 => i64::from(dice.word()),
        _ => least + dice.below(usize::try_from(most - least).unwrap_or(0).min(200) + 1) as i64,
    };
    let raw = parameter.raw_of(number).unwrap_or(0);
    let ak = match dice.below(10) {
        0 => *dice.pick(&[2, 3, 7, 8]).unwrap_or(&2),
        1 if parameter.is_array() => {
            if parameter.has(Flag::Long) {
                8
            } else {
                7
            }
        }
        _ => Task::change(parameter).ak(),
    };
    spiced(
        Pkw::of(ak, parameter.number, index(parameter, dice), raw),
        dice,
    )
}

/// The same task, sometimes with SPM, or with a PWE1 that a word does not have.
fn spiced(mut task: Pkw, dice: &mut Dice) -> Pkw {
    match dice.below(24) {
        0 => task.pke |= 0x0800,
        1 => task.pwe |= u32::from(dice.word()) << 16,
        2 => task.pwe |= 0xFFFF_0000,
        _ => {}
    }
    task
}
