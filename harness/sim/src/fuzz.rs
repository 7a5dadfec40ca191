//! What all fuzz targets share, whatever their bus: the names of what an input reaches.
//!
//! By these names a grown corpus is distilled, its files are named, and its targets are summed up.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::fmt;

/// A target: its name, which is that of its folder in `corpora/fuzz`, and its body.
pub type FuzzTarget = (&'static str, fn(&[u8]));

/// Maximum length of an input; further bytes are ignored.
pub const LONGEST: usize = 4_096;

/// Something that an input reaches: a place (a state, a command, a kind of fault) and what happened there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// The section of the manual with the rule; empty where the manual has none, as for texts.
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
        let section = self.section.replace(' ', "");
        format!("{section}{between}{place}--{what}")
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
        let ((section, place, what), (others, its_place, its_what)) = (self.key(), other.key());
        section
            .cmp(others)
            .then((place, what).cmp(&(its_place, its_what)))
            .then(self.section.cmp(other.section))
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
    /// Of what its inputs are made.
    pub pieces: InputPieces,
    /// How many features there are in all, where that is known.
    pub of: Option<fn() -> usize>,
}

/// Of what the inputs of a target are made: pieces that can be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputPieces {
    /// Bytes behind a head, in records of a fixed length.
    Bytes {
        /// How many bytes stand in front of the records.
        head: usize,
        /// How many bytes a record has.
        record: usize,
    },
    /// A text, in lines and words; files have this ending.
    Text(&'static str),
}

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

/// A name as part of a file's name: words in lower-case letters with hyphens between.
#[must_use]
pub fn slug(name: &str) -> String {
    let name = name.replace('*', "upstream").replace("+ 1", "plus 1");
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<_> = words
        .filter(|word| !word.is_empty())
        .map(str::to_ascii_lowercase)
        .collect();
    words.join("-")
}

/// Rows of events: variant, section, words.
#[cfg(any(feature = "unitek", feature = "nordac"))]
macro_rules! events {
    ($($name:ident $section:literal $words:literal;)+) => {
        /// What happens to a drive, or what it does by itself.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Event {
            $(#[doc = concat!($words, " (", $section, ").")] $name,)+
        }

        impl Event {
            /// All of them, in order.
            pub(super) const ALL: &'static [Self] = &[$(Self::$name),+];

            const fn words(self) -> (&'static str, &'static str) {
                match self { $(Self::$name => ($section, $words),)+ }
            }
        }
    };
}

#[cfg(any(feature = "unitek", feature = "nordac"))]
pub(crate) use events;

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
        let feature = Feature::new("9.2", "sync byte due", "A byte; then *");
        assert_eq!(
            feature.file_name(),
            "9.2-sync-byte-due--a-byte-then-upstream"
        );
        let long = Feature::new("", "a text", "x".repeat(200));
        assert_eq!(long.file_name().len(), "a-text--".len() + 72);
    }

    #[test]
    fn nobody_makes_a_feature_that_nobody_notes() {
        Notebook::none().note(|| panic!("made all the same"));
    }
}
