//! `drivebench campaign`.

use super::args::CampaignArguments;
use crate::buses::novobus::campaign::class::CaseClass;
use crate::buses::novobus::campaign::find::{FindCampaignError, find, names};
use crate::buses::novobus::campaign::part::{CampaignCounts, CountsFile, WholeCampaign};
use crate::buses::novobus::campaign::replay::scenario;
use crate::buses::novobus::campaign::report::{json, line as case_line, table};
use crate::buses::novobus::campaign::{Campaign, CaseFaults, Contradiction, PlayedCampaign};
use crate::buses::shared_lines;
use crate::campaign::line::{self, LineCampaign, PlayedLine};
use crate::command::args::TableFormat;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::{save, writable, write};
use crate::command::progress::progress_bar;
use crate::partition::Partition;
use clap::ValueEnum;
use std::path::PathBuf;

/// Plays campaigns.
pub(crate) fn campaign(
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let mut found = match find_all(&arguments.campaigns, output) {
        Ok(found) => found,
        Err(exit) => return Ok(exit),
    };
    if let Some(name) = &arguments.case {
        return replay(name, &found.on_rings, &found.on_lines, output);
    }
    for path in arguments.html.iter().chain(&arguments.output) {
        if writable(path, output).is_err() {
            return Ok(Exit::Usage);
        }
    }
    if arguments.pairs {
        return pairs(&found, arguments, output);
    }
    let wholes = found.divide(arguments.partition);
    let all = match play_rings(&found.on_rings, arguments, output)? {
        Ok(all) => all,
        Err(contradiction) => {
            output.complain(&contradiction.to_string());
            return Ok(Exit::RigError);
        }
    };
    let mut listed = json(&all, arguments.only.and_then(ClassName::of_rings));
    let played = play_lines(&found.on_lines, arguments, &mut listed, output)?;
    if arguments.format == TableFormat::Json {
        output.result(&format!("{listed}\n"))?;
    }
    if let Some(path) = &arguments.html
        && !write(path, &campaigns_page(&all, &played), output)
    {
        return Ok(Exit::RigError);
    }
    let differs = all.iter().any(|own| !own.differs().is_empty());
    let differs = differs || played.iter().any(|own| !own.differs().is_empty());
    Ok(keep(
        wholes.counts(&all, &played),
        differs,
        arguments,
        output,
    ))
}

/// Writes counts where they are asked for; says how it ended.
fn keep(
    counts: Vec<CampaignCounts>,
    differs: bool,
    arguments: &CampaignArguments,
    output: &mut Output,
) -> Exit {
    let counts = CountsFile::new(arguments.partition, counts);
    if let Some(path) = &arguments.output
        && !save(path, &counts.text(), "the counts are", output)
    {
        return Exit::RigError;
    }
    let nothing = counts.campaigns.iter().all(|own| own.played() == Some(0));
    match (&arguments.partition, differs) {
        (_, true) => Exit::Failed,
        (Some(part), false) if nothing => {
            output.complain(&format!("{part} has no case"));
            Exit::NothingSelected
        }
        (Some(part), false) => {
            output.say(&format!(
                "{part} was counted; `merge` adds all parts and compares them with [expect]\n"
            ));
            Exit::Passed
        }
        (None, false) => Exit::Passed,
    }
}

/// The campaigns that were found.
#[derive(Default)]
struct FoundCampaigns {
    on_rings: Vec<Campaign>,
    on_lines: Vec<Box<dyn LineCampaign>>,
}

/// What each of them is as a whole.
struct Wholes {
    of_rings: Vec<WholeCampaign>,
    of_lines: Vec<WholeCampaign>,
}

impl FoundCampaigns {
    /// Keeps the cases of the part, if one is given.
    fn divide(&mut self, part: Option<Partition>) -> Wholes {
        let of_rings = self.on_rings.iter_mut();
        let of_lines = self.on_lines.iter_mut();
        Wholes {
            of_rings: of_rings
                .map(|own| WholeCampaign::of_rings(own, part))
                .collect(),
            of_lines: of_lines
                .map(|own| WholeCampaign::of_line(&mut **own, part))
                .collect(),
        }
    }
}

impl Wholes {
    fn counts(self, all: &[PlayedCampaign], played: &[PlayedLine]) -> Vec<CampaignCounts> {
        let of_rings = self.of_rings.into_iter().zip(all);
        let of_lines = self.of_lines.into_iter().zip(played);
        of_rings
            .map(|(whole, own)| whole.counts(own))
            .chain(of_lines.map(|(whole, own)| whole.counts_of_line(own)))
            .collect()
    }
}

/// Finds the named campaigns, or all built-in ones. The exit code where one cannot be played, which has been reported.
fn find_all(named: &[PathBuf], output: &mut Output) -> Result<FoundCampaigns, Exit> {
    let built_in = || {
        let on_lines = shared_lines().flat_map(|line| (line.campaigns)());
        let mut on_lines: Vec<_> = on_lines.collect();
        on_lines.sort_unstable();
        let on_lines = on_lines.into_iter().map(PathBuf::from);
        names()
            .into_iter()
            .map(PathBuf::from)
            .chain(on_lines)
            .collect()
    };
    let wanted: Vec<PathBuf> = match named {
        [] => built_in(),
        named => named.to_vec(),
    };
    let mut found = FoundCampaigns::default();
    for name in &wanted {
        match shared_lines().find_map(|line| (line.campaign)(name)) {
            Some(Ok(campaign)) => {
                found.on_lines.push(campaign);
                continue;
            }
            Some(Err(error)) => {
                output.complain(&error);
                return Err(Exit::Usage);
            }
            None => {}
        }
        match find(name) {
            Ok(campaign) => found.on_rings.push(campaign),
            Err(error) => {
                complain(&error, output);
                return Err(Exit::Usage);
            }
        }
    }
    Ok(found)
}

/// Plays campaigns on rings, and shows them.
fn play_rings(
    campaigns: &[Campaign],
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Result<Vec<PlayedCampaign>, Contradiction>> {
    let threads = arguments.threads.unwrap_or_else(cores);
    let mut all = Vec::new();
    for campaign in campaigns {
        let bar = progress_bar(campaign.cases.len(), output.progress);
        bar.set_message(campaign.name.clone());
        let finished = campaign.run(threads, &|done| bar.inc(done));
        bar.finish_and_clear();
        let finished = match finished {
            Ok(finished) => finished,
            Err(contradiction) => return Ok(Err(contradiction)),
        };
        if arguments.format == TableFormat::Table {
            output.result(&shown(&finished, arguments.only))?;
        }
        all.push(finished);
    }
    Ok(Ok(all))
}

/// Counts the pairs of cases of campaigns of single faults, and shows them.
fn pairs(
    found: &FoundCampaigns,
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(other) = found.on_lines.first() {
        let name = other.name();
        output.complain(&format!(
            "--pairs counts faults of rings; {name} has no ring"
        ));
        return Ok(Exit::Usage);
    }
    let threads = arguments.threads.unwrap_or_else(cores);
    let mut counted = Vec::new();
    for campaign in &found.on_rings {
        match campaign.pairs(arguments.sample.is_some()) {
            Ok(all) => counted.push(match (arguments.sample, arguments.partition) {
                (Some(sample), _) => sample.min(all),
                (None, Some(part)) => campaign.pairs_of_part(part),
                (None, None) => all,
            }),
            Err(error) => {
                output.complain(&error.to_string());
                return Ok(Exit::Usage);
            }
        }
    }
    let (mut listed, mut counts) = (Vec::new(), Vec::new());
    for (campaign, cases) in found.on_rings.iter().zip(counted) {
        let bar = progress_bar(
            usize::try_from(cases).unwrap_or(usize::MAX),
            output.progress,
        );
        bar.set_message(campaign.name.clone());
        let progress = |done| bar.inc(done);
        let played = match arguments.sample {
            None => campaign.count_pairs(arguments.partition, threads, &progress),
            Some(sample) => campaign.sample_pairs(sample, arguments.seed, threads, &progress),
        };
        bar.finish_and_clear();
        let played = match played {
            Ok(played) => played,
            Err(error) => {
                output.complain(&error.to_string());
                return Ok(Exit::RigError);
            }
        };
        match arguments.format {
            TableFormat::Json => listed.push(played.json()),
            TableFormat::Table => output.result(&(played.table() + "\n"))?,
        }
        counts.push(WholeCampaign::of_pairs(campaign).counts_of_pairs(&played));
    }
    if arguments.format == TableFormat::Json {
        let all = serde_json::json!({ "schema": 1, "pairs": listed });
        output.result(&format!("{all}\n"))?;
    }
    Ok(keep(counts, false, arguments, output))
}

fn campaigns_page(all: &[PlayedCampaign], on_lines: &[PlayedLine]) -> String {
    let sections = (all.len() + 1..).zip(on_lines);
    let sections = sections.map(|(number, own)| line::section(number, own));
    crate::buses::novobus::campaign::campaigns(all, sections.collect())
}

/// Plays campaigns on shared lines, and shows them.
fn play_lines(
    campaigns: &[Box<dyn LineCampaign>],
    arguments: &CampaignArguments,
    listed: &mut serde_json::Value,
    output: &mut Output,
) -> std::io::Result<Vec<PlayedLine>> {
    let mut all = Vec::new();
    for campaign in campaigns {
        let bar = progress_bar(campaign.cases(), output.progress);
        bar.set_message(campaign.name().to_owned());
        let played = campaign.run(&|done| bar.inc(done));
        bar.finish_and_clear();
        let only = arguments.only.map(|own| played.class(&own.name()));
        match (arguments.format, only) {
            (TableFormat::Table, None) => output.result(&(line::table(&played) + "\n"))?,
            (TableFormat::Table, Some(class)) => {
                let shown = class.map(|class| line::only(&played, class));
                output.result(&shown.unwrap_or_default())?;
            }
            (_, class) => {
                // A class that this campaign does not have leaves it out.
                let wanted = class != Some(None);
                if let Some(list) = listed["campaigns"].as_array_mut().filter(|_| wanted) {
                    list.push(line::json(&played, class.flatten()));
                }
            }
        }
        all.push(played);
    }
    Ok(all)
}

/// How many threads there is room for.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn shown(finished: &PlayedCampaign, only: Option<ClassName>) -> String {
    let only = match only.map(ClassName::of_rings) {
        None => return table(finished) + "\n",
        Some(only) => only,
    };
    let outcomes = finished.outcomes.iter();
    let wanted = outcomes.filter(|outcome| Some(outcome.class) == only);
    wanted
        .map(|outcome| case_line(outcome, finished.drives))
        .collect()
}

fn complain(error: &FindCampaignError, output: &mut Output) {
    match error {
        FindCampaignError::Mistakes(problems) => output.mistakes(problems),
        error => output.complain(&error.to_string()),
    }
}

/// Prints the scenario of one case.
fn replay(
    name: &str,
    campaigns: &[Campaign],
    on_lines: &[Box<dyn LineCampaign>],
    output: &mut Output,
) -> std::io::Result<Exit> {
    let campaign = match (campaigns, on_lines) {
        ([campaign], []) => campaign,
        ([], [campaign]) => {
            return match campaign.scenario(name) {
                Ok(text) => output.result(&text).map(|()| Exit::Passed),
                Err(wrong) => {
                    output.complain(&wrong);
                    Ok(Exit::Usage)
                }
            };
        }
        _ => {
            let why = "--case needs exactly one campaign; name the one that the case belongs to";
            output.complain(why);
            return Ok(Exit::Usage);
        }
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
    /// On CAN: nothing is different.
    Answered,
    /// On CAN: a request was repeated, and nothing else is different.
    Retried,
    /// On CAN: the master reported the fault.
    Noticed,
    /// On CAN: the master reported nothing, and something is wrong.
    Unnoticed,
    /// On PROFIBUS: nothing is different.
    Unharmed,
    /// On PROFIBUS: a request was repeated, and nothing else is different.
    Repeated,
    /// On PROFIBUS: the master started the slave again, or gave up.
    FellBack,
    /// On PROFIBUS: the master noticed nothing, and a word is wrong.
    WrongWord,
}

impl ClassName {
    /// The name on the command line and in tables.
    fn name(self) -> String {
        let value = self.to_possible_value();
        value
            .map(|own| own.get_name().to_owned())
            .unwrap_or_default()
    }

    /// The class of campaigns on rings; `None` for one of frames.
    const fn of_rings(self) -> Option<CaseClass> {
        Some(match self {
            Self::Harmless => CaseClass::Harmless,
            Self::Located => CaseClass::Located,
            Self::Recovered => CaseClass::Recovered,
            Self::Mislocated => CaseClass::Mislocated,
            Self::NotRecovered => CaseClass::NotRecovered,
            Self::Corrupted => CaseClass::Corrupted,
            Self::SilentCorruption => CaseClass::SilentCorruption,
            _ => return None,
        })
    }
}
