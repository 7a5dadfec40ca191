//! `drivebench manual`: which tables are pinned, the errata ledger, and what the manual leaves open.

use crate::cli::args::{ManualArguments, Selection};
use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::cli::run::select;
use crate::library::Entry;
use crate::manual::{Erratum, ManualTable, NOT_YET, errata, pinned_by, tables};
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::nd21;
use std::fmt::Write as _;

/// Shows the coverage of the manual and the ledger.
pub(crate) fn manual(arguments: &ManualArguments, output: &mut Output) -> std::io::Result<Exit> {
    let entries = match select(&Selection::default(), None) {
        Ok(entries) => entries,
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            return Ok(Exit::RigError);
        }
    };
    let (tables, errata) = match (tables(), errata()) {
        (Ok(tables), Ok(errata)) => (tables, errata),
        (Err(error), _) | (_, Err(error)) => {
            output.complain(&format!("the catalogue of the manual is damaged: {error}"));
            return Ok(Exit::RigError);
        }
    };
    let filter = arguments
        .filter
        .as_deref()
        .unwrap_or_default()
        .to_lowercase();
    let wanted = |text: &str| text.to_lowercase().contains(&filter);
    let mut text = coverage(&tables, &entries, arguments.missing, &wanted);
    text.push('\n');
    text.push_str(&ledger(&errata, &entries, arguments.missing, &wanted));
    text.push('\n');
    text.push_str(&open_points(&wanted));
    output.result(&text)?;
    Ok(Exit::Passed)
}

/// What the manual leaves open, and the properties that settle it.
fn open_points(wanted: &dyn Fn(&str) -> bool) -> String {
    let mut text = String::from(
        "Open: what only hardware can settle, as properties of a drive, the default first\n",
    );
    let bus = PROPERTIES.iter().map(|property| {
        let values = property.values.join(" or ");
        (property.section, property.name, values, property.about)
    });
    let own = nd21::PROPERTIES.iter().map(|property| {
        let values = property.values();
        (property.section, property.name, values, property.about)
    });
    for (section, name, values, about) in bus.chain(own) {
        let line = format!("nd21 {section:8} {name:22} {values:27} {about}\n");
        if wanted(&line) {
            text.push_str(&line);
        }
    }
    text
}

fn coverage(
    tables: &[ManualTable],
    entries: &[Entry],
    missing: bool,
    wanted: &dyn Fn(&str) -> bool,
) -> String {
    let mut text = String::from("Tables and examples of the ND21 User Manual 1/96\n");
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
            text.push_str(&line);
            text.push('\n');
        }
    }
    // Writing to a String cannot fail.
    let _infallible = writeln!(text, "{pinned} of {} pinned", tables.len());
    text
}

fn ledger(
    errata: &[Erratum],
    entries: &[Entry],
    missing: bool,
    wanted: &dyn Fn(&str) -> bool,
) -> String {
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
            text.push_str(&entry);
        }
    }
    let _infallible = writeln!(text, "{} errata", errata.len());
    text
}
