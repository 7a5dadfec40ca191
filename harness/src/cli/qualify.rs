//! `drivebench qualify`: every scenario that fits, every open property settled, every deviation named, and a folder of
//! evidence.

use super::args::QualifyArguments;
use super::run::{of_rig, select};
use super::run_rig::{EarlyEnd, PlayOrder, over, play, show, work};
use super::run_segment;
use super::tally::EarlierVerdicts;
use crate::buses::find_any_rig;
use crate::buses::novobus::language::read::RingScenario;
use crate::buses::novobus::qualify::{Qualification, QualifiedBench};
use crate::buses::novobus::rig::Run;
use crate::buses::syntax::Header;
use crate::buses::twin::Twin;
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::evidence::{DEVIATIONS, Folder, Keep, PROFILE, SplitRun};
use crate::rig::PlayedScenario;
use crate::rig::state;
use crate::scenario::problem::Problems;
use std::path::PathBuf;
use std::time::SystemTime;

/// Qualifies a rig.
pub(crate) fn qualify(arguments: &QualifyArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(rig) = find_any_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    let size = Some(rig.ring_size()).filter(|own| *own > 0);
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
        .map(|own| SplitRun::new(own, filter, &entries, |_| false));
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
    match rig.port() {
        Some(_) => run_segment::work(&rig, &entries, &job, page, output),
        None => work(&rig, &entries, &job, page, output),
    }
}

/// A rig in use, and the folder that keeps what is played on it.
pub(super) struct Live<'l, 's> {
    pub(super) run: &'l mut Run<'s>,
    pub(super) folder: Option<&'l mut Folder>,
    pub(super) output: &'l mut Output,
}

impl QualifiedBench for Live<'_, '_> {
    type Stop = EarlyEnd;

    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, EarlyEnd> {
        let (_, played) = play(self.run, &entry.clone().into(), self.folder.as_deref_mut())?;
        Ok(played)
    }

    fn over(&mut self) -> bool {
        over(self.run)
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        self.run.twin_with(header)
    }

    fn tell(&mut self, text: &str) -> Result<(), EarlyEnd> {
        Ok(self.output.result(text)?)
    }

    fn show(&mut self, entry: &RingScenario, played: &PlayedScenario) -> Result<(), EarlyEnd> {
        Ok(show(&entry.clone().into(), played, self.output)?)
    }
}

/// Settles what is left of a qualification, and writes its files.
pub(super) fn settle(course: Qualification, mut live: Live<'_, '_>) -> Result<Exit, EarlyEnd> {
    let qualified = course.settle(&mut live)?;
    if let Some(folder) = live.folder {
        if let Some(profile) = &qualified.profile {
            folder.add(PROFILE, profile)?;
        }
        folder.add(DEVIATIONS, &qualified.deviations)?;
    }
    live.output.result(&qualified.deviations)?;
    Ok(Exit::of(&[qualified.verdict], false))
}
