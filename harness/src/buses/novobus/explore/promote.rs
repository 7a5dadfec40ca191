//! A finding that is kept: a scenario, an input of the fuzz targets and the table that it leaves, in a checkout of the repository.

use crate::explore::ExploreError;
use crate::explore::Finding;
use crate::explore::files::write_whole;
use crate::explore::{Act, ActKind, Case, Harm};
use crate::library::Entry;
use crate::link::Link;
use crate::manual::tables;
use crate::report::page::page;
use crate::scenario::run::run;
use crate::scenario::simulate::simulated;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use std::path::{Path, PathBuf};

/// The folders of a checkout that the files go into.
const SCENARIOS: &str = "corpora/scenarios/novobus";
const INPUTS: &str = "corpora/fuzz/ring";
const SNAPSHOTS: &str = "snapshots/scenarios/novobus";

/// Maximum number of bytes of an input of the fuzz target `ring`.
const MOST_INPUT: usize = 256;

/// What a promoted finding is called.
#[derive(Clone, Debug)]
pub struct Naming {
    /// The name of its files.
    pub name: String,
    /// Its title; by default that of the finding.
    pub title: Option<String>,
    /// The table of the manual that it covers; by default that of the finding.
    pub source: Option<String>,
}

/// What promoting wrote, and what it saw.
#[derive(Clone, Debug)]
pub struct Promoted {
    /// The scenario, the input and the snapshot.
    pub files: [PathBuf; 3],
    /// The scenario's text.
    pub text: String,
    /// Whether the ring with the planted deviations fails the scenario; `None` where none was planted.
    pub fails_on_deviating: Option<bool>,
}

/// The top folder of the checkout that contains `from`.
///
/// # Errors
/// It is not in a checkout.
pub fn checkout(from: &Path) -> Result<PathBuf, ExploreError> {
    let is_top = |folder: &&Path| {
        let has = |inner: &str| folder.join(inner).is_dir();
        has(SCENARIOS) && has(INPUTS) && has(SNAPSHOTS)
    };
    from.ancestors().find(is_top).map(Path::to_owned).ok_or_else(|| {
        ExploreError::Usage(format!(
            "{} is in no checkout of the repository: {SCENARIOS}, {INPUTS} and {SNAPSHOTS} must be there",
            from.display()
        ))
    })
}

/// Turns a finding into a scenario, an input and a snapshot. Nothing is written where anything is amiss, or where one of the files
/// is there.
///
/// # Errors
/// A name or a table that cannot be, files that are there, a scenario that does not pass on the model.
pub fn promote(finding: &Finding, naming: &Naming, top: &Path) -> Result<Promoted, ExploreError> {
    let name = &naming.name;
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '.';
    if name.is_empty() || name.len() > 80 || !name.chars().all(plain) || name.starts_with('.') {
        return Err(ExploreError::Usage(format!(
            "`{name}` is not a name: small letters, digits, `-` and `.`, such as 9.6-checksum-of-a-read"
        )));
    }
    let files = [
        top.join(SCENARIOS).join(format!("{name}.scn")),
        top.join(INPUTS).join(format!("{name}.hex")),
        top.join(SNAPSHOTS).join(format!("{name}.snap")),
    ];
    if let Some(there) = files.iter().find(|file| file.exists()) {
        return Err(ExploreError::Usage(format!(
            "{} is there already; choose another --name",
            there.display()
        )));
    }
    let sources = sources(finding, naming)?;
    let title = match &naming.title {
        Some(title) => title.clone(),
        None => format!("Found by fuzzing: {}", finding.difference.kind()),
    };
    let text = finding.scenario(&title, &sources)?;
    let snapshot = snapshot(name, &text)?;
    let fails_on_deviating = deviating_fails(finding)?;
    let input = input(&finding.case, &title);
    for (file, text) in files.iter().zip([&text, &input, &snapshot]) {
        if let Err(error) = write_whole(file, text) {
            // All of them or none: none was there before.
            for written in &files {
                let _gone = std::fs::remove_file(written);
            }
            return Err(error);
        }
    }
    Ok(Promoted {
        files,
        text,
        fails_on_deviating,
    })
}

/// The snapshot of a scenario, as `cargo test --test files scenarios` compares it; the model must pass the scenario.
fn snapshot(name: &str, text: &str) -> Result<String, ExploreError> {
    let entry = Entry::new(
        Source {
            name: name.to_owned(),
            text: text.to_owned().into(),
        },
        None,
    )?;
    let Some(plan) = &entry.plan else {
        return Err(ExploreError::Usage("this bus is not built yet".to_owned()));
    };
    let mut link = simulated(plan);
    let outcome = run(plan, &mut link);
    if outcome.verdict != Verdict::Passed {
        let why = outcome.finding.map(|finding| finding.message);
        return Err(ExploreError::Usage(format!(
            "the model itself does not pass this scenario ({}: {}); nothing was written",
            outcome.verdict,
            why.unwrap_or_default()
        )));
    }
    let traces: Vec<_> = (0..plan.rings.len()).map(|ring| link.trace(ring)).collect();
    Ok(format!(
        "---\nsource: harness/tests/files/scenarios.rs\n---\n{}\n",
        page(&entry, &outcome, &traces).trim_end_matches('\n')
    ))
}

/// The tables that the scenario pins: each is in the catalogue.
fn sources(finding: &Finding, naming: &Naming) -> Result<Vec<String>, ExploreError> {
    let Some(source) = &naming.source else {
        return Ok(finding.sources());
    };
    let known = tables().unwrap_or_default();
    match known.iter().any(|table| table.id == *source) {
        true => Ok(vec![source.clone()]),
        false => Err(ExploreError::Usage(format!(
            "the catalogue has no `{source}`; `drivebench manual` shows what there is"
        ))),
    }
}

/// Whether the ring under test fails the scenario.
fn deviating_fails(finding: &Finding) -> Result<Option<bool>, ExploreError> {
    if finding.setup.deviates.is_empty() {
        return Ok(None);
    }
    let header = finding.setup.with_deviations();
    let text = finding.scenario_on(&header, "the ring under test", &[])?;
    let entry = Entry::new(
        Source {
            name: "the ring under test".to_owned(),
            text: text.into(),
        },
        None,
    )?;
    let fails = |plan| run(plan, &mut simulated(plan)).verdict == Verdict::Failed;
    Ok(entry.plan.as_ref().map(fails))
}

/// The input of the fuzz target `ring`: what is damaged and where, then the bytes of the wire.
#[must_use]
pub fn input(case: &Case, title: &str) -> String {
    let bytes = case.bytes();
    let (head, note) = match damage(case) {
        Some(head) => (head, ""),
        None => (
            [0, 0],
            "; without its faults and its silence, which the target has not",
        ),
    };
    let hex = |bytes: &[u8]| {
        let words: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        words.join(" ")
    };
    let mut text = format!(
        "# {title}; a ring of {}{note}\n{}\n",
        case.drives,
        hex(&head)
    );
    for line in bytes[..bytes.len().min(MOST_INPUT)].chunks(32) {
        text.push_str(&hex(line));
        text.push('\n');
    }
    text
}

/// The two bytes in front of an input: link and kind, and which byte; `None` where the target has no such case.
fn damage(case: &Case) -> Option<[u8; 2]> {
    let beyond = |act: &Act| matches!(act.what, ActKind::Wait(_) | ActKind::Power { .. });
    if case.acts.iter().any(beyond) {
        return None;
    }
    match case.faults().as_slice() {
        [] => Some([0, 0]),
        [(link @ 0..=3, byte, harm)] => {
            let kind = match harm {
                Harm::Flip {
                    data,
                    parity: false,
                    stop: false,
                } if data.count_ones() == 1 => u8::try_from(data.trailing_zeros()).ok()?,
                Harm::Drop => 8,
                Harm::Duplicate => 9,
                _ => return None,
            };
            Some([kind << 4 | link, u8::try_from(*byte).ok()?])
        }
        _ => None,
    }
}
