//! `drivebench campaign`.

use super::args::{CampaignArguments, TableFormat};
use super::exit::Exit;
use super::output::Output;
use super::page::{writable, write};
use super::run::progress_bar;
use crate::campaign::find::{FindCampaignError, find, names};
use crate::campaign::frames::{self, FrameCampaign};
use crate::campaign::replay::scenario;
use crate::campaign::report::{json, line, table};
use crate::campaign::{Campaign, CaseClass, CaseFaults, PlayedCampaign};
use clap::ValueEnum;
use std::path::PathBuf;

/// Plays campaigns.
pub(crate) fn campaign(
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let wanted = if arguments.campaigns.is_empty() {
        let of_frames = frames::names().into_iter().map(PathBuf::from);
        names()
            .into_iter()
            .map(PathBuf::from)
            .chain(of_frames)
            .collect()
    } else {
        arguments.campaigns.clone()
    };
    let mut campaigns = Vec::new();
    let mut of_frames = Vec::new();
    for name in &wanted {
        match frames::find(name) {
            Some(Ok(campaign)) => {
                of_frames.push(campaign);
                continue;
            }
            Some(Err(error)) => {
                output.complain(&error);
                return Ok(Exit::Usage);
            }
            None => {}
        }
        match find(name) {
            Ok(campaign) => campaigns.push(campaign),
            Err(error) => {
                complain(&error, output);
                return Ok(Exit::Usage);
            }
        }
    }
    let rings_only =
        arguments.only.is_some() || arguments.html.is_some() || arguments.case.is_some();
    if rings_only && campaigns.is_empty() && !of_frames.is_empty() {
        output.complain("--only, --case and --html show campaigns of rings; for one of frames use --format json, which lists every case");
        return Ok(Exit::Usage);
    }
    if rings_only && !of_frames.is_empty() {
        output.say(
            "campaigns of frames are left out: --only, --case and --html show those of rings\n",
        );
    }
    if let Some(name) = &arguments.case {
        return replay(name, &campaigns, output);
    }
    if let Some(path) = &arguments.html
        && writable(path, output).is_err()
    {
        return Ok(Exit::Usage);
    }
    let threads = arguments.threads.unwrap_or_else(cores);
    let mut all = Vec::new();
    for campaign in &campaigns {
        let bar = progress_bar(campaign.cases.len(), output.progress);
        bar.set_message(campaign.name.clone());
        let finished = campaign.run(threads, &|done| bar.inc(done));
        bar.finish_and_clear();
        match finished {
            Ok(finished) => {
                if arguments.format == TableFormat::Table {
                    output.result(&shown(&finished, arguments.only))?;
                }
                all.push(finished);
            }
            Err(contradiction) => {
                output.complain(&contradiction.to_string());
                return Ok(Exit::RigError);
            }
        }
    }
    let mut listed = json(&all, arguments.only.map(CaseClass::from));
    let mut differs = all.iter().any(|finished| !finished.differs().is_empty());
    if !rings_only {
        differs |= play_frames(&of_frames, arguments.format, &mut listed, output)?;
    }
    if arguments.format == TableFormat::Json {
        output.result(&format!("{listed}\n"))?;
    }
    if let Some(path) = &arguments.html
        && !write(path, &crate::campaign::campaigns(&all), output)
    {
        return Ok(Exit::RigError);
    }
    Ok(if differs { Exit::Failed } else { Exit::Passed })
}

/// Plays campaigns of frames; gives whether a pinned figure is not met.
fn play_frames(
    campaigns: &[FrameCampaign],
    format: TableFormat,
    listed: &mut serde_json::Value,
    output: &mut Output,
) -> std::io::Result<bool> {
    let mut differs = false;
    for campaign in campaigns {
        let bar = progress_bar(campaign.cases.len(), output.progress);
        bar.set_message(campaign.name.clone());
        let played = campaign.run(&|done| bar.inc(done));
        bar.finish_and_clear();
        differs |= !played.differs().is_empty();
        if format == TableFormat::Table {
            output.result(&(frames::table(&played) + "\n"))?;
        } else if let Some(all) = listed["campaigns"].as_array_mut() {
            all.push(frames::json(&played));
        }
    }
    Ok(differs)
}

/// How many threads there is room for.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn shown(finished: &PlayedCampaign, only: Option<ClassName>) -> String {
    let Some(only) = only.map(CaseClass::from) else {
        return table(finished) + "\n";
    };
    let outcomes = finished.outcomes.iter();
    let wanted = outcomes.filter(|outcome| outcome.class == only);
    wanted
        .map(|outcome| line(outcome, finished.drives))
        .collect()
}

fn complain(error: &FindCampaignError, output: &mut Output) {
    match error {
        FindCampaignError::Mistakes(problems) => output.mistakes(problems),
        error => output.complain(&error.to_string()),
    }
}

/// Prints the scenario of one case.
fn replay(name: &str, campaigns: &[Campaign], output: &mut Output) -> std::io::Result<Exit> {
    let [campaign] = campaigns else {
        output.complain("--case needs exactly one campaign; name the one that the case belongs to");
        return Ok(Exit::Usage);
    };
    let case = match CaseFaults::from_name(name, campaign.shape.drives) {
        Ok(case) => case,
        Err(wrong) => {
            output.complain(&wrong);
            return Ok(Exit::Usage);
        }
    };
    match scenario(campaign, &case) {
        Ok(text) => {
            output.result(&text)?;
            Ok(Exit::Passed)
        }
        Err(contradiction) => {
            output.complain(&contradiction.to_string());
            Ok(Exit::RigError)
        }
    }
}

/// The classes on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClassName {
    /// Not noticed, and nothing differs.
    Harmless,
    /// The damaged link was named, everything is back.
    Located,
    /// No link was named, everything is back.
    Recovered,
    /// A sound link was named, everything is back.
    Mislocated,
    /// Noticed, and not everything is back.
    NotRecovered,
    /// Noticed and repaired, but a cell is wrong.
    Corrupted,
    /// Not noticed, and a value is wrong.
    SilentCorruption,
}

impl From<ClassName> for CaseClass {
    fn from(name: ClassName) -> Self {
        match name {
            ClassName::Harmless => Self::Harmless,
            ClassName::Located => Self::Located,
            ClassName::Recovered => Self::Recovered,
            ClassName::Mislocated => Self::Mislocated,
            ClassName::NotRecovered => Self::NotRecovered,
            ClassName::Corrupted => Self::Corrupted,
            ClassName::SilentCorruption => Self::SilentCorruption,
        }
    }
}
