//! The values of what the manual leaves open, but for the model's defaults: a right drive may have any of them.

use super::language::syntax::{DriveRange, Header, Setup, SetupKind};
use harness_bench::scenario::times::Duration;
use harness_proto::novobus::properties;
use harness_sim::nd21;
use std::fmt;

/// Times that a time-out may have, in milliseconds, but for the model's own 10 (ND21 9.9).
const TIME_OUTS: std::ops::RangeInclusive<u64> = 11..=20;

/// How long a drive tests itself.
pub(crate) const SELF_TEST_TIME: &str = "self-test-time";

/// A value of an open property that is not the model's default.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    pub(crate) property: &'static str,
    /// It with its value.
    pub(crate) setting: SetupKind,
    /// Another property, without whose value this one explains nothing.
    pub(crate) with: Option<(&'static str, SetupKind)>,
    /// The section of the ND21 manual that leaves it open.
    section: &'static str,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            property,
            setting,
            with,
            section,
        } = self;
        write!(f, "{property} = {}", setting.value())?;
        if let Some((name, with)) = with {
            write!(f, " with {name} = {}", with.value())?;
        }
        write!(f, " (ND21 {section})")
    }
}

impl Choice {
    /// It in every drive of this number of rings.
    pub(crate) fn in_all(&self, rings: usize) -> Header {
        let every = |ring| self.in_some(DriveRange::all(ring));
        (0..rings).flat_map(every).collect()
    }

    /// It in these drives.
    pub(crate) fn in_some(&self, whom: DriveRange) -> Vec<Setup> {
        let with = self.with.as_ref().map(|(_, with)| with);
        let settings = std::iter::once(&self.setting).chain(with);
        settings
            .map(|setting| Setup::new(whom.clone(), setting.clone()))
            .collect()
    }
}

/// Those of the bus.
pub(crate) fn of_the_bus() -> impl Iterator<Item = Choice> {
    properties::PROPERTIES.iter().flat_map(|property| {
        let name = property.name;
        let settings: Vec<_> = match name {
            "time-out" => TIME_OUTS
                .map(|ms| SetupKind::time(name, Duration::millis(ms)))
                .collect(),
            "time-out-wait" => Vec::new(),
            _ => property.values[1..]
                .iter()
                .map(|word| SetupKind::word(name, word))
                .collect(),
        };
        settings.into_iter().map(move |setting| Choice {
            property: name,
            setting,
            with: None,
            section: property.section,
        })
    })
}

/// Those of whole drives.
pub(crate) fn of_drives() -> impl Iterator<Item = Choice> {
    nd21::PROPERTIES.iter().flat_map(|property| {
        let values = property.words().skip(1);
        values.map(|value| Choice {
            property: property.name,
            setting: SetupKind::word(property.name, value),
            with: None,
            section: property.section,
        })
    })
}

/// Self-tests that last for so long (ND21 11.8), of drives that answer the bus meanwhile and of drives that do not.
pub(crate) fn of_self_tests(lasting: Duration) -> impl Iterator<Item = Choice> {
    let time = SetupKind::time(SELF_TEST_TIME, lasting);
    let alone = Choice {
        property: SELF_TEST_TIME,
        setting: time.clone(),
        with: None,
        section: "11.8",
    };
    let silent = of_drives().filter(|choice| choice.property == "self-test-bus");
    let silent = silent.map(move |choice| Choice {
        with: Some((SELF_TEST_TIME, time.clone())),
        ..choice
    });
    std::iter::once(alone).chain(silent)
}
