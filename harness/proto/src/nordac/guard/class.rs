//! What a task of the parameter channel may do, and which permissions it needs.

use super::denial::Missing;
use crate::nordac::parameter::{Flag, Parameter};
use crate::nordac::pkw::{Pkw, Task};

/// What a write to a parameter may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskClass {
    /// Changes the EEPROM and nothing that moves.
    Stored,
    /// Changes data of the motor or of its protection.
    MotorData,
    /// Changes the speed of an enabled motor at once.
    Speed,
    /// Changes how the inverter is reached, and who controls it.
    BusSettings,
    /// Replaces every parameter, the address among them, or is not listed.
    Everything,
    /// Would start a motor past every guard (967, if an inverter takes it).
    Never,
}

/// First number, last number, class; every other parameter is [`TaskClass::Stored`].
const CLASSES: &[(u16, u16, TaskClass)] = {
    use TaskClass::{BusSettings, Everything, MotorData, Never, Speed};
    &[
        (967, 967, Never),
        (970, 970, Everything),
        (1202, 1203, Speed),
        (1205, 1205, Speed),
        (1300, 1309, MotorData),
        (1401, 1402, MotorData),
        (1405, 1411, MotorData),
        (1414, 1414, MotorData),
        (1420, 1420, MotorData),
        (1509, 1509, Speed),
        (1515, 1516, MotorData),
        (1520, 1526, MotorData),
        (1602, 1602, Everything),
        (1604, 1604, MotorData),
        (1609, 1609, MotorData),
        (1614, 1616, MotorData),
        (1619, 1619, BusSettings),
        (1621, 1622, BusSettings),
        (1624, 1624, BusSettings),
        (1625, 1625, MotorData),
        (1627, 1627, MotorData),
        (1701, 1734, MotorData),
    ]
};

/// What a write to this number may do. A number that cannot be written, or is not listed, may do everything.
#[must_use]
pub fn class(number: u16) -> TaskClass {
    let listed = CLASSES
        .iter()
        .find(|(first, last, _)| (*first..=*last).contains(&number))
        .map(|(_, _, class)| *class);
    match Parameter::of(number) {
        _ if listed == Some(TaskClass::Never) => TaskClass::Never,
        Some(parameter) if !parameter.has(Flag::ReadOnly) => listed.unwrap_or(TaskClass::Stored),
        _ => TaskClass::Everything,
    }
}

/// The permissions that a task needs.
pub(super) const fn need(class: TaskClass) -> &'static [Missing] {
    match class {
        TaskClass::Stored => &[Missing::Eeprom],
        TaskClass::MotorData => &[Missing::Eeprom, Missing::MotorData],
        TaskClass::Speed => &[Missing::Eeprom, Missing::MotorData, Missing::Motion],
        TaskClass::BusSettings => &[Missing::Eeprom, Missing::BusSettings],
        TaskClass::Everything | TaskClass::Never => &[Missing::Everything],
    }
}

/// What a task may do; `None` where it only reads. A task that the manual calls invalid may do everything.
pub(super) fn of_task(pkw: Pkw) -> Option<TaskClass> {
    match pkw.task() {
        Task::None
        | Task::Request
        | Task::RequestDescription
        | Task::RequestArray
        | Task::Elements => None,
        Task::Invalid(_) => Some(TaskClass::Everything),
        _ => Some(class(pkw.number())),
    }
}
