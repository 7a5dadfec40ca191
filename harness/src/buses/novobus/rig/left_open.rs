//! What the manual leaves open, as an explanation of bytes that differ from the model with its defaults.
//!
//! A drive may have any value of an open property. A difference that such a value explains is no drive's fault.

use super::judge::Heard;
use crate::buses::novobus::twin::Divergence;
use crate::rig::check::Rig;
use crate::rig::run::{known, twin};
use harness_proto::novobus::properties;
use harness_proto::time::Span;
use harness_sim::nd21;
use std::fmt;

/// The largest ring of which single drives are tried.
const SMALL: u8 = 16;

/// Times that a time-out may have, in milliseconds, but for the model's own 10 (ND21 9.9).
const TIME_OUTS: std::ops::RangeInclusive<u64> = 11..=20;

/// A value of an open property that is not the model's default.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Choice {
    /// The property.
    property: &'static str,
    /// The value, as the scenario language writes it.
    value: String,
    /// The section of the ND21 manual that leaves it open.
    section: &'static str,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            property,
            value,
            section,
            ..
        } = self;
        write!(f, "{property} = {value} (ND21 {section})")
    }
}

/// The choices that explain every byte of an attempt, in words; `None` where the model's defaults explain them as well, or where no
/// choice does.
pub(crate) fn explanation(heard: &Heard<'_>) -> Option<String> {
    let real = heard.exactness.tolerance > Span::ZERO && !heard.exactness.knows_cells;
    if !real {
        return None;
    }
    let (mut first, monitored) = differs(&[], heard)?;
    let mut open = choices(heard.rig);
    open.retain(|choice| choice.property != "time-out" || monitored);
    let (mut lines, mut chosen) = (Vec::new(), Vec::new());
    // Each choice explains more bytes than those before it.
    loop {
        let mut further = None;
        for (choice, whose, more) in candidates(&open, &first, &lines, heard) {
            let all = [lines.as_slice(), &more].concat();
            match differs(&all, heard) {
                None => {
                    chosen.push(format!("{choice}{whose}"));
                    return Some(chosen.join(" and "));
                }
                Some((place, _)) if further.is_none() && place.is_behind(&first) => {
                    further = Some((place, format!("{choice}{whose}"), all, choice.property));
                }
                Some(_) => {}
            }
        }
        let (place, words, all, property) = further?;
        open.retain(|choice| choice.property != property);
        chosen.push(words);
        (first, lines) = (place, all);
    }
}

/// Where an attempt first differs from a model.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Place {
    /// In which conversation, counted from 0.
    conversation: usize,
    /// How; `None` where the choice makes no ring.
    divergence: Option<Divergence>,
}

impl Place {
    fn is_behind(&self, other: &Self) -> bool {
        let byte = |own: &Self| own.divergence.as_ref().map(|own| own.byte);
        let place = |own: &Self| (own.conversation, byte(own));
        place(self) > place(other)
    }
}

/// What is tried beside `lines`: each choice in every drive, and in single drives those that change where or how the attempt differs.
fn candidates<'c>(
    open: &'c [Choice],
    first: &Place,
    lines: &[String],
    heard: &Heard<'_>,
) -> Vec<(&'c Choice, String, Vec<String>)> {
    let rings = || ["", "2:"].into_iter().zip(&heard.way.rings);
    let every = |choice: &Choice| -> Vec<String> {
        let all = rings().map(|(ring, _)| line(&format!("{ring}0..last"), choice));
        all.collect()
    };
    let mut all: Vec<_> = open
        .iter()
        .map(|choice| (choice, String::new(), every(choice)))
        .collect();
    for choice in open {
        let whole = [lines, &every(choice)].concat();
        let same = |(place, _): (Place, bool)| place == *first;
        if differs(&whole, heard).is_none_or(same) {
            continue;
        }
        for (ring, size) in rings().filter(|(_, size)| (2..=SMALL).contains(&size.drives())) {
            let single = (0..size.drives()).map(|drive| {
                let drive = format!("{ring}{drive}");
                let line = line(&drive, choice);
                (choice, format!(" in drive {drive}"), vec![line])
            });
            all.extend(single);
        }
    }
    all
}

/// The choices that the rig's file and its profile do not settle.
fn choices(rig: &Rig) -> Vec<Choice> {
    let profile = rig.profile.iter().flat_map(|profile| &profile.lines);
    let setup = rig.file.sim.iter().flat_map(|sim| &sim.setup);
    let lines: Vec<_> = profile.chain(setup).collect();
    let of_the_bus = properties::PROPERTIES.iter().flat_map(|property| {
        let values: Vec<String> = match property.name {
            "time-out" => TIME_OUTS.map(|ms| format!("{ms}ms")).collect(),
            "time-out-wait" => Vec::new(),
            _ => property.values[1..]
                .iter()
                .map(ToString::to_string)
                .collect(),
        };
        values.into_iter().map(move |value| Choice {
            property: property.name,
            value,
            section: property.section,
        })
    });
    let of_drives = nd21::PROPERTIES.iter().flat_map(|property| {
        let values = property.words().skip(1);
        values.map(|value| Choice {
            property: property.name,
            value: value.to_owned(),
            section: property.section,
        })
    });
    let settled = |choice: &Choice| {
        let setting = format!(" property {} = ", choice.property);
        lines.iter().any(|line| line.contains(&setting))
    };
    of_the_bus
        .chain(of_drives)
        .filter(|choice| !settled(choice))
        .collect()
}

fn line(drives: &str, choice: &Choice) -> String {
    format!(
        "drive {drives} property {} = {}",
        choice.property, choice.value
    )
}

/// Where an attempt first differs from drives with these header lines that have just been switched on, and whether one of them monitors
/// time-outs; `None` where every byte is the same.
fn differs(lines: &[String], heard: &Heard<'_>) -> Option<(Place, bool)> {
    (heard.alive)();
    let lines = [known(heard.rig).as_slice(), lines].concat();
    let Ok(mut twin) = twin(heard.rig, &lines) else {
        let nowhere = Place {
            conversation: 0,
            divergence: None,
        };
        return Some((nowhere, false));
    };
    let comparisons = twin.follow_while_alike(heard.conversations, heard.exactness);
    let conversation = comparisons.len();
    let divergence = comparisons.into_iter().next_back()?.divergence?;
    let place = Place {
        conversation,
        divergence: Some(divergence),
    };
    Some((place, twin.monitors()))
}
