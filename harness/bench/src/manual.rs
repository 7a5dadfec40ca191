//! The manuals' tables and examples, which scenario pins each, and the errata ledgers.

use crate::bus_name::BusName;
use serde::Deserialize;

/// The manual of a bus.
#[derive(Clone, Copy, Debug)]
pub struct Manual {
    pub bus: BusName,
    pub title: &'static str,
    /// The document in a `source` line.
    pub document: &'static str,
    pub tables: &'static str,
    pub errata: &'static str,
    pub open: fn() -> Vec<Open>,
}

/// What a manual leaves open: a property of a drive.
#[derive(Clone, Debug)]
pub struct Open {
    pub section: &'static str,
    /// The name of the property.
    pub name: &'static str,
    /// What it can be, the default first.
    pub values: String,
    /// What it decides.
    pub about: &'static str,
}

/// What a ledger says of an erratum that no scenario shows yet.
pub const NOT_YET: &str = "not yet";

/// A numbered table, byte table, figure of bits or worked example of the manual.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManualTable {
    /// The reference that a scenario's `source` line gives: the document, a section, and an item where the section has several.
    pub id: String,
    pub section: String,
    /// What the reader finds there.
    pub title: String,
    pub page: Option<u32>,
}

/// A place where the manual contradicts itself or cannot be meant as printed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// Its number in the ledger.
    pub id: String,
    pub document: String,
    pub section: String,
    pub prints: String,
    pub meant: String,
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

impl Manual {
    /// The tables and examples, in order of the manual.
    ///
    /// # Errors
    /// The embedded catalogue is damaged; a test keeps it whole.
    pub fn tables(&self) -> Result<Vec<ManualTable>, toml::de::Error> {
        Ok(toml::from_str::<Tables>(self.tables)?.table)
    }

    /// The name of the first table of a section, or else of the section `usual`.
    #[must_use]
    pub fn table_of(&self, section: &str, usual: &str) -> Option<String> {
        let tables = self.tables().unwrap_or_default();
        let of = |section| tables.iter().find(|table| table.section == section);
        Some(of(section).or_else(|| of(usual))?.id.clone())
    }

    /// The errata ledger, in order of the manual.
    ///
    /// # Errors
    /// The embedded ledger is damaged; a test keeps it whole.
    pub fn errata(&self) -> Result<Vec<Erratum>, toml::de::Error> {
        Ok(toml::from_str::<Errata>(self.errata)?.erratum)
    }

    /// What it leaves open.
    #[must_use]
    pub fn open(&self) -> Vec<Open> {
        (self.open)()
    }
}
