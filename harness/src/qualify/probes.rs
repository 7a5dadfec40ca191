//! The probes: a conversation for each property of the bus that the manual leaves open, and its possible values.

use super::hypothesis::Hypothesis;
use crate::library::Entry;
use crate::link::link_name;
use crate::scenario::problem::Problems;
use crate::scenario::source::Source;
use harness_proto::novobus::properties::PROPERTIES;
use include_dir::{Dir, include_dir};
use std::collections::BTreeSet;

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/corpora/probes/novobus");

static CONVERSATIONS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/corpora/qualify/novobus");

/// What stands for a drive's number in a conversation that is played for several: the first ones, the middle one and the
/// last one.
const EACH: &str = "{drive}";

/// Times that a time-out may have, in milliseconds (ND21 9.9: 10 to 20).
const TIME_OUTS: std::ops::RangeInclusive<u64> = 10..=20;

/// A probe for a ring of a given size.
#[derive(Clone, Debug)]
pub struct Probe {
    /// The property that it settles.
    pub property: &'static str,
    /// The section that leaves it open.
    pub section: &'static str,
    /// What the property decides.
    pub about: &'static str,
    /// The conversation; `None` where no conversation on the bus alone shows it.
    pub entry: Option<Entry>,
}

/// The probes for a ring of `drives`, one for each property of the bus.
///
/// # Errors
/// A probe has mistakes.
pub fn probes(drives: u8) -> Result<Vec<Probe>, Box<Problems>> {
    let mut probes = Vec::new();
    for property in &PROPERTIES {
        let file = FILES.get_file(format!("{}.scn", property.name));
        let entry = match file.and_then(|file| file.contents_utf8()) {
            None => None,
            Some(text) => {
                let source = Source {
                    name: format!("probe-{}", property.name),
                    text: text.into(),
                };
                Some(Entry::new(source, Some(drives))?)
            }
        };
        probes.push(Probe {
            property: property.name,
            section: property.section,
            about: property.about,
            entry,
        });
    }
    Ok(probes)
}

/// What stands for a link in a conversation that is played for every link that faults can be put on, and for the drive behind it.
const LINK: &str = "{link}";
const RECEIVER: &str = "{receiver}";

/// More links than this are not all asked: the first ones, the middle one and the last one to a drive.
const MOST_LINKS: usize = 8;

/// The links of a conversation: their places, counted from the master's outgoing one.
fn links(drives: u8, reaches: &dyn Fn(usize) -> bool) -> Vec<u8> {
    let all: Vec<u8> = (0..drives)
        .filter(|place| reaches(usize::from(*place)))
        .collect();
    if all.len() <= MOST_LINKS {
        return all;
    }
    let some = [0, 1, all.len() / 2, all.len() - 1];
    some.into_iter()
        .filter_map(|at| all.get(at).copied())
        .collect()
}

/// The conversations of a qualification, for a ring of `drives`, by their names; `reaches` says on which links faults can be put.
///
/// # Errors
/// One of them has mistakes.
pub fn conversations(
    drives: u8,
    reaches: &dyn Fn(usize) -> bool,
) -> Result<Vec<Entry>, Box<Problems>> {
    let mut files: Vec<_> = CONVERSATIONS.files().collect();
    files.sort_by_key(|file| file.path().to_owned());
    let named = files.into_iter().filter_map(|file| {
        let name = file.path().file_stem()?.to_str()?;
        Some((name, file.contents_utf8()?))
    });
    let mut entries = Vec::new();
    for (name, text) in named {
        if text.contains(LINK) {
            for place in links(drives, reaches) {
                let link = link_name(0, drives, usize::from(place));
                let receiver = (drives - 1 - place).to_string();
                let source = Source {
                    name: format!("qualify-{name}-{}", link.replace("->", "-to-")),
                    text: text
                        .replace(LINK, &link)
                        .replace(RECEIVER, &receiver)
                        .into(),
                };
                entries.push(Entry::new(source, Some(drives))?);
            }
            continue;
        }
        let each: Vec<u8> = match text.contains(EACH) {
            false => vec![0],
            true => [0, 1, drives / 2, drives.saturating_sub(1)]
                .into_iter()
                .filter(|drive| *drive < drives)
                .collect::<BTreeSet<_>>()
                .into_iter()
                .collect(),
        };
        for drive in each {
            let several = text.contains(EACH);
            let source = Source {
                name: match several {
                    true => format!("qualify-{name}-drive-{drive}"),
                    false => format!("qualify-{name}"),
                },
                text: text.replace(EACH, &drive.to_string()).into(),
            };
            entries.push(Entry::new(source, Some(drives))?);
        }
    }
    Ok(entries)
}

/// What a property may be: every drive alike, and then one drive otherwise than the others.
#[must_use]
pub fn hypotheses(property: &str, drives: u8) -> Vec<Hypothesis> {
    let known = PROPERTIES.iter().find(|known| known.name == property);
    let values: Vec<String> = match known.map(|known| known.values) {
        None => return Vec::new(),
        Some(["10ms", _]) => TIME_OUTS.map(|ms| format!("{ms}ms")).collect(),
        Some(words) => words.iter().map(|&word| word.to_owned()).collect(),
    };
    let all = |value: &String| Hypothesis {
        name: value.clone(),
        lines: vec![format!("drive 0..last property {property} = {value}")],
    };
    let mut hypotheses: Vec<_> = values.iter().map(all).collect();
    let differing = values.iter().flat_map(|value| {
        let others = values.iter().filter(move |other| *other != value);
        others.flat_map(move |other| {
            (0..drives).map(move |drive| (value.clone(), other.clone(), drive))
        })
    });
    // More than this tells nothing that a person would read.
    let times = values.len() > 2;
    let differing = differing.take(if drives > 1 && !times { 1_000 } else { 0 });
    hypotheses.extend(differing.map(|(value, other, drive)| Hypothesis {
        name: format!("{value}, but drive {drive} {other}"),
        lines: vec![
            format!("drive 0..last property {property} = {value}"),
            format!("drive {drive} property {property} = {other}"),
        ],
    }));
    hypotheses
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 9.7: the drive that a damaged byte comes to spells out its address.
    #[test]
    fn every_reachable_link_is_located() {
        let names = |drives, reaches: &dyn Fn(usize) -> bool| -> Vec<String> {
            let entries = conversations(drives, reaches).expect("no mistakes");
            let names = entries.iter().map(|entry| entry.short_name().to_owned());
            names.filter(|name| name.contains("location")).collect()
        };
        let own = names(3, &|place| place == 0);
        assert_eq!(own, ["qualify-location-master-to-2"]);
        let inner = names(3, &|place| place < 2);
        assert_eq!(
            inner,
            ["qualify-location-master-to-2", "qualify-location-2-to-1"]
        );
        assert_eq!(names(250, &|_| true).len(), 4);
    }

    #[test]
    fn every_property_of_the_bus_has_a_probe_or_none_can_show_it() {
        let probes = probes(3).expect("no mistakes");
        let without: Vec<_> = probes
            .iter()
            .filter(|probe| probe.entry.is_none())
            .map(|probe| probe.property)
            .collect();
        // The zeros tell time-out and wait together.
        assert_eq!(without, ["time-out-wait"]);
        assert_eq!(hypotheses("read-long", 3).len(), 2 + 2 * 3);
        assert_eq!(hypotheses("read-long", 1).len(), 2);
    }
}
