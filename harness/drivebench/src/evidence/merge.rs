//! One folder of the parts of a run that was split.
//!
//! | file | what it holds |
//! |---|---|
//! | `merge.json` | which parts there are, which are missing, and what came of each scenario |
//! | `parts/N` | the folder of part N as it was |
//! | `junit.xml`, `report.txt`, `report.html` | the verdicts of all parts in the order of the whole run |
//! | `profile.toml`, `deviations.txt` | of a qualification: what all parts come to |
//!
//! Each part was played on drives of its own, so each is judged by its own record. All else is made from the parts, and `verify` makes it again.

use super::derive::{DEVIATIONS_HEADING, Derived, PROFILE_HEADING, plain, suite};
use super::error::EvidenceError;
use super::files::{self, DEVIATIONS, JUNIT, PAGE, PROFILE, REPORT, SUMS, sum};
use super::gather::{Gathering, Row};
use super::junit::junit;
use super::qualified::compare;
use super::read_parts::{PARTS, ReadPart, copy, entries, failed, parts_of, place, read};
use super::reports::{file, moved};
use super::signature::Signer;
use super::verify::{OpenedFolder, Verified, verify};
use crate::partition::Partition;
use crate::regular;
use crate::rig::playing::Qualified;
use crate::scenario::run::DENIED;
use crate::scenario::verdict::Verdict;
use crate::shown::{Head, run};
use harness_proto::time::Span;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The record of a merged folder.
pub const MERGE: &str = "merge.json";
/// What the parts of a run come to.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The name and the verdict of each selected scenario, in the order of the whole run.
    pub verdicts: Vec<(String, Verdict)>,
    /// How long they took on the line.
    pub took: Span,
    /// The numbers of the parts that are there, and how many there are.
    pub parts: (Vec<u32>, u32),
    /// What was not played and should have been, in sentences; with any of it the run is incomplete.
    pub missing: Vec<String>,
    /// Whether a scenario that the user named itself was denied by the rig's limits.
    pub named_denied: bool,
    /// Whether no part has left its drives in a state that is not known to be safe.
    pub safe: bool,
    /// Of a qualification: which deviations there are and what was compared, and the verdict on the drives.
    pub deviations: Option<(String, Verdict)>,
}

/// The files of a merged folder.
struct MergedFiles {
    merged: Merged,
    record: String,
    junit: String,
    report: String,
    page: String,
    qualified: Option<Qualified>,
    /// The version of the program that played the parts.
    program: String,
}

/// Merges the folders of parts into a new folder.
///
/// # Errors
/// A folder is no part, was changed, is there twice, is part of another run, or was written by another version of this program; or the new
/// folder cannot be written.
pub fn merge(parts: &[PathBuf], output: &Path) -> Result<Merged, EvidenceError> {
    if fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(EvidenceError::NotEmpty(output.display().to_string()));
    }
    let all = read(parts)?;
    for part in &all {
        let path = part.path.display();
        let program = &part.opened.header.program;
        if program != env!("CARGO_PKG_VERSION") {
            return Err(EvidenceError::Merge(format!(
                "drivebench {program} wrote {path}, and this is {}; merge with the version that played the parts",
                env!("CARGO_PKG_VERSION")
            )));
        }
        let verified = verify(&part.path, None)?;
        if let Some(why) = verified.first_wrong() {
            return Err(EvidenceError::Merge(format!(
                "{path} is not what its record gives: {why}; `drivebench verify {path}` shows all of it"
            )));
        }
    }
    let whole = |path: &Path| std::path::absolute(path).map_err(failed(path));
    let into = whole(output)?;
    for part in &all {
        if into.starts_with(whole(&part.path)?) {
            return Err(EvidenceError::Merge(format!(
                "{} lies in {}, which must stay as it is; name another folder",
                output.display(),
                part.path.display()
            )));
        }
    }
    for part in &all {
        copy(&part.path, &place(output, part.partition.number))?;
    }
    let made = make(output)?;
    let texts = [
        (JUNIT, &made.junit),
        (REPORT, &made.report),
        (PAGE, &made.page),
        (MERGE, &made.record),
    ];
    let qualified = made.qualified.as_ref();
    let found = qualified.map(|qualified| (DEVIATIONS, &qualified.deviations));
    let profile = qualified.and_then(|qualified| Some((PROFILE, qualified.profile.as_ref()?)));
    for (name, text) in texts.into_iter().chain(found).chain(profile) {
        let path = output.join(name);
        regular::write_text(&path, text).map_err(failed(&path))?;
    }
    Ok(made.merged)
}

/// Judges a merged folder again: each part by its own record and its signature where a signer is given, and all else by the parts.
///
/// # Errors
/// It is no merged folder, or a part of it is none.
pub fn verify_merged(
    path: &Path,
    signer: Option<Signer<'_>>,
) -> Result<(Verified, Merged), EvidenceError> {
    let made = make(path).map_err(|error| match error {
        EvidenceError::Merge(why) => EvidenceError::Foreign(path.display().to_string(), why),
        other => other,
    })?;
    let mut verified = Verified {
        complete: made.merged.missing.is_empty(),
        ..Verified::default()
    };
    let mut unconfirmed = BTreeSet::new();
    for number in &made.merged.parts.0 {
        let part = verify(&place(path, *number), signer)?;
        let named = |what: String| format!("{PARTS}/{number}: {what}");
        verified.files.extend(part.files.into_iter().map(named));
        verified.attempts.extend(part.attempts);
        verified.complete &= part.complete;
        unconfirmed.extend(part.unconfirmed);
    }
    verified.unconfirmed.extend(unconfirmed);
    verified
        .unconfirmed
        .extend(made.merged.missing.iter().cloned());
    if made.program == env!("CARGO_PKG_VERSION") {
        let wrong = [
            file(path, MERGE, |_| made.record.clone()),
            file(path, REPORT, |_| made.report.clone()),
            file(path, JUNIT, |stated| {
                moved(&made.junit, path, stated, PARTS)
            }),
            file(path, PAGE, |_| made.page.clone()),
        ];
        verified.files.extend(wrong.into_iter().flatten());
        if let Some(qualified) = &made.qualified {
            verified.files.extend(compare(path, qualified));
        }
    }
    let of_qualification = [PROFILE, DEVIATIONS];
    for name in entries(path)? {
        let name = name.as_str();
        let known = [MERGE, REPORT, JUNIT, PAGE, PARTS].contains(&name)
            || made.qualified.is_some() && of_qualification.contains(&name);
        if !known {
            verified
                .files
                .push(format!("{name} is not a file of a merged run"));
        }
    }
    Ok((verified, made.merged))
}

/// Makes the reports of a merged folder again.
///
/// # Errors
/// It is no merged folder, or a part of it is damaged.
pub(super) fn derive_merged(path: &Path) -> Result<Derived, EvidenceError> {
    make(path).map(|made| Derived {
        html: made.page,
        junit: made.junit,
    })
}

/// The records of the parts of a merged folder.
pub(super) fn opened_parts(path: &Path) -> Result<Vec<OpenedFolder>, EvidenceError> {
    let parts = parts_of(path)?.into_iter();
    Ok(parts.map(|part| part.opened).collect())
}

/// What a qualification found, as the page shows it.
fn found(qualified: &Qualified) -> Vec<(&'static str, String)> {
    let profile = qualified.profile.clone();
    let profile = profile.map(|profile| (PROFILE_HEADING, profile));
    let deviations = (DEVIATIONS_HEADING, qualified.deviations.clone());
    std::iter::once(deviations).chain(profile).collect()
}

/// Makes the files of a merged folder from its parts.
fn make(path: &Path) -> Result<MergedFiles, EvidenceError> {
    let parts = parts_of(path)?;
    let first = &parts[0];
    let (rig, all, of) = (first.opened.rig.id(), first.scenarios(), first.partition.of);
    let mut places: BTreeMap<u32, Vec<usize>> =
        (1..=of).map(|number| (number, Vec::new())).collect();
    for (place, item) in all.iter().enumerate() {
        let owner = first.partition.owner(place, &item.name);
        places.entry(owner).or_default().push(place);
    }
    let mut gathering = Gathering::of(path, first)?;
    for (number, scenarios) in &places {
        let place = parts.binary_search_by_key(number, |part| part.partition.number);
        match place {
            Ok(place) => gathering.part(&parts[place], scenarios)?,
            Err(_) => gathering.no_part(
                Partition {
                    number: *number,
                    ..first.partition
                },
                scenarios,
            ),
        }
    }
    let qualified = gathering.qualified()?;
    let Gathering {
        rows,
        behind,
        missing,
        ..
    } = gathering;
    let denied =
        |(place, row): (&usize, &Row)| all[*place].named && row.settled.begins_with(DENIED);
    let merged = Merged {
        took: rows
            .values()
            .fold(Span::ZERO, |sum, row| sum + row.settled.took),
        verdicts: rows
            .values()
            .map(|row| (row.settled.name.clone(), row.settled.verdict))
            .collect(),
        parts: (parts.iter().map(|part| part.partition.number).collect(), of),
        missing,
        named_denied: rows.iter().any(denied),
        safe: !parts.iter().any(ReadPart::is_unsafe),
        deviations: qualified
            .as_ref()
            .map(|qualified| (qualified.deviations.clone(), qualified.verdict)),
    };
    let head = Head {
        found: qualified.as_ref().map_or_else(Vec::new, found),
        title: "drivebench: scenarios on a rig, merged of parts",
        facts: facts(&merged, first),
    };
    let (mut settled, mut cases, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows.into_values().chain(behind) {
        settled.push(row.settled);
        cases.push(row.junit);
        shown.extend(row.shown);
    }
    Ok(MergedFiles {
        record: record(&merged, &parts),
        junit: junit(&suite(rig), &cases),
        report: plain(rig, &settled),
        page: run(&head, shown),
        qualified,
        program: first.opened.header.program.clone(),
        merged,
    })
}

fn facts(merged: &Merged, first: &ReadPart) -> Vec<(&'static str, String)> {
    let (there, of) = &merged.parts;
    let mut facts = vec![
        ("Rig", first.opened.rig.id().to_owned()),
        (
            "Played by",
            format!("drivebench {}", first.opened.header.program),
        ),
        ("Parts", format!("{} of {of}", there.len())),
    ];
    let missing = merged.missing.iter();
    facts.extend(missing.map(|reason| ("Incomplete", reason.clone())));
    facts
}

fn record(merged: &Merged, parts: &[ReadPart]) -> String {
    let of_part = |part: &ReadPart| {
        let sums = files::read(&part.path, SUMS).ok().map(|bytes| sum(&bytes));
        serde_json::json!({ "part": part.partition.to_string(), "folder": format!("{PARTS}/{}", part.partition.number), "sums_sha256": sums })
    };
    let cases = merged.verdicts.iter();
    let cases =
        cases.map(|(name, verdict)| serde_json::json!({ "name": name, "verdict": verdict.name() }));
    let fingerprint: serde_json::Map<_, _> = parts[0]
        .fingerprint()
        .into_iter()
        .map(|(what, value)| (what.replace(' ', "_"), value.into()))
        .collect();
    let value = serde_json::json!({
        "schema": 1,
        "fingerprint": fingerprint,
        "parts": parts.iter().map(of_part).collect::<Vec<_>>(),
        "missing": merged.missing,
        "cases": cases.collect::<Vec<_>>(),
    });
    format!("{value:#}\n")
}
