//! The manual's tables and examples, which scenario pins each, and the errata ledger.

use crate::library::Entry;
use serde::Deserialize;

const TABLES: &str = include_str!("../../corpora/manual/nd21-tables.toml");
const ERRATA: &str = include_str!("../../corpora/manual/errata.toml");

/// What a ledger says of an erratum that no scenario shows yet.
pub const NOT_YET: &str = "not yet";

/// A numbered table, byte table, figure of bits or worked example of the manual.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManualTable {
    /// The reference that a scenario's `source` line gives: `nd21 9.7`.
    pub id: String,
    /// The section.
    pub section: String,
    /// What the reader finds there.
    pub title: String,
    /// The printed page.
    pub page: Option<u32>,
}

/// A place where the manual contradicts itself or cannot be meant as printed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// Its number in the ledger.
    pub id: String,
    /// Which manual.
    pub document: String,
    /// Which section.
    pub section: String,
    /// What is printed.
    pub prints: String,
    /// What is meant.
    pub meant: String,
    /// The evidence.
    pub why: String,
    /// The table whose scenario shows it, or [`NOT_YET`].
    pub shown_by: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tables {
    table: Vec<ManualTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Errata {
    erratum: Vec<Erratum>,
}

/// The tables and examples, in order of the manual.
///
/// # Errors
/// The embedded catalogue is damaged; a test keeps it whole.
pub fn tables() -> Result<Vec<ManualTable>, toml::de::Error> {
    Ok(toml::from_str::<Tables>(TABLES)?.table)
}

/// The errata ledger, in order of the manual.
///
/// # Errors
/// The embedded ledger is damaged; a test keeps it whole.
pub fn errata() -> Result<Vec<Erratum>, toml::de::Error> {
    Ok(toml::from_str::<Errata>(ERRATA)?.erratum)
}

/// The scenarios that pin a table.
pub fn pinned_by<'a>(table: &str, entries: &'a [Entry]) -> impl Iterator<Item = &'a Entry> {
    entries.iter().filter(move |entry| {
        let sources = &entry.scenario.sources;
        sources.iter().any(|source| source.text == table)
    })
}
