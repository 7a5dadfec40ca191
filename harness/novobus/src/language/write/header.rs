//! The header: rings, rate, and what drives hold and are before anything is sent.

use super::{cell, drives, named};
use crate::language::parse::drive::DEVICES;
use crate::language::syntax::header::{DriveRange, Header, Influence, RingRange, Setup, SetupKind};
use harness_sim::nd21::Stimulus;
use harness_sim::novobus::drive::Model;

/// The lines of a header, each with the word that it begins with and the rest.
pub(crate) fn header(header: &Header) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if !header.rings.is_empty() {
        let sizes: Vec<_> = header.rings.iter().map(sizes).collect();
        lines.push(("ring", sizes.join(", ")));
    }
    if let Some(rate) = header.rate {
        lines.push(("line", rate.bits_per_second().to_string()));
    }
    lines
}

pub(crate) fn lines(header: &Header) -> Vec<String> {
    let words = self::header(header).into_iter();
    let words = words.map(|(word, value)| format!("{word} {value}"));
    words.chain(devices(header)).collect()
}

/// A line about drives: `drive 3 model nd21`.
pub(crate) fn setup(setup: &Setup) -> String {
    format!("drive {} {}", drives(&setup.drives), kind(&setup.what))
}

/// The lines of a header that begin with `drive` or `master`.
pub(crate) fn devices(header: &Header) -> Vec<String> {
    let setups = header.setups.iter();
    let master = header.master.iter();
    let master = master.map(|master| format!("master deviates {}", master.value.name));
    setups.map(setup).chain(master).collect()
}

fn sizes(range: &RingRange) -> String {
    match range.default == range.smallest {
        true => range.sizes(),
        false => format!("{} default {}", range.sizes(), range.default),
    }
}

fn kind(what: &SetupKind) -> String {
    match what {
        SetupKind::Memory(place, value) => {
            format!("memory {} = {}", cell::place(place), cell::value(value))
        }
        SetupKind::Eeprom(place, value) => {
            format!("eeprom {} = {}", cell::place(place), cell::value(value))
        }
        SetupKind::Model(model) => format!("model {}", named(&Model::NAMES, *model)),
        SetupKind::Type(device) => format!("type {}", named(&DEVICES, *device)),
        SetupKind::Influence(what) => influence(what),
        SetupKind::Word(name, word) => format!("property {} = {}", name.value, word.value),
        SetupKind::Time(name, time) => format!("property {} = {time}", name.value),
        SetupKind::Deviates(deviation) => format!("deviates {}", deviation.name),
    }
}

/// What happens to drives from outside the bus: `drive 3 power off`.
pub(crate) fn influence_on(whom: &DriveRange, what: &Influence) -> String {
    format!("drive {} {}", drives(whom), influence(what))
}

/// `input GPIN3 GPIN5 high`, `power off`
fn influence(influence: &Influence) -> String {
    let on = |on: bool| if on { "on" } else { "off" };
    let stimuli = match influence {
        Influence::Power(state) => return format!("power {}", on(*state)),
        Influence::Stimuli(stimuli) => stimuli,
    };
    let inputs: Vec<_> = stimuli
        .iter()
        .filter_map(|stimulus| match stimulus {
            Stimulus::Input(input, level) => Some((input.name(), *level)),
            _ => None,
        })
        .collect();
    if let Some((_, high)) = inputs.first() {
        let names: Vec<_> = inputs.iter().map(|(name, _)| *name).collect();
        let level = if *high { "high" } else { "low" };
        return format!("input {} {level}", names.join(" "));
    }
    stimuli
        .first()
        .map_or_else(String::new, Stimulus::to_string)
}
