//! `run --rig` on a rig with a port, whose stations share one segment.

use super::run_rig::{Course, EarlyEnd, PlayOrder, course_of, keep, reports, show, worse};
use crate::buses::run_on;
use crate::cli::page::Page;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::{alarm, exit_of, exit_of_end, tell_end};
use crate::evidence::{AboutRun, DEVIATIONS, Folder, PROFILE};
use crate::library::Entry;
use crate::rig::segment::SegmentRun;
use crate::rig::{PlayedScenario, Rig, UseOptions};
use crate::signals::interrupt_flag;

/// Plays scenarios on a rig with a port, and gives the rig back in its safe state.
pub(crate) fn work(
    rig: &Rig,
    entries: &[Entry],
    job: &PlayOrder,
    mut page: Option<Page>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let options = UseOptions {
        purpose: job.purpose.to_owned(),
        wait: job.wait,
        allow_motion: job.allow_motion,
        ill_as_well: job.qualify,
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..UseOptions::default()
    };
    let run = match run_on(rig, &options) {
        Ok(run) => run,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    let mut course = SegmentCourse { rig, run };
    let mut folder = None;
    let exit = match all(
        &mut course,
        entries,
        job,
        (&mut folder, page.as_mut()),
        output,
    ) {
        Ok(exit) => exit,
        Err(EarlyEnd::Session(error)) => {
            output.complain(&error.to_string());
            exit_of(&error)
        }
        Err(EarlyEnd::Evidence(error)) => {
            output.complain(&error.to_string());
            folder = None;
            Exit::of_evidence(&error)
        }
        Err(EarlyEnd::Output(error)) => output.unwritable(&error),
    };
    let exit = exit_of_end(course.run.trouble().as_ref(), exit, output);
    let end = course
        .run
        .close(matches!(exit, Exit::RigError | Exit::Interlock));
    let exit = tell_end(&end, exit, output);
    let safe = end.safe.as_ref().map(|_| exit != Exit::NotSafe);
    Ok(match reports(rig, folder, page, safe, output) {
        true => exit,
        false => exit.with_rig_error(),
    })
}

fn all(
    course: &mut SegmentCourse<'_>,
    entries: &[Entry],
    job: &PlayOrder,
    (folder, page): (&mut Option<Folder>, Option<&mut Page>),
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    if job.qualify && course.run.qualified("", false).is_none() {
        output.complain("drives of this bus cannot be qualified; use `run --rig`");
        return Ok(Exit::Usage);
    }
    if let Some(path) = &job.evidence {
        let segment = course.run.segment();
        let about = AboutRun {
            rig: course.rig,
            rate: segment.rate,
            tolerance: segment.tolerance,
            capabilities: segment.capabilities,
            anew: false,
            own_rings: false,
            purpose: job.purpose,
            selected: entries.iter().map(|entry| &*entry.source.text).collect(),
            part: job.part.as_ref(),
            keep: job.keep,
            sign: job.sign.as_deref(),
        };
        *folder = Some(Folder::create(path, &about)?);
    }
    let exit = course_of(course, entries, job, (folder.as_mut(), page), output)?;
    match job.qualify {
        true => Ok(worse(exit, qualify(course, folder.as_mut(), output)?)),
        false => Ok(exit),
    }
}

/// Plays the conversations of a qualification, and writes what all attempts come to.
fn qualify(
    course: &mut SegmentCourse<'_>,
    mut folder: Option<&mut Folder>,
    output: &mut Output,
) -> Result<Exit, EarlyEnd> {
    let sources = course.run.conversations();
    let mut whole = true;
    for source in sources {
        whole &= !course.over(output);
        if !whole {
            break;
        }
        let entry = match Entry::new(source, None) {
            Ok(entry) => entry,
            Err(problems) => {
                output.mistakes(&problems);
                return Ok(Exit::RigError);
            }
        };
        let (name, played) = course.play(&entry, folder.as_deref_mut())?;
        show(&entry, &played, output)?;
        course.note(&entry, &name, &played, output);
    }
    let began = folder
        .as_ref()
        .map_or_else(String::new, |own| own.began().to_owned());
    let Some(qualified) = course.run.qualified(&began, whole) else {
        return Ok(Exit::Usage);
    };
    if let Some(folder) = folder {
        if let Some(profile) = &qualified.profile {
            folder.add(PROFILE, profile)?;
        }
        folder.add(DEVIATIONS, &qualified.deviations)?;
    }
    output.result(&qualified.deviations)?;
    Ok(Exit::of(&[qualified.verdict], false))
}

/// A rig with a port in use.
struct SegmentCourse<'r> {
    rig: &'r Rig,
    run: Box<dyn SegmentRun>,
}

impl Course for SegmentCourse<'_> {
    fn name(&mut self) -> String {
        self.rig.id().to_owned()
    }

    fn play(
        &mut self,
        entry: &Entry,
        folder: Option<&mut Folder>,
    ) -> Result<(String, PlayedScenario), EarlyEnd> {
        let name = entry.short_name().to_owned();
        match folder {
            None => Ok((name, self.run.play(&entry.source, None)?)),
            Some(folder) => keep(entry, folder, |keeper| {
                self.run.play(&entry.source, Some(keeper))
            }),
        }
    }

    fn note(&mut self, _: &Entry, _: &str, _: &PlayedScenario, output: &mut Output) {
        for note in self.run.notes() {
            output.say(&format!("  note: {note}\n"));
        }
    }

    fn over(&mut self, output: &mut Output) -> bool {
        if let Some(why) = self.run.over() {
            output.complain(&why);
            return true;
        }
        let trouble = self.run.trouble();
        trouble.is_some_and(|trouble| trouble.ends_a_run())
    }
}
