//! `drivebench manual`: which tables are pinned, the errata ledgers, and what the manuals leave open.

use super::args::{ManualArguments, Selection};
use super::run::select;
use crate::buses::BUSES;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::library::Entry;
use crate::manual::{Erratum, Manual, ManualTable, NOT_YET};
use std::fmt::Write as _;

/// Shows the coverage of the manuals and the ledgers.
pub(crate) fn manual(arguments: &ManualArguments, output: &mut Output) -> std::io::Result<Exit> {
    let entries = match select(&Selection::default(), None) {
        Ok(entries) => entries,
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            return Ok(Exit::RigError);
        }
    };
    let filter = arguments
        .filter
        .as_deref()
        .unwrap_or_default()
        .to_lowercase();
    let wanted = |text: &str| text.to_lowercase().contains(&filter);
    let mut parts = Vec::new();
    for manual in BUSES.iter().map(|bus| &bus.manual) {
        let (tables, errata) = match (manual.tables(), manual.errata()) {
            (Ok(tables), Ok(errata)) => (tables, errata),
            (Err(error), _) | (_, Err(error)) => {
                let title = manual.title;
                output.complain(&format!("the catalogue of the {title} is damaged: {error}"));
                return Ok(Exit::RigError);
            }
        };
        let sections = [
            coverage(manual, &tables, &entries, arguments.missing, &wanted),
            ledger(&errata, &entries, arguments.missing, &wanted),
            open_points(manual, &wanted),
        ];
        // Of a manual of which nothing is wanted, nothing is shown.
        if filter.is_empty() || sections.iter().any(|(found, _)| *found) {
            parts.push(sections.map(|(_, text)| text).join("\n"));
        }
    }
    if parts.is_empty() {
        output.complain(
            "no table, erratum or open point has this text; `drivebench manual` shows all",
        );
        return Ok(Exit::NothingSelected);
    }
    output.result(&parts.join("\n"))?;
    Ok(Exit::Passed)
}

/// What a manual leaves open, and the properties that settle it; and whether there is anything.
fn open_points(manual: &Manual, wanted: &dyn Fn(&str) -> bool) -> (bool, String) {
    let mut text = String::from(
        "Open: what only hardware can settle, as properties of a drive, the default first\n",
    );
    let mut found = false;
    for open in manual.open() {
        let line = format!(
            "{} {:8} {:22} {:27} {}\n",
            manual.document, open.section, open.name, open.values, open.about
        );
        if wanted(&line) {
            found = true;
            text.push_str(&line);
        }
    }
    (found, text)
}

fn coverage(
    manual: &Manual,
    tables: &[ManualTable],
    entries: &[Entry],
    missing: bool,
    wanted: &dyn Fn(&str) -> bool,
) -> (bool, String) {
    let mut text = format!("Tables and examples of the {}\n", manual.title);
    let mut found = false;
    let mut pinned = 0;
    for table in tables {
        let by: Vec<_> = pinned_by(&table.id, entries)
            .map(Entry::short_name)
            .collect();
        pinned += usize::from(!by.is_empty());
        let by = if by.is_empty() {
            NOT_YET.to_owned()
        } else {
            by.join(", ")
        };
        let page = table
            .page
            .map(|page| format!("p. {page}"))
            .unwrap_or_default();
        let line = format!("{:28} {page:7} {:66} {by}", table.id, table.title);
        if wanted(&line) && !(missing && by != NOT_YET) {
            found = true;
            text.push_str(&line);
            text.push('\n');
        }
    }
    // Writing to a String cannot fail.
    let _infallible = writeln!(text, "{pinned} of {} pinned", tables.len());
    (found, text)
}

/// The scenarios that pin a table.
fn pinned_by<'a>(table: &str, entries: &'a [Entry]) -> impl Iterator<Item = &'a Entry> {
    entries.iter().filter(move |entry| {
        let sources = &entry.scenario.sources;
        sources.iter().any(|source| source.text == table)
    })
}

fn ledger(
    errata: &[Erratum],
    entries: &[Entry],
    missing: bool,
    wanted: &dyn Fn(&str) -> bool,
) -> (bool, String) {
    let mut found = false;
    let mut text =
        String::from("Errata: where the manual contradicts itself or cannot be meant as printed\n");
    for erratum in errata {
        let by: Vec<_> = pinned_by(&erratum.shown_by, entries)
            .map(Entry::short_name)
            .collect();
        if missing && !by.is_empty() {
            continue;
        }
        let by = if by.is_empty() {
            NOT_YET.to_owned()
        } else {
            by.join(", ")
        };
        let entry = format!(
            "{} {} {}: prints \"{}\", meant is {}\n      {}\n      shown by: {by}\n",
            erratum.id,
            erratum.document,
            erratum.section,
            erratum.prints,
            erratum.meant,
            erratum.why
        );
        if wanted(&entry) {
            found = true;
            text.push_str(&entry);
        }
    }
    let _infallible = writeln!(text, "{} errata", errata.len());
    (found, text)
}
