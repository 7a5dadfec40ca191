//! `drivebench qualify`: every scenario that fits, every open property settled, every deviation named, and a folder of
//! evidence.

use super::args::QualifyArguments;
use super::run::{of_rig, select};
use super::run_rig::{PlayOrder, work};
use super::tally::EarlierVerdicts;
use crate::buses::find_any_rig;
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::evidence::{Keep, SplitRun};
use crate::rig::state;
use std::path::PathBuf;
use std::time::SystemTime;

/// Qualifies a rig.
pub(crate) fn qualify(arguments: &QualifyArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(rig) = find_any_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    let size = Some(rig.ring_size()).filter(|size| *size > 0);
    let entries = match select(&arguments.selection, size) {
        Ok(entries) => of_rig(entries, &rig, output),
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            return Ok(Exit::Usage);
        }
    };
    if entries.is_empty() {
        output.complain("no scenario was selected; `drivebench list` shows what there is");
        return Ok(Exit::NothingSelected);
    }
    let filter = arguments.selection.filter.as_deref();
    let part = arguments
        .partition
        .map(|partition| SplitRun::new(partition, filter, &entries, |_| false));
    let entries = match &part {
        Some(part) => part.share(entries),
        None => entries,
    };
    let Ok(page) = Page::new(arguments.html.as_deref(), output) else {
        return Ok(Exit::Usage);
    };
    let stamp = state::utc(SystemTime::now()).replace([':', ' '], "-");
    let evidence = arguments
        .evidence
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("evidence-{}-{stamp}", rig.id())));
    let job = PlayOrder {
        purpose: "qualify",
        named: Vec::new(),
        allow_motion: arguments.allow_motion,
        wait: arguments.wait.unwrap_or_default(),
        evidence: Some(evidence),
        records: false,
        require_all: arguments.require_all,
        junit: None,
        qualify: true,
        thorough: arguments.thorough,
        sign: arguments.sign.clone(),
        part,
        keep: Keep::All,
        earlier: EarlierVerdicts::default(),
    };
    work(&rig, &entries, &job, page, output)
}
