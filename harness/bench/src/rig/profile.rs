//! A profile: what is known about the drives of a rig, as a file that the simulator can load.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Header lines of a scenario, as a profile keeps what makes simulated drives behave as was found.
pub(crate) type ProfileLines = Vec<String>;

/// What makes simulated drives behave as was found.
pub trait ProfileSetup: Default {
    /// Adds what was found of another drive.
    fn add(&mut self, more: &Self);
}

impl ProfileSetup for ProfileLines {
    fn add(&mut self, more: &Self) {
        self.extend_from_slice(more);
    }
}

/// A drive profile (TOML).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile<S> {
    /// The version of this form: 1.
    pub schema: u32,
    /// Which rig was asked.
    pub rig: String,
    /// When, as a date and time of day in UTC.
    pub date: String,
    /// How many drives each ring has; one number for drives that share a segment.
    pub rings: Vec<u8>,
    /// The properties that were settled, by name.
    #[serde(default = "BTreeMap::new")]
    pub property: BTreeMap<String, SettledProperty<S>>,
    /// The properties that were not, with the reason.
    #[serde(default)]
    pub open: BTreeMap<String, String>,
}

/// A property that was settled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettledProperty<S> {
    /// What was found, for people.
    pub value: String,
    /// The section that leaves it open.
    pub section: String,
    /// What makes a simulated drive behave so; in a file, a list of header lines of the scenario language.
    pub setup: S,
}

/// A profile that a rig's file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownProfile {
    pub text: String,
    /// The header lines that make simulated drives behave so.
    pub lines: ProfileLines,
}

/// Why a text is not a profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// It is not TOML, or has other keys than a profile.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// It is of another version.
    #[error("a profile of schema {0}; this program knows schema 1")]
    Schema(u32),
}

impl<S: ProfileSetup + DeserializeOwned> Profile<S> {
    /// Reads a profile.
    ///
    /// # Errors
    /// [`ProfileError`], with line and column.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let profile: Self = toml::from_str(text)?;
        match profile.schema {
            1 => Ok(profile),
            other => Err(ProfileError::Schema(other)),
        }
    }

    /// Notes what was found of a property, of one drive after another.
    pub fn settle(&mut self, property: &str, section: &str, value: &str, setup: &S) {
        let settled = self.property.entry(property.to_owned());
        let settled = settled.or_insert_with(|| SettledProperty {
            value: String::new(),
            section: section.to_owned(),
            setup: S::default(),
        });
        add(&mut settled.value, value);
        settled.setup.add(setup);
    }

    /// Notes why a property is not known, of one drive after another.
    pub fn leave_open(&mut self, property: &str, why: &str) {
        add(self.open.entry(property.to_owned()).or_default(), why);
    }

    /// What makes simulated drives behave as was found.
    #[must_use]
    pub fn header(&self) -> S {
        let mut all = S::default();
        let settled = self.property.values();
        settled.for_each(|property| all.add(&property.setup));
        all
    }
}

fn add(text: &mut String, more: &str) {
    if !text.is_empty() {
        text.push_str("; ");
    }
    text.push_str(more);
}
