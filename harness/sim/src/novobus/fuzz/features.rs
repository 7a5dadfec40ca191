//! What an input of a fuzz target reaches, by names: by these a grown corpus is distilled, its files are named, and its targets are
//! summed up.

use super::{
    bus_end_watched, codec, detector_watched, drive, guard, hostile, jobs, links, ring_watched,
};
use crate::novobus::transitions::{Event, Reached, Transition, WITHOUT_TIME_OUT, slug};
use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::fmt;

/// Something that an input reaches: a place (a state, a command, a kind of fault) and what happened there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// The section of the ND21's manual with the rule; empty where the manual has none, as for texts.
    pub section: &'static str,
    /// The place.
    pub place: Cow<'static, str>,
    /// What happened there.
    pub what: Cow<'static, str>,
}

impl Feature {
    /// Something that happened at a place, under a rule of a section.
    pub fn new(
        section: &'static str,
        place: impl Into<Cow<'static, str>>,
        what: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self {
            section,
            place: place.into(),
            what: what.into(),
        }
    }

    /// Its name as that of a file, without ending: section, place and what.
    #[must_use]
    pub fn file_name(&self) -> String {
        let between = if self.section.is_empty() { "" } else { "-" };
        let (place, what) = (short(&self.place), short(&self.what));
        format!("{}{between}{place}--{what}", self.section)
    }

    fn key(&self) -> (impl Iterator<Item = u32> + use<>, &str, &str) {
        let numbers = self
            .section
            .split('.')
            .map(|part| part.parse().unwrap_or(0));
        (numbers, &self.place, &self.what)
    }
}

/// A part of a file's name: few enough letters that every file system takes it.
fn short(name: &str) -> String {
    let name = slug(name);
    let end = name.char_indices().nth(72).map_or(name.len(), |(at, _)| at);
    name[..end].trim_end_matches('-').to_owned()
}

impl Ord for Feature {
    /// By the manual: section 9.2 comes before 10.1.
    fn cmp(&self, other: &Self) -> Ordering {
        let ((own, place, what), (others, its_place, its_what)) = (self.key(), other.key());
        own.cmp(others)
            .then((place, what).cmp(&(its_place, its_what)))
    }
}

impl PartialOrd for Feature {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Feature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.what)
    }
}

/// Receives features if the caller wants them. Without a receiver no feature is built.
#[derive(Default)]
pub struct Notebook<'n>(Option<&'n mut dyn FnMut(Feature)>);

impl<'n> Notebook<'n> {
    /// No feature is noted.
    #[must_use]
    pub const fn none() -> Self {
        Self(None)
    }

    /// Each feature goes there.
    pub fn to(there: &'n mut dyn FnMut(Feature)) -> Self {
        Self(Some(there))
    }

    /// Whether features are noted.
    #[must_use]
    pub const fn wanted(&self) -> bool {
        self.0.is_some()
    }

    /// Notes a feature. It is built only if features are noted.
    #[inline]
    pub fn note(&mut self, feature: impl FnOnce() -> Feature) {
        if let Some(there) = &mut self.0 {
            there(feature());
        }
    }

    /// Notes the cells of the matrix.
    pub(super) fn reached(&mut self, reached: &Reached) {
        if self.wanted() {
            for cell in Transition::reachable().filter(|cell| reached.contains(*cell)) {
                self.note(|| of_cell(cell));
            }
        }
    }
}

/// A cell of the matrix as a feature.
#[must_use]
pub fn of_cell(cell: Transition) -> Feature {
    Feature::new(cell.state.section(), cell.state.name(), cell.event.name())
}

/// A body that plays an input and names what it reaches. It panics where the target does.
pub type Body = fn(&[u8], &mut Notebook<'_>);

/// A target with what its inputs reach.
#[derive(Clone, Copy, Debug)]
pub struct Noting {
    /// Its name.
    pub name: &'static str,
    /// Its body.
    pub body: Body,
    /// How many features there are in all, where that is known.
    pub of: Option<fn() -> usize>,
}

/// The targets whose bodies are here.
pub const NOTING: [Noting; 9] = [
    Noting {
        name: "bus_end",
        body: |data, notes| notes.reached(&bus_end_watched(data)),
        of: Some(|| Transition::reachable().count()),
    },
    Noting {
        name: "codec",
        body: codec::noted,
        of: Some(codec::count),
    },
    Noting {
        name: "detector",
        body: |data, notes| notes.reached(&detector_watched(data)),
        of: Some(|| WITHOUT_TIME_OUT),
    },
    Noting {
        name: "links",
        body: links::noted,
        of: Some(links::count),
    },
    Noting {
        name: "ring",
        body: |data, notes| notes.reached(&ring_watched(data)),
        of: Some(parity_only),
    },
    Noting {
        name: "drive",
        body: drive::noted,
        of: None,
    },
    Noting {
        name: "master",
        body: hostile::noted,
        of: None,
    },
    Noting {
        name: "jobs",
        body: jobs::noted,
        of: None,
    },
    Noting {
        name: "guard",
        body: guard::noted,
        of: None,
    },
];

/// What an input reaches.
///
/// # Panics
/// It breaks a rule of the target.
#[must_use]
pub fn features(body: Body, data: &[u8]) -> BTreeSet<Feature> {
    let mut features = BTreeSet::new();
    let mut there = |feature| {
        features.insert(feature);
    };
    body(data, &mut Notebook::to(&mut there));
    features
}

/// Of the line errors the inputs of `ring` can express parity alone.
fn parity_only() -> usize {
    let expressed =
        |cell: &Transition| !matches!(cell.event, Event::Framing | Event::Break | Event::Overrun);
    Transition::reachable().filter(expressed).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_s_order() {
        let early = Feature::new("9.2", "b", "b");
        let late = Feature::new("10.1", "a", "a");
        assert!(early < late);
        assert!(late < Feature::new("10.1", "a", "b"));
        assert!(late < Feature::new("10.1", "b", "a"));
    }

    #[test]
    fn names_of_files() {
        let feature = Feature::new("9.2", "sync byte due", "SYNCO; then *");
        assert_eq!(
            feature.file_name(),
            "9.2-sync-byte-due--synco-then-upstream"
        );
        let long = Feature::new("", "a text", "x".repeat(200));
        assert_eq!(long.file_name().len(), "a-text--".len() + 72);
    }

    #[test]
    fn nobody_makes_a_feature_that_nobody_notes() {
        Notebook::none().note(|| panic!("made all the same"));
    }

    /// Nor does an input of `detector` know silence: counted by the names of events and sections.
    fn without_time_outs() -> usize {
        let expressed = |cell: &Transition| {
            let other = matches!(
                cell.event,
                Event::Framing | Event::Break | Event::Overrun | Event::Silence
            );
            !other && cell.state.section() != "9.9"
        };
        Transition::reachable().filter(expressed).count()
    }

    /// The figures of the corpus's README.
    #[test]
    fn how_many_there_are() {
        assert_eq!((without_time_outs(), parity_only()), (175, 288));
        assert_eq!(without_time_outs(), WITHOUT_TIME_OUT);
    }
}
