//! The values of what the manual leaves open, but for the model's defaults: a right drive may have any of them.

use super::language::syntax::{DriveRange, Header, Setup, SetupKind};
use crate::scenario::times::Duration;
use harness_proto::novobus::properties;
use harness_sim::nd21;
use std::fmt;

/// Times that a time-out may have, in milliseconds, but for the model's own 10 (ND21 9.9).
const TIME_OUTS: std::ops::RangeInclusive<u64> = 11..=20;

/// A value of an open property that is not the model's default.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    /// The property.
    pub(crate) property: &'static str,
    /// It with its value.
    pub(crate) setting: SetupKind,
    /// The section of the ND21 manual that leaves it open.
    section: &'static str,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            property,
            setting,
            section,
        } = self;
        write!(f, "{property} = {} (ND21 {section})", setting.value())
    }
}

impl Choice {
    /// It in every drive of this number of rings.
    pub(crate) fn in_all(&self, rings: usize) -> Header {
        let every = |ring| Setup::new(DriveRange::all(ring), self.setting.clone());
        (0..rings).map(every).collect()
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
            section: property.section,
        })
    })
}
